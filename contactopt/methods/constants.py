"""Numbers of the methods and their kernels that were chosen by trial, all of them, with the command
that shows what each is worth.

`python -m experiments.questions.solving_constants` halves and doubles each of them on problems of
elastic bodies, of random rigid bodies and of packings, and prints how many are certified and the
time that it takes. None of them changes what a certificate means. Limits and tolerances that follow
from rounding, from the literature or from a proof stand beside the code that uses them.
"""

from __future__ import annotations

# The default method (contactopt.methods.auto): when one stage gives way to the next.
NEWTON_STEPS = 25  # of Newton's method, whose last ones converge quadratically
PATIENCE = 6  # Newton steps without progress
# unknowns of an operator up to which its entries are asked for as soon as there is no progress
FEW_ENTRIES = 5000
PROGRESS = 0.9  # a residual that falls by less than this factor is no progress
CONE_PROGRAMS = 5  # of the fixed point of Acary and Cadoux
CLOSE = 1e-3  # error of an interior point from which the proximal loop finds the last digits
LEAST_ALPHA = 1e-4  # weight with which it begins there
NEARBY = (
    # residual of Newton's best point, over its forces, up to which the proximal loop goes on from
    # there at once
    1.0
)
POLISH = 10  # proximal steps for the last digits, each so many of which must halve the residual
ROUND = 20  # outer iterations of the first proximal loop that must halve the residual
SPARSE_ROUND = 100  # of the first of a sparse Q, where random forces lead nowhere
PATHS = 3  # interior-point paths drawn at random before each proximal loop of a sparse Q
TURNING = 1000  # linear systems of the first path that turns back
GENTLE_ALPHA = 0.1  # weight with which the gentle loop begins
LARGER = 3.0  # random starts, over the root-mean-square force of the point left

# The proximal loop (contactopt.methods.proximal): by what its weight falls after a subproblem that
# was solved, and rises
# after one that was not.
FALL, RISE = 5.0, 8.0
# of the gentle loop, which falls after subproblems of at most EASY steps only
GENTLE_FALL, GENTLE_RISE = 1.5, 3.0
EASY = 6

# Its subproblems (contactopt.methods.kernels.sparse_newton).
SUBPROBLEM_STEPS = 15  # Newton steps of one of them
SHORTEST = 1e-2  # step of a line search, over the full one
MEMORY = 4  # a step is accepted whose residual is below the worst of so many before
# a subproblem is solved when its residual is this much smaller than the change that it makes
ENOUGH = 0.1

# Which linear algebra is faster (contactopt.methods.kernels.alart_curnier,
# contactopt.methods.kernels.sparse_blocks).
# share of contacts that do not stick, up to which the bonded factorisation is cheaper than a new
# one
LOOSE = 0.5
SMALL = 60  # unknowns up to which LAPACK on an array is faster than a sparse factorisation
FULL = 0.5  # share of entries that are not zero from which on it is faster at any size

# Methods with an inner iteration (contactopt.methods.apg, contactopt.methods.lagrangian).
# its accuracy over the change of the last outer iteration, so that it does not limit the outer one
SHARPER = 1e-2
SHARPEST = 1e-14  # and the finest accuracy that is asked of it

# The interior-point method (contactopt.methods.kernels.interior).
# friction coefficients below and above which they count as none and as this
FRICTIONLESS, ROUGHEST = 1e-4, 1e3
INTERIOR_STEPS = 60
STALLED = 12  # steps without progress after which it ends
INTERIOR_PROGRESS = 0.9  # an error that falls by less than this factor is no progress
START = 100.0  # size of the first point in both cones, over dimensionless forces of order one
LEAST_SMOOTHING, MOST_SMOOTHING = 0.03, 0.3  # of the friction of random paths
PREDICTED = 0.99  # way of a predictor to the boundary of the cones
# way of a step to the boundary, and that of a step with |u_t| linearised
BOUNDARY, SHORT = 0.98, 0.9
STUCK = 0.3  # a step shorter than this is no Newton step; the next one leaves |u_t| as it is
CORRECTED = 0.1  # a predictor shorter than this has no second-order correction
LEAST_CENTERING, MOST_CENTERING = 1e-4, 0.95  # bounds of the centring of a step
STUCK_CENTERING = 0.1  # the lower bound after a step that was stuck
CENTRAL = 1e-3  # least eigenvalue of x o z at a contact, over the mean
CENTRAL_KEPT = 0.5  # share of this eigenvalue that a step keeps where it is less
BACKTRACK = 0.8  # factor by which a step is shortened until it is so

# Newton's steps from products with Q (contactopt.methods.kernels.alart_curnier, .krylov,
# .linearised).
KRYLOV_FIRST = 1e-2  # accuracy of the first step
KRYLOV_LOOSEST, KRYLOV_TIGHTEST = 0.1, 1e-4  # bounds of the accuracy of the others
PRODUCT_SHARE = 0.05  # accuracy of products, over that of the step
# accuracy of the same step for the model of Q, over that of the step; it costs next to nothing
MODEL_STEP = 1e-3
MODEL_PRODUCTS = 1e-4  # accuracy of the products that make the model
# diagonal entries of D below this count as zero where only a rough inverse is asked for
SLIPPING = 0.5

# Active sets of the normal and of the tangential problem (contactopt.methods.kernels.subproblems).
ACTIVE_SETS = 15  # tried in a row
SUCCESS = 1e-2  # residual of a proximal step, over the one it began with, at which it is taken
# of the proximal weight after a step that was taken, and after one that was not
WEIGHT_FALL, WEIGHT_RISE = 4.0, 8.0

# Newton's steps on contact and bodies at once (contactopt.methods.kernels.coupled_newton).
COUPLED_FIRST = 0.1  # accuracy of the bonded solution and of the first step
COUPLED_LOOSEST, COUPLED_TIGHTEST = 0.1, 1e-2  # bounds of the accuracy of the others
SCHUR_STEP = 1e-2  # accuracy of the solve with the Schur complement of the model
SCHUR_MARGIN = 1.5  # the model's Schur complement over that of a mean fit
GIVEN_BALANCE = 1e-3  # accuracy of the equilibrium under forces to start from

# Nested grids (contactopt.methods.nested, contactopt.methods.kernels.levels).
COARSEST = 12  # contacts along a side of a grid that is not halved
# accuracy of a step while contacts still open or close, and at last
NESTED_LOOSEST, NESTED_TIGHTEST = 0.1, 1e-4
# residual at which a coarse grid has done its work, over the size of the forces
COARSE_ENOUGH = 3e-2
COARSEST_ENOUGH = 1e-4  # that of the coarsest grid, from which the others must not be led astray
COARSE_STEPS = 30  # Newton steps on a coarse grid
COARSE_TRIES = 80  # iterates of the default method on the coarsest grid, where Newton's steps fail
# residual of a given start over that of the coarse grids' answer, below which the start is taken
CLOSER = 0.1
LEAST_SYMBOL = 1e-3  # value of the symbol that is inverted, over its median
LEAST_DETERMINANT = 0.1  # of the two tangential symbols, over their product
# where the shifts of slipping contacts begin to grow, and by how much
FIRST_SHIFT, SHIFT_RATIO = 0.5, 32.0

# Conjugate gradients with bounds (contactopt.methods.kernels.mprgp). Single precision halves the bytes that
# a product reads, which is what a product costs where Q does not fit the processor's cache.
# on the estimate of the largest eigenvalue, which power steps approach from below
EIGENVALUE_MARGIN = 1.1
SINGLE_ACCURACY = 1e-4  # relative accuracy asked of one round in single precision
SINGLE_STEPS = 300  # of one round
# a round that leaves more than this of the residual is the last one in single precision
SINGLE_PROGRESS = 0.1
ROUND_SHARE = 0.3  # residual after the last round, over what is asked for
ROWS_FALL = 0.3  # factor by which the error of the rows should fall in one step of the multipliers
ROWS_SHARE = 0.1  # accuracy of an inner solve, over the penalty times the error of the rows
FINEST_SHARE = 1e-3  # and the finest, over the accuracy that is asked for
STIFFER = 4  # factor by which the penalty grows
ROUGH_NORMAL = 1e-4  # accuracy of the normal problem of `lagrangian` before its active set steps

# The balancing of rho (contactopt.methods.admm).
FIRST_BALANCING = 10  # iteration of the first one; each further one comes after twice as many
MOST_CHANGE = 10.0  # largest factor by which rho changes at once
LEAST_CHANGE = 2.0  # smallest factor that is worth a factorisation

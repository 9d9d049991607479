"""Numbers of the methods and their kernels that were chosen by trial, all of them.

`contactopt report --run full small_tier` shows what another value of one is worth: how many
problems of the small tier are certified, and in which time. None of them changes what a certificate
means. Limits and tolerances that follow
from rounding, from the literature or from a proof stand beside the code that uses them.
"""

# The default method (contactopt.methods.auto): when one stage gives way to the next.
# Sweeps at first, and where Newton's method has failed; multiplications that they may cost at
# first (1e6 take about a millisecond).
FIRST_SWEEPS, MORE_SWEEPS, SWEEPING = 500, 1000, 1e9
LOCAL = 100.0  # multiplications that a local problem and the acceleration are worth
FEWEST_SWEEPS = 60  # for which there must be room
QUICK = 2e5  # multiplications of a sweep up to which the first sweeps are one call
SWEEPS_KEPT = 16  # last sweeps that one starts from which is accelerated
# Sweeps between two of these after the first 50, in the first and in the second run: what goes
# round in a circle with one number seldom does so with the other.
FIRST_BETWEEN, MORE_BETWEEN = 5, 1
NEARLY_SWEPT, SWEPT = 1e-7, 1e-13  # change of a sweep over the forces: most digits, all digits
LOOK, MOMENT = 3e5, 1e8  # multiplications worth a certificate; between two looks at the clock
NEWTON_STEPS = 25  # of Newton's method, whose last ones converge quadratically
PATIENCE = 6  # Newton steps without progress
FEW_ENTRIES = 5000  # unknowns of an operator whose entries are asked for without progress
PROGRESS = 0.9  # a residual or error that falls by less than this factor is no progress
MOST_STATES = {2: 100, 3: 10}  # contacts up to which it is tried, by the dimension
TREE_WORK = 3e8  # on the tree over the states of the contacts at first, in its units: .5 s
CONE_PROGRAMS = 5  # of the fixed point of Acary and Cadoux
CLOSE = 1e-3  # error of an interior point from which the proximal loop finds the last digits
LEAST_ALPHA = 1e-4  # weight with which it begins there
# residual of Newton's best point, over its forces, from which the proximal loop goes on at once
NEARBY = 1.0
POLISH = 10  # proximal steps for the last digits, each so many of which must halve the residual
ROUND = 20  # outer iterations of the first proximal loop that must halve the residual
SPARSE_ROUND = 100  # of the first of a sparse Q, where random forces lead nowhere
PATHS = 3  # interior-point paths drawn at random before each proximal loop of a sparse Q
EAGER_ALPHA = 1e-2  # weight with which the eager loop begins
GENTLE_ALPHA = 0.1  # weight with which the gentle loop begins
LARGER = 3.0  # random starts, over the root-mean-square force of the point left

# The proximal loop (contactopt.methods.proximal): by what its weight falls after a subproblem that
# was solved, and rises after one that was not; the gentle one falls after at most EASY steps only.
FALL, RISE = 5.0, 8.0
GENTLE_FALL, GENTLE_RISE = 1.5, 3.0
EASY = 6
EAGER_STEPS = 10  # Newton steps of a subproblem of the eager loop, which ends with a harder one

# Its subproblems (contactopt.methods.kernels.damped).
SUBPROBLEM_STEPS = 15  # Newton steps of one of them
SHORTEST = 1e-2  # step of a line search, over the full one
MEMORY = 4  # a step is accepted whose residual is below the worst of so many before
ENOUGH = 0.1  # residual of a subproblem that is solved, over the change that it makes

# Which linear algebra is faster (contactopt.methods.kernels.alart_curnier,
# contactopt.methods.kernels.sparse_blocks).
LOOSE = 0.5  # share of contacts that do not stick: less make the bonded factorisation cheaper
SMALL = 150  # unknowns up to which LAPACK on an array is faster than a sparse factorisation
FULL = 0.5  # share of entries that are not zero from which on it is faster at any size

# Methods with an inner iteration (contactopt.methods.apg, contactopt.methods.lagrangian).
SHARPER = 1e-2  # its accuracy over the change of the last outer iteration
SHARPEST = 1e-14  # and the finest accuracy that is asked of it

# The interior-point method (contactopt.methods.kernels.interior).
FRICTIONLESS, ROUGHEST = 1e-4, 1e3  # friction below and above them counts as none and as this
INTERIOR_STEPS = 60
STALLED = 12  # steps without progress after which it ends
START = 100.0  # size of the first point in both cones, over dimensionless forces of order one
LEAST_SMOOTHING, MOST_SMOOTHING = 0.03, 0.3  # of the friction of random paths
PREDICTED = 0.99  # way of a predictor to the boundary of the cones
BOUNDARY, SHORT = 0.98, 0.9  # way of a step to the boundary; the same with |u_t| linearised
STUCK = 0.3  # a step shorter than this is no Newton step; the next one leaves |u_t| as it is
CORRECTED = 0.1  # a predictor shorter than this has no second-order correction
LEAST_CENTERING, MOST_CENTERING = 1e-4, 0.95  # bounds of the centring of a step
STUCK_CENTERING = 0.1  # the lower bound after a step that was stuck
CENTRAL = 1e-3  # least eigenvalue of x o z at a contact, over the mean
CENTRAL_KEPT = 0.5  # share of this eigenvalue that a step keeps where it is less
BACKTRACK = 0.8  # factor by which a step is shortened until it is so

# The step that ends a solve which stops in time (contactopt.methods.kernels.alart_curnier).
LAST_SHARE = 0.3  # accuracy of the step, over the share of the residual that may be left
LAST_LOOSEST = 0.5  # bound of it

# Newton's steps from products with Q (contactopt.methods.newton, contactopt.methods.kernels.krylov,
# .linearised).
KRYLOV_LOOSEST = 1e-2  # accuracy of the first step, and the loosest of the others
TIGHTEST = 1e-4  # lower bound of the accuracy of the others, and on nested grids
PRODUCT_SHARE = 0.05  # accuracy of products, over that of the step
MODEL_STEP = 1e-3  # accuracy of the same step for the model of Q, over that of the step
MODEL_PRODUCTS = 1e-4  # accuracy of the products that make the model
SLIPPING = 0.5  # diagonal entries of D below this count as zero in a rough inverse

# Active sets of the normal and of the tangential problem (contactopt.methods.kernels.subproblems).
ACTIVE_SETS = 15  # tried in a row
SUCCESS = 1e-2  # residual of a proximal step, over the one it began with, at which it is taken
WEIGHT_FALL, WEIGHT_RISE = 4.0, 8.0  # of the proximal weight after a step taken, and not taken

# Newton's steps on contact and bodies at once (contactopt.methods.kernels.coupled_newton).
LOOSEST = 0.1  # upper bound of the accuracy of the steps here and on nested grids
COUPLED_FIRST = 0.1  # accuracy of the bonded solution and of the first step
COUPLED_TIGHTEST = 1e-2  # lower bound of the accuracy of the others
SCHUR_STEP = 1e-2  # accuracy of the solve with the Schur complement of the model
SCHUR_MARGIN = 1.5  # the model's Schur complement over that of a mean fit
GIVEN_BALANCE = 1e-3  # accuracy of the equilibrium under forces to start from

# Nested grids (contactopt.methods.nested, contactopt.methods.kernels.levels, .level_steps).
COARSEST = 12  # contacts along a side of a grid that is not halved
COARSE_ENOUGH = 3e-3  # residual at which a coarse grid has done its work, over the forces
COARSEST_ENOUGH = 1e-4  # that of the coarsest grid, from which the others must not be led astray
COARSE_STEPS = 30  # Newton steps on a coarse grid
COARSE_TRIES = 80  # iterates of the default method on the coarsest grid, where Newton's steps fail
# order of convergence that the accuracy of steps allows for: the contacts that change their state
# spoil more than products can gain
GRID_ORDER = 1.5
CLOSER = 0.1  # residual of a given start that is taken, over that of the coarse grids' answer
LEAST_SYMBOL = 1e-3  # value of the symbol that is inverted, over its median
LEAST_DETERMINANT = 0.1  # of the two tangential symbols, over their product
SLOW = 0.1  # residual of a Newton step over the one before, above which few contacts are to blame
MOST_LOCAL = 600  # contacts that are solved by themselves, at most
FEW_OF_ALL = 0.02  # and the share of the closed ones that they may be
LOCAL_SHARE = 0.9  # of the squared residual, which must be theirs
AROUND = 2  # rings of contacts around them that are solved with them
LOCAL_TRIES = 60  # iterates of the default method on them
LOCAL_ENOUGH = 1e-3  # residual at which they are solved, over the one that they began with
FIRST_SHIFT, SHIFT_RATIO = 0.5, 32.0  # where shifts of slipping contacts begin to grow, how much

# The balancing of rho (contactopt.methods.admm).
FIRST_BALANCING = 10  # iteration of the first one; each further one comes after twice as many
MOST_CHANGE = 10.0  # largest factor by which rho changes at once
LEAST_CHANGE = 2.0  # smallest factor that is worth a factorisation

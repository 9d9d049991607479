"""Numbers of the methods and their kernels that were chosen by trial, all of them, with the command that shows what each is worth.

`python -m experiments.questions.solving_constants` halves and doubles each of them on problems of elastic bodies, of random rigid bodies
and of packings, and prints how many are certified and the time that it takes. None of them changes what a certificate means.
Limits and tolerances that follow from rounding, from the literature or from a proof stand beside the code that uses them.
"""

from __future__ import annotations

# The default method (contactopt.solving.methods.auto): when one stage gives way to the next.
NEWTON_STEPS = 25  # of Newton's method, whose last ones converge quadratically
PATIENCE = 6  # Newton steps without progress
PROGRESS = 0.9  # a residual that falls by less than this factor is no progress
CONE_PROGRAMS = 5  # of the fixed point of Acary and Cadoux
CLOSE = 1e-3  # error of an interior point from which the proximal loop finds the last digits
LEAST_ALPHA = 1e-4  # weight with which it begins there
POLISH = 10  # proximal steps for the last digits, each so many of which must halve the residual
ROUND = 20  # outer iterations of the first proximal loop that must halve the residual
SPARSE_ROUND = 100  # of the first of a sparse Q, where random forces lead nowhere
PATHS = 3  # interior-point paths drawn at random before each proximal loop of a sparse Q
TURNING = 1000  # linear systems of the first path that turns back
GENTLE_ALPHA = 0.1  # weight with which the gentle loop begins
LARGER = 3.0  # random starts, over the root-mean-square force of the point left

# The proximal loop (contactopt.solving.methods.proximal): by what its weight falls after a subproblem that was solved, and rises
# after one that was not.
FALL, RISE = 5.0, 8.0
GENTLE_FALL, GENTLE_RISE = 1.5, 3.0  # of the gentle loop, which falls after subproblems of at most EASY steps only
EASY = 6

# Its subproblems (contactopt.solving.kernels.sparse_newton).
SUBPROBLEM_STEPS = 15  # Newton steps of one of them
SHORTEST = 1e-2  # step of a line search, over the full one
MEMORY = 4  # a step is accepted whose residual is below the worst of so many before
ENOUGH = 0.1  # a subproblem is solved when its residual is this much smaller than the change that it makes

# Which linear algebra is faster (contactopt.solving.kernels.alart_curnier, contactopt.solving.kernels.sparse_blocks).
LOOSE = 0.5  # share of contacts that do not stick, up to which the bonded factorisation is cheaper than a new one
SMALL = 60  # unknowns up to which LAPACK on an array is faster than a sparse factorisation
FULL = 0.5  # share of entries that are not zero from which on it is faster at any size

# Methods with an inner iteration (contactopt.solving.methods.apg, contactopt.solving.methods.lagrangian).
SHARPER = 1e-2  # its accuracy over the change of the last outer iteration, so that it does not limit the outer one
SHARPEST = 1e-14  # and the finest accuracy that is asked of it

"""Every number of the body solvers that was chosen by measurement, with the command that measures
it.

None of them changes what a solver converges to. They change only how long it takes.
"""

# `python -m experiments.questions.body_solvers` measures time and memory of every solver over the
# number of unknowns of a 3D body.
PARDISO_FROM = 5_000  # unknowns of a body from which PARDISO is faster, its library loaded or not

# The limits for a body by itself. In a scene contactopt.coupling.costs chooses for all its bodies.
FACTORS_UP_TO = {"superlu": 26_000, "pardiso": 70_000}  # unknowns of a 3D body that is factorised

# Chosen by the times of trials.
LEAF = 48  # nodes of a piece of the mesh that nested dissection does not cut further
COARSE_LEAF = 200  # the same where only the size of the factors is estimated

# Chosen by the times of trials that varied one of these at a time.
COARSEST = 60  # nodes or aggregates that multigrid does not coarsen further
NEAR = 1.5  # neighbours at up to this multiple of the least distance are aggregated
DEGREE = 3  # products with A in the smoother, which is a polynomial of this degree less one

# V-cycles for a decimal digit of a solve, as `python -m experiments.questions.large_punch` has them
USUAL = 1.7

# Limits, not fitted.
# entries of a matrix from which threads share its products; a product takes about a millisecond
# then
LARGE = 2**20
SHARE = 4  # pieces of such a product for each core; whoever is free takes the next one
GALERKIN = 8  # pieces of rows from which the matrix of the next level is summed up
RTOL = 1e-10  # accuracy of an iterative solve when none is asked for
TELLING = 1e-6  # accuracy from which the V-cycles of a solve say what others will take: the first
# digits of a solve take more than later ones
MOST_ITERATIONS = 300  # conjugate gradient iterations before a solve is given up

"""Every number of the body solvers that was chosen by measurement, with the command that measures it.

None of them changes what a solver converges to. They change only how long it takes.
"""

from __future__ import annotations

# `python -m experiments.questions.body_solvers` measures time and memory of every solver over the number of unknowns.
PARDISO_FROM = 5_000  # unknowns of a 3D body from which PARDISO is faster than SuperLU
FACTORS_UP_TO = {"superlu": 100_000, "pardiso": 200_000}  # unknowns of a 3D body that is factorised

# `python -m experiments.questions.solver_constants` compares the elimination orders.
LEAF = 48  # nodes of a piece of the mesh that nested dissection does not cut further

# `python -m experiments.questions.solver_constants` varies one of these at a time.
COARSEST = 60  # nodes or aggregates that multigrid does not coarsen further
NEAR = 1.5  # neighbours at up to this multiple of the least distance are aggregated
DEGREE = 3  # products with A in the smoother, which is a polynomial of this degree less one

# Limits, not fitted.
RTOL = 1e-10  # accuracy of an iterative solve when none is asked for
MOST_ITERATIONS = 300  # conjugate gradient iterations before a solve is given up

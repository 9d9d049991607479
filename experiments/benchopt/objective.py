"""Contact with Coulomb's friction between elastic bodies, as a benchmark of benchopt.

    pip install benchopt
    benchopt run experiments/benchopt -d 'contacts[problem=punch-2d]'

The value of an answer is its certificate, which is computed from the problem: the natural-map
residual, dimensionless, 0 at a solution. Your own solver is one more file in `solvers/`.
"""

import numpy as np
from benchopt import BaseObjective

from contactopt import natural_map_residual


class Objective(BaseObjective):
    """How far forces are from a solution of Coulomb's problem."""

    name = "Contact with Coulomb's friction"
    min_benchopt_version = "1.7"

    def set_data(self, problem):
        self.problem = problem

    def get_objective(self):
        return {"problem": self.problem}

    def evaluate_result(self, reactions, multipliers):
        return {"value": natural_map_residual(self.problem, reactions, multipliers)}

    def get_one_result(self):
        return {"reactions": np.zeros(self.problem.q.shape), "multipliers": None}

"""The methods of contactopt, each at three tolerances of its certificate."""

from typing import ClassVar

from benchopt import BaseSolver

from contactopt import solve


class Solver(BaseSolver):
    """A method by its name."""

    name = "contactopt"
    parameters: ClassVar = {"method": ["auto", "nsgs", "proximal"], "tol": [1e-3, 1e-6, 1e-9]}
    sampling_strategy = "run_once"

    def set_objective(self, problem):
        self.problem = problem

    def run(self, _):
        self.answer = solve(self.problem, self.method, tol=self.tol)

    def get_result(self):
        answer = self.answer
        return {"reactions": answer.reactions, "multipliers": answer.multipliers}

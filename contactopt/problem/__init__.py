"""The interface problem of frictional contact, its solution and its certificate."""

from contactopt.problem.certificate import (
    amplification,
    balance_residual,
    fit_multipliers,
    natural_map_residual,
    siconos_residual,
)
from contactopt.problem.chart import Chart, Pair
from contactopt.problem.feasibility import Infeasible, infeasibility
from contactopt.problem.interface_problem import InterfaceProblem, check_problem
from contactopt.problem.laws import LAWS
from contactopt.problem.laws.law import Law
from contactopt.problem.pairs import alone, part_of
from contactopt.problem.scaling import Scales, dimensionless, isotropic
from contactopt.problem.solution import Solution, Status

__all__ = [
    "LAWS",
    "Chart",
    "Infeasible",
    "InterfaceProblem",
    "Law",
    "Pair",
    "Scales",
    "Solution",
    "Status",
    "alone",
    "amplification",
    "balance_residual",
    "check_problem",
    "dimensionless",
    "fit_multipliers",
    "infeasibility",
    "isotropic",
    "natural_map_residual",
    "part_of",
    "siconos_residual",
]

"""Methods: one file each, one line here. Nothing is imported before it is used.

A method is a frozen dataclass whose fields are its settings. `iterate(problem, start)` takes a
dimensionless InterfaceProblem and yields (reactions (k, dim), multipliers (p,)) after each outer
iteration, from a cold start if `start` is None. A method that knows Q r of an iterate to a stated
accuracy yields it as well, as a Moved, which saves the driver a product. The driver
(contactopt.solve) owns the clock, the stopping rule, the history and the limits. A method that ends
by itself has met its own criterion or cannot go on.

Three statements are optional. `implicit = True` says that it takes a Q that is known by its
products only. `wanders = True` says that its iterates may leave a good point to look for a better
one: its answer is then the best of them, else the last one. `solves(law)` says whether it solves
problems of that law (contactopt.problem.laws); a method without it solves every law, because it
needs nothing of a law but its projection.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from contactopt.errors import InputError

if TYPE_CHECKING:
    from contactopt.methods.method import Method
    from contactopt.problem import Infeasible, Law


class Repeated(Exception):
    """Thrown into `iterate` because its iterates repeat. A method that has another way goes on."""


class NoSolution(Exception):
    """Raised by a method that has proved that its problem has no solution."""

    def __init__(self, proof: Infeasible):
        super().__init__(proof.sentence)
        self.proof = proof


# name -> (module in this room, class, what it is)
METHODS = {
    "auto": ("auto", "Auto", "Newton, then cones and proximal where it fails; the default"),
    "newton": ("newton", "Newton", "semismooth Newton on the Alart-Curnier equations"),
    "proximal": ("proximal", "Proximal", "proximal-point loop around Newton"),
    "tresca": (
        "tresca_iteration",
        "Tresca",
        "successive convex problems with given friction bounds",
    ),
    "acary_cadoux": ("cone", "AcaryCadoux", "fixed point on the SOCP over Coulomb's cones"),
    "relaxation": ("cone", "Relaxation", "one SOCP: associated friction, another law (dilatancy)"),
    "penalty": ("penalty", "Penalty", "penalty method, minimised exactly; error ~ 1 / factor"),
    "lagrangian": ("lagrangian", "Lagrangian", "normal QP, then Uzawa's multipliers for friction"),
    "augmented_lagrangian": (
        "augmented_lagrangian",
        "AugmentedLagrangian",
        "method of multipliers, exact or Uzawa",
    ),
    "nsgs": ("nsgs", "NSGS", "nonsmooth Gauss-Seidel, contact by contact"),
    "admm": ("admm", "ADMM", "alternating direction method of multipliers"),
    "apg": ("apg", "APG", "accelerated projected gradient in a fixed point"),
    "lemke": (
        "complementarity",
        "Lemke",
        "Lemke's method on the 2D complementarity problem; small",
    ),
    "alternating": (
        "alternating",
        "Alternating",
        "normal QP and tangential QP or SOCP in turn (paper, 5.1)",
    ),
}


def solves(method: Method, law: Law) -> bool:
    """Whether a method solves problems of a law, in the variables of `Law.plain`."""
    predicate = getattr(method, "solves", None)
    return predicate is None or bool(predicate(law.plain))


def solvers_of(law: Law) -> list[str]:
    """The names in METHODS of those that solve problems of a law."""
    return [name for name in METHODS if solves(find_method(name), law)]


def default_method(settings: Mapping[str, Any]) -> str:
    """The method if none is named: `auto`, or `alternating` where the settings name a backend."""
    return "alternating" if settings.get("normal") or settings.get("tangential") else "auto"


def find_method(name: str, **settings: Any) -> Method:
    """The method of a name with its settings; InputError for a wrong name, setting or value."""
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; choose from {', '.join(METHODS)}.")
    module, cls, _ = METHODS[name]
    try:
        method: Method = getattr(import_module(f"{__name__}.{module}"), cls)(**settings)
    except TypeError as error:
        raise InputError(f"method '{name}': {error}.") from error
    return method

"""contactopt: frictional contact between elastic bodies as mathematical programs, with certified answers.

    >>> import contactopt
    >>> result = contactopt.run("punch-2d", mu=0.3)
    >>> problem = contactopt.reduce(contactopt.scenes.flat_punch(dim=2))
    >>> solution = contactopt.solve(problem, tol=1e-10)
    >>> contactopt.natural_map_residual(problem, solution.reactions)

Names are loaded when first used: `import contactopt` costs nothing, scikit-fem and cvxpy only what needs them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from contactopt.analytic import Reference
    from contactopt.diagnosis import Diagnosis, diagnose
    from contactopt.driver import solve
    from contactopt.enumeration import all_solutions
    from contactopt.errors import BackendError, InputError
    from contactopt.paths import PathResult, follow
    from contactopt.problem import InterfaceProblem, Solution, Status, natural_map_residual
    from contactopt.recover import Fields
    from contactopt.reduction import reduce, reduce_bodies
    from contactopt.runner import Result, run
    from contactopt.scene import BodyForce, Material, Part, Plate, Rigid, Scene, Support, Traction
    from contactopt.warm import transfer

_HOMES = {
    "analytic": ("Reference",),
    "driver": ("solve",),
    "diagnosis": ("Diagnosis", "diagnose"),
    "enumeration": ("all_solutions",),
    "errors": ("BackendError", "InputError"),
    "paths": ("PathResult", "follow"),
    "problem": ("InterfaceProblem", "Solution", "Status", "natural_map_residual"),
    "recover": ("Fields",),
    "reduction": ("reduce", "reduce_bodies"),
    "runner": ("Result", "run"),
    "warm": ("transfer",),
    "scene": ("BodyForce", "Material", "Part", "Plate", "Rigid", "Scene", "Support", "Traction"),
}
_MODULES = ("analytic", "animation", "benchmark", "fclib", "models", "plots", "scenes")
__all__ = sorted([*(name for names in _HOMES.values() for name in names), *_MODULES])


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"contactopt.{name}")
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"contactopt.{module}"), name)
    raise AttributeError(f"module 'contactopt' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__

"""contactopt: frictional contact between elastic bodies as mathematical programs, with certified
answers.

    >>> import contactopt
    >>> result = contactopt.run("punch-2d", mu=0.3)
    >>> problem = contactopt.reduce(contactopt.scenes.flat_punch(dim=2))
    >>> solution = contactopt.solve(problem, tol=1e-10)
    >>> contactopt.natural_map_residual(problem, solution.reactions)

Names are loaded when first used: `import contactopt` costs nothing, scikit-fem and cvxpy only what
needs them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from contactopt.analytic import Reference
    from contactopt.bodies.fields import Fields
    from contactopt.coupling.reduction import reduce, reduce_bodies
    from contactopt.derivatives.gradient import gradient
    from contactopt.derivatives.interface import sensitivity
    from contactopt.errors import BackendError, InputError
    from contactopt.holding import Limit, limit
    from contactopt.material import Material
    from contactopt.meshes.mesh_files import load_mesh
    from contactopt.methods.batch import solve_batch
    from contactopt.methods.diagnosis import Diagnosis, diagnose
    from contactopt.methods.driver import solve
    from contactopt.methods.enumeration import all_solutions
    from contactopt.problem import (
        InterfaceProblem,
        Solution,
        Status,
        natural_map_residual,
        siconos_residual,
    )
    from contactopt.problem.transfer import transfer
    from contactopt.runner import Result, run
    from contactopt.scenes.contact import Contact
    from contactopt.scenes.matrix_part import MatrixPart
    from contactopt.scenes.scene import (
        BodyForce,
        HalfSpace,
        Part,
        Plate,
        Pressure,
        Rigid,
        Scene,
        Support,
        Traction,
    )
    from contactopt.simplification.findings import Simplification, Simplified
    from contactopt.simplification.search import simplify
    from contactopt.solving.follow import follow
    from contactopt.solving.paths import PathResult

# module -> the names that stand in it
_HOMES = {
    "analytic": "Reference",
    "bodies.fields": "Fields",
    "coupling.reduction": "reduce reduce_bodies",
    "derivatives.gradient": "gradient",
    "derivatives.interface": "sensitivity",
    "errors": "BackendError InputError",
    "holding": "Limit limit",
    "material": "Material",
    "meshes.mesh_files": "load_mesh",
    "methods.batch": "solve_batch",
    "methods.diagnosis": "Diagnosis diagnose",
    "methods.driver": "solve",
    "methods.enumeration": "all_solutions",
    "problem": "InterfaceProblem Solution Status natural_map_residual siconos_residual",
    "problem.transfer": "transfer",
    "runner": "Result run",
    "scenes.contact": "Contact",
    "scenes.matrix_part": "MatrixPart",
    "scenes.scene": "BodyForce Bolt HalfSpace Part Plate Pressure Rigid Scene Support Traction",
    "simplification.findings": "Simplification Simplified",
    "simplification.search": "simplify",
    "solving.follow": "follow",
    "solving.paths": "PathResult",
}
_MODULES = {
    "analytic": "analytic",
    "benchmark": "benchmark",
    "fclib": "fclib",
    "laws": "problem.laws",
    "models": "models",
    "plots": "figures.plots",
    "scenes": "scenes",
}
__all__ = sorted([*(name for names in _HOMES.values() for name in names.split()), *_MODULES])


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"contactopt.{_MODULES[name]}")
    for module, names in _HOMES.items():
        if name in names.split():
            value = globals()[name] = getattr(import_module(f"contactopt.{module}"), name)
            return value
    raise AttributeError(f"module 'contactopt' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__

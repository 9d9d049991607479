"""Everything that can be chosen by its name."""

from __future__ import annotations

from contactopt.bodies.solvers import SOLVERS
from contactopt.linear.operators import FORMS
from contactopt.methods import METHODS
from contactopt.methods.backends import CONIC, QP
from contactopt.methods.preconditioners import PRECONDITIONERS
from contactopt.problem.laws import LAWS
from contactopt.scenes import PATHS, SCENES


def print_lists() -> None:
    """Scenes, laws, methods, solvers, preconditioners and backends, each with a line that says what
    it is.
    """
    print("scenes")
    for name, (_, _, what, *_) in SCENES.items():
        print(f"  {name:26} {what}" + (" (load path)" if name in PATHS else ""))
    print("laws of contact")
    for name, (_, _, what) in LAWS.items():
        print(f"  {name:20} {what}")
    print("methods")
    for name, (_, _, what) in METHODS.items():
        print(f"  {name:20} {what}")
    print("forms of the interface operator Q: " + ", ".join(FORMS))
    print("solvers of the bodies: auto, " + ", ".join(SOLVERS))
    print("preconditioners of the interface operator")
    for name, (_, _, what) in PRECONDITIONERS.items():
        print(f"  {name:20} {what}")
    for title, table in (
        ("QP backends (normal; tangential in 2D)", QP),
        ("conic backends (tangential in 3D)", CONIC),
    ):
        print(title)
        for backend in table.values():
            missing = f"not installed: pip install {backend.package}"
            print(
                f"  {backend.name:12}"
                f" {f'installed, {backend.version}' if backend.installed else missing}"
            )

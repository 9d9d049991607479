"""Data flows one way: a module imports only what stands to its left in this list."""

import ast
import subprocess
import sys
from pathlib import Path

import contactopt

ROOT = Path(contactopt.__file__).parent
ORDER = [
    "errors", "scene", "analytic.reference", "analytic.normal", "analytic.panels", "analytic.spence", "analytic.friction",
    "analytic.mindlin", "analytic.corner", "analytic", "mesh", "disc", "scenes.common", "scenes.flat", "scenes.round", "scenes.sliding", "scenes", "elements", "refinement", "body", "dissection", "multigrid", "factors", "linear", "cones", "operators", "problem", "semismooth", "bonded", "cosine", "preconditioners", "krylov", "alart_curnier", "subproblems",
    "balance", "mprgp", "models", "backends", "backends.qp", "backends.conic", "backends.direct", "splitting", "methods",
    "methods.alternating", "methods.tresca", "methods.cone", "methods.apg", "methods.nsgs", "methods.admm",
    "methods.lagrangian", "methods.complementarity", "methods.newton", "methods.proximal",
    "methods.augmented_lagrangian", "methods.auto", "methods.penalty", "driver", "enumeration", "diagnosis", "warm",
    "interface", "condensation", "reduction", "zone", "edges", "quantities", "paths", "accuracy", "recover", "fclib", "plots", "animation", "runner",
    "benchmark.plugins", "benchmark.problems", "benchmark.runs", "benchmark.experiment", "benchmark.store",
    "benchmark.measure", "benchmark.worker", "benchmark.pool", "benchmark.tables",
    "benchmark.figures", "benchmark.report", "benchmark.campaign", "benchmark", "cli", "__main__",
]  # fmt: skip
FINITE_ELEMENTS = {
    "accuracy",
    "quantities",
    "refinement",
    "interface",
    "mesh",
    "elements",
    "body",
    "condensation",
    "linear",
    "multigrid",
    "reduction",
    "zone",
    "animation",
    "disc",
    "edges",
    "paths",
    "recover",
    "plots",
    "runner",
    "benchmark",
    "benchmark.problems",
    "cli",
    "__main__",
    "scene",
    "scenes",
}


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found |= {f"{node.module}.{a.name}" for a in node.names}
        elif isinstance(node, ast.Import):
            found |= {a.name for a in node.names}
    return found


def modules() -> dict[str, Path]:
    paths = {str(p.relative_to(ROOT).with_suffix("")).replace("/", "."): p for p in ROOT.rglob("*.py")}
    return {name.removesuffix(".__init__"): path for name, path in paths.items() if name != "__init__"}


def test_every_module_has_its_place():
    assert sorted(modules()) == sorted(ORDER)


def test_imports_point_left():
    for name, path in modules().items():
        for imported in imports(path):
            inner = imported.removeprefix("contactopt.")
            if imported.startswith("contactopt.") and inner in ORDER:
                assert ORDER.index(inner) < ORDER.index(name), f"{name} imports {inner}"


def test_optimisation_does_not_know_finite_elements():
    for name, path in modules().items():
        if name.split(".")[0] not in FINITE_ELEMENTS:
            used = {i.removeprefix("contactopt.").split(".")[0] for i in imports(path)}
            assert not used & {"skfem", "body", "mesh", "reduction"}, name


def test_heavy_imports_wait_until_they_are_used():
    code = (
        "import sys, contactopt, contactopt.cli, contactopt.driver;"
        "print([m for m in ('skfem', 'cvxpy', 'matplotlib', 'qpsolvers', 'meshio') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_modules_stay_readable():
    for name, path in modules().items():
        limit = 120 if name.startswith(("methods.", "backends.")) else 310
        lines = len(path.read_text().splitlines())
        assert lines <= limit, f"{name} has {lines} lines: split it by what it does"

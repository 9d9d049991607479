"""Data flows one way, and what is heavy waits until it is used."""

import ast
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_rooms_import_only_what_stands_below_them():
    tool = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([tool, "--no-cache"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout


def test_heavy_imports_wait_until_they_are_used():
    code = (
        "import sys, contactopt, contactopt.cli, contactopt.methods.driver;print([m for m in"
        " ('skfem', 'cvxpy', 'matplotlib', 'qpsolvers', 'meshio') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_few_ask_for_the_type_of_q():
    """Everyone else asks contactopt.linear.operators for the form of Q, or for what it does."""
    asked = re.compile(r"isinstance\([\w.]*\bQ, \(?(InterfaceOperator|Convolution|np\.ndarray)")
    files = [p for p in (ROOT / "contactopt").rglob("*.py") if asked.search(p.read_text())]
    assert {file.name for file in files} <= {"operators.py", "interface_problem.py"}


def test_newton_steps_are_added_in_one_place():
    """A step is taken in newton_loop.py; other files evaluate equations, or solve for a step."""
    taken = re.compile(r"system\.change\(")
    kernels = ROOT / "contactopt" / "methods"
    files = {path.name for path in kernels.rglob("*.py") if taken.search(path.read_text())}
    assert files == {"newton_loop.py"}


def test_types_imported_for_annotations_have_names_of_their_own():
    """The documentation finds such a type by its short name, which must be unique."""
    texts = [path.read_text() for path in (ROOT / "contactopt").rglob("*.py")]
    classes = [name for text in texts for name in re.findall(r"^class (\w+)", text, re.M)]
    late = {
        alias.name
        for text in texts
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in node.body
        if isinstance(inner, ast.ImportFrom) and str(inner.module).startswith("contactopt")
        for alias in inner.names
    }
    assert not {name for name in late if classes.count(name) > 1}

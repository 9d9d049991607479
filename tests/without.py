"""Run pytest as if packages were not installed, in the processes that tests start, too:

python -m tests.without pypardiso gmsh -- -n 2 tests/test_linear.py

Without names all packages of the optional extras are hidden but those that the tests themselves are
made of (OURS). What then fails takes a package for granted: it must ask for it, or skip.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
# name at the registry -> name of the module, where they differ
MODULES = {"markdown-it-py": "markdown_it", "myst-nb": "myst_nb"}
# makes Python's own finder blind to some names
SITE = """
import importlib.machinery as machinery
hidden, found = {names!r}, machinery.PathFinder.find_spec
def find_spec(cls, name, *more):
    return None if name.partition(".")[0] in hidden else found(name, *more)
machinery.PathFinder.find_spec = classmethod(find_spec)
"""


def optional_packages() -> dict[str, tuple[str, ...]]:
    """extra -> the modules of its own packages, without those of the extra `test`."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    found = {}
    for extra, needs in extras["optional-dependencies"].items():
        names = [re.split(r"[^\w.-]", need)[0] for need in needs]
        if extra != "test":
            found[extra] = tuple(MODULES.get(name, name) for name in names if name != "contactopt")
    return found


def hiding(names: Sequence[str], folder: Path) -> dict[str, str]:
    """The environment in which the packages of these names cannot be imported."""
    (folder / "sitecustomize.py").write_text(SITE.format(names=set(names)))
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", str(ROOT))])
    return dict(os.environ) | {"PYTHONPATH": path}


def main(arguments: Sequence[str]) -> int:
    given = list(arguments)
    end = given.index("--") if "--" in given else len(given)
    names = given[:end] or [own for group in optional_packages().values() for own in group]
    print("without", *names)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pytest", *given[end + 1 :]]
        return subprocess.run(command, env=hiding(names, Path(folder)), cwd=ROOT).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

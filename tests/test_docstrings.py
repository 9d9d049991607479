"""A function that a room shows in its `__init__` says in sections what it takes and returns."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from textwrap import indent

import pytest

ROOT = Path(__file__).parents[1]
Function = ast.FunctionDef | ast.AsyncFunctionDef


class Package:
    """The modules of a package, parsed and not imported.

    nodes        module -> all nodes of its syntax tree
    initial      modules that are the `__init__` of a folder
    definitions  (module, name) -> a function or class at the top of a module
    """

    def __init__(self, folder: Path):
        trees: dict[str, ast.Module] = {}
        self.initial: set[str] = set()
        for file in sorted(folder.rglob("*.py")):
            parts = [folder.name, *file.relative_to(folder).with_suffix("").parts]
            if parts[-1] == "__init__":
                parts.pop()
                self.initial.add(".".join(parts))
            trees[".".join(parts)] = ast.parse(file.read_text(encoding="utf-8"))
        self.nodes = {module: list(ast.walk(tree)) for module, tree in trees.items()}
        self.definitions = {
            (module, node.name): node
            for module, tree in trees.items()
            for node in tree.body
            if isinstance(node, Function | ast.ClassDef)
        }
        self.imports = {module: list(imported(nodes)) for module, nodes in self.nodes.items()}

    def home(self, module: str, name: str) -> tuple[str, str] | None:
        """Where a name is defined that a module offers, by itself or as one that it imports."""
        for _ in range(len(self.nodes)):
            if (module, name) in self.definitions:
                return module, name
            found = [row for row in self.imports.get(module, ()) if row[0] == name]
            if not found:
                return None
            module, name = found[0][1:]
        return None

    def uses(self) -> Iterator[tuple[str, tuple[str, str]]]:
        """(module, definition that it uses), by an import or as an attribute of a module that it
        imports.
        """
        for module, nodes in self.nodes.items():
            modules = {}
            for here, source, name in self.imports[module]:
                if f"{source}.{name}" in self.nodes:
                    modules[here] = f"{source}.{name}"
                elif found := self.home(source, name):
                    yield module, found
            for node in nodes:
                if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Name):
                    continue
                source = modules.get(node.value.id)
                if source and (found := self.home(source, node.attr)):
                    yield module, found

    def tables(self) -> Iterator[tuple[str, str]]:
        """Definitions that a row ("module", "name", ...) of a table in an `__init__` names."""
        for module in self.initial:
            for row in self.nodes[module]:
                if not isinstance(row, ast.Tuple) or len(row.elts) < 2:
                    continue
                texts = [
                    one.value if isinstance(one, ast.Constant) else None for one in row.elts[:2]
                ]
                for home in (f"{texts[0]}", f"{module}.{texts[0]}"):
                    if (home, texts[1]) in self.definitions:
                        yield home, str(texts[1])

    def shared(self) -> set[tuple[str, str]]:
        """Public definitions that an `__init__` imports, or names in a table."""
        shown = {found for user, found in self.uses() if user in self.initial}
        return {
            (module, name)
            for module, name in shown | set(self.tables())
            if not name.startswith("_")
        }


def imported(nodes: list[ast.AST]) -> Iterator[tuple[str, str, str]]:
    """(name here, module, name there) of every `from module import name`, wherever it stands."""
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from ((one.asname or one.name, node.module, one.name) for one in node.names)


def room(module: str) -> str:
    """The part of the package that a module belongs to: its folder, or itself at the top."""
    return ".".join(module.split(".")[:2])


def missing(function: Function) -> set[str]:
    """The sections that the docstring of a function lacks."""
    said = set(re.findall(r"^(\w+)\n-+$", ast.get_docstring(function) or "", re.MULTILINE))
    arguments = function.args
    given = [
        *arguments.posonlyargs,
        *arguments.args,
        *arguments.kwonlyargs,
        arguments.vararg,
        arguments.kwarg,
    ]
    takes = any(one is not None and one.arg not in ("self", "cls") for one in given)
    returns = function.returns is not None and ast.unparse(function.returns) not in (
        "None",
        "NoReturn",
    )
    lacks = {"Parameters"} if takes and "Parameters" not in said else set()
    return lacks | ({"Returns"} if returns and not said & {"Returns", "Yields"} else set())


def methods(node: ast.ClassDef) -> Iterator[Function]:
    """The public methods of a class, without its properties."""
    for one in node.body:
        if not isinstance(one, Function) or one.name.startswith("_"):
            continue
        if not any("property" in ast.unparse(decorator) for decorator in one.decorator_list):
            yield one


def unexplained(folder: Path) -> list[str]:
    """Functions and methods that rooms show and whose docstrings lack sections.

    A method may be explained in any of the classes that define it: in the protocol or in the base
    class.
    """
    package = Package(folder)
    shared = package.shared()
    found = [
        f"{module}.{name} lacks {' and '.join(sorted(lacks))}"
        for module, name in shared
        if isinstance(node := package.definitions[module, name], Function)
        and (lacks := missing(node))
    ]
    attributes: dict[str, set[str]] = {}
    for module, nodes in package.nodes.items():
        for one in nodes:
            if isinstance(one, ast.Attribute):
                attributes.setdefault(one.attr, set()).add(room(module))
    classes = [node for node in package.definitions.values() if isinstance(node, ast.ClassDef)]
    explained = {method.name for node in classes for method in methods(node) if not missing(method)}
    for module, name in shared:
        node = package.definitions[module, name]
        for method in methods(node) if isinstance(node, ast.ClassDef) else ():
            if method.name not in explained and attributes.get(method.name, set()) - {room(module)}:
                found.append(
                    f"{module}.{name}.{method.name} lacks {' and '.join(sorted(missing(method)))}"
                )
    return sorted(found)


def test_what_a_room_shows_has_sections():
    assert unexplained(ROOT / "contactopt") == []


EXPLAINED = '''"""Twice the number.

Parameters
----------
x
    A number.

Returns
-------
float
    Twice the number.
"""'''
SHORT = '"""Twice the number."""'
CALL = "from house.cellar.stairs import double\n"


@pytest.mark.parametrize(
    ("doc", "user", "complaints"),
    [
        (
            SHORT,
            {"cellar/__init__.py": CALL},
            ["house.cellar.stairs.double lacks Parameters and Returns"],
        ),
        (SHORT, {"cellar/__init__.py": 'ROWS = {"a": ("stairs", "double", "twice")}\n'}, 1),
        (SHORT, {"attic.py": "from house.cellar import double\n", "cellar/__init__.py": CALL}, 1),
        (SHORT, {"attic.py": CALL}, 0),  # no room shows it
        (EXPLAINED.replace("Returns\n-------", "It returns"), {"cellar/__init__.py": CALL}, 1),
        (EXPLAINED, {"cellar/__init__.py": CALL}, 0),
    ],
)
def test_a_function_without_sections_is_found(tmp_path, doc, user, complaints):
    code = f"def double(x: float) -> float:\n{indent(doc, '    ')}\n    return 2 * x\n"
    files = {"__init__.py": "", "cellar/__init__.py": "", "cellar/stairs.py": code, **user}
    assert_found(tmp_path, files, complaints)


@pytest.mark.parametrize(("doc", "complaints"), [(SHORT, 1), (EXPLAINED, 0)])
def test_a_method_is_explained_in_the_class_or_in_its_base(tmp_path, doc, complaints):
    base = f"class Base:\n    def double(self, x: float) -> float:\n{indent(doc, ' ' * 8)}\n"
    code = (
        f"{base}\nclass Stairs(Base):\n    def double(self, x: float) -> float:\n        return 2"
        " * x\n"
    )
    user = "from house.cellar import Stairs\nStairs().double(1.0)\n"
    shown = "from house.cellar import Stairs\n"
    assert_found(tmp_path, {"__init__.py": shown, "cellar.py": code, "attic.py": user}, complaints)


def assert_found(tmp_path: Path, files: dict[str, str], complaints: list[str] | int) -> None:
    for name, text in files.items():
        file = tmp_path / "house" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    found = unexplained(tmp_path / "house")
    assert found == complaints if isinstance(complaints, list) else len(found) == complaints, found

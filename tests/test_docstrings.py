"""Sections stand in the docstrings of public names, protocols and base classes."""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import contactopt

Function = ast.FunctionDef | ast.AsyncFunctionDef
Definition = Function | ast.ClassDef


def public(package: ModuleType) -> set[str]:
    """The full names of the functions and classes that a package shows."""
    things = [getattr(package, name) for name in package.__all__]
    for module in [thing for thing in things if hasattr(thing, "__path__")]:
        things += [getattr(module, name) for name in module.__all__]
    return {
        f"{thing.__module__}.{thing.__qualname__}"
        for thing in things
        if inspect.isclass(thing) or inspect.isfunction(thing)
    }


def definitions(node: ast.AST, home: str) -> Iterator[tuple[str, Definition]]:
    """All functions and classes below a node, by their full names."""
    for child in ast.iter_child_nodes(node):
        name = home
        if isinstance(child, Definition):
            name = f"{home}.{child.name}"
            yield name, child
        yield from definitions(child, name)


def missing(node: Function, said: set[str]) -> set[str]:
    """The sections that the docstring of a public function lacks."""
    given = {one.arg for one in ast.walk(node.args) if isinstance(one, ast.arg)}
    returns = node.returns is not None and ast.unparse(node.returns) not in ("None", "NoReturn")
    return ({"Parameters"} if given else set()) - said | ({"Returns"} if returns else set()) - said


def complaints(code: dict[str, str], shown: set[str]) -> list[str]:
    """The sections that are missing, or out of place, in modules of this code."""
    found = {
        name: node
        for module, text in code.items()
        for name, node in definitions(ast.parse(text), module)
    }
    classes = {name: node for name, node in found.items() if isinstance(node, ast.ClassDef)}
    bases = {
        name: {ast.unparse(base).partition("[")[0].rpartition(".")[2] for base in node.bases}
        for name, node in classes.items()
    }
    derived_from = set().union(*bases.values())
    general = {
        name
        for name, node in classes.items()
        if node.name in derived_from or bases[name] & {"Protocol", "ABC"}
    }
    told = []
    for name, node in found.items():
        said = set(re.findall(r"^(\w+)\n-+$", ast.get_docstring(node) or "", re.MULTILINE))
        lacks = missing(node, said) if name in shown and isinstance(node, Function) else set()
        if lacks:
            told.append(f"{name} lacks {' and '.join(sorted(lacks))}")
        if said and not {name, name.rpartition(".")[0]} & general and name not in shown:
            told.append(f"{name} needs no {' and '.join(sorted(said))}")
    return sorted(told)


def test_sections_stand_where_they_belong():
    folder = Path(contactopt.__file__).parent
    code = {
        ".".join(["contactopt", *file.relative_to(folder).with_suffix("").parts]).removesuffix(
            ".__init__"
        ): file.read_text(encoding="utf-8")
        for file in folder.rglob("*.py")
    }
    assert complaints(code, public(contactopt)) == []


SECTIONS = "Twice the number.\n\nParameters\n----------\nx\n\nReturns\n-------\nIt.\n"
SHORT = "Twice the number."
FUNCTION = 'def double(x: float) -> float:\n    """{}"""\n'
METHOD = "class Base{}:\n" + "".join(f"    {line}\n" for line in FUNCTION.splitlines())


@pytest.mark.parametrize(
    ("code", "shown", "told"),
    [
        (FUNCTION.format(SHORT), {"m.double"}, ["m.double lacks Parameters and Returns"]),
        (FUNCTION.format(SECTIONS), {"m.double"}, []),
        (FUNCTION.format(SECTIONS.partition("\nReturns")[0]), {"m.double"}, 1),
        (FUNCTION.format(SHORT), set(), []),
        (FUNCTION.format(SECTIONS), set(), ["m.double needs no Parameters and Returns"]),
        (METHOD.format("(Protocol)", SECTIONS), set(), []),
        (METHOD.format("", SECTIONS) + "class Derived(Base): pass\n", set(), []),
        (METHOD.format("", SECTIONS), {"m.Base"}, 1),  # the class itself may have them
    ],
)
def test_sections_that_are_missing_or_out_of_place_are_found(code, shown, told):
    found = complaints({"m": code}, shown)
    assert found == told if isinstance(told, list) else len(found) == told, found

"""Every public name says what it is, is typed, and names the errors that it raises."""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from typing import Any

import pytest

import contactopt
from contactopt.methods import METHODS

# homes of what `contactopt` exports, the modules it exports, and those that its documentation sends
# readers to
EXPORTED = [getattr(contactopt, name) for name in contactopt.__all__]
MODULES = sorted(
    {thing.__name__ if inspect.ismodule(thing) else thing.__module__ for thing in EXPORTED}
    | {
        "contactopt.problem",
        "contactopt.problem.cones",
        "contactopt.meshes.structured",
        "contactopt.methods.preconditioners",
    }
)


def defined_in(module: Any) -> Iterator[tuple[str, Any]]:
    """Public classes and functions of a module, not those it imports from outside the package."""
    for name, thing in vars(module).items():
        home = getattr(thing, "__module__", "") or ""
        inside = home == module.__name__ or home.startswith(f"{module.__name__}.")
        if (
            not name.startswith("_")
            and inside
            and (inspect.isclass(thing) or inspect.isfunction(thing))
        ):
            yield name, thing


def symbols() -> dict[str, Any]:
    found = {}
    for name in MODULES:
        module = importlib.import_module(name)
        found[module.__name__] = module
        found |= {f"{module.__name__}.{inner}": thing for inner, thing in defined_in(module)}
    for file, name, _ in METHODS.values():
        module = f"contactopt.methods.{file}"
        found[f"{module}.{name}"] = getattr(importlib.import_module(module), name)
    return found


SYMBOLS = symbols()


def functions(thing: Any) -> Iterator[Any]:
    """The function itself, or the public methods and properties and the constructor that a class
    defines.
    """
    if inspect.isfunction(thing):
        yield thing
    elif inspect.isclass(thing):
        for name, member in vars(thing).items():
            member = getattr(member, "fget", None) or getattr(member, "func", None) or member
            member = getattr(member, "__func__", member)
            ours = inspect.isfunction(
                member
            ) and member.__code__.co_filename == inspect.getsourcefile(thing)
            if ours and (name == "__init__" or not name.startswith("_")):
                yield member


@pytest.mark.parametrize("name", contactopt.__all__)
def test_what_is_exported_can_be_had_in_one_line(name):
    thing = getattr(contactopt, name)
    assert inspect.ismodule(thing) or thing in SYMBOLS.values()


@pytest.mark.parametrize("name", SYMBOLS)
def test_it_has_a_docstring_of_its_own(name):
    thing = SYMBOLS[name]
    doc = (vars(thing).get("__doc__") if inspect.isclass(thing) else thing.__doc__) or ""
    assert len(doc.split()) >= 2, f"{name} has no docstring"
    assert not doc.startswith(f"{name.rsplit('.', 1)[-1]}("), (
        f"{name} has only the docstring that dataclasses make"
    )


@pytest.mark.parametrize("name", SYMBOLS)
def test_it_is_fully_annotated(name):
    for function in functions(SYMBOLS[name]):
        signature = inspect.signature(function)
        bare = [
            p.name
            for p in signature.parameters.values()
            if p.annotation is p.empty and p.name not in ("self", "cls")
        ]
        assert not bare, f"{function.__qualname__}: no annotation of {', '.join(bare)}"
        told = signature.return_annotation is not signature.empty or function.__name__ == "__init__"
        assert told, f"{function.__qualname__}: no return annotation"


def public_functions() -> dict[str, Any]:
    """The functions that `contactopt` and the folders among its public modules show."""
    found = {name: getattr(contactopt, name) for name in contactopt.__all__}
    for name, module in list(found.items()):
        if hasattr(module, "__path__"):
            found |= {f"{name}.{inner}": getattr(module, inner) for inner in module.__all__}
    return {name: thing for name, thing in found.items() if inspect.isfunction(thing)}


FUNCTIONS = public_functions()


def section(function: Any, title: str) -> str:
    """The text of one section of a docstring, or nothing."""
    lines = inspect.cleandoc(function.__doc__).split("\n")
    at = [i for i in range(len(lines) - 1) if lines[i] == title and set(lines[i + 1]) == {"-"}]
    if not at:
        return ""
    rest = lines[at[0] + 2 :]
    stop = next(
        (i for i in range(len(rest) - 1) if rest[i + 1] and set(rest[i + 1]) == {"-"}), len(rest)
    )
    return "\n".join(rest[:stop])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_tells_of_every_argument_and_of_what_it_returns(name):
    function = FUNCTIONS[name]
    told = re.findall(r"^(\w+(?:, \w+)*)(?: :|$)", section(function, "Parameters"), re.MULTILINE)
    named = {one for line in told for one in line.split(", ")}
    missing = {p for p in inspect.signature(function).parameters if p not in named}
    assert not missing, f"{name}: the docstring has no parameter {', '.join(sorted(missing))}"
    returns = inspect.signature(function).return_annotation not in ("None", None)
    assert not returns or section(function, "Returns"), f"{name}: no section Returns"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_errors_that_an_exported_function_raises_are_documented(name):
    function = FUNCTIONS[name]
    calls = [
        node.exc
        for node in ast.walk(ast.parse(inspect.getsource(function)))
        if isinstance(node, ast.Raise)
    ]
    told = section(function, "Raises") + function.__doc__.partition("Raises ")[2]
    for raised in {
        call.func.id
        for call in calls
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name)
    }:
        assert raised in told, f"{name} raises {raised} and does not say when"

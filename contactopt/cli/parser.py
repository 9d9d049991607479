"""The parser of the command line, made of command_line.toml and of the options of a run."""

import argparse
import tomllib
from collections.abc import Callable, Mapping
from importlib.resources import files
from typing import Any

import contactopt
from contactopt.benchmark.keys import help_text
from contactopt.cli.completion import NAMES
from contactopt.run_options import OPTIONS

OF_A_SCENE = ("run", "show", "check", "simplify", "export", "limit")


def make_parser() -> argparse.ArgumentParser:
    """The parser of the command line; its result's `command` names the function to execute."""
    texts = tomllib.loads(files("contactopt.cli").joinpath("command_line.toml").read_text("utf-8"))
    texts["commands"]["bench"]["epilog"] = help_text()
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        "contactopt",
        description=texts["description"],
        epilog=texts["epilog"],
        formatter_class=plain,
    )
    version = f"contactopt {contactopt.__version__}"
    parser.add_argument("--version", action="version", version=version)
    common = argparse.ArgumentParser(add_help=False)
    _add(common, texts["common"])
    found = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, command in texts["commands"].items():
        what, epilog = command["help"], command.get("epilog")
        made = found.add_parser(
            name,
            help=what,
            description=f"{what[0].upper()}{what[1:]}.",
            epilog=epilog,
            parents=[common],
            # an epilog of several paragraphs keeps its lines
            formatter_class=plain if "\n\n" in (epilog or "") else argparse.HelpFormatter,
        )
        made.set_defaults(command=command.get("function", name), parser=parser)
        arguments = texts["scene"] if name in OF_A_SCENE else {}
        _add(made, arguments | command.get("arguments", {}) | (_of_run() if name == "run" else {}))
    return parser


def _add(
    parser: argparse.ArgumentParser | argparse._ArgumentGroup,
    arguments: Mapping[str, Mapping[str, Any]],
) -> None:
    """Give a parser arguments: flags, with spaces between them -> what argparse is told."""
    groups: dict[str, Any] = {}
    for flags, given in arguments.items():
        told = dict(given)
        group = told.pop("group", None)
        if group is not None and group not in groups:
            groups[group] = parser.add_mutually_exclusive_group()
        if (names := told.pop("names", None)) is not None:
            told["help"] += f" {', '.join(NAMES[names])}"
        if "type" in told:
            told["type"] = TYPES.get(told["type"], told["type"])
        groups.get(group, parser).add_argument(*flags.split(), **told)


def _of_run() -> dict[str, dict[str, Any]]:
    """The options of a run as arguments."""
    made: dict[str, dict[str, Any]] = {}
    for name, option in OPTIONS.items():
        flag = f"--{name.lower().replace('_', '-')}"
        told = made[flag] = {"help": option.what, "dest": name}
        if name in NAMES:
            told |= {"help": f"{option.what}:", "names": name}
        if option.kind is bool:
            told |= {"action": "store_true", "default": None}
        else:
            told |= {"metavar": option.value, "type": option.kind}
        if option.kind is tuple:
            told |= {"nargs": "+", "type": str}
        if name == "figures":
            told |= {"choices": [*NAMES[name]], "group": "pictures"}
            none = {"dest": name, "action": "store_const", "const": (), "group": "pictures"}
            made["--no-figures"] = none | {"help": "draw no figures"}
    return made


def _named(text: str) -> tuple[str, float]:
    name, _, size = text.rpartition(":")
    try:
        return name, float(size)
    except ValueError as error:
        said = f"give NAME:SIZE, as in flank:0.1; got {text!r}"
        raise argparse.ArgumentTypeError(said) from error


def _called(text: str) -> tuple[str, str]:
    new, sign, old = text.partition("=")
    if not (new and sign and old):
        raise argparse.ArgumentTypeError(f"give NEW=OLD,..., as in flank=plane1; got {text!r}")
    return new, old


TYPES: dict[str, Callable[[str], Any]] = {
    "int": int, "float": float, "name:size": _named, "new=old": _called,
}  # fmt: skip

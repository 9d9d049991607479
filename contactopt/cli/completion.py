"""The names that options take, kept in a file so that words need no numerical package; and scripts
that complete them, commands and options in a shell, made from the parser itself by shtab.

bash:  contactopt completion bash > ~/.local/share/bash-completion/completions/contactopt
zsh:   contactopt completion zsh >> ~/.zshrc
fish:  contactopt completion fish > ~/.config/fish/completions/contactopt.fish
"""

import argparse
import ast
import json
from importlib.resources import files

# argument -> the names that it takes, and what each is; made from the tables of the package by
# experiments.site.command_names
NAMES: dict[str, dict[str, str]] = json.loads(
    files("contactopt.cli").joinpath("names.json").read_text("utf-8")
)


def table(room: str, name: str) -> dict[str, str]:
    """Names and descriptions in a table of a room, read from the source without importing it."""
    home = files("contactopt").joinpath(*room.split("."), "__init__.py")
    for node in ast.parse(home.read_text("utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if any(isinstance(one, ast.Name) and one.id == name for one in targets):
            rows = zip(node.value.keys, node.value.values)  # type: ignore[attr-defined]
            return {key.value: _third(value) for key, value in rows}
    raise LookupError(f"{room} has no table {name}")


def _third(row: ast.Tuple) -> str:
    return str(getattr(row.elts[2], "value", "")) if len(row.elts) > 2 else ""


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Write the completion script of a shell. The parser then takes none but the known names."""
    import shtab

    for commands in parser._actions:
        if isinstance(commands, argparse._SubParsersAction):
            for made in commands.choices.values():
                for action in made._actions:
                    if action.dest in NAMES:
                        action.choices = [*NAMES[action.dest]]
    return str(shtab.complete(parser, shell))

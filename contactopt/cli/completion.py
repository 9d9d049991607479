"""The names that options take, and scripts that complete them, commands and options in a shell,
made from the parser itself by shtab.

bash:  contactopt completion bash > ~/.local/share/bash-completion/completions/contactopt
zsh:   contactopt completion zsh >> ~/.zshrc
fish:  contactopt completion fish > ~/.config/fish/completions/contactopt.fish
"""

from __future__ import annotations

import argparse

from contactopt.bodies.solvers import SOLVERS
from contactopt.figures.style import FORMATS
from contactopt.linear.operators import FORMS
from contactopt.methods import METHODS
from contactopt.methods.backends import CONIC, QP
from contactopt.methods.preconditioners import PRECONDITIONERS
from contactopt.readings.places import PLACED
from contactopt.readings.quantities import ROWS
from contactopt.scenes import SCENES

# argument -> the names that it takes; a scene may be a file, too, and a quantity is of a place
NAMES = {
    "scene": tuple(SCENES),
    "method": tuple(METHODS),
    "normal": tuple(QP),
    "tangential": (*QP, *(name for name in CONIC if name not in QP)),
    "Q": tuple(FORMS),
    "preconditioner": (*PRECONDITIONERS, "none"),
    "solver": ("auto", *SOLVERS),
    "quantity": (*ROWS, *PLACED),
    "figures": FORMATS,
}


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Write the completion script of a shell. The parser is changed: it takes none but
    the known names afterwards.
    """
    import shtab

    for commands in parser._actions:
        if isinstance(commands, argparse._SubParsersAction):
            for made in commands.choices.values():
                for action in made._actions:
                    action.choices = NAMES.get(action.dest, action.choices)
    return str(shtab.complete(parser, shell))

"""Scripts that complete commands, options and names of scenes in a shell, made from the parser
itself by shtab.

bash:  contactopt completion bash > ~/.local/share/bash-completion/completions/contactopt
zsh:   contactopt completion zsh >> ~/.zshrc
fish:  contactopt completion fish > ~/.config/fish/completions/contactopt.fish
"""

from __future__ import annotations

import argparse

from contactopt.bodies.solvers import SOLVERS
from contactopt.linear.operators import FORMS
from contactopt.methods import METHODS
from contactopt.methods.backends import CONIC, QP
from contactopt.methods.preconditioners import PRECONDITIONERS
from contactopt.scenes import SCENES

SHELLS = ("bash", "zsh", "fish", "tcsh")
# what an argument takes besides what the parser knows: names, of which some are files
VALUES = {
    "scene": tuple(SCENES),
    "method": tuple(METHODS),
    "normal": tuple(QP),
    "tangential": (*QP, *(name for name in CONIC if name not in QP)),
    "q": tuple(FORMS),
    "preconditioner": (*PRECONDITIONERS, "none"),
    "solver": ("auto", *SOLVERS),
}


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Write the completion script of a shell.

    Parameters
    ----------
    parser : The parser of the command line. It is changed, and completes names afterwards where it
        also takes files.
    shell : One of SHELLS.

    Returns
    -------
    The text of the script.
    """
    import shtab

    for commands in parser._actions:
        for made in (
            commands.choices.values() if isinstance(commands, argparse._SubParsersAction) else ()
        ):
            for action in made._actions:
                action.choices = VALUES.get(action.dest, action.choices)
    return str(shtab.complete(parser, shell))

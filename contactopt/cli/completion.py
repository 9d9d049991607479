"""Scripts that complete commands, options and names of scenes in a shell, made from the parser itself.

bash:  contactopt completion bash > ~/.local/share/bash-completion/completions/contactopt
zsh:   contactopt completion zsh >> ~/.zshrc
fish:  contactopt completion fish > ~/.config/fish/completions/contactopt.fish
"""

from __future__ import annotations

import argparse
import shlex

from contactopt.bodies.solvers import SOLVERS
from contactopt.figures.style import FORMATS
from contactopt.problem.operators import FORMS
from contactopt.scenes import SCENES
from contactopt.solving.backends import CONIC, QP
from contactopt.solving.methods import METHODS
from contactopt.solving.preconditioners import PRECONDITIONERS

# option -> the names that it takes
VALUES = {
    "--method": tuple(METHODS),
    "--normal": tuple(QP),
    "--tangential": (*QP, *(name for name in CONIC if name not in QP)),
    "--q": tuple(FORMS),
    "--preconditioner": (*PRECONDITIONERS, "none"),
    "--solver": ("auto", *SOLVERS),
    "--figures": FORMATS,
    "--run": ("quick", "full"),
}
WITH_SCENES = ("run", "show")
BASH = """_contactopt() {
  local word="${COMP_WORDS[COMP_CWORD]}" last="${COMP_WORDS[COMP_CWORD-1]}" words=""
  case "$last" in
%(values)s
  esac
  if [ -z "$words" ] && [ "$COMP_CWORD" -eq 1 ]; then words=%(commands)s
  elif [ -z "$words" ]; then
    case "${COMP_WORDS[1]}" in
%(options)s
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}
complete -o default -F _contactopt contactopt"""


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Write the completion script of a shell.

    Parameters
    ----------
    parser
        The parser of the command line, whose commands and options are completed.
    shell
        'bash', 'zsh' or 'fish'.

    Returns
    -------
    str
        The text of the script.
    """
    options = _options(parser)
    if shell == "fish":
        return _fish(options)
    values = "\n".join(f"    {name}) words={shlex.quote(' '.join(names))};;" for name, names in VALUES.items())
    words = {name: [*found, *(SCENES if name in WITH_SCENES else ())] for name, found in options.items()}
    cases = "\n".join(f"      {name}) words={shlex.quote(' '.join(found))};;" for name, found in words.items())
    made = BASH % {"values": values, "commands": shlex.quote(" ".join(options)), "options": cases}
    return made if shell == "bash" else f"autoload -Uz bashcompinit && bashcompinit\n{made}"


def _options(parser: argparse.ArgumentParser) -> dict[str, list[str]]:
    """Command -> its options."""
    (commands,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return {
        name: [text for action in made._actions for text in action.option_strings]
        for name, made in commands.choices.items()
    }


def _fish(options: dict[str, list[str]]) -> str:
    lines = [f"complete -c contactopt -n __fish_use_subcommand -a {shlex.quote(' '.join(options))}"]
    for name, found in options.items():
        here = f"complete -c contactopt -n '__fish_seen_subcommand_from {name}'"
        lines += [f"{here} -l {text[2:]}" for text in found if text.startswith("--") and text not in VALUES]
        lines += [f"{here} -l {t[2:]} -xa {shlex.quote(' '.join(VALUES[t]))}" for t in found if t in VALUES]
        if name in WITH_SCENES:
            lines.append(f"{here} -a {shlex.quote(' '.join(SCENES))}")
    return "\n".join(lines)

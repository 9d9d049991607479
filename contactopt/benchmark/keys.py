"""The keys of an experiment file and the columns of results; the texts are in keys.toml."""

import tomllib
from importlib.resources import files

_texts = tomllib.loads(files("contactopt.benchmark").joinpath("keys.toml").read_text("utf-8"))
# key -> what it says, an example of its value
EXPERIMENT: dict[str, tuple[str, str]] = _texts["experiment"]
FIGURE: dict[str, tuple[str, str]] = _texts["figure"]
KINDS: dict[str, str] = _texts["kinds"]
USUAL: list[dict[str, str]] = _texts["usual"]  # figures of a report that asks for none
# column -> type, what it is
COLUMNS: dict[str, tuple[str, str]] = _texts["columns"]
ENDS: dict[str, str] = _texts["statuses"]  # how runs end besides with a word of contactopt.Status


def help_text() -> str:
    """Every key of an experiment file as plain text, one line or two for each, with an example."""
    lines = ["keys of an experiment file, with an example each:", *_lines(EXPERIMENT)]
    lines += ["", "keys of a table [[figures]]; those from `by` on belong to some kinds only:"]
    lines += [
        *_lines(FIGURE),
        "",
        "kinds of figures and tables, and the question that each answers:",
    ]
    return "\n".join(lines + [f"  {kind:20} {what}" for kind, what in KINDS.items()])


def _lines(keys: dict[str, tuple[str, str]]) -> list[str]:
    return [f"  {key:16} {what}\n{'':19}{key} = {value}" for key, (what, value) in keys.items()]

"""Every remark that the package makes reaches the reader: the summary, the command line, pages and
notebooks. The places that make one are found in the code, so that a new one is tested, too.
"""

import ast
import importlib
import json
import logging
import re
from dataclasses import replace
from pathlib import Path

import pytest

import contactopt
from contactopt.cli import main
from contactopt.coupling import posed as posing
from contactopt.methods import driver, notes

PACKAGE = Path(contactopt.__file__).parent
SPEAKERS = {"warning", "error", "critical", "exception"}
# they run, or speak, outside of a run
OTHERS = {"benchmark", "cli", "fclib", "derivatives", "simplification", "jax"}


def calls(tree):
    return (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def speaking():
    """(module, name of its logger, line) of every call that warns, and (module, line) of every
    note.
    """
    warned, noted = [], []
    for file in sorted(PACKAGE.rglob("*.py")):
        room = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
        module = ".".join(("contactopt", *file.relative_to(PACKAGE).with_suffix("").parts))
        for call in calls(ast.parse(file.read_text())):
            by = call.func
            if isinstance(by, ast.Attribute) and by.attr in SPEAKERS and room not in OTHERS:
                owner = by.value.id if isinstance(by.value, ast.Name) else ""
                if "log" in owner:
                    warned.append((module, owner, call.lineno))
            if isinstance(by, ast.Name) and by.id == "note" and len(call.args) == 2:
                noted.append((module, call.lineno))
    return warned, noted


WARNED, NOTED = speaking()


def seen(tmp_path, capsys, text):
    """What the summary, the terminal, the page and a notebook show of a run."""
    out = tmp_path / "out"
    main(["run", "punch-2d", "--elements", "2", "--no-figures", "--html", "--out", str(out)])
    assert re.search(rf"^note \d+ +{re.escape(text)}$", capsys.readouterr().out, re.M)
    assert text in json.loads((out / "summary.json").read_text())["remarks"]
    assert text in (out / "view.html").read_text()
    result = contactopt.run("punch-2d", elements=2)
    assert result.summary["remarks"].count(text) == 1 and text in result._repr_html_()


def test_the_code_has_places_that_speak():
    assert len(WARNED) > 3 and len(NOTED) > 8


def test_nothing_speaks_past_the_log():
    """No room that a run enters warns through Python's warnings, or prints."""
    for file in sorted(PACKAGE.rglob("*.py")):
        room = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if room in OTHERS or room in ("__main__", "teaching"):
            continue
        for call in calls(ast.parse(file.read_text())):
            name = ast.unparse(call.func)
            assert name not in ("print", "warnings.warn"), f"{file}:{call.lineno}"


@pytest.mark.parametrize("module, owner", sorted({place[:2] for place in WARNED}))
def test_a_warning_reaches_the_reader(module, owner, tmp_path, capsys, monkeypatch):
    """Made by the logger of each module that warns, while the scene is posed."""
    logger, text = getattr(importlib.import_module(module), owner), f"a remark of {module}"
    whole = posing.assemble

    def assemble(*arguments):
        logger.warning("a remark of %s", module)
        return whole(*arguments)

    monkeypatch.setattr(posing, "assemble", assemble)
    seen(tmp_path, capsys, text)


@pytest.mark.parametrize("module", sorted({place[0] for place in NOTED}))
def test_a_note_of_a_method_reaches_the_reader(module, tmp_path, capsys, monkeypatch):
    """Made by the function that each module calls, while a problem is solved."""
    found, text = importlib.import_module(module), f"a remark of {module}"
    assert found.note is notes.note
    follow = driver._follow

    def solving(*arguments):
        found.note(logging.getLogger(module), text)
        return follow(*arguments)

    monkeypatch.setattr(driver, "_follow", solving)
    seen(tmp_path, capsys, text)


def test_notes_of_all_states_of_a_path_are_told_once(monkeypatch):
    states, follow = [], driver._follow

    def solving(*arguments):
        states.append(len(states))
        for text in ("always", f"state {len(states)}"):
            notes.note(logging.getLogger("contactopt"), text)
        return follow(*arguments)

    monkeypatch.setattr(driver, "_follow", solving)
    told = contactopt.run("hertz-dissimilar", elements=6, steps=3).summary["remarks"]
    assert told[:4] == ["always", "state 1", "state 2", "state 3"]


def test_remarks_of_a_coupling_reach_the_reader(tmp_path, capsys, monkeypatch):
    couple, text = posing.couple, "a remark of a coupling"
    monkeypatch.setattr(posing, "couple", lambda *given: replace(couple(*given), fails=text))
    seen(tmp_path, capsys, text)


@pytest.mark.parametrize("verbose", [["-q"], ["-v"]])
def test_a_quiet_run_keeps_its_remarks(verbose, tmp_path, capsys, monkeypatch):
    whole, out = posing.assemble, tmp_path / "out"

    def assemble(*arguments):
        logging.getLogger("contactopt.bodies").warning("heard")
        return whole(*arguments)

    monkeypatch.setattr(posing, "assemble", assemble)
    line = ["run", "punch-2d", "--elements", "2", "--no-figures", "--out", str(out)]
    main([*line[:1], *verbose, *line[1:]])
    printed = capsys.readouterr()
    assert re.search("^note 1 +heard$", printed.out, re.M) and ("heard" in printed.err) == (
        verbose != ["-q"]
    )
    assert "heard" in json.loads((out / "summary.json").read_text())["remarks"]


def test_check_tells_what_the_bodies_say(capsys, monkeypatch):
    whole = posing.assemble

    def assemble(*arguments):
        logging.getLogger("contactopt.bodies").warning("heard")
        return whole(*arguments)

    monkeypatch.setattr(posing, "assemble", assemble)
    assert main(["check", "punch-2d", "--no-page"]) == 0
    assert "note: heard" in capsys.readouterr().out

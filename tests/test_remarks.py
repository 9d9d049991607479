"""Every remark that the package makes reaches the reader."""

import ast
import importlib
import json
import logging
import re
from dataclasses import replace
from functools import cache
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


@cache
def calls():
    """(room, module, call) of every call in the package."""
    found = []
    for file in sorted(PACKAGE.rglob("*.py")):
        path = file.relative_to(PACKAGE).with_suffix("")
        module = ".".join(("contactopt", *path.parts))
        nodes = ast.walk(ast.parse(file.read_text()))
        found += [(path.parts[0], module, node) for node in nodes if isinstance(node, ast.Call)]
    return found


def speaking():
    """(module, name of its logger) of every module that warns in a run."""
    warned, noted = set(), set()
    for room, module, call in calls():
        by = call.func
        if isinstance(by, ast.Attribute) and by.attr in SPEAKERS and room not in OTHERS:
            owner = by.value.id if isinstance(by.value, ast.Name) else ""
            if "log" in owner:
                warned.add((module, owner))
        if isinstance(by, ast.Name) and by.id == "note" and len(call.args) == 2:
            noted.add(module)
    return sorted(warned), sorted(noted)


def seen(tmp_path, capsys, *texts):
    """What the summary, the terminal, the page and a notebook show of a run."""
    out = tmp_path / "out"
    main(["run", "punch-2d", "--elements", "2", "--no-figures", "--html", "--out", str(out)])
    printed, page = capsys.readouterr().out, (out / "view.html").read_text()
    written = json.loads((out / "summary.json").read_text())["remarks"]
    result = contactopt.run("punch-2d", elements=2)
    for text in texts:
        assert re.search(rf"^note \d+ +{re.escape(text)}$", printed, re.M), text
        assert text in written and text in page, text
        assert result.summary["remarks"].count(text) == 1 and text in result._repr_html_(), text


def test_nothing_speaks_past_the_log():
    """No room that a run enters warns through Python's warnings, or prints."""
    for room, module, call in calls():
        if room not in OTHERS and room not in ("__main__", "teaching"):
            assert ast.unparse(call.func) not in ("print", "warnings.warn"), (module, call.lineno)


def test_warnings_and_notes_of_all_modules_reach_the_reader(tmp_path, capsys, monkeypatch):
    """Modules that warn do so while the scene is posed; those that note, while it is solved."""
    warned, noted = speaking()
    assert len(warned) > 3 and len(noted) > 7
    whole, follow = posing.assemble, driver._follow

    def assemble(*arguments):
        for module, owner in warned:
            logger = getattr(importlib.import_module(module), owner)
            logger.warning("a warning of %s", module)
        return whole(*arguments)

    def solving(*arguments):
        for module in noted:
            found = importlib.import_module(module)
            assert found.note is notes.note
            found.note(logging.getLogger(module), f"a note of {module}")
        return follow(*arguments)

    monkeypatch.setattr(posing, "assemble", assemble)
    monkeypatch.setattr(driver, "_follow", solving)
    own = [f"a warning of {module}" for module, _ in warned]
    seen(tmp_path, capsys, *own, *(f"a note of {module}" for module in noted))


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
    assert re.search("^note 1 +heard$", printed.out, re.M)
    assert ("heard" in printed.err) == (verbose != ["-q"])
    assert "heard" in json.loads((out / "summary.json").read_text())["remarks"]


def test_check_tells_what_the_bodies_say(capsys, monkeypatch):
    whole = posing.assemble

    def assemble(*arguments):
        logging.getLogger("contactopt.bodies").warning("heard")
        return whole(*arguments)

    monkeypatch.setattr(posing, "assemble", assemble)
    assert main(["check", "punch-2d", "--no-page"]) == 0
    assert "note: heard" in capsys.readouterr().out

"""The first screen answers the question: tables, colours, the bar, and what a notebook shows."""

import base64
import html
import io
import json
import os
import pty
import re
import subprocess
import sys
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest
from conftest import two_blocks

import contactopt
from contactopt import Contact, Plate, Scene, Support, screen
from contactopt.cli import main
from contactopt.outcome import pair_rows, summary_rows, time_words


@pytest.fixture(scope="module")
def result():
    return contactopt.run("punch-2d", elements=4)


def columns(summary, row=1):
    table = pair_rows(summary)
    return dict(zip([cell.replace("\n", " ") for cell in table[0]], table[row], strict=True))


def moved(aside, law="coulomb", mu=0.3):
    """Two blocks, of which the upper one is pressed down by 0.01 and moved aside."""
    base = two_blocks("plane-strain")
    held = (Support("top", {"x": aside, "y": -0.01}),)
    upper = replace(base.upper, supports=held, loads=())
    lower = replace(base.lower, supports=(Support("bottom"),))
    return Scene("moved", bodies=(upper, lower), contacts=(Contact("upper", "lower", mu, law),))


def test_friction_is_compared_with_what_it_could_carry():
    """Less than the whole holds; far aside everything slides, and friction is its bound."""
    for aside, low, high in ((0.001, 0.01, 0.95), (0.1, 1 - 1e-6, 1 + 1e-6)):
        summary = contactopt.run(moved(aside), figures=()).summary
        (pair,) = summary["pairs"].values()
        assert pair["friction_bound"] == pytest.approx(0.3 * pair["normal_force"])
        share = pair["friction_force"] / pair["friction_bound"]
        assert low < share < high and abs(pair["force"][0]) <= pair["friction_force"] * (1 + 1e-9)
        assert columns(summary)["of bound"] == f"{100 * share:.3g} %"
    assert columns(summary)["stick"] == "0" and columns(summary)["of bound"] == "100 %"


@pytest.mark.parametrize("law", ["frictionless", "tied"])
def test_no_share_of_a_bound_that_is_not_there(law):
    summary = contactopt.run(moved(0.001, law, mu=0.0), figures=()).summary
    assert columns(summary)["of bound"] == "-"


SIZES = {"mm": 1e-3, "m": 1.0, "MPa": 1e6, "Pa": 1.0, "N": 1.0, "": 1.0}
READ = ("approach", "shift", "energy", "pressure", "width", "stick", "normal_force", "shear_force")
PLACES = ("resultant:upper-lower:x", "von_mises:lower", "pressure@0.5,0", "von_mises:lower@0.4,-1")


def test_quantities_are_printed_in_their_units():
    """The same blocks in mm and MPa and in m and Pa: values times their units are the same."""
    read, base = (*READ, *PLACES), moved(0.0)
    push = Plate("top", {"x": 0.3, "y": -3.0})
    scene = replace(
        base, bodies=(replace(base.bodies[0], supports=(), loads=(push,)), base.bodies[1])
    )
    shown = []
    for length, stress, wide in (("mm", "MPa", 1.0), ("m", "Pa", 1e-3)):
        bodies = []
        for body in scene.bodies:
            mesh = replace(body.mesh, doflocs=wide * body.mesh.p)
            material = replace(body.material, E=body.material.E * wide**-2)
            held = tuple(
                Support(one.boundary, one.displacement and scaled(one.displacement, wide))
                for one in body.supports
            )
            bodies.append(replace(body, mesh=mesh, material=material, supports=held))
        own = replace(scene, bodies=tuple(bodies), units=(length, stress), thickness=wide)
        names = [scaled_place(name, wide) for name in read]
        rows = summary_rows(contactopt.run(own, figures=(), read=names).summary)
        words = [rows[name].partition(";")[0].split() for name in names]
        shown.append([float(value) * np.prod([SIZES[u] for u in unit]) for value, *unit in words])
    assert shown[0] == pytest.approx(shown[1], rel=1e-4)


def scaled(values, wide):
    return {name: wide * value for name, value in values.items()}


def scaled_place(name, wide):
    kind, sign, place = name.partition("@")
    return kind + sign + ",".join(f"{wide * float(x):g}" for x in place.split(",") if x)


def test_the_answer_comes_first_and_files_last(result, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", "punch-2d", "--elements", "4", "--no-figures", "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "\x1b" not in "".join(lines), "no colours where the output is no terminal"
    order = ["peak", "punch-foundation", "approach", "status", "note 1", " s: ", "files in"]
    places = [next(i for i, line in enumerate(lines) if word in line) for word in order]
    assert places == sorted(places) and places[-1] == len(lines) - 1
    assert len([line for line in lines if line.startswith("status")]) == 1
    numbers = next(i for i, line in enumerate(lines) if "contact " in line)
    assert all(len(line) <= 80 for line in lines[: numbers + 2])


def test_terminal_page_and_notebook_say_the_same(result, tmp_path, capsys):
    out = tmp_path / "out"
    line = ["run", "punch-2d", "--elements", "4", "--no-figures", "--html", "--out", str(out)]
    assert main(line) == 0
    printed = capsys.readouterr().out
    page, summary = (out / "view.html").read_text(), json.loads((out / "summary.json").read_text())
    page, notebook = (text.replace("<wbr>", "") for text in (page, result._repr_html_()))
    for name, words in summary_rows(summary).items():
        assert re.search(rf"^{re.escape(name)} +{re.escape(words)}$", printed, re.M)
        for text in (page, notebook):
            assert html.escape(name) in text and html.escape(words) in text
    for cell in pair_rows(summary)[1]:
        assert cell in printed and f">{cell}<" in page and f">{cell}<" in notebook


def test_the_time_line_names_what_took_long():
    seconds = {"scene": 0.1, "solve": 6.0, "files": 3.5, "total": 10.0}
    assert time_words({"seconds": seconds}) == "10.0 s: solve 6.00, files 3.50"


def test_a_result_that_is_not_solved_says_why(tmp_path, capsys):
    line = ["run", "punch-2d", "--elements", "4", "--no-figures", "--time-limit", "0"]
    assert main([*line, "--out", str(tmp_path / "out")]) == 1
    (status,) = re.findall("^status +(.*)$", capsys.readouterr().out, re.M)
    assert not status.startswith("solved") and "(" in status


def test_a_notebook_shows_the_pressure(result):
    shown = result._repr_html_()
    (data,) = re.findall('src="data:image/png;base64,([^"]*)"', shown)
    picture = matplotlib.image.imread(io.BytesIO(base64.b64decode(data)))
    assert 200 < picture.shape[1] < 700 and np.ptp(picture[..., :3]) > 0.5
    assert len(data) < 100_000
    far = replace(result.fields[0], displacement=1e9 * np.ones_like(result.fields[0].displacement))
    stalled = replace(result.solution, status=contactopt.Status.STALLED)
    broken = replace(result, solution=stalled, fields=(far, *result.fields[1:]))
    assert "<img" not in broken._repr_html_() and "<table>" in broken._repr_html_()


def test_a_notebook_shows_a_scene_as_check_does():
    scene = contactopt.scenes.flat_punch(2, elements=4)
    (page,) = re.findall('srcdoc="([^"]*)"', scene._repr_html_())
    page = html.unescape(page)
    assert page.startswith("<!doctype html>") and "Nothing has been solved yet" in page
    assert "contacts by matching" in page
    hostile = replace(scene, name='"><script>alert(1)</script>')
    assert "<script>alert" not in hostile._repr_html_()


def on_a_terminal(program, columns=80):
    """What a program writes to a terminal of so many columns."""
    own, its = pty.openpty()
    environment = os.environ | {"COLUMNS": str(columns), "TERM": "xterm"}
    environment.pop("NO_COLOR", None)
    child = subprocess.Popen(
        [sys.executable, "-c", program], stdout=its, stderr=its, env=environment
    )
    os.close(its)
    parts = []
    try:
        while part := os.read(own, 65536):
            parts.append(part)
    except OSError:  # Linux: the other end was closed
        pass
    os.close(own)
    assert child.wait(60) == 0
    return b"".join(parts).decode()


BAR = """
import time
from contactopt import screen
screen.PATIENCE = 0.1
with screen.progress("punch") as shown:
    shown.note("state 3 of 12: solved, 2 iterations")
    shown.note("step 4: residual 1.0e-03, 5 s, 0.2 GiB, about 7 s left")
    time.sleep(1.0)
with screen.progress("runs", 4, 1) as shown:
    shown.count("1 timeout")
    time.sleep(1.0)
"""


def test_a_terminal_has_a_bar_and_keeps_no_line_of_it():
    shown = on_a_terminal(BAR, 140)
    assert "punch: state 3 of 12: solved, 2 iterations; step 4: residual 1.0e-03" in shown
    assert "about 7 s left" in shown and "runs: 2 of 4, 1 timeout" in shown
    assert "\x1b[2K" in shown.split("runs:")[-1], "the line is wiped at the end"


def test_work_that_is_short_shows_no_bar():
    assert not on_a_terminal(BAR.replace("time.sleep(1.0)", "pass").replace("0.1", "5.0"))


def test_elsewhere_progress_is_made_of_lines(capsys, monkeypatch):
    with screen.progress("punch") as shown:
        shown.note("solving 3 contacts")
    assert capsys.readouterr().err == "  solving 3 contacts\n"
    monkeypatch.setattr(screen, "PAUSE", 0.0)
    for quiet, lines in ((False, 2), (True, 0)):
        with screen.progress("runs", 5, 3, quiet) as shown:
            shown.count()
            shown.count("1 timeout")
        told = capsys.readouterr()
        assert told.err.count("\n") == lines and told.out == ""
        assert quiet or told.err.endswith("runs: 5 of 5, 1 timeout\n")


def test_no_name_of_a_row_is_cut():
    name = "pressure:ball.sphere1-inner.torus1"
    shown = screen.in_tables("a", [("contact", "peak")], {name: "1 MPa"})
    assert "".join(line[:26].strip() for line in shown.splitlines()[2:]) == name


def test_a_terminal_has_colours_and_names_in_brackets_stay():
    program = (
        "from contactopt.screen import in_tables\n"
        "print(in_tables('a', [('contact', 'peak\\nMPa'), ('[red]x', '1')],"
        " {'status': 'solved', 'note 1': 'long ' * 30}))"
    )
    shown = on_a_terminal(program)
    assert "\x1b[32msolved" in shown and "[red]x" in shown
    assert all(len(re.sub(r"\x1b\[[\d;]*m", "", line)) <= 80 for line in shown.split("\r\n"))

"""The deck for CalculiX says what the scene says; where ccx is installed, both codes agree."""

import shutil

import numpy as np
import pytest

from contactopt import InputError, reduce, scenes
from experiments.questions.calculix import __main__ as calculix
from experiments.questions.calculix.deck import LAWS, Contact, deck, model
from experiments.questions.calculix.run import RIGID, Bench, difference, linear, printed, punch

CCX = shutil.which("ccx")
needs_ccx = pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed")
SCENE = punch(elements=4, modulus=5.0)


def cards(text: str) -> list[tuple[str, list[list[str]]]]:
    """(keyword line, data lines as fields), continued lines joined."""
    found: list[tuple[str, list[list[str]]]] = []
    joined = ""
    for line in text.splitlines():
        if line.startswith("*"):
            found.append((line, []))
            continue
        joined += line
        if not line.endswith(","):
            found[-1][1].append([field.strip() for field in joined.split(",")])
            joined = ""
        else:
            joined += " "
    return found


def data(text: str, start: str) -> list[list[str]]:
    return [row for head, rows in cards(text) if head.startswith(start) for row in rows]


@pytest.mark.parametrize("law", LAWS)
def test_deck_holds_the_mesh_and_the_load(law):
    bodies = model(SCENE)
    text = deck(bodies, Contact(law, 100.0, 10.0))
    layers = 2 if law == "mortar" else 1
    nodes, quads = bodies.points.shape[1], bodies.quads.shape[1]
    assert [row[0] for row in data(text, "*NODE, NSET")] == [
        str(i + 1) for i in range(layers * nodes)
    ]
    solids = data(text, f"*ELEMENT, TYPE={'C3D8' if layers == 2 else 'CPE4'}")
    assert [row[0] for row in solids] == [str(i + 1) for i in range(quads)]
    assert all(len(row) == 1 + 4 * layers for row in solids)
    assert {int(n) for row in solids for n in row[1:]} == set(range(1, layers * nodes + 1))
    (load,) = data(text, "*CLOAD")
    assert load[1] == "2" and float(load[2]) == -100.0 / 2  # half model
    # ccx reads no more
    assert max(len(field) for _, rows in cards(text) for row in rows for field in row) <= 20
    assert all("." in row[-1] for row in data(text, "*SPRING")[1:])


def test_elements_are_anticlockwise_and_cover_both_bodies():
    bodies = model(SCENE)
    (x, y), (u, v) = (
        bodies.points[:, bodies.quads],
        bodies.points[:, np.roll(bodies.quads, -1, axis=0)],
    )
    areas = np.sum(x * v - u * y, axis=0) / 2
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(20 * 40 + 80 * 80)


def test_supports_plate_and_bond_hold_each_unknown_once():
    bodies = model(SCENE)
    text = deck(bodies, Contact("bonded"))
    held = {(int(row[0]), int(row[1])) for row in data(text, "*BOUNDARY")}
    top, contact = bodies.nodes(0, "top"), bodies.nodes(0, "contact")
    assert {(n + 1, 1) for n in top} <= held
    assert {(n + 1, c) for n in bodies.nodes(1, "bottom") for c in (1, 2)} <= held
    equations = [tuple(int(i) for i in row[:2]) for row in data(text, "*EQUATION") if len(row) == 6]
    # x of the axis is held already
    assert len(set(equations)) == len(equations) == len(top) - 1 + 2 * len(contact) - 1
    assert not set(equations) & held


def test_surfaces_match_node_by_node():
    bodies = model(SCENE)
    text = deck(bodies, Contact("surface-to-surface", 100.0, 10.0))
    ends = []
    for name in ("UPPER", "LOWER"):
        faces = data(text, f"*SURFACE, NAME={name}")
        assert len(faces) == 4
        sides = [bodies.quads[[int(s[1]) - 1, int(s[1]) % 4], int(e) - 1] for e, s in faces]
        ends.append(np.sort(bodies.points[:, np.array(sides)].round(12).reshape(2, -1), axis=1))
    np.testing.assert_array_equal(*ends)
    assert np.all(ends[0][1] == 0) and ends[0][0].max() == 20
    wider = deck(bodies, Contact("surface-to-surface", 100.0, 10.0, master="top"))
    assert len(data(wider, "*SURFACE, NAME=LOWER")) > 4


def test_what_the_deck_cannot_say_is_refused():
    with pytest.raises(InputError, match="plane strain"):
        model(scenes.flat_punch(3, elements=2))
    with pytest.raises(InputError, match="elastic"):
        model(scenes.flat_punch(2, elements=4, rigid="punch"))
    with pytest.raises(InputError, match="one load"):
        deck(model(scenes.cattaneo(2, elements=4)), Contact("mortar"))
    with pytest.raises(InputError, match="unknown contact law"):
        deck(model(SCENE), Contact("glue"))


def test_printed_tables_keep_the_last_of_each(tmp_path):
    path = tmp_path / "job.dat"
    text = (
        "\n displacements (vx,vy,vz) for set A and time  {}\n\n   1  {}  2.0E+00 -3.0E-10\n\n"
        " stresses (elem) x\n\n 1 1 5.\n"
    )
    path.write_text(text.format("0.5", "9.0") + text.format("1.0", "1.5"))
    tables = printed(path)
    np.testing.assert_array_equal(tables["displacements"], [[1, 1.5, 2.0, -3e-10]])
    np.testing.assert_array_equal(tables["stresses"], [[1, 1, 5]])


def test_without_ccx_one_sentence_and_no_report(monkeypatch, capsys):
    monkeypatch.setattr(calculix.shutil, "which", lambda name: None)
    monkeypatch.setattr(calculix, "write", lambda *args: pytest.fail("the report was touched"))
    calculix.main()
    assert "apt-get install calculix-ccx" in capsys.readouterr().out


@needs_ccx
def test_linear_problem_agrees():
    check = linear(CCX)
    assert check["displacements, largest difference"] < 1e-6
    assert check["normal forces, largest difference"] < 1e-6
    assert check["tangential forces, largest difference"] < 1e-6


@needs_ccx
def test_contact_agrees():
    bench = Bench(CCX, punch(elements=8))
    hard = bench.run("mortar", RIGID)
    assert hard.failure == "" and hard.iterations > 1
    assert max(difference(hard.reactions[0], bench.exact.reactions)) < 1e-6
    assert max(difference(hard.reactions[1], bench.exact.reactions)) < 1e-6
    soft = bench.row("node-to-surface", 100.0)
    assert soft["same law"] < 1e-5 < 1e-4 < soft["normal, largest"]


@needs_ccx
def test_failure_is_a_row(monkeypatch):
    bench = Bench(CCX, punch(elements=4))
    monkeypatch.setattr("experiments.questions.calculix.run.LIMIT", 0.0)
    row = bench.row("node-to-surface", 100.0)
    assert row["end"].startswith("no answer") and row["force"] == ""


def test_forces_do_not_depend_on_the_modulus():
    soft, stiff = (reduce(punch(elements=4, modulus=E)) for E in (5.0, 5e5))
    np.testing.assert_allclose(soft.Q, stiff.Q * 1e5, rtol=1e-9)

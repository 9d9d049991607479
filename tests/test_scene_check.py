"""`contactopt check`: what is said of a scene before it is solved is what the solved scene has."""

import json
import re

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from conftest import MATERIAL
from test_page import data_of, decoded

import contactopt
from contactopt import Contact, InputError, Part, Plate, Rigid, Scene, Support, Traction, scenes
from contactopt.cli import main
from contactopt.figures.check_page import ROLES, write_check_page
from contactopt.figures.scene_check import check_scene
from contactopt.meshes.structured import tensor_mesh


def block(name, low, high, **more):
    mesh = tensor_mesh(np.linspace(0, 1, 5), np.linspace(low, high, 5))
    return Part(name, mesh, MATERIAL, **more)


def two(load, gap=0.0, mu=0.0):
    upper = block("upper", 1 + gap, 2 + gap, loads=load, contact="y-")
    lower = block("lower", 0, 1, supports=(Support("y-"),), contact="y+")
    return Scene("two", bodies=(upper, lower), contacts=(Contact("upper", "lower", mu),))


@pytest.mark.parametrize("name", ["punch-2d", "pin-in-bush", "cattaneo-2d", "stack", "press-fit"])
def test_contacts_gaps_and_free_motions_are_those_of_the_reduction(name):
    states = scenes.make_path(name) if name in scenes.PATHS else (scenes.make_scene(name),)
    found = check_scene(states)
    made = contactopt.coupling.reduction.reduce_bodies(states[-1], zone=states[-1].zone)
    np.testing.assert_allclose(
        np.concatenate([pair.gap for pair in found.posed.couplings]), made.gap, atol=1e-12
    )
    assert sum(body.unknowns for body in found.posed.bodies) == made.dofs
    assert sorted(found.free.s.round(6)) == pytest.approx(sorted(made.problem.s), abs=1e-6)
    assert not found.notes


def test_free_motions_do_not_know_north():
    """A body that hangs on a plate and a slanted block: turned, the same number of free motions."""
    for angle in (0.0, 0.3, 2.0):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        parts = [
            block("upper", 1, 2, loads=(Traction("y+", tuple(turn @ [0.0, -1.0])),), contact="y-"),
            block("lower", 0, 1, supports=(Support("y-"),), contact="y+"),
        ]
        parts = [
            Part(p.name, type(p.mesh)(turn @ p.mesh.p, p.mesh.t, _boundaries=p.mesh.boundaries),
                 p.material, p.supports, p.loads, p.contact)
            for p in parts
        ]  # fmt: skip
        scene = Scene("turned", bodies=tuple(parts), contacts=(Contact("upper", "lower", 0.0),))
        found = check_scene((scene,))
        assert len(found.free.s) == 3
        resultant = np.linalg.norm(found.free.s[:2])
        assert resultant == pytest.approx(1.0)
        (note,) = found.notes  # nothing resists sliding along the surface
        assert "resist a motion of body 'upper': translation" in note


def test_loads_that_nothing_balances_are_told_as_the_solver_tells_them():
    for load, mu, word in (
        (Traction("y+", (0.0, 1.0)), 0.3, "pulls the bodies apart"),
        (Traction("y+", (1.0, -1.0)), 0.3, "slides off"),
    ):
        scene = two((load,), mu=mu)
        (note,) = check_scene((scene,)).notes
        assert word in note
        with pytest.raises(InputError) as refused:
            contactopt.run(scene)
        assert note == str(refused.value).removeprefix("contactopt: ")
    assert not check_scene((two((Traction("y+", (0.2, -1.0)),), mu=0.3),)).notes


def test_misplaced_bodies_are_told():
    apart = check_scene((two((Plate("y+", {"y": -1.0}),), gap=0.5),))
    assert "0.5 length or more apart" in apart.notes[0]
    over = check_scene((two((Plate("y+", {"y": -1.0}),), gap=-0.25),))
    assert "overlap by up to 0.25" in over.notes[0] and "5 overlap, 100 % of the area" in over.text


def test_the_way_and_its_memory_are_those_of_the_run(caplog):
    scene = scenes.make_scene("punch-3d", elements=6)
    found = check_scene((scene,))
    with caplog.at_level("INFO", logger="contactopt"):
        contactopt.reduce(scene)
    taken = re.search(r"the way is (\w+) by (\w+)", caplog.text)
    assert min(found.costs, key=found.costs.get) == taken.groups()
    dense = check_scene((scene,), {"Q": "explicit", "solver": "superlu"})
    assert set(dense.costs) == {("dense", "superlu")}
    fine = check_scene((scenes.make_scene("punch-3d", elements=12),), {"Q": "explicit"})
    assert fine.memory > dense.memory


def test_the_page_shows_boundaries_loads_and_gaps(tmp_path):
    scene = scenes.make_scene("punch-3d", elements=3)
    found = check_scene((scene,))
    data = data_of(write_check_page(found, tmp_path / "page.html"))
    items = {item["name"]: item for item in data["contacts"]}
    assert {"punch: top (plate)", "foundation: bottom (support)", "punch-foundation"} <= set(items)
    assert np.ptp(decoded(items["punch-foundation"]["states"]["gap"])) == 0
    top = items["punch: top (plate)"]
    assert decoded(top["states"]["vector"]).sum(axis=0) == pytest.approx([0, 0, -100])
    points, cells = decoded(top["points"]), decoded(top["cells"])
    corners = points[cells]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(area, axis=1).sum() / 2 == pytest.approx(400.0)
    assert data["roles"] == list(ROLES)
    shown = {name: decoded(item["states"]["status"]).sum() for name, item in items.items()}
    assert shown["punch-foundation"] == 3, "a dozen normals on four images"
    bottom = items["foundation: bottom (support)"]["states"]
    held = decoded(bottom["held"])[decoded(bottom["status"]) > 0]
    assert len(held) == 5 and np.all(held == [0, 0, -2]), "clamped, from below"
    symmetric = [item["hidden"] for name, item in items.items() if "symmetry" in name]
    assert symmetric and all(symmetric), "planes of symmetry, which the whole does not have"
    page = (tmp_path / "page.html").read_text()
    assert page.index("pair &#x27;punch-foundation&#x27;") < page.index("body &#x27;punch&#x27;")


@pytest.mark.skipif(CHROMIUM is None, reason="no browser")
@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 400])
def test_a_browser_draws_it(tmp_path, width):
    for name in ("punch-2d", "rough"):
        states = scenes.make_path(name, points=64) if name == "rough" else (scenes.flat_punch(2),)
        page = write_check_page(check_scene(states), tmp_path / f"{name}.html")
        with Browser(page, width) as browser:
            browser.wait("performance.getEntriesByName('drawn').length > 0")
            drawn = browser.ask(
                "(() => { const c = document.getElementById('view'); const d ="
                " c.getContext('2d').getImageData(0, 0, c.width, c.height).data; const seen = new"
                " Set(); for (let i = 0; i < d.length; i += 4) seen.add(d[i] << 16 | d[i + 1] << 8"
                " | d[i + 2]); return [seen.size, seen.has(0xE69F00), seen.has(0xD55E00)]; })()"
            )
            assert drawn[0] > 8 and not browser.faults
            assert drawn[1:] == [True, False], "the legend has contacts, and no bolt"


def test_the_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["check", "punch-2d", "--no-open"]) == 0
    said = capsys.readouterr().out
    assert "held by its supports" in said and "cost: about" in said
    assert (tmp_path / "out" / "punch-2d-check.html").stat().st_size < 1e6
    assert main(["check", "punch-2d", "--no-page", "--set", "mu=-1"]) == 2
    assert main(["check", "nothing.toml"]) == 2
    assert "does not exist" in capsys.readouterr().err


def test_rigid_bodies_and_names_are_escaped(tmp_path):
    upper = block(
        "<b>up</b>".replace("/", ""), 1, 2, contact="y-", loads=(Plate("y+", {"y": -1.0}),)
    )
    scene = Scene(
        "<i>", bodies=(upper, Rigid("floor")), contacts=(Contact(upper.name, "floor", 0.1),)
    )
    page = write_check_page(check_scene((scene,)), tmp_path / "page.html")
    assert "<i>" not in page.read_text() and "<b>up" not in page.read_text()
    assert json.dumps(data_of(page))

"""Pairs of boundaries that face each other, found by proximity."""

import logging
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from deck_shapes import block, element_rows, node_rows

import contactopt
from contactopt import InputError
from contactopt.cli import main
from contactopt.meshes.polar import ring
from contactopt.meshes.structured import tensor_mesh
from contactopt.scenes.facing_boundaries import facing_boundaries, usual_distance
from contactopt.scenes.scene_files import read_scene_file

TWO_SHELVES = """
kind = "plane-strain"
units = { length = "mm", stress = "MPa" }
contacts = "auto"
mu = 0.4
[bodies.block]
block = { x = [0, 10], y = [0, 10], elements = [5, 5] }
material = "steel"
plates = [{ boundary = "y+", force = { y = [-50.0, -100.0] } }]
[bodies.floor]
block = { x = [-10, 10], y = [-10, -0.01], elements = [13, 4] }
material = "steel"
supports = [{ boundary = "y-" }]
[bodies.wall]
block = { x = [10.02, 15], y = [0, 10], elements = [3, 8] }
material = "steel"
supports = [{ boundary = "x+" }]
"""
PAIRS = [("block:y-", "floor:y+"), ("block:x+", "wall:x-")]


def sides(found):
    return [tuple(":".join(side) for side in pair.sides) for pair in found]


def test_facets_face_each_other_within_a_distance_and_not_beside_each_other():
    block = tensor_mesh(np.linspace(0, 1, 11), np.linspace(0, 1, 11))
    floor = tensor_mesh(np.linspace(-2, 0.5, 6), np.linspace(-1, -0.001, 5))
    both = {"block": block, "floor": floor}
    (pair,) = facing_boundaries(both, 0.01)
    assert sides([pair]) == [("block:y-", "floor:y+")]
    # half a unit of 1 and of 2.5 units, up to one facet of the floor
    assert pair.share == pytest.approx(1 / 3.5, abs=0.5 / 3.5)
    assert pair.gaps == pytest.approx((0.001, 0.001))
    assert not facing_boundaries(both, 0.0009)
    beside = replace(floor, doflocs=floor.doflocs - np.array([[0.6], [0.0]]))
    assert not facing_boundaries({"block": block, "beside": beside}, 0.01)
    # an overlap is a negative gap
    sunk = replace(floor, doflocs=floor.doflocs + np.array([[0.0], [0.002]]))
    assert facing_boundaries({"block": block, "floor": sunk}, 0.01)[0].gaps[0] < 0


def test_the_boundary_that_fits_best_is_taken_and_a_turned_scene_has_the_same_pairs():
    meshes = {
        "upper": tensor_mesh(*[np.linspace(0, 1, 6)] * 3),
        "lower": tensor_mesh(np.linspace(-1, 2, 8), np.linspace(-1, 2, 9), np.linspace(-1, 0, 4)),
    }
    meshes["lower"] = meshes["lower"].with_boundaries({"skin": lambda x: x[0] == x[0]})
    assert sides(facing_boundaries(meshes, 0.01)) == [("upper:z-", "lower:z+")]
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    turned = {name: replace(mesh, doflocs=turn @ mesh.doflocs) for name, mesh in meshes.items()}
    one, two = (facing_boundaries(own, 0.01)[0] for own in (meshes, turned))
    assert two.sides == one.sides and two.share == pytest.approx(one.share, rel=1e-9)


def test_a_ring_in_a_ring_is_one_pair():
    inner = ring(np.linspace(1, 2, 4), np.linspace(0, np.pi / 2, 7))
    outer = ring(np.linspace(1.99, 3, 4), np.linspace(0, np.pi / 2, 10))
    both = {"inner": inner, "outer": outer}
    (pair,) = facing_boundaries(both, usual_distance(both))
    assert sides([pair]) == [("inner:outer", "outer:inner")] and pair.share == pytest.approx(1.0)


def test_a_scene_file_finds_its_contacts_and_shows_them_to_be_pasted(tmp_path, caplog):
    path = tmp_path / "shelves.toml"
    path.write_text(TWO_SHELVES)
    with caplog.at_level(logging.WARNING):
        found = read_scene_file(path).states
    assert [(c.upper, c.lower, c.mu) for c in found[-1].contacts] == [(*p, 0.4) for p in PAIRS]
    (told,) = [record.message for record in caplog.records]
    pasted = told.partition("\n")[2]
    assert len(tomllib.loads(pasted)["contacts"]) == 2 and "0.02 mm" in told
    other = tmp_path / "pasted.toml"
    other.write_text(TWO_SHELVES.replace('contacts = "auto"\nmu = 0.4', "") + pasted)
    again = read_scene_file(other).states
    assert again[-1].contacts == found[-1].contacts and len(again) == len(found) == 2
    assert read_scene_file(path, {"mu": 0.1}).states[0].contacts[0].mu == 0.1
    one, two = (contactopt.run(file) for file in (path, other))
    assert one.solution.solved and one.summary["normal_force"] == two.summary["normal_force"]


def test_the_command_lists_the_pairs(tmp_path, capsys):
    path = tmp_path / "shelves.toml"
    path.write_text(TWO_SHELVES)
    assert main(["check", str(path), "--no-page"]) == 0
    told = capsys.readouterr().out
    assert "block.y--floor.y+" in told and "block.x+-wall.x-" in told


@pytest.mark.parametrize(("old", "new", "words"), [
    ("mu = 0.4", "mu = 0.4\ndistance = 0.001", "face each other within 0.001 mm; give a larger"),
    ("mu = 0.4", "", "'mu' is missing"),
    ('"auto"', '"all"', "there is no contacts 'all'; choose from auto"),
    ("mu = 0.4", "mu = -0.4", "must be a finite number at least 0"),
    ("mu = 0.4", "mu = 0.4\n[bodies.rigid]\nrigid = {}", "'rigid' has none"),
    ("mu = 0.4", "mu = 0.4\ndistance = 0.015", "'wall' belongs to no contact"),
])  # fmt: skip
def test_what_cannot_be_found_is_told_in_a_sentence(tmp_path, old, new, words):
    path = tmp_path / "shelves.toml"
    path.write_text(TWO_SHELVES.replace(old, new))
    with pytest.raises(InputError, match=words):
        read_scene_file(path)


def body_of_nodes(name, shape, at):
    """Lines of a deck: a block, the set of all of its nodes, and those of two of its sides."""
    sets = {
        name: list(shape.nodes),
        f"{name}_low": shape.on(1, at),
        f"{name}_up": shape.on(1, at + 2),
    }
    rows = "\n".join(f"*NSET, NSET={n}\n" + ",\n".join(map(str, own)) for n, own in sets.items())
    return (
        f"*NODE\n{node_rows(shape)}\n*ELEMENT, TYPE=CPE4, ELSET={name}\n"
        f"{element_rows(shape.elements)}\n{rows}\n"
    )


@pytest.mark.parametrize("elements", [2, 1])
def test_nodes_of_a_whole_body_are_no_surface_that_may_touch(tmp_path, elements):
    """Gmsh's option SaveGroupsOfNodes writes the nodes of each body as a set; so does HyperMesh."""
    low = block("quad", 1, (elements, 2))
    up = block("quad", 1, (elements, 2), first=101, at=(0.0, 2.0, 0.0))
    text = body_of_nodes("LOWER", low, 0.0) + body_of_nodes("UPPER", up, 2.0)
    both = [*low.on(1, 0.0), *low.on(0, 0.0)]
    text += "*NSET, NSET=CORNER\n" + ",\n".join(map(str, both)) + "\n"
    (tmp_path / "two.inp").write_text(text)
    (tmp_path / "two.toml").write_text(
        'contacts = "auto"\nmu = 0.3\n[bodies.up]\nmesh = "two.inp"\ngroup = "UPPER"\n'
        'material = { E = 1000, nu = 0.3 }\ntractions = [{ boundary = "UPPER_up", y = -1 }]\n'
        '[bodies.low]\nmesh = "two.inp"\ngroup = "LOWER"\nmaterial = { E = 1000, nu = 0.3 }\n'
        'supports = [{ boundary = "LOWER_low", x = 0, y = 0 }]\n'
    )
    (pair,) = read_scene_file(tmp_path / "two.toml").states[0].pairs
    assert (pair.upper, pair.lower) == ("up:UPPER_low", "low:LOWER_up")

"""Scenes without a solution end in a sentence, in time, and no number overflows without one."""

import time
import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import MATERIAL, block, two_blocks

from contactopt import Contact, InputError, Part, Rigid, Scene, Support, run
from contactopt.scenes.scene import BodyForce

SOON = 60.0  # s of process time; the proof takes some seconds on an idle core


def tied(shift, degree=1, cells=4, law="tied"):
    """Two blocks whose common surface supports hold on both sides, one shifted along x."""
    upper = Part(
        "upper",
        block("plane-strain", 0, 1, cells),
        MATERIAL,
        (Support("bottom", {"x": shift, "y": 0.0}),),
        contact="bottom",
    )
    lower = Part("lower", block("plane-strain", -1, 0), MATERIAL, (Support("top"),), contact="top")
    contact = Contact("upper", "lower", mu=0.0, law=law)
    return Scene("held", bodies=(upper, lower), contacts=(contact,), degree=degree)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cells", [4, 5])
@pytest.mark.parametrize("form", ["explicit", "implicit"])
def test_a_tie_between_nodes_that_are_held_apart_has_no_solution(degree, cells, form):
    result = run(tied(0.1, degree, cells), Q=form)
    assert result.summary["status"] == "infeasible" and result.solution.proof is not None
    assert "held on both sides, 0.1 apart" in result.summary["message"]
    # what the supports need for the shift alone
    assert all(np.abs(own["force"]).max() < 1e3 for own in result.summary["holders"].values())


@pytest.mark.parametrize("law", ["tied", "bilateral"])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_tie_between_nodes_that_are_held_alike_is_solved(law, degree):
    result = run(tied(0.0, degree, law=law))
    assert result.solution.solved and np.abs(result.solution.reactions).max() < 1e-9


def test_a_bilateral_contact_may_slide_where_it_is_held():
    assert run(tied(0.1, law="bilateral")).solution.solved


def falling(mu, overlap=0.0, count=2):
    """Blocks beside each other between two walls, under their weight."""
    bodies = []
    for number in range(count):
        mesh = block("plane-strain", 0, 1)
        low, high = number, number + 1 + (overlap if number == count - 1 else 0.0)
        across = low + mesh.p[0] * (high - low)
        mesh = replace(mesh, doflocs=np.stack([across, mesh.p[1]]), _boundaries=None)
        ends = {"left": lambda x, at=low: abs(x[0] - at) < 1e-9}
        ends["right"] = lambda x, at=high: abs(x[0] - at) < 1e-9
        load, mesh = BodyForce((0.0, -1.0)), mesh.with_boundaries(ends)
        bodies.append(Part(f"block-{number}", mesh, MATERIAL, (), (load,), contact="left"))
    names = [body.name for body in bodies]
    pairs = [
        Contact(f"{names[0]}:left", "west", mu=mu),
        Contact(f"{names[-1]}:right", "east", mu=mu),
        *(Contact(f"{a}:right", f"{b}:left", mu=mu) for a, b in pairwise(names)),
    ]
    walls = Rigid("west", (1.0, 0.0)), Rigid("east", (-1.0, 0.0))
    return Scene("falling", bodies=(*bodies, *walls), contacts=tuple(pairs))


@pytest.mark.parametrize(
    ("mu", "overlap"), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.01), (0.3, 0.01), (1.5, 0.01)]
)
def test_blocks_that_fall_between_walls_are_told_so_in_time(mu, overlap):
    began = time.process_time()
    try:
        summary = run(falling(mu, overlap=overlap)).summary
        said = summary["message"]
        assert summary["status"] == "infeasible", said
        assert "no solution" in said or "slides" in said
        assert summary["remarks"] == [] or all("small" not in text for text in summary["remarks"])
    except InputError as error:
        assert "slides off" in str(error)
    assert time.process_time() - began < SOON


@pytest.mark.parametrize("mu", [1e300, np.finfo(float).max])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("law", ["coulomb", "bilateral", "associated", "orthotropic"])
def test_no_friction_overflows(mu, degree, law, tmp_path):
    value = mu if law != "orthotropic" else (mu, mu)
    scene = replace(two_blocks("plane-strain" if law != "orthotropic" else "solid"), degree=degree)
    pair = Contact("upper", "lower", mu=value, law=law)
    if law == "orthotropic":
        pair = replace(pair, direction=(1.0, 0.0, 0.0))
    scene = Scene(scene.name, bodies=scene.parts, contacts=(pair,), kind=scene.kind, degree=degree)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run(scene, tmp_path, figures=()).summary["status"]

import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import MATERIAL, block, two_blocks

from contactopt import (
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    reduce,
    reduce_bodies,
    scenes,
    solve,
)
from contactopt.coupling import reduction
from contactopt.coupling.back_to_bodies import recover
from contactopt.solving.solve_scene import Options, solve_scene


@pytest.mark.parametrize(
    "scene",
    [scenes.flat_punch(2, elements=4), scenes.flat_punch(3, elements=3), scenes.sphere(elements=6)],
)
def test_recovered_bodies_are_in_equilibrium_and_meet_the_interface_equation(scene):
    reduction = reduce_bodies(scene)
    problem = reduction.problem
    solution = solve(problem, tol=1e-10)
    fields = recover(reduction, solution)
    jump = np.zeros(problem.q.shape)
    for body, B, field in zip(reduction.bodies, reduction.maps, fields):
        basis = body.body.basis
        U = np.zeros(basis.N)
        U[basis.nodal_dofs] = field.displacement
        force = B.T @ solution.reactions.ravel()
        free = body.body.free
        assert (
            np.abs((body.body.A @ U - body.body.load - force)[free]).max()
            < 1e-9 * np.abs(force).max()
        )
        jump += (B @ U).reshape(jump.shape)
    rest = problem.displacements(solution.reactions, solution.multipliers) - jump
    assert np.abs(rest[:, 1:]).max() < 1e-9
    x = problem.coordinates[0]
    # what is left is the initial gap below the sphere
    radius = 400.0 if scene.name == "sphere" else np.inf
    assert np.allclose(
        rest[:, 0], 0.0 if radius == np.inf else radius - np.sqrt(radius**2 - x**2), atol=1e-9
    )


def test_a_plate_that_a_support_resists_is_condensed():
    """No multiplier is left, the problem is linear in the force."""
    base = two_blocks("plane-strain", mu=0.4)
    mesh = base.upper.mesh.with_boundaries({"grip": lambda x: (x[0] == 0) & (x[1] < 0.4)})
    held = replace(base.upper, mesh=mesh, supports=(Support("grip"),))
    scenes_ = [
        replace(base, upper=replace(held, loads=(Plate("top", {"y": -f}),))) for f in (3.0, 6.0)
    ]
    problem, doubled = (reduce(scene) for scene in scenes_)
    assert problem.V.shape == (2 * 5, 0)
    assert np.allclose(doubled.q, 2 * problem.q) and np.any(problem.q)
    one, two = solve(problem, tol=1e-10), solve(doubled, tol=1e-10)
    assert one.solved and np.allclose(two.reactions, 2 * one.reactions, atol=1e-7)
    # Condensed plate = the constraint "all of the top moves as one", here by minimising the energy
    # over its height.
    body = reduce_bodies(scenes_[0]).bodies[0]
    A, M = body.body.A, body.body.motion[:, 0]
    free = np.append(body.body.free, A.shape[0])
    bordered = np.block(
        [[A.toarray(), (A @ M)[:, None]], [(A @ M)[None], np.array([[M @ (A @ M)]])]]
    )
    load = np.append(np.zeros(A.shape[0]), -3.0)
    x = np.zeros(len(load))
    x[free] = np.linalg.solve(bordered[np.ix_(free, free)], load[free])
    assert np.allclose(body.at_rest, x[:-1] + M * x[-1], atol=1e-12)


def test_prescribed_displacement_loads_as_the_force_it_needs():
    base = two_blocks("plane-strain", force=3.0)
    driven = replace(
        base.upper, loads=(), supports=(*base.upper.supports, Support("top", {"y": -1.2}))
    )
    solution = solve(reduce(replace(base, upper=driven)), tol=1e-11)
    assert solution.reactions[:, 0].sum() == pytest.approx(1.2 / 3 * 5 / (1 - 0.3**2), rel=1e-9)


def test_a_rigid_body_is_the_limit_of_a_stiff_one():
    stiff = reduce(scenes.flat_punch(2, elements=6, upper=Material(5e7, 0.3)))
    rigid = reduce(scenes.flat_punch(2, elements=6, rigid="punch"))
    a, b = solve(stiff, tol=1e-10), solve(rigid, tol=1e-10)
    assert np.allclose(a.reactions, b.reactions, atol=1e-3 * np.abs(b.reactions).max())
    assert a.multipliers[0] == pytest.approx(b.multipliers[0], rel=1e-4)
    floor = solve(reduce(scenes.flat_punch(2, elements=6, rigid="foundation")), tol=1e-10)
    assert floor.solved and floor.reactions[:, 0].sum() == pytest.approx(100)


@pytest.mark.parametrize(
    "cells,shift,message", [(5, 0.0, "has 5 contact nodes"), (4, 0.05, "lies .* off the normal")]
)
def test_interface_nodes_that_do_not_match_are_refused(cells, shift, message):
    base = two_blocks("plane-strain")
    mesh = block("plane-strain", -2, 0, cells)
    inner = (mesh.p[0] > 0) & (mesh.p[0] < 1)
    moved = type(mesh)(
        mesh.p + shift * np.stack([inner, 0 * inner]), mesh.t, _boundaries=mesh.boundaries
    )
    with pytest.raises(InputError, match=f"interface nodes do not match.*{message}.*same nodes"):
        reduce_bodies(replace(base, lower=replace(base.lower, mesh=moved)), coupling="matching")


def test_two_rigid_bodies_are_refused():
    with pytest.raises(InputError, match=r"both bodies of contact .* are rigid"):
        Scene("s", Rigid("a"), Rigid("b"), 0.1)


def test_a_plate_that_moves_along_the_contact():
    """Pressed and dragged, it sticks below the friction limit, and the shift is an output."""
    mesh = block("plane-strain", 0, 1)
    upper = Part("u", mesh, MATERIAL, (), (Plate("top", {"x": 0.5, "y": -3.0}),), contact="bottom")
    lower = Part("l", block("plane-strain", -2, 0), MATERIAL, (Support("bottom"),), contact="top")
    problem = reduce(Scene("drag", upper, lower, 0.5))
    assert problem.V.shape == (10, 2)
    solution = solve(problem, tol=1e-9)
    assert solution.solved
    assert solution.reactions[:, 0].sum() == pytest.approx(3.0)
    assert solution.reactions[:, 1].sum() == pytest.approx(-0.5)
    assert solution.multipliers[0] > 0 > solution.multipliers[1]


def test_a_long_reduction_says_what_it_does(monkeypatch):
    """A large scene was silent for a minute behind one word."""
    said = []
    solve_scene(scenes.flat_punch(2, elements=8), options=Options(note=said.append))
    assert not any("unknowns" in text for text in said)
    monkeypatch.setattr(reduction, "LONG", 0.0)
    solve_scene(scenes.flat_punch(2, elements=8), options=Options(note=said.append))
    assert any(re.search(r"explicit Q by \w+, \d+ unknowns: about .* s$", text) for text in said)

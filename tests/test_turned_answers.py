"""Turning or mirroring a scene turns the answer and what is read from it."""

import numpy as np
import pytest
import turned
from scipy.spatial import KDTree

from contactopt import solve
from contactopt.methods.preconditioners import preconditioner
from contactopt.problem.contact_status import contact_status
from contactopt.readings.edges import contact_edge, stick_edge
from contactopt.readings.quantities import value_of
from contactopt.solving.solve_scene import Options, solve_scene

SCENES = {
    "punch": lambda: turned.punch(elements=16, mu=0.1),
    "cylinder": lambda: turned.cylinder(12),
    "pin": turned.pin_in_bush,
    "cube": lambda: turned.punch(3, elements=3),
}
OBLIQUE = turned.turn_about((1.0, 2.0, -0.5), 67.0)
MOVES = [
    *(
        (name, f"{degrees}", turned.turn(degrees))
        for name in list(SCENES)[:3]
        for degrees in (30, 180)
    ),
    *((name, "mirrored", turned.mirror(2)) for name in list(SCENES)[:3]),
    ("cube", "oblique", OBLIQUE),
    ("cube", "mirrored", turned.mirror(3) @ OBLIQUE),
]
# The solver is named, for nested dissection cuts across the axes: turned bodies cost factors more.
OPTIONS = Options(Q="implicit", solver="superlu", tol=1e-11)


@pytest.fixture(scope="module")
def plain():
    return {name: solve_scene(make(), options=OPTIONS) for name, make in SCENES.items()}


def products_to(residual: float, solution) -> float:
    """Products with Q until the certificate is below `residual`: closer to rounding, rounding
    decides on one more step.
    """
    return next(step["products"] for step in solution.history if step["residual"] <= residual)


@pytest.mark.parametrize("name,_,R", MOVES, ids=[f"{name}-{how}" for name, how, _ in MOVES])
def test_a_turned_scene_has_the_same_answer(plain, name, _, R):
    a, b = plain[name], solve_scene(turned.moved(SCENES[name](), R), options=OPTIONS)
    assert a.solution.solved and b.solution.solved
    p, q = a.reduction.problem, b.reduction.problem
    own = KDTree(q.coordinates.T).query((R @ p.coordinates).T)[1]
    r, t = a.solution.reactions, b.solution.reactions[own]
    scale = np.abs(r).max()
    assert np.abs(r[:, 0] - t[:, 0]).max() < 1e-8 * scale
    assert (
        np.abs(np.linalg.norm(r[:, 1:], axis=1) - np.linalg.norm(t[:, 1:], axis=1)).max()
        < 1e-8 * scale
    )
    for mask, other in zip(
        vars(contact_status(p, r)).values(), vars(contact_status(q, b.solution.reactions)).values()
    ):
        assert np.array_equal(mask, other[own])
    work, other_work = (products_to(1e-8, s.solution) for s in (a, b))
    assert abs(work - other_work) <= 0.1 * work
    for read in (contact_edge, lambda *given: stick_edge(*given)[0]):
        value = read(a.reduction.scene, p, r)
        assert value > 0
        assert read(b.reduction.scene, q, b.solution.reactions) == pytest.approx(value, rel=1e-8)
    for quantity in ("pressure", "width", "stick", "energy"):
        one, two = (value_of(quantity, s.reduction, s.solution) for s in (a, b))
        assert two == pytest.approx(one, rel=1e-7)


def test_some_of_these_contacts_are_open_stick_and_slip(plain):
    """Otherwise the test above would say little."""
    for name, needs in (
        ("punch", "stick slip"),
        ("cylinder", "open stick slip"),
        ("pin", "open stick slip"),
    ):
        solved = plain[name]
        status = contact_status(solved.reduction.problem, solved.solution.reactions)
        for need in needs.split():
            assert getattr(status, need).any(), (name, need)


@pytest.mark.parametrize("name", ["neumann", "p21"])
@pytest.mark.parametrize("R", [turned.turn(0), turned.turn(137), turned.mirror(2)])
def test_preconditioners_of_a_closed_line_serve_it(name, R):
    """Half as many PCG iterations or fewer, and as many wherever the numbering begins."""
    from scipy.sparse.linalg import cg

    from contactopt import reduce

    problem = reduce(turned.moved(turned.pin_in_bush(clearance=0.0, sectors=120), R), Q="explicit")
    assert problem.chart.closed
    load = np.random.default_rng(0).normal(size=problem.q.size)
    counts = []
    for P in (None, preconditioner(problem, name)):
        steps = []
        _, failed = cg(problem.Q, load, rtol=1e-8, M=P, callback=steps.append, maxiter=2000)
        assert not failed
        counts.append(len(steps))
    assert counts[1] < 0.6 * counts[0]


def test_a_start_around_a_closed_line_is_as_good_as_the_answer():
    """From the answer on the same mesh, turned, the first iterate is the answer."""
    from dataclasses import replace

    from contactopt import transfer

    solved = solve_scene(turned.pin_in_bush())
    problem = solved.reduction.problem
    order = np.roll(np.arange(problem.contacts), 7)
    seam = problem.chart.places[0, order]
    places = ((seam - seam[0]) % problem.chart.period)[None]
    moved = turned.renumbered(problem, order)
    moved = replace(moved, chart=replace(moved.chart, places=places))
    start = transfer(problem, solved.solution, moved)
    assert np.allclose(start.reactions, solved.solution.reactions[order], atol=1e-12)
    assert solve(moved, start=start).iterations <= 1


@pytest.mark.parametrize(("name", "turns"), [("punch-2d", 1), ("cylinder-2d", 2), ("punch-2d", 3)])
def test_a_half_model_in_any_direction(name, turns, tmp_path):
    """The named scenes, whose plane of symmetry then is y = 0, have the same summary."""
    from contactopt import run
    from contactopt.scenes import make_scene

    scene = make_scene(name, mu=0.3, elements=12)
    plain = run(scene, Q="implicit", tol=1e-11).summary
    scene = turned.moved(scene, turned.turn(90.0 * turns))
    summary = run(scene, tmp_path, Q="implicit", tol=1e-11).summary
    for key, value in plain.items():
        if key in ("products", "outer_iterations"):
            assert abs(summary[key] - value) <= 0.1 * value
        elif isinstance(value, float) and key not in ("residual", "approach"):
            assert summary[key] == pytest.approx(value, rel=1e-8), key
        elif isinstance(value, (str, int)):
            assert summary[key] == value
    assert abs(summary["approach"]) == pytest.approx(abs(plain["approach"]), rel=1e-8)

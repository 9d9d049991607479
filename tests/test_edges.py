from dataclasses import replace

import numpy as np
import pytest

from contactopt import InterfaceProblem, Part, Rigid, Scene
from contactopt.material import Material
from contactopt.problem.chart import Chart
from contactopt.readings.edges import contact_area, contact_edge, contact_zone, stick_edge
from contactopt.scenes import make_scene
from contactopt.scenes.scene_files import read_scene_file
from contactopt.solving.solve_scene import solve_scene

PART = Part("body", None, Material(1.0, 0.3))


def contact(x: np.ndarray, kind: str, areas: np.ndarray) -> tuple[Scene, InterfaceProblem]:
    dim = 3 if kind == "solid" else 2
    problem = InterfaceProblem(
        np.eye(dim * x.shape[1]),
        np.zeros((x.shape[1], dim)),
        np.full(x.shape[1], 0.5),
        areas=areas,
        coordinates=x,
    )
    return Scene("s", PART, Rigid("floor"), 0.5, kind=kind), problem


def cattaneo(distance: np.ndarray, a: float, c: float) -> tuple[np.ndarray, np.ndarray]:
    p = np.sqrt(np.maximum(0.0, 1 - (distance / a) ** 2))
    return p, 0.5 * (p - c / a * np.sqrt(np.maximum(0.0, 1 - (distance / c) ** 2)))


@pytest.mark.parametrize("c", [0.613, 0.8])
def test_forces_on_a_graded_line_act_beside_its_nodes(c):
    """Each is the integral of the traction times a hat, whose centroid is not at the node."""
    x = np.concatenate([[0.0], np.cumsum(0.02 * 1.06 ** np.arange(26.0))])
    x = np.concatenate([-x[:0:-1], x])
    fine = np.linspace(x[0], x[-1], 400_001)
    hats = np.array([np.interp(fine, x, unit) for unit in np.eye(len(x))])
    step = fine[1] - fine[0]
    areas = hats.sum(axis=1) * step
    scene, problem = contact(x[None], "plane-strain", areas)
    forces = np.array(cattaneo(np.abs(fine), 1.0, c)) @ hats.T * step
    r = np.stack([forces[0], -forces[1]], axis=1)
    assert contact_edge(scene, problem, r) == pytest.approx(1.0, rel=5e-3)  # .06 elements
    assert stick_edge(scene, problem, r)[0] == pytest.approx(c, rel=2e-3)


def test_edges_of_exact_tractions_on_a_surface():
    grid = np.linspace(-1.25, 1.25, 31)
    x = np.stack(np.meshgrid(grid, grid)).reshape(2, -1)
    scene, problem = contact(x, "solid", np.full(961, (2.5 / 30) ** 2))
    p, q = cattaneo(np.linalg.norm(x, axis=0), 0.987, 0.613)
    r = (2.5 / 30) ** 2 * np.stack([p, -0.6 * q, 0.8 * q], axis=1)
    assert contact_edge(scene, problem, r) == pytest.approx(0.987, rel=1e-9)
    assert stick_edge(scene, problem, r)[0] == pytest.approx(0.613, rel=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.4])
@pytest.mark.parametrize(
    "ratio, pressure",
    [
        (1.0, lambda s: (1 + 2 * s**2) * np.sqrt(1 - s**2)),  # x^4: no straight line can be fitted
        (0.7, lambda s: np.sqrt(1 - s**2)),
        (0.4, lambda s: np.sqrt(1 - s**2)),
    ],
)
def test_an_ellipse_has_the_half_width_of_the_disc_of_its_area(ratio, pressure, turn):
    grid = np.linspace(-1.25, 1.25, 41)
    x = np.stack(np.meshgrid(grid, grid)).reshape(2, -1)
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    s = np.linalg.norm(along @ (x - [[0.013], [0.007]]) / [[1.0], [ratio]], axis=0)
    areas = np.full(x.shape[1], (2.5 / 40) ** 2)
    scene, problem = contact(x, "solid", areas)
    r = np.zeros((x.shape[1], 3))
    r[:, 0] = areas * np.where(s < 1, pressure(np.minimum(s, 1.0)), 0.0)
    edge = contact_edge(scene, problem, r)
    assert edge == pytest.approx(ratio**0.5, rel=5e-3)
    assert contact_area(scene, problem, r, edge) == pytest.approx(np.pi * ratio, rel=1e-2)


def test_a_surface_of_which_one_corner_is_open_is_no_disc():
    grid = np.linspace(-0.5, 0.5, 6)
    x = np.stack(np.meshgrid(grid, grid)).reshape(2, -1)
    edge = np.where(np.isin(np.arange(6), (0, 5)), 0.1, 0.2)
    areas = np.outer(edge, edge).ravel()
    scene, problem = contact(x, "solid", areas)
    tilted = np.maximum(0.0, 1.2 + x.sum(axis=0)) * areas  # presses least on the first corner
    tilted[0] = 0.0
    r = np.stack([tilted, 0 * tilted, 0 * tilted], axis=1)
    assert contact_edge(scene, problem, r) == pytest.approx(np.sqrt(areas[1:].sum()) / 2, rel=1e-12)


def test_a_strip_across_a_coarse_surface_is_no_disc():
    """To within an element it was one, larger than the surface."""
    x = np.stack(np.meshgrid(0.3 * np.arange(11), np.arange(7) / 3, indexing="ij")).reshape(2, -1)
    share = np.array([0, 0, 0.19, 0.53, 0.87, 1, 0.87, 0.53, 0.19, 0, 0])  # under a bolt's head
    areas = np.ones((11, 7))
    for end in ([0, -1], slice(None)), (slice(None), [0, -1]):
        areas[end] /= 2
    scene, problem = contact(x, "solid", 0.1 * areas.ravel())
    first = np.arange(77).reshape(11, 7)[:-1, :-1].ravel()
    cells = np.stack([first, first + 7, first + 8, first + 1])
    problem = replace(problem, chart=replace(problem.chart, cells=cells))
    r = np.zeros((77, 3))
    r[:, 0] = problem.areas * np.repeat(share, 7)
    edge = contact_edge(scene, problem, r)
    assert contact_area(scene, problem, r, edge) == pytest.approx(7 * 0.3 * 2, rel=1e-12)


def disc(x, half, centre=0.0):
    return np.sqrt(np.maximum(0.0, 1 - ((x - centre) / half) ** 2))


def profile(of, a):
    """A pressure whose square is no straight line over x^2."""
    return lambda x: np.where(np.abs(x) < a, of(np.minimum(np.abs(x) / a, 1.0)), 0.0)


# end of the line and its nodes, pressure, friction, half-widths of contact and stick, and how near
LINES = {
    "after a reversal": (
        (1.25, 201),
        lambda x: disc(x, 0.987),
        lambda x: cattaneo(x, 0.987, 0.4)[1] - 2 * cattaneo(x, 0.987, 0.7)[1],
        (None, 0.7, 1e-9),
    ),
    "stick off the centre": (
        (1.25, 201),
        lambda x: disc(x, 1.0),
        lambda x: 0.5 * (disc(x, 1.0) - 0.4 * disc(x, 0.5, 0.2)),
        (None, 0.5, 1e-9),
    ),
    "two patches": (
        (2.0, 401),
        lambda x: disc(x, 0.413, -1.1) + disc(x, 0.718, 0.9),
        None,
        (0.413 + 0.718, None, 1e-9),
    ),
    # contact from the surface's end to 0.403, where the pressure is zero, as at -1.597
    "to a corner": (
        (1.0, 101),
        lambda x: np.sqrt(np.maximum(0.0, 0.403 - x) * (x + 1.597)),
        None,
        ((1 + 0.403) / 2, None, 2e-3),
    ),
}
for centre, a in ((0.5, 0.5), (-0.313, 0.6), (0.0, 0.987)):
    LINES[f"centre {centre}"] = (
        (1.25, 101),
        lambda x, a=a, c=centre: disc(x, a, c),
        lambda x, a=a, c=centre: cattaneo(x - c, a, 0.6 * a)[1],
        (a, 0.6 * a, 1e-9),
    )
for a in (0.987, 1.0, 1.013):
    of = {
        "punch x^4": (lambda s: (1 + 2 * s**2) * np.sqrt(1 - s**2), 1e-9),
        "wedge": (lambda s: np.arccosh(1 / np.maximum(s, 1e-3)), 2e-3),
        "falling": (lambda s: np.sqrt(1 - s**2) * np.exp(-3 * s), 2e-3),
    }
    for name, (shape, off) in of.items():
        LINES[f"{name} {a}"] = (1.25, 101), profile(shape, a), None, (a, None, off)


@pytest.mark.parametrize("name", LINES)
def test_edges_on_a_line(name):
    (end, nodes), pressure, friction, (edge, stick, off) = LINES[name]
    x, h = np.linspace(-end, end, nodes), 2 * end / (nodes - 1)
    scene, problem = contact(x[None], "plane-strain", np.full(nodes, h))
    r = h * np.stack([pressure(x), -friction(x) if friction else 0 * x], axis=1)
    if edge is not None:
        assert contact_edge(scene, problem, r) == pytest.approx(edge, rel=off)
    if stick is not None:
        assert stick_edge(scene, problem, r)[0] == pytest.approx(stick, rel=off)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_half_model_is_read_as_the_whole(sign):
    """Half of a contact, and a patch beside the plane of symmetry, against all of their images."""
    half, full = np.linspace(0.0, 2.0, 161), np.linspace(-2.0, 2.0, 321)
    for p in (
        lambda x: np.sqrt(np.maximum(0.0, 1 - (x / 0.987) ** 2)),
        lambda x: np.sqrt(np.maximum(0.0, 1 - ((np.abs(x) - 1) / 0.613) ** 2)),
    ):
        scene, problem = contact(full[None], "plane-strain", np.full(321, 0.0125))
        whole = contact_edge(scene, problem, 0.0125 * np.stack([p(full), 0 * full], axis=1))
        scene, problem = contact(half[None], "plane-strain", 0.025 * np.where(half == 0, 0.5, 1.0))
        problem = replace(problem, chart=Chart(sign * half[None], (True,)))
        r = problem.areas[:, None] * np.stack([p(half), 0 * half], axis=1)
        assert contact_edge(scene, problem, r) == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("centre", [0.0, 1.0, 3.1, 5.9])
def test_a_zone_across_the_seam_of_a_closed_line(centre):
    """The same zone anywhere on a closed line of length 2 pi."""
    angle = np.linspace(0.0, 2 * np.pi, 240, endpoint=False)
    space = np.stack([np.cos(angle), np.sin(angle)])
    scene, problem = contact(space, "plane-strain", np.full(240, 2 * np.pi / 240))
    problem = replace(problem, chart=Chart(angle[None], (False,), 2 * np.pi))
    apart = (angle - centre + np.pi) % (2 * np.pi) - np.pi
    p, q = cattaneo(np.abs(apart), 0.987, 0.613)
    r = problem.areas[:, None] * np.stack([p, -q], axis=1)
    assert contact_edge(scene, problem, r) == pytest.approx(0.987, rel=1e-9)
    assert stick_edge(scene, problem, r)[0] == pytest.approx(0.613, rel=1e-9)


def test_a_disc_off_the_origin_and_turned():
    grid = np.linspace(-1.25, 1.25, 41)
    x = np.stack(np.meshgrid(grid, grid)).reshape(2, -1)
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    for places, centre in ((x, (0.25, -0.125)), (turn @ x, turn @ (0.25, -0.125))):
        scene, problem = contact(places, "solid", np.full(1681, (2.5 / 40) ** 2))
        p, q = cattaneo(np.linalg.norm(places - np.array(centre)[:, None], axis=0), 0.787, 0.513)
        r = (2.5 / 40) ** 2 * np.stack([p, -0.6 * q, 0.8 * q], axis=1)
        assert contact_edge(scene, problem, r) == pytest.approx(0.787, rel=1e-3)
        assert stick_edge(scene, problem, r)[0] == pytest.approx(0.513, rel=1e-3)


def test_all_or_nothing_sticks():
    x = np.linspace(0.0, 1.0, 11)
    scene, problem = contact(x[None], "plane-strain", np.full(11, 0.2))
    full = np.stack([np.ones(11), np.full(11, 0.1)], axis=1)
    # areas of the nodes: 2.2, half of it
    assert stick_edge(scene, problem, full)[0] == pytest.approx(1.1)
    slipping = np.stack([np.ones(11), np.full(11, 0.5)], axis=1)
    assert stick_edge(scene, problem, slipping)[0] == 0.0


def punch(c: float) -> tuple[Scene, InterfaceProblem, np.ndarray, np.ndarray, np.ndarray]:
    """Contact up to a corner at 1, stick up to c: scene, problem, distances, reactions and slip."""
    x = np.linspace(-1.0, 1.0, 101)
    areas = np.full(101, 0.02)
    scene, problem = contact(x[None], "plane-strain", areas)
    distance = np.abs(x)
    p = 1 / np.sqrt(1.01 - x**2)
    bound = 1 - np.sqrt(np.maximum(0.0, 1 - (distance / c) ** 2))
    r = areas[:, None] * np.stack([p, -0.5 * p * bound * np.sign(x)], axis=1)
    return scene, problem, distance, r, (np.maximum(0.0, distance - c) ** 1.5 * np.sign(x))[:, None]


@pytest.mark.parametrize("c", [0.613, 0.3, 0.87])
def test_stick_edge_of_exact_slack_and_slip(c):
    scene, problem, distance, r, slip = punch(c)
    assert stick_edge(scene, problem, r)[0] == pytest.approx(c, rel=1e-9)
    assert stick_edge(scene, problem, r, slip)[0] == pytest.approx(c, rel=1e-9)
    assert stick_edge(scene, problem, r, slip * 1e-12)[0] == pytest.approx(c, rel=1e-9)
    # a small step does not move it, and it is the mean of what slack and slip read
    step = (np.maximum(0.0, distance - c) ** 0.5)[:, None] * np.sign(slip)
    assert stick_edge(scene, problem, r, step)[0] == pytest.approx(c, rel=1e-9)
    farther = np.where(distance > c, np.maximum(0.0, distance - c + 0.004) ** 1.5, 0.0)
    moved = farther[:, None] * np.sign(slip)
    assert stick_edge(scene, problem, r, moved)[0] == pytest.approx(c - 0.002, rel=1e-9)


def test_the_edge_of_a_flat_punch_is_that_of_the_surface():
    """Every contact touches, and the pressure grows towards the corner: the half-width is exact."""
    scene = make_scene("rigid-punch-2d", mu=0.5)
    solved = solve_scene(scene, 8)
    problem, r = solved.reduction.problem, solved.solution.reactions
    assert contact_zone(scene, problem, r) == (pytest.approx(20.0), 0.0)
    falling = r.copy()
    falling[np.argsort(problem.coordinates[0])[-1]] *= 1e-3
    assert contact_zone(scene, problem, falling)[1] > 0.1
    wall = np.stack([1e-14 * np.cos(np.arange(len(r)) ** 2), problem.coordinates[0]])
    upright = replace(problem, coordinates=wall)
    assert contact_zone(scene, upright, r) == (pytest.approx(20.0), 0.0)


def test_a_zone_on_two_feet_does_not_lie_between_them():
    """One foot touches all over, and the next one up to a corner's pressure that ends at 9.3."""
    x = np.concatenate([np.linspace(0, 1, 11), np.linspace(8, 10, 21)])
    areas = np.full(32, 0.1)
    areas[[0, 10, 11, 31]] = 0.05
    scene, problem = contact(x[None], "plane-strain", areas)
    links = np.stack([np.arange(31), np.arange(1, 32)])
    cells = np.delete(links, 10, axis=1)
    problem = replace(problem, chart=replace(problem.chart, cells=cells))
    p = np.where(x < 2, 1.0, np.sqrt(np.maximum(0.0, 1 - ((x - 8) / 1.3) ** 2)))
    r = np.stack([areas * p, 0 * p], axis=1)
    assert contact_edge(scene, problem, r) == pytest.approx((1 + 1.3) / 2, abs=0.025)


SPREAD = """kind = "solid"
[bodies.block]
block = { x = [-2, 2], y = [-2, 2], z = [0, 2], elements = [4, 4, 2] }
material = { E = 210e3, nu = 0.3 }
contact = "z-"
body_force = { z = -1e-3 }
tractions = [
    { boundary = "x+", x = 0.004 }, { boundary = "x-", x = -0.004 },
    { boundary = "y+", y = 0.004 }, { boundary = "y-", y = -0.004 },
]
[bodies.ground]
block = { x = [-2, 2], y = [-2, 2], z = [-2, 0], elements = [4, 4, 2] }
material = { E = 210e3, nu = 0.3 }
contact = "z+"
supports = [{ boundary = "z-", x = 0, y = 0, z = 0 }]
[[contacts]]
upper = "block"
lower = "ground"
mu = 0.3
"""


def test_a_zone_of_one_contact_has_no_negative_width(tmp_path):
    """Only the contact in the middle sticks; its edge, extrapolated from it, lies beyond it."""
    (tmp_path / "spread.toml").write_text(SPREAD)
    solved = solve_scene(read_scene_file(tmp_path / "spread.toml").states[0])
    width, uncertainty = stick_edge(
        solved.reduction.scene,
        solved.reduction.problem,
        solved.solution.reactions,
        solved.reduction.moved(solved.solution)[:, 1:],
    )
    assert width == pytest.approx(np.pi**-0.5) and uncertainty >= width / 2

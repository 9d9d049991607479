from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator
from turned import renumbered

from contactopt import InputError, InterfaceProblem, Material, Part, Scene, Support, reduce, scenes
from contactopt.meshes.structured import graded, rename, tensor_mesh
from contactopt.methods.preconditioners import (
    PRECONDITIONERS,
    deflated,
    preconditioner,
    restricted,
    smooth_motions,
)
from contactopt.methods.preconditioners.circulant import norm, seminorm
from contactopt.problem.chart import Chart

SIZES = (17, 33, 65)  # contacts

# tests/test_surface_laplacian.py has the other
ON_GRIDS = [name for name in PRECONDITIONERS if name != "laplacian"]


@cache
def blocks(k: int, upper: float, lower: float, nu: float) -> InterfaceProblem:
    """A punch 4 wide and high, held on top, on a foundation 16 x 8, clamped below."""
    zone = np.linspace(-2, 2, k)
    h = zone[1] - zone[0]
    punch = rename(tensor_mesh(zone, graded(4, h, 1.15)), contact="y-", top="y+")
    pin = zone[k // 2 + 1] if k % 2 else zone[k // 2]
    punch = punch.with_boundaries(
        {"pin": lambda x: (x[1] > 4 - 1e-9) & (np.abs(x[0] - pin / 2) < pin / 2)}
    )
    out = 2 + graded(6, h * 1.15, 1.15)[1:]
    across = np.concatenate([-out[::-1], zone, out])
    ground = tensor_mesh(across, -graded(8, h, 1.15)[::-1])
    held = (Support("top", {"y": 0.0}), Support("pin", {"x": 0.0}))
    return reduce(
        Scene("blocks", *pair(punch, held, ground, (upper, lower), nu), 0.5), Q="explicit"
    )


@cache
def solids(n: int, upper: float, lower: float) -> InterfaceProblem:
    """The same bodies in 3D, with n x n contact nodes."""
    zone = np.linspace(-2, 2, n)
    h = zone[1] - zone[0]
    punch = rename(tensor_mesh(zone, zone, graded(4, h, 1.3)), contact="z-", top="z+")
    out = 2 + graded(6, 1.3 * h, 1.3)[1:]
    across = np.concatenate([-out[::-1], zone, out])
    ground = tensor_mesh(across, across, -graded(8, h, 1.3)[::-1])
    bodies = pair(punch, (Support("top"),), ground, (upper, lower), 0.3)
    return reduce(Scene("solids", *bodies, 0.5, kind="solid"), Q="explicit")


def pair(punch, held, ground, moduli, nu):
    ground = rename(ground, bottom="yz"[len(ground.p) - 2] + "-").with_boundaries(
        {"contact": lambda x: (x[-1] > -1e-9) & np.all(np.abs(x[:-1]) < 2, axis=0)}
    )
    first, second = (Material(E, nu) for E in moduli)
    return Part("punch", punch, first, held), Part("ground", ground, second, (Support("bottom"),))


def condition(P: np.ndarray | LinearOperator, Q: np.ndarray) -> float:
    L = la.cholesky((Q + Q.T) / 2, lower=True)
    values = la.eigvalsh(L.T @ (P @ L))
    return float(values[-1] / values[0]) if values[0] > 0 else np.inf


def normal_block(problem: InterfaceProblem, name: str) -> tuple[np.ndarray, np.ndarray]:
    P = preconditioner(problem, name) @ np.eye(2 * problem.contacts)
    return P[::2, ::2], problem.Q[::2, ::2]


@pytest.mark.parametrize("k", SIZES)
def test_condition_numbers_of_the_papers_preconditioners(k):
    """Against the matrices of eqs (25) and (26) written down densely."""
    problem, m = blocks(k, 5.0, 5.0, 0.3), int(2 ** np.ceil(np.log2(k)))
    Q = problem.Q[::2, ::2]
    first = la.circulant(seminorm(m))[:k, :k]
    inverse = np.linalg.inv(la.circulant(norm(m, 4 / (k - 1))))
    second = np.linalg.inv((inverse @ la.circulant(seminorm(m)))[:k, :k])
    bare = np.linalg.cond(Q)
    for name, dense in (("p21", first), ("p22", second)):
        found = condition(*normal_block(problem, name))
        assert found == pytest.approx(condition((dense + dense.T) / 2, Q), rel=1e-6)
        assert found < 8 and found < 0.5 * bare


def test_neumann_is_flat_in_the_number_of_nodes_and_better():
    conditions = [condition(*normal_block(blocks(k, 5.0, 5.0, 0.3), "neumann")) for k in SIZES]
    assert max(conditions) < 2.5 and np.ptp(conditions) < 0.1 * max(conditions)


@pytest.mark.parametrize("upper,lower,bound", [(5, 5, 3), (5e4, 5, 5), (5, 5e4, 5)])
def test_full_operator_with_four_motions_deflated(upper, lower, bound):
    for k in (17, 65):
        problem = blocks(k, upper, lower, 0.3)
        P = deflated(preconditioner(problem, "neumann"), problem.Q, smooth_motions(problem))
        assert condition(P, problem.Q) < bound


@pytest.mark.parametrize("name", ON_GRIDS)
def test_they_are_symmetric_positive_definite_and_blind_to_order_and_units(name):
    problem = blocks(17, 5.0, 5.0, 0.3)
    P = preconditioner(problem, name) @ np.eye(34)
    assert np.allclose(P, P.T, atol=1e-9 * np.abs(P).max()) and la.eigvalsh((P + P.T) / 2)[0] > 0
    order = np.random.default_rng(0).permutation(17)
    rows = (2 * order[:, None] + np.arange(2)).ravel()
    mixed = renumbered(problem, order, unit=1e3)
    assert np.allclose(
        preconditioner(mixed, name) @ np.eye(34), P[np.ix_(rows, rows)], atol=1e-9 * np.abs(P).max()
    )


def test_bad_input():
    with pytest.raises(
        InputError, match="unknown preconditioner 'ilu'; choose from p21, p22, neumann"
    ):
        preconditioner(blocks(17, 5.0, 5.0, 0.3), "ilu")
    short = InterfaceProblem(np.eye(4), np.zeros((2, 2)), 0.1)
    ragged = InterfaceProblem(
        np.eye(9), np.zeros((3, 3)), 0.1, coordinates=np.array([[0.0, 1, 2], [0, 1, 3], [0, 0, 0]])
    )
    for problem in (short, ragged):
        with pytest.raises(InputError, match="on a line or a rectangular grid"):
            preconditioner(problem, "p21")
    with pytest.raises(InputError, match="choose p21 or neumann"):
        preconditioner(solids(5, 5.0, 5.0), "p22")


@pytest.mark.parametrize("n", [5, 9])
def test_in_3d(n):
    problem = solids(n, 5.0, 5.0)
    size = problem.q.size
    first, second = (preconditioner(problem, name) for name in ("p21", "neumann"))
    for P in (first @ np.eye(size), second @ np.eye(size)):
        assert np.allclose(P, P.T, atol=1e-9 * np.abs(P).max())
    bare = np.linalg.cond(problem.Q)
    assert condition(first @ np.eye(size), problem.Q) < 0.6 * bare
    assert condition(deflated(second, problem.Q, smooth_motions(problem)), problem.Q) < 6


@pytest.mark.parametrize("make", [lambda: blocks(33, 5.0, 5e4, 0.3), lambda: solids(7, 5.0, 5.0)])
def test_on_an_active_set_it_is_as_good_as_on_all_contacts(make):
    problem = make()
    Q = problem.Q
    P = deflated(preconditioner(problem, "neumann"), Q, smooth_motions(problem))
    everywhere = condition(P, Q)
    random = np.random.default_rng(1)
    for share in (0.1, 0.5, 0.9):
        A = np.flatnonzero(random.random(len(Q)) < share)
        added = np.where(random.random(len(A)) < 0.5, 0.0, random.random(len(A)) * Q[0, 0])
        inner = restricted(P, sp.identity(len(Q), format="csr")[:, A], added) @ np.eye(len(A))
        assert condition(inner, Q[np.ix_(A, A)] + np.diag(added)) <= everywhere * (1 + 1e-6)


def test_components_held_at_a_plane_of_symmetry_get_sine_transforms():
    problem = reduce(scenes.flat_punch(2, elements=32))
    P = deflated(preconditioner(problem, "neumann"), problem.Q, smooth_motions(problem))
    moves = np.abs(problem.Q).max(axis=1) > 0
    dense = (P @ np.eye(len(moves)))[np.ix_(moves, moves)]
    assert condition(dense, problem.Q[np.ix_(moves, moves)]) < 4


def around(k: int, uneven: float = 0.0) -> InterfaceProblem:
    """The logarithmic kernel of k nodes on a closed line of length 2 pi, normal and tangential
    alike.
    """
    angle = 2 * np.pi * np.arange(k) / k
    angle = angle + uneven * np.sin(angle)
    apart = np.abs(2 * np.sin((angle[:, None] - angle) / 2))
    steps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
    areas = (steps + np.roll(steps, 1)) / 2
    np.fill_diagonal(apart, areas / np.exp(1.5))
    Q = np.kron(1 - np.log(apart), np.eye(2))
    chart = Chart(angle[None], (False,), 2 * np.pi)
    return InterfaceProblem(Q, np.zeros((k, 2)), 0.3, areas=areas, chart=chart)


@pytest.mark.parametrize("k", [16, 33, 64, 65, 256])
@pytest.mark.parametrize("name,bound", [("neumann", 4), ("p21", 12), ("p22", 15)])
def test_on_a_closed_line_condition_numbers_hardly_grow(name, bound, k):
    problem = around(k)
    P = preconditioner(problem, name)
    dense = P @ np.eye(2 * k)
    assert np.allclose(dense, dense.T, atol=1e-10 * np.abs(dense).max())
    assert condition(deflated(P, problem.Q, smooth_motions(problem)), problem.Q) < bound
    if P.model is not None:
        assert np.allclose(
            P.model @ (P @ problem.Q[0]), problem.Q[0], atol=1e-9 * np.abs(problem.Q[0]).max()
        )


@pytest.mark.parametrize("name", ON_GRIDS)
def test_a_closed_line_may_be_numbered_from_anywhere(name):
    problem = around(33, 0.3)
    order = np.random.default_rng(0).permutation(33)
    rows = (2 * order[:, None] + np.arange(2)).ravel()
    place = (problem.chart.places[0, order] + 1.0) % (2 * np.pi)
    chart = Chart(place[None], (False,), 2 * np.pi)
    mixed = replace(renumbered(problem, order), coordinates=place[None], chart=chart)
    P = preconditioner(problem, name) @ np.eye(66)
    assert np.allclose(
        preconditioner(mixed, name) @ np.eye(66), P[np.ix_(rows, rows)], atol=1e-9 * np.abs(P).max()
    )


@pytest.mark.parametrize("degrees", [20.0, 90.0, 200.0])
@pytest.mark.parametrize("name", ["p21", "neumann"])
def test_a_grid_may_lie_at_any_angle_in_its_chart(name, degrees):
    """Chart and tangential components turned together: the same operator, turned."""
    problem, a = solids(5, 5.0, 50.0), np.deg2rad(degrees)
    R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    turn = np.kron(np.eye(problem.contacts), la.block_diag(1.0, R))
    Q = turn @ problem.Q @ turn.T
    moved = replace(problem, Q=(Q + Q.T) / 2, chart=Chart(R @ problem.chart.places, (False, False)))
    P = preconditioner(problem, name) @ np.eye(len(Q))
    expected = turn @ P @ turn.T
    assert np.allclose(
        preconditioner(moved, name) @ np.eye(len(Q)), expected, atol=1e-8 * np.abs(P).max()
    )

"""Bodies that nothing but friction holds."""

from dataclasses import replace

import numpy as np
import pytest

from contactopt import (
    HalfSpace,
    InterfaceProblem,
    Material,
    Rigid,
    Scene,
    Status,
    reduce_bodies,
    solve,
)
from contactopt.derivatives.interface import sensitivity
from contactopt.methods import Repeated


def held(dim, mu, seed=0, turn=0.0, unit=1.0, slope=0.0):
    """A rigid paraboloid on compliances of smooth decay; V holds its translations, turned by an
    angle.
    """
    rng = np.random.default_rng(seed)
    side = 15 if dim == 2 else 5
    x = np.stack(np.meshgrid(*[np.linspace(-1, 1, side)] * (dim - 1), indexing="ij"), -1).reshape(
        -1, dim - 1
    )
    far = np.linalg.norm(x[:, None] - x[None], axis=-1)
    k = len(x)
    Q = np.kron(np.exp(-3 * far), np.eye(dim))
    # pressed points draw others near
    across = 0.3 * (x[:, None] - x[None]) * np.exp(-3 * far)[:, :, None]
    for i in range(dim - 1):
        Q[1 + i :: dim, 0::dim] += across[:, :, i]
        Q[0::dim, 1 + i :: dim] += across[:, :, i].T
    q = np.zeros((k, dim))
    q[:, 0] = 0.2 * np.sum((x - 0.1 * rng.normal(size=dim - 1)) ** 2, axis=1)
    R = np.eye(dim)
    R[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    load = np.zeros(dim)
    load[:2] = -3.0, slope * mu * 3.0
    V = np.tile(np.eye(dim) @ R, (k, 1))
    return InterfaceProblem(Q * unit, q, mu, V, R.T @ load / unit)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("mu", [1e-8, 1e-5, 1e-3, 0.03, 0.3, 1.0])
def test_friction_alone_holds_a_body(dim, mu):
    for seed, slope in ((0, 0.0), (1, 0.5)):
        solution = solve(held(dim, mu, seed, turn=0.7, slope=slope), tol=1e-9)
        assert solution.solved and solution.iterations <= 15
        assert not any("made no progress" in note for note in solution.notes)


def test_the_same_answer_as_by_pivoting_turned_and_in_other_units():
    for mu in (1e-6, 1e-3, 0.1):
        mine = solve(held(2, mu), tol=1e-11)
        pivots = solve(held(2, mu), "lemke", tol=1e-11)
        assert np.allclose(mine.reactions, pivots.reactions, atol=1e-8)
        assert np.allclose(mine.multipliers, pivots.multipliers, atol=1e-6)
        turned = solve(held(2, mu, turn=1.1, unit=1e-6), tol=1e-11)
        assert np.allclose(turned.reactions, 1e6 * mine.reactions, atol=1e-2)


class Turning:
    """A method that repeats itself until the driver says so, and then solves the problem."""

    def iterate(self, problem, start=None):
        while True:
            try:
                yield np.array([[0.5, 0.0]]), np.zeros(0)
            except Repeated:
                break
        yield np.array([[1.0, 0.0]]), np.zeros(0)


def test_a_method_with_another_way_goes_on_where_it_repeats_itself():
    problem = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.5)
    solution = solve(problem, Turning())
    assert solution.status is Status.SOLVED and solution.iterations > 5
    assert "relaxation" not in Status.CYCLING.sentence


def periodic(dim, mu, gap, side=0.0, n=24):
    t = (np.arange(n) + 0.5) / n
    half = HalfSpace("half-space", Material(1000.0, 0.3), (t,) * (dim - 1), periodic=True)
    force = {"xyz"[dim - 1]: -0.1} | ({"x": side} if mu else {})
    body = Rigid("body", (0.0,) * (dim - 1) + (1.0,), gap, force)
    return Scene("periodic", body, half, mu, kind="plane-strain" if dim == 2 else "solid")


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("n", [8, 32])
def test_flat_on_a_flat_periodic_half_space(dim, mu, n):
    """The pressure is uniform and moves nothing: all displacements are zero but for rounding."""
    solution = solve(reduce_bodies(periodic(dim, mu, None, 0.01, n)).problem)
    assert solution.solved
    assert np.allclose(solution.reactions[:, 0] * n ** (dim - 1), 0.1, rtol=1e-6)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_gradients_on_a_periodic_half_plane_are_those_of_differences(mu):
    problem = reduce_bodies(
        periodic(2, mu, lambda x: 1e-4 * np.cos(2 * np.pi * x[0] + 0.3), 0.005)
    ).problem
    solution, rng = solve(problem, tol=1e-11), np.random.default_rng(0)
    closed = np.count_nonzero(solution.reactions[:, 0])
    assert 2 < closed < problem.contacts
    change, weights = 1e-6 * rng.normal(size=problem.q.shape), rng.normal(size=problem.q.shape)
    ends = [
        solve(replace(problem, q=problem.q + h * change), tol=1e-11).reactions
        for h in (0.01, -0.01)
    ]
    slopes = (ends[0] - ends[1]) / 0.02
    made = sensitivity(problem, solution)
    assert np.allclose(made.forward(q=change).reactions, slopes, atol=1e-6 * np.abs(slopes).max())
    assert np.sum(made.adjoint(reactions=weights).q * change) == pytest.approx(
        np.sum(weights * slopes), rel=1e-5
    )

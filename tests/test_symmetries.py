"""Answers do not depend on the numbering of contacts, the choice of tangents, units."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import turned
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from contactopt import (
    InterfaceProblem,
    diagnose,
    natural_map_residual,
    reduce_bodies,
    siconos_residual,
    solve,
)
from contactopt.methods import METHODS
from contactopt.problem.contact_status import contact_status
from contactopt.problem.laws.bilateral import Bilateral

CONTACTS = 6
DIMENSION = st.sampled_from([2, 3])
SEED = st.integers(0, 2**32 - 1)


def random_problem(seed: int, dim: int) -> InterfaceProblem:
    """Contacts that open, stick and slip, pressed by a plate that moves along the normals."""
    rng, n = np.random.default_rng(seed), CONTACTS * dim
    A = rng.normal(size=(n, n))
    V = np.kron(np.ones((CONTACTS, 1)), np.eye(dim)[:, :1])
    q = rng.normal(size=(CONTACTS, dim))
    mu = rng.uniform(0.0, 0.3, CONTACTS)
    return InterfaceProblem(
        A @ A.T / n + np.eye(n), q, mu, V, [-CONTACTS], areas=rng.uniform(1, 2, CONTACTS)
    )


def orthogonal(seed: int, dim: int) -> np.ndarray:
    """Tangents (k, dim, dim) turned or mirrored, at every contact in another way; normals stay."""
    rng = np.random.default_rng(seed)
    turns = [
        la.qr(rng.normal(size=(dim - 1, dim - 1)))[0] * rng.choice([-1, 1]) for _ in range(CONTACTS)
    ]
    return np.array([la.block_diag(1.0, R) for R in turns])


def with_tangents(problem: InterfaceProblem, R: np.ndarray) -> InterfaceProblem:
    T = la.block_diag(*R)
    q = np.einsum("kab,kb->ka", R, problem.q)
    return InterfaceProblem(
        T @ problem.Q @ T.T, q, problem.law, T @ problem.V, problem.s, problem.areas
    )


def certificates(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray) -> list[float]:
    return [natural_map_residual(problem, r, lam), siconos_residual(problem, r, lam)]


@settings(max_examples=15, deadline=None)
@given(SEED, DIMENSION)
def test_contacts_may_be_numbered_in_any_order(seed, dim):
    problem = random_problem(seed, dim)
    order = np.random.default_rng(seed + 1).permutation(CONTACTS)
    other = turned.renumbered(problem, order)
    a, b = solve(problem, tol=1e-11), solve(other, tol=1e-11)
    assert a.solved and b.solved
    assert np.allclose(b.reactions, a.reactions[order], rtol=0, atol=1e-8)
    assert np.allclose(b.multipliers, a.multipliers, rtol=0, atol=1e-8)
    assert np.array_equal(
        contact_status(other, b.reactions).slip, contact_status(problem, a.reactions).slip[order]
    )
    wrong = a.reactions + 0.1
    one = certificates(problem, wrong, a.multipliers)
    two = certificates(other, wrong[order], a.multipliers)
    assert two == pytest.approx(one, rel=1e-9) and min(one) > 1e-3


@settings(max_examples=15, deadline=None)
@given(SEED, DIMENSION)
def test_tangents_may_be_turned_and_mirrored_at_every_contact(seed, dim):
    problem, R = random_problem(seed, dim), orthogonal(seed + 1, dim)
    other = with_tangents(problem, R)
    a, b = solve(problem, tol=1e-11), solve(other, tol=1e-11)
    assert a.solved and b.solved
    assert np.allclose(b.reactions, np.einsum("kab,kb->ka", R, a.reactions), rtol=0, atol=1e-8)
    wrong = a.reactions + 0.1
    turned_ = np.einsum("kab,kb->ka", R, wrong)
    one = certificates(problem, wrong, a.multipliers)
    two = certificates(other, turned_, a.multipliers)
    assert two == pytest.approx(one, rel=1e-9)
    assert diagnose(other).guaranteed.unique == pytest.approx(
        diagnose(problem).guaranteed.unique, rel=1e-6
    )


@settings(max_examples=15, deadline=None)
@given(SEED, DIMENSION, st.floats(-6, 6), st.floats(-6, 6))
def test_forces_and_lengths_may_have_any_unit(seed, dim, force, length):
    """Powers of ten; with Coulomb's law and with the one that never opens."""
    f, x = 10.0**force, 10.0**length
    for law in (None, Bilateral(0.1)):
        problem = random_problem(seed, dim)
        problem = problem if law is None else replace(problem, law=law)
        other = replace(problem, Q=problem.Q * x / f, q=problem.q * x, s=problem.s * f)
        a, b = solve(problem, tol=1e-11), solve(other, tol=1e-11)
        assert a.solved and b.solved and a.iterations == b.iterations
        assert np.allclose(b.reactions / f, a.reactions, rtol=0, atol=1e-8)
        assert np.allclose(b.multipliers / x, a.multipliers, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", sorted(METHODS))
def test_every_method_sees_the_same_problem_in_another_frame(name):
    problem = random_problem(3, 2)
    order, R = np.random.default_rng(4).permutation(CONTACTS), orthogonal(5, 2)
    other = with_tangents(turned.renumbered(problem, order), R)
    tol = 5e-6 if name == "penalty" else 1e-8
    a, b = (solve(p, name, tol=tol, max_iterations=20_000) for p in (problem, other))
    assert a.status == b.status
    assert np.allclose(
        b.reactions, np.einsum("kab,kb->ka", R, a.reactions[order]), rtol=0, atol=20 * tol
    )


# surfaces that touch everywhere: where they do not, the normal is that of the lower body, which is
# then another
SCENES = {
    "punch": turned.punch,
    "pin": lambda: turned.pin_in_bush(clearance=1e-9),
    "cube": lambda: turned.punch(3, elements=3),
}


@pytest.mark.parametrize("name", SCENES)
def test_upper_and_lower_body_may_be_swapped(name):
    """Forces in space change their sign, for they then act on the other body."""
    scene = SCENES[name]()
    first, second = (
        reduce_bodies(s) for s in (scene, replace(scene, upper=scene.lower, lower=scene.upper))
    )
    a, b = (solve(reduction.problem, tol=1e-11) for reduction in (first, second))
    assert a.solved and b.solved
    p = first.problem
    distance, own = KDTree(second.problem.coordinates.T).query(p.coordinates.T)
    assert distance.max() < 1e-9 * np.ptp(p.coordinates) and len(set(own)) == p.contacts
    force = np.einsum("kac,ka->kc", first.coupling.frames, a.reactions)
    back = np.einsum("kac,ka->kc", second.coupling.frames, b.reactions)[own]
    assert np.allclose(force, -back, rtol=0, atol=1e-7 * np.abs(force).max())
    assert np.allclose(a.multipliers, b.multipliers, rtol=1e-8)

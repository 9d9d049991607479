"""contactopt.jax: derivatives of solutions and of quantities in both directions."""

import warnings

import numpy as np
import pytest

jax = pytest.importorskip("jax")
jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402

import contactopt  # noqa: E402
from contactopt.derivatives import linear  # noqa: E402
from contactopt.jax import Kink, quantity, solve  # noqa: E402


def data(k: int = 6, dim: int = 3, p: int = 1, seed: int = 0) -> tuple:
    """A random problem with a free normal motion, pressed and pushed."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(k * dim, k * dim))
    Q = A @ A.T / (k * dim) + 0.3 * np.eye(k * dim)
    V = np.zeros((k, dim, p))
    V[:, 0] = 1.0
    return Q, 0.5 * rng.normal(size=(k, dim)), np.full(k, 0.4), V.reshape(k * dim, p), -np.ones(p)


def weighted(*arrays):
    reactions, multipliers = solve(*arrays, tol=1e-13)
    weights = jnp.cos(jnp.arange(reactions.size)).reshape(reactions.shape)
    return (weights * reactions).sum() + 0.7 * multipliers.sum()


@pytest.mark.parametrize("dim", [2, 3])
def test_both_directions_agree_with_differences(dim):
    arrays = data(dim=dim)
    rng = np.random.default_rng(1)
    turned = [rng.normal(size=x.shape) for x in arrays]
    turned[0] = turned[0] + turned[0].T
    gradient = jax.grad(weighted, argnums=(0, 1, 2, 3, 4))(*arrays)
    backward = sum(float((a * b).sum()) for a, b in zip(gradient, turned))
    _, forward = jax.jvp(weighted, arrays, tuple(map(jnp.asarray, turned)))
    h = 1e-6
    ends = [weighted(*[x + sign * h * d for x, d in zip(arrays, turned)]) for sign in (1, -1)]
    difference = float(ends[0] - ends[1]) / (2 * h)
    assert abs(backward - float(forward)) < 1e-10 * max(1.0, abs(backward))
    assert abs(backward - difference) < 1e-7 * max(1.0, abs(backward))


@pytest.mark.slow
def test_transformations_compose():
    Q, q, mu, V, s = data()
    many = jnp.stack([q, 1.1 * q])
    each = jax.jit(jax.vmap(lambda one: solve(Q, one, mu, V, s)[0]))(many)
    for one, reactions in zip(many, each):
        problem = contactopt.InterfaceProblem(Q, np.asarray(one), mu=mu, V=V, s=s)
        assert np.allclose(reactions, contactopt.solve(problem).reactions, atol=1e-9)
    rows = jax.jacrev(lambda x: solve(Q, q, x, V, s)[0])(jnp.asarray(mu))
    columns = jax.jacfwd(lambda x: solve(Q, q, x, V, s)[0])(jnp.asarray(mu))
    assert np.allclose(rows, columns, atol=1e-9)


@pytest.mark.slow
def test_systems_of_several_problems_are_told_apart():
    # a Jacobian has many right sides of one system, and vmap many systems
    Q, q, _, V, s = data()
    offsets, coefficients = jnp.array([0.0, 0.3, -0.2]), jnp.array([0.1, 0.8])

    def slopes(lift, friction):
        return jax.jacrev(lambda x: solve(Q, x, friction, V, s)[0])(q + lift)

    each = jax.vmap(lambda a: jax.vmap(lambda b: slopes(a, b))(coefficients))(offsets)
    for i, lift in enumerate(offsets):
        for j, friction in enumerate(coefficients):
            one = jax.jacfwd(lambda x, mu=friction: solve(Q, x, mu, V, s)[0])(q + lift)
            assert np.abs(one).max() > 0.1
            assert np.allclose(each[i, j], one, atol=1e-10)


def test_the_systems_of_a_batch_are_made_at_once(monkeypatch):
    Q, q, mu, *_ = data()
    many = jnp.stack([q, 1.1 * q, q - 0.2])
    slope = jax.grad(lambda x, Q=Q: jnp.sin(solve(Q, x, mu)[0]).sum())
    single = [slope(one) for one in many]
    monkeypatch.setattr(linear, "dense_factors", None)
    assert np.allclose(jax.vmap(slope)(many), single, atol=1e-10)


def test_a_kink_in_a_batch_leaves_the_others_alone():
    Q, q = np.eye(4), jnp.array([[-1.0, 0.0], [0.0, 0.0]])
    many = jnp.stack([q, q + jnp.array([[0.0, 0.1], [1.0, 0.0]])])
    with pytest.warns(Kink, match="1 "):
        by = jax.vmap(jax.grad(lambda x: solve(Q, x, 0.3)[0][0, 0]))(many)
    assert np.allclose(by[:, 0], [-1.0, 0.0])


def test_a_kink_is_reported():
    # the gap of the second contact is exactly zero without a force
    Q, q = np.eye(4), np.array([[-1.0, 0.0], [0.0, 0.0]])
    with pytest.warns(Kink, match="1 "):
        jax.grad(lambda x: solve(Q, x, 0.3)[0][0, 0])(jnp.asarray(q))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        jax.grad(lambda x: solve(Q, x, 0.3)[0][0, 0])(jnp.asarray(q) + np.array([[0, 0], [1, 0]]))


def test_what_is_not_unique_has_no_derivative_and_the_rest_has():
    # two contacts press on one spring: only the sum of their normal forces is known
    Q, q = np.eye(4), np.array([[-1.0, 0.0], [-1.0, 0.0]])
    Q[0, 2] = Q[2, 0] = 1.0
    for weights, known in (([1.0, 1.0], True), ([1.0, 0.0], False)):

        def force(x, weights=weights):
            return (jnp.array(weights) * solve(Q, x, 0.3, method="newton")[0][:, 0]).sum()

        with pytest.warns(UserWarning, match="not unique"):
            by = jax.grad(force)(jnp.asarray(q))
        assert np.isfinite(by).all() == known
        if known:  # both gaps together, since one alone would open one of the contacts
            assert np.isclose(by[:, 0].sum(), -1.0)


def test_quantities_of_a_scene():
    pressure = quantity("punch-2d", "pressure", ["mu", "E:punch"], elements=8)
    at = jnp.array([0.3, 5.0])
    value, slope = jax.value_and_grad(pressure)(at)
    result = contactopt.run("punch-2d", elements=8, mu=0.3)
    scene = contactopt.gradient(result, "pressure", ["mu", "E:punch"])
    assert np.isclose(float(value), scene.value)
    assert np.allclose(slope, [scene.by["mu"], scene.by["E:punch"]])
    _, along = jax.jvp(pressure, (at,), (jnp.array([1.0, 0.0]),))
    assert np.isclose(float(along), float(slope[0]))


def test_bad_input_gets_a_sentence():
    Q, q, mu, *_ = data()
    with pytest.raises(contactopt.InputError, match="one row per contact"):
        solve(Q, q.ravel(), mu)
    with pytest.raises(Exception, match="shape"):
        solve(Q[:3], q, mu)
    with pytest.raises(contactopt.InputError, match="needs 1 number,"):
        quantity("punch-2d", "pressure", "mu")(jnp.zeros(2))
    with pytest.raises(contactopt.InputError, match="colour"):
        quantity("punch-2d", "pressure", "colour")
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(contactopt.InputError, match="double precision"):
            solve(Q, q, mu)
    finally:
        jax.config.update("jax_enable_x64", True)

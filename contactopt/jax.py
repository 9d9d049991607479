"""Solutions and quantities as functions of JAX, with certified derivatives in both directions.

    >>> import jax
    >>> from contactopt.jax import quantity, solve
    >>> jax.config.update("jax_enable_x64", True)
    >>> forces, multipliers = solve(Q, q, 0.3)
    >>> jax.grad(lambda mu: solve(Q, q, mu)[0][:, 1].sum())(0.3)
    >>> pressure = quantity("punch-2d", "pressure", ["mu", "E:punch"])
    >>> jax.value_and_grad(pressure)(jax.numpy.array([0.3, 5.0]))

The problems are solved outside of JAX, those of one `vmap` at once (contactopt.solve_batch). The
derivative of `solve` is the linear system of contactopt.derivatives, with the matrix of Newton's
last step, whose factors come with the solution; that of `quantity` is contactopt.gradient.
So jax.jvp, jax.vjp, jax.grad,
jax.jacfwd and jax.jacrev all work. There are no second derivatives.

Where a contact is on the edge between open and closed, or stick and slip, a solution has one-sided
derivatives only. A Kink warning then names the contacts, and the derivative is that of the piece at
which the solver ended. contactopt.sensitivity has the one-sided ones. Where forces or motions are
not unique, a warning says so, and derivatives that depend on which they are have the value NaN.
"""

import warnings
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from math import prod
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from contactopt.cards import count
from contactopt.defaults import TOL
from contactopt.derivatives.factors import UNSEEN, Square, Whole
from contactopt.derivatives.gradient import gradient
from contactopt.derivatives.interface import Sensitivity, told_apart
from contactopt.derivatives.states import chain_of
from contactopt.errors import InputError
from contactopt.methods.batch import problems_of, solve_all
from contactopt.methods.driver import solve as solve_problem
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.readings.quantities import seeds_of
from contactopt.runner import run, scene_of
from contactopt.scenes.parameters import parameters as parameters_of
from contactopt.scenes.parameters import put_all
from contactopt.scenes.scene import Scene

Arrays = tuple[Any, ...]
UNDETERMINED = (
    "forces or motions are not unique here: a derivative that depends on which they are is not a"
    " number."
)


class Kink(UserWarning):
    """A derivative was taken at a point that has one-sided derivatives only."""


def solve(
    Q: jax.Array,
    q: jax.Array,
    mu: jax.Array,
    V: jax.Array | None = None,
    s: jax.Array | None = None,
    tol: float = TOL,
    **settings: Any,
) -> tuple[jax.Array, jax.Array]:
    """Solve an interface problem with Coulomb friction, differentiably by Q (k dim, k dim) [length
    / force], q (k, dim) [length], mu, one number or (k,), and the motions V (k dim, p) and
    resultants s (p,) [force]. The result is the reactions (k, dim) [force] and multipliers (p,)
    [length].

    InputError where JAX works in single precision, on data that contactopt.solve refuses, and where
    no certified solution was found. JAX wraps the last two into errors of its own.
    """
    _check_precision()
    q = jnp.asarray(q, float)
    if q.ndim != 2:
        raise InputError(f"q must have one row per contact, (k, dim); got the shape {q.shape}.")
    V = jnp.zeros((q.size, 0)) if V is None else jnp.asarray(V, float)
    s = jnp.zeros(V.shape[1]) if s is None else jnp.asarray(s, float)
    mu = jnp.broadcast_to(jnp.asarray(mu, float), q.shape[:1])

    reactions, multipliers = _solver(tol, **settings)(jnp.asarray(Q, float), q, mu, V, s)
    return reactions, multipliers


@lru_cache
def _solver(tol: float, **settings: Any) -> Callable[..., Any]:
    """The function of Q, q, mu, V and s, made once so that JAX traces it once."""

    def found(data: Arrays) -> list[Sensitivity]:
        """One problem, or many under `vmap`, which puts axes before those of each array."""
        before = np.shape(data[1])[:-2]
        shapes = [(prod(before), *np.shape(array)[len(before) :]) for array in data]
        Q, q, mu, V, s = (np.reshape(array, shape) for array, shape in zip(data, shapes))
        if s.size:
            given = zip(Q, q, mu, V, s)
            problems = [InterfaceProblem(Q, q, mu, V, s) for Q, q, mu, V, s in given]
        else:
            problems = problems_of(Q, q, mu)
        if len(problems) > 1 and not (s.size or settings):
            solutions = solve_all(problems, tol)
        else:
            solutions = [solve_problem(problem, tol=tol, **settings) for problem in problems]
        for solution in solutions:
            if not solution.solved:
                raise InputError(f"no certified solution was found: {solution.status}.")
        return [Sensitivity(p, x, told_apart(x.residual)) for p, x in zip(problems, solutions)]

    def shaped(results: list[Arrays], data: Arrays) -> Arrays:
        before = np.shape(data[1])[:-2]
        return tuple(np.reshape(parts, (*before, *np.shape(parts[0]))) for parts in zip(*results))

    def solved(*data: Arrays) -> Arrays:
        points = [(at.solution.reactions, at.solution.multipliers) for at in found(data)]
        return shaped(points, data)

    def linearised(*data: Arrays) -> Arrays:
        results, points = list[Arrays](), found(data)
        for at, made in zip(points, _together(points)):
            if made is not None:
                results.append(made)
                continue
            by_mu = np.broadcast_to(at.by_parameter, at.problem.q.shape)
            tangent = _smooth(at).tangent
            whole = tangent.factors.whole
            if not whole.unique:
                warnings.warn(UNDETERMINED, stacklevel=2)
            point = at.solution.reactions, at.solution.multipliers
            results.append((*point, tangent.rho, tangent.D, by_mu, *whole))
        return shaped(results, data)

    def rule(data: Arrays, changes: Arrays) -> Any:
        _, q, mu, _, s = data
        (k, d), m = q.shape, q.size + s.size
        numbers = jnp.zeros(m, int)
        whole = jnp.zeros((m, m)), numbers, numbers, jnp.zeros((2, m)), jnp.array(True)
        like = q, s, mu, jnp.zeros((k, d, d)), q, *whole
        r, lam, *linear = _outside(linearised, like, "broadcast_all", *data)
        return (r, lam), _change(data, changes, r, lam, *linear)

    act = jax.custom_jvp(lambda *data: _outside(solved, (data[1], data[4]), "broadcast_all", *data))
    act.defjvp(rule)
    return jax.jit(act)


def _together(points: list[Sensitivity]) -> list[Arrays | None]:
    """What `linearised` gives for many problems without motions, made for all at once. None for
    those with a kink, a singular matrix M, or contacts that are much stiffer than others.
    """
    problems = [at.problem for at in points]
    if len(points) < 2 or problems[0].s.size or not problems[0].q.size:
        return [None] * len(points)
    Q, q, mu = (np.stack([getattr(p, name) for p in problems]) for name in ("Q", "q", "mu"))
    (b, k, d), own = q.shape, np.arange(q.shape[1])
    r = np.stack([at.solution.reactions for at in points])
    compliance = Q.diagonal(0, 1, 2).reshape(b, k, d)
    near = [at.distance for at in points] * np.linalg.norm(r, axis=2).max(axis=1)
    usual = (compliance.min(axis=(1, 2)) > 1e-3 * compliance.max(axis=(1, 2))) & (near > 0)
    rho, law = 1 / np.where(usual[:, None], compliance.mean(axis=2), 1.0), Coulomb(mu.ravel())
    y = (r - rho[:, :, None] * ((Q @ r.reshape(b, -1, 1)).reshape(r.shape) + q)).reshape(-1, d)
    kinks = law.kinks(y, np.repeat(near, k))  # type: ignore[arg-type]
    usual &= ~(kinks.normal | kinks.tangential).reshape(b, k).any(axis=1)
    D, by_mu = law.project(y)[1], law.project_by_parameter(y).reshape(r.shape)
    D[~law.rough, 1:] = 0.0  # no friction, no tangential force
    D = D.reshape(b, k, d, d)
    M = (D * rho[:, :, None, None] @ Q.reshape(b, k, d, -1)).reshape(b, k, d, k, d)
    M[:, own, :, own] += (np.eye(d) - D).swapaxes(0, 1)
    rows, ones, made = np.arange(k * d), np.ones((2, k * d)), list[Arrays | None]([None] * b)
    for i in np.flatnonzero(usual):
        if (square := Square(M[i].reshape(k * d, -1))).unique:
            whole = square.lu.T, rows, square.order, ones, True
            made[i] = (r[i], problems[i].s, rho[i], D[i], by_mu[i], *whole)
    return made


def _change(
    data: Arrays,
    changes: Arrays,
    r: jax.Array,
    lam: jax.Array,
    rho: jax.Array,
    D: jax.Array,
    by_mu: jax.Array,
    *whole: jax.Array,
) -> tuple[jax.Array, jax.Array]:
    """dr and dlambda of contactopt.derivatives for changes of Q, q, mu, V and s, linear in them."""
    (Q, q, _, V, _), (dQ, dq, dmu, dV, ds) = data, changes
    du = dq + (dQ @ r.ravel() + dV @ lam).reshape(q.shape)
    error = by_mu * dmu[:, None] - jnp.einsum("kab,k,kb->ka", D, rho, du)
    # One vector: JAX has no derivative of the step by some parts of the right side alone.
    right = jnp.concatenate([error.ravel(), -ds - dV.T @ r.ravel()])

    def M(change: jax.Array) -> jax.Array:
        dr, dlam = jnp.split(change, [q.size])
        moved = dr.reshape(q.shape) - rho[:, None] * (Q @ dr + V @ dlam).reshape(q.shape)
        return jnp.concatenate([dr - jnp.einsum("kab,kb->ka", D, moved).ravel(), V.T @ dr])

    dr, dlam = jnp.split(lax.custom_linear_solve(M, right, *_inverse(Whole(*whole))), [q.size])
    return dr.reshape(q.shape), dlam


def _inverse(whole: Whole) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """What solves M x = b and M' x = b from the factors. Where M is singular, x is no number; but
    for a right side b of M' that does not see what is undetermined.
    """
    triangular = partial(lax.linalg.triangular_solve, whole.array.T, left_side=True)

    def solved(b: jax.Array) -> jax.Array:
        y = triangular((whole.scales[0] * b)[whole.rows][:, None], transpose_a=True)
        x = triangular(y, lower=True, unit_diagonal=True, transpose_a=True)[:, 0]
        return whole.scales[1] * jnp.zeros(b.shape).at[whole.unknowns].set(x, unique_indices=True)

    def forward(_: Any, b: jax.Array) -> jax.Array:
        return jnp.where(whole.unique, solved(b), jnp.nan)

    def back(product: Callable[..., Any], b: jax.Array) -> jax.Array:
        def checked(x: jax.Array) -> jax.Array:
            left, size = (jnp.linalg.norm(whole.scales[1] * y) for y in (product(x) - b, b))
            return jnp.where(left <= UNSEEN * size, x, jnp.nan)

        (found,) = jax.linear_transpose(solved, b)(b)
        return lax.cond(whole.unique, lambda x: x, checked, found)

    return forward, back


def quantity(
    scene: str | Path | Scene, name: str, parameters: str | Sequence[str], **options: Any
) -> Callable[[Any], jax.Array]:
    """A function of JAX from the values (j,) of parameters of a scene to a quantity of its
    solution. Both have the names of contactopt.gradient, and the options are those of
    contactopt.run; fields, one number per contact, are no parameters.

    InputError where JAX works in single precision, for a quantity or a parameter that does not
    exist, and where no certified solution was found.
    """
    _check_precision()
    base = scene_of(scene)
    which = parameters_of(parameters, base)
    names = [one.name for one in which]
    for one in which:
        one.read(base)  # refuses what has no value to change

    def changed(values: jax.Array) -> Any:
        numbers = np.asarray(values).tolist()
        return run(put_all(base, dict(zip(which, numbers))), **options)

    def read(values: jax.Array) -> np.ndarray:
        return np.asarray(seeds_of(name, chain_of(changed(values)).steps[-1]).value, float)

    def both(values: jax.Array) -> Arrays:
        at = _smooth(gradient(changed(values), name, names))
        return np.asarray(at.value, float), np.array([float(at.by[one]) for one in names])

    act = jax.custom_jvp(lambda values: _outside(read, jnp.zeros(()), "sequential", values))

    def rule(values: jax.Array, changes: Arrays) -> Any:
        value, by = _outside(both, (jnp.zeros(()), *values), "sequential", *values)
        return value, by @ changes[0]

    act.defjvp(rule)

    def function(values: jax.Array) -> jax.Array:
        array = jnp.asarray(values, float)
        if array.shape != (len(names),):
            raise InputError(
                f"the function of {', '.join(names)} needs {count(len(names), 'number')}, shape"
                f" ({len(names)},); got the shape {array.shape}."
            )
        return act(array)

    return function


def _outside(act: Callable[..., Any], like: Any, vmap: str, *arrays: jax.Array) -> Arrays:
    """Call a function of NumPy from JAX; its results have the shapes of `like`."""
    shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), like)
    return jax.pure_callback(act, shapes, *arrays, vmap_method=vmap)


def _smooth(at: jax.Array) -> jax.Array:
    """A sensitivity or a gradient; a warning where it is not differentiable."""
    if not at.differentiable:
        warnings.warn(at.sentence, Kink, stacklevel=2)
    return at


def _check_precision() -> None:
    if not jax.config.jax_enable_x64:
        raise InputError(
            "contactopt computes in double precision; call"
            ' jax.config.update("jax_enable_x64", True) first.'
        )

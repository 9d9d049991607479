"""Solutions and quantities as functions of JAX, with certified derivatives in both directions.

    >>> import jax
    >>> from contactopt.jax import quantity, solve
    >>> jax.config.update("jax_enable_x64", True)
    >>> forces, multipliers = solve(Q, q, 0.3)
    >>> jax.grad(lambda mu: solve(Q, q, mu)[0][:, 1].sum())(0.3)
    >>> pressure = quantity("punch-2d", "pressure", ["mu", "E:punch"])
    >>> jax.value_and_grad(pressure)(jax.numpy.array([0.3, 5.0]))

The problems are solved outside of JAX, one after the other under `vmap`. The derivative of `solve`
is the linear system of contactopt.derivatives, with the matrix of Newton's last step; that of
`quantity` is contactopt.gradient. So jax.jvp, jax.vjp, jax.grad, jax.jacfwd and
jax.jacrev all work. There are no second derivatives.

Where a contact is on the edge between open and closed, or stick and slip, a solution has one-sided
derivatives only. A Kink warning then names the contacts, and the derivative is that of the piece at
which the solver ended. contactopt.sensitivity has the one-sided ones.
"""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from contactopt.derivatives.gradient import Gradient, gradient
from contactopt.derivatives.interface import Sensitivity, sensitivity
from contactopt.errors import InputError
from contactopt.methods.driver import TOL
from contactopt.methods.driver import solve as solve_problem
from contactopt.problem import InterfaceProblem
from contactopt.runner import run, scene_of
from contactopt.scenes.parameters import parameters as parameters_of
from contactopt.scenes.parameters import put_all
from contactopt.scenes.scene import Scene

KEPT = 32  # solutions whose derivative may still be asked for
Arrays = tuple[np.ndarray, ...]


class Kink(UserWarning):
    """A derivative was taken at a point that has one-sided derivatives only."""


class Kept:
    """The last answers of a function of arrays, by the number that each was given."""

    def __init__(self, make: Callable[..., Any]):
        self.make, self.count, self.last = make, 0, OrderedDict[int, Any]()

    def new(self, arrays: Any) -> tuple[Any, np.ndarray]:
        """The answer for some arrays, and its number."""
        self.count += 1
        self.last[self.count] = self.make(*(np.array(array, float) for array in arrays))
        while len(self.last) > KEPT:
            self.last.popitem(last=False)
        return self.last[self.count], np.array(float(self.count))

    def at(self, number: Any, arrays: Any) -> Any:
        """The answer of that number, made again from its arrays if it is no longer kept."""
        there = self.last.get(int(number))
        return self.new(arrays)[0] if there is None else there


def solve(
    Q: Any, q: Any, mu: Any, V: Any = None, s: Any = None, tol: float = TOL, **settings: Any
) -> tuple[jax.Array, jax.Array]:
    """Solve an interface problem with Coulomb friction, differentiably by all its data.

    Parameters
    ----------
    Q : (k dim, k dim) compliance [length / force].
    q : (k, dim) displacements without forces, normal component first [length].
    mu : Coefficients of friction, one number or (k,) [-].
    V, s : Free motions (k dim, p) and their resultants (p,) [force]; none by default.
    tol, settings : Of contactopt.solve.

    Returns
    -------
    Reactions (k, dim) [force] and multipliers (p,) [length].

    Raises
    ------
    InputError : Where JAX works in single precision, on data that contactopt.solve refuses, and
        where no certified solution was found. JAX wraps the last two into errors of its own.
    """
    _check_precision()
    q = jnp.asarray(q, float)
    if q.ndim != 2:
        raise InputError(f"q must have one row per contact, (k, dim); got the shape {q.shape}.")
    V = jnp.zeros((q.size, 0)) if V is None else jnp.asarray(V, float)
    s = jnp.zeros(V.shape[1]) if s is None else jnp.asarray(s, float)
    mu = jnp.broadcast_to(jnp.asarray(mu, float), q.shape[:1])

    def found(*data: np.ndarray) -> Sensitivity:
        Q, q, mu, V, s = data
        problem = InterfaceProblem(Q, q, mu=mu, V=V, s=s)
        solution = solve_problem(problem, tol=tol, **settings)
        if not solution.solved:
            raise InputError(f"no certified solution was found: {solution.status}.")
        return sensitivity(problem, solution)

    kept = Kept(found)

    def solved(*data: Any) -> Arrays:
        made, number = kept.new(data)
        return made.solution.reactions, made.solution.multipliers, number

    act = jax.custom_jvp(lambda *data: _outside(solved, (data[1], data[4], jnp.zeros(())), *data))

    def rule(data: Any, changes: Any) -> Any:
        answer = act(*data)
        return answer, (*_change(kept, data, changes, answer), jnp.zeros(()))

    act.defjvp(rule)
    reactions, multipliers, _ = act(jnp.asarray(Q, float), q, mu, V, s)
    return reactions, multipliers


def _change(kept: Kept, data: Any, changes: Any, answer: Any) -> tuple[jax.Array, jax.Array]:
    """dr and dlambda of contactopt.derivatives for changes of Q, q, mu, V and s, linear in them."""
    (Q, q, _, V, _), (dQ, dq, dmu, dV, ds), (r, lam, number) = data, changes, answer

    def slopes(number: Any, data: Any) -> Arrays:
        return _smooth(kept.at(number, data)).slopes

    def step(name: str, number: Any, data: Any, right: Any) -> np.ndarray:
        first, last = np.split(np.asarray(right), [q.size])
        parts = getattr(kept.at(number, data), name)(first.reshape(q.shape), last)
        return np.concatenate([part.ravel() for part in parts])

    blocks = jnp.zeros((*q.shape, q.shape[1]))
    D, D_rho, by_mu = _outside(slopes, (blocks, blocks, q), number, data)
    du = dq + (dQ @ r.ravel() + dV @ lam).reshape(q.shape)
    error = by_mu * dmu[:, None] - jnp.einsum("kab,kb->ka", D_rho, du)
    # One vector: JAX has no derivative of the step by some parts of the right side alone.
    right = jnp.concatenate([error.ravel(), -ds - dV.T @ r.ravel()])

    def M(change: jax.Array) -> jax.Array:
        dr, dlam = jnp.split(change, [q.size])
        both = jnp.stack([dr, Q @ dr + V @ dlam]).reshape(2, *q.shape)
        rows = both[0] - jnp.einsum("jkab,jkb->ka", jnp.stack([D, -D_rho]), both)
        return jnp.concatenate([rows.ravel(), V.T @ dr])

    def inverse(name: str) -> Callable[[Any, jax.Array], jax.Array]:
        return lambda _, b: _outside(partial(step, name), right, number, data, b)

    change = lax.custom_linear_solve(M, right, inverse("step"), inverse("step_transposed"))
    dr, dlam = jnp.split(change, [q.size])
    return dr.reshape(q.shape), dlam


def quantity(
    scene: str | Path | Scene, name: Any, parameters: str | Sequence[str], **options: Any
) -> Callable[[Any], jax.Array]:
    """Make a function of JAX from the parameters of a scene to a quantity of its solution.

    Parameters
    ----------
    scene, options : Of contactopt.run.
    name, parameters : The quantity and the names of the parameters, as for contactopt.gradient.
        Fields, one number per contact, are none of them.

    Returns
    -------
    A function of the values of the parameters (j,) to one number.

    Raises
    ------
    InputError : Where JAX works in single precision, for a quantity or a parameter that does not
        exist, and where no certified solution was found.
    """
    _check_precision()
    base = scene_of(scene)
    which = parameters_of(parameters, base)
    names = [one.name for one in which]
    for one in which:
        one.read(base)  # refuses what has no value to change

    def found(values: np.ndarray) -> Gradient:
        changed = put_all(base, dict(zip(which, values.tolist())))
        return gradient(run(changed, **options), name, names)

    kept = Kept(found)

    def value(values: Any) -> Arrays:
        made, number = kept.new((values,))
        return np.asarray(made.value, float), number

    def slope(number: Any, values: Any) -> np.ndarray:
        by = _smooth(kept.at(number, (values,))).by
        return np.array([float(by[one]) for one in names])

    act = jax.custom_jvp(lambda values: _outside(value, 2 * (jnp.zeros(()),), values))

    def rule(values: Any, changes: Any) -> Any:
        reading, number = act(*values)
        by = _outside(slope, *values, number, *values)
        return (reading, number), (by @ changes[0], jnp.zeros(()))

    act.defjvp(rule)

    def function(values: Any) -> jax.Array:
        array = jnp.asarray(values, float)
        if array.shape != (len(names),):
            raise InputError(
                f"the function of {', '.join(names)} needs {len(names)} numbers, shape"
                f" ({len(names)},); got the shape {array.shape}."
            )
        return act(array)[0]

    return function


def _outside(act: Callable[..., Any], like: Any, *arrays: Any) -> Any:
    """Call a function of NumPy from JAX; its results have the shapes of `like`."""
    shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, np.float64), like)
    return jax.pure_callback(act, shapes, *arrays, vmap_method="sequential")


def _smooth(at: Any) -> Any:
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

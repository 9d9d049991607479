"""How exact are the derivatives of a certified solution, and what do they cost?"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import contactopt
from contactopt import InterfaceProblem, Solution, scenes, solve
from contactopt.coupling.reduction import reduce_bodies
from contactopt.defaults import TOL
from contactopt.derivatives.states import chain_of
from contactopt.jax import solve as jax_solve
from contactopt.problem.scaling import immovable
from contactopt.readings.quantities import seeds_of
from contactopt.scenes.parameters import parameters
from contactopt.solving.solve_scene import Solved
from experiments.report import measure

PROBLEMS = 100
STEP = 1e-6
SCENES: dict[str, tuple[Callable[[], Any], tuple[str, ...], tuple[str, ...], dict[str, Any]]] = {
    "punch-2d": (
        lambda: scenes.flat_punch(2, elements=12),
        ("mu", "E:punch", "nu:foundation", "force:punch:y"),
        ("approach", "energy", "pressure:3", "pressure", "shear_force"),
        {},
    ),
    "punch-3d": (
        lambda: scenes.flat_punch(3, elements=4),
        ("mu", "E:punch", "nu:punch"),
        ("approach", "energy"),
        {},
    ),
    "sphere": (
        lambda: scenes.make_scene("sphere", elements=8),
        ("E", "nu", "force:sphere:z"),
        ("approach", "width"),
        {},
    ),
    "cattaneo-2d": (
        lambda: scenes.make_scene("cattaneo-2d", elements=6),
        ("E:upper", "nu:lower", "mu", "force:upper:x"),
        ("shift", "energy"),
        {},
    ),
    "stack": (lambda: scenes.make_scene("stack"), ("E", "nu"), ("energy",), {}),
    "punch-2d, products": (
        lambda: scenes.flat_punch(2, elements=12),
        ("mu", "E:punch"),
        ("approach", "energy"),
        {"Q": "implicit"},
    ),
}


def random_problem(seed: int, dim: int, contacts: int = 0) -> InterfaceProblem:
    """Positive definite Q, every third unsymmetric, every second with a plate; 8 to 20 contacts, or
    as many as are asked for.
    """
    rng = np.random.default_rng(seed)
    k = contacts or int(rng.integers(8, 21))
    n, p = k * dim, seed % 2
    A, B = rng.normal(size=(2, n, n))
    Q = A @ A.T / n + 0.3 * np.eye(n) + (seed % 3 == 0) * 0.15 * (B - B.T) / np.sqrt(n)
    V, s = np.zeros((n, p)), -0.8 * k * np.ones(p)
    V[::dim] = 1.0
    return InterfaceProblem(Q, 0.5 * rng.normal(size=(k, dim)), rng.uniform(0.1, 0.5, k), V, s)


def directions(problem: InterfaceProblem, seed: int) -> dict[str, dict[str, np.ndarray]]:
    """One direction for each kind of data."""
    rng = np.random.default_rng(seed)
    shapes = {
        "q": problem.q.shape,
        "mu": (problem.contacts,),
        "s": problem.s.shape,
        "V": problem.V.shape,
    }
    found = {
        name: {name: 0.2 * rng.normal(size=shape)}
        for name, shape in shapes.items()
        if np.prod(shape)
    }
    return found | {"Q": {"Q": 0.1 * rng.normal(size=problem.Q.shape)}}


def moved(problem: InterfaceProblem, change: dict[str, np.ndarray], t: float) -> InterfaceProblem:
    data = {
        name: getattr(problem, name) + t * value for name, value in change.items() if name != "mu"
    }
    return replace(
        problem, law=problem.law.shifted(t * change.get("mu", np.zeros(problem.contacts))), **data
    )


def paired(dual: Any, change: dict[str, np.ndarray]) -> float:
    return sum(float(np.sum(getattr(dual, name) * value)) for name, value in change.items())


def against_differences(dim: int) -> list[dict[str, Any]]:
    """The worst of PROBLEMS random problems for each kind of data."""
    worst: dict[str, list[float]] = {name: [0.0, 0.0] for name in ("q", "mu", "s", "V", "Q")}
    used = seed = left_out = 0
    while used < PROBLEMS:
        seed += 1
        problem = random_problem(seed, dim)
        solution = solve(problem, tol=1e-12)
        if not solution.solved:
            left_out += 1
            continue
        # A difference needs both of its ends in the piece of the solution.
        ours = contactopt.sensitivity(problem, solution, distance=1e-4)
        if not ours.differentiable:
            left_out += 1
            continue
        used += 1
        weight = np.random.default_rng(seed).normal(size=problem.q.shape)
        dual = ours.adjoint(reactions=weight)
        for name, change in directions(problem, seed).items():
            ends = [
                solve(
                    moved(problem, change, t),
                    "newton",
                    tol=1e-14,
                    start=solution,
                    max_iterations=20,
                )
                for t in (STEP, -STEP)
            ]
            found = ours.forward(**change)
            wanted = (ends[0].reactions - ends[1].reactions) / (2 * STEP)
            error = float(np.abs(found.reactions - wanted).max() / np.abs(wanted).max())
            one, two = float(np.sum(weight * found.reactions)), paired(dual, change)
            size = float(np.linalg.norm(weight) * np.linalg.norm(found.reactions))
            worst[name] = [max(worst[name][0], error), max(worst[name][1], abs(one - two) / size)]
    return [
        {
            "dim": dim,
            "problems": used,
            "left out": left_out,
            "data": name,
            "difference": row[0],
            "adjoint - forward": row[1],
        }
        for name, row in worst.items()
    ]


def solved(scene: Any, settings: dict[str, Any], start: Solution | None = None) -> Solved:
    reduction = reduce_bodies(scene, **settings)
    return Solved(reduction, solve(reduction.problem, tol=1e-13, start=start))


def value(quantity: str, result: Solved) -> float:
    return float(seeds_of(quantity, chain_of(result).steps[-1]).value)


def through_scenes() -> list[dict[str, Any]]:
    """The best of two central differences: neither rounding nor curvature decides."""
    rows = []
    for name, (make, names, quantities, settings) in SCENES.items():
        scene = make()
        base = solved(scene, settings)
        for quantity in quantities:
            found = contactopt.gradient(base, quantity, names)
            assert found.differentiable
            for which in parameters(names, scene):
                at, errors = which.read(scene), []
                for relative in (1e-4, 1e-5):
                    h = relative * (abs(at) or 1.0)
                    ends = [
                        solved(which.put(scene, at + t), settings, base.solution) for t in (h, -h)
                    ]
                    wanted = (value(quantity, ends[0]) - value(quantity, ends[1])) / (2 * h)
                    scale = max(abs(wanted), 1e-3 * abs(found.value / (at or 1.0)))
                    errors.append(abs(found.by[which.name] - wanted) / scale)
                once = abs(found.onesided({which.name: 1.0}) - found.by[which.name]) / scale
                rows.append(
                    {
                        "scene": name,
                        "quantity": quantity,
                        "parameter": which.name,
                        "derivative": float(found.by[which.name]),
                        "difference": float(min(errors)),
                        "adjoint - forward": float(once),
                    }
                )
    return rows


def cpu(act: Callable[[], Any], repeats: int = 5) -> float:
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        act()
        times.append(time.process_time() - begin)
    return median(times)


def costs() -> list[dict[str, Any]]:
    """CPU seconds of all derivatives of one quantity, and of the solve before."""
    rows = []
    cases = (
        ("punch-2d, dense", lambda: scenes.flat_punch(2, elements=512), {"Q": "explicit"}),
        ("punch-3d, dense", lambda: scenes.flat_punch(3, elements=16), {"Q": "explicit"}),
        (
            "punch-3d, multigrid",
            lambda: scenes.flat_punch(3, elements=10),
            {"Q": "implicit", "solver": "multigrid"},
        ),
    )
    for name, make, settings in cases:
        reduction = reduce_bodies(make(), **settings)
        problem = reduction.problem
        solution = solve(problem, "newton", tol=1e-8)
        steps = solution.iterations
        whole = cpu(lambda p=problem: solve(p, "newton", tol=1e-8), 3)
        weight = np.zeros(problem.q.shape)
        weight[:, 0] = np.linspace(0.0, 1.0, problem.contacts)

        def linear(
            p: InterfaceProblem = problem, s: Solution = solution, w: np.ndarray = weight
        ) -> None:
            contactopt.sensitivity(p, s).adjoint(reactions=w).mu  # noqa: B018

        own = cpu(linear, 3)
        anew = cpu(partial(linear, replace(problem)), 3)
        rows.append(
            {
                "problem": name,
                "contacts": problem.contacts,
                "Newton steps": steps,
                "whole solve [s]": whole,
                "gradient with respect to all data [s]": own,
                "anew [s]": anew,
                "over the whole solve": own / whole,
                "anew over the whole solve": anew / whole,
            }
        )
    return rows


def of_contacts() -> list[tuple[str, InterfaceProblem]]:
    """Problems of about a hundred contacts."""
    made = {
        "punch-2d": lambda: scenes.flat_punch(2, elements=99),
        "punch-3d": lambda: scenes.flat_punch(3, elements=9),
        "cattaneo-2d": lambda: scenes.make_scene("cattaneo-2d", elements=32),
        "sphere": lambda: scenes.make_scene("sphere", elements=80),
    }
    found = [(name, reduce_bodies(make(), Q="explicit").problem) for name, make in made.items()]
    return found + [
        (f"random, dimension {dim}{', plate' * plate}", random_problem(seed, dim, 100))
        for seed, dim, plate in ((2, 2, 0), (1, 2, 1), (2, 3, 0), (1, 3, 1))
    ]


def through_jax() -> list[dict[str, Any]]:
    """Error and CPU time of jax.value_and_grad by all data, compiled, beside the value alone."""
    jax.config.update("jax_enable_x64", True)
    rows = []
    for name, problem in of_contacts():
        arrays = tuple(jnp.asarray(x) for x in (problem.Q, problem.q, problem.mu, problem.V))
        s, turn = jnp.asarray(problem.s), np.random.default_rng(0).normal(size=problem.q.shape)
        weight = jnp.asarray(turn)

        def value(*data: Any, tol: float = TOL, s: Any = s, weight: Any = weight) -> Any:
            return (weight * jax_solve(*data, s, tol=tol)[0]).sum()  # type: ignore[call-arg]

        plain, both = jax.jit(value), jax.jit(jax.value_and_grad(value, argnums=(0, 1, 2, 3)))
        exact = partial(value, tol=1e-13)
        turned = [jnp.asarray(np.zeros(x.shape)) for x in arrays]
        pressed = problem.Q @ solve(problem).reactions.ravel()
        moves = ~immovable(problem).reshape(turn.shape)
        turned[1] = jnp.asarray(moves * turn * float(np.abs(pressed).mean()))
        along = float(jax.jvp(exact, arrays, tuple(turned))[1])
        h = 1e-6
        ends = [exact(arrays[0], arrays[1] + t * turned[1], *arrays[2:]) for t in (h, -h)]
        size = float(np.linalg.norm(turn) * np.linalg.norm(solve(problem).reactions))
        at = contactopt.sensitivity(problem, solve(problem)).tangent
        acts = {
            "solve": partial(solve, problem),
            "call": empty_call((*arrays, s), (turn, problem.s)),
            "factors": lambda at=at: replace(at).factors.whole,
            "value": lambda f=plain, x=arrays: jax.block_until_ready(f(*x)),
            "gradient": lambda f=both, x=arrays: jax.block_until_ready(f(*x)),
        }
        spent = in_turn(acts)
        more = spent["gradient"] - spent["value"]
        rows.append(
            {
                "problem": name,
                "contacts": problem.contacts,
                "difference": abs(along - float(ends[0] - ends[1]) / (2 * h)) / size,
                "contactopt.solve [ms]": 1e3 * spent["solve"],
                "value by JAX [ms]": 1e3 * spent["value"],
                "and gradient [ms]": 1e3 * spent["gradient"],
                "an empty call [ms]": 1e3 * spent["call"],
                "factors [ms]": 1e3 * spent["factors"],
                "gradient over value": more / spent["value"],
                "gradient over contactopt.solve": more / spent["solve"],
            }
        )
    return rows


def empty_call(arrays: tuple[Any, ...], results: tuple[Any, ...]) -> Callable[[], Any]:
    """A call of NumPy from JAX with these arrays, in which nothing is computed."""
    shapes = tuple(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in results)
    act = jax.jit(lambda *given: jax.pure_callback(lambda *_: results, shapes, *given))
    return lambda: jax.block_until_ready(act(*arrays))


def in_turn(acts: dict[str, Callable[[], Any]], repeats: int = 31) -> dict[str, float]:
    """Median CPU seconds of some acts, each done once in every round, so that all see the same
    machine.
    """
    spent: dict[str, list[float]] = {name: [] for name in acts}
    for count in range(repeats + 2):  # the first two compile and warm up
        for name, act in acts.items():
            begin = time.process_time()
            act()
            if count > 1:
                spent[name].append(time.process_time() - begin)
    return {name: median(times) for name, times in spent.items()}


def planted() -> list[dict[str, Any]]:
    """Contacts that are put on an edge between two states, and how many of them JAX names."""
    jax.config.update("jax_enable_x64", True)
    rows = []
    for edge in ("open / closed", "stick / slip"):
        named = count = 0
        for seed in range(1, PROBLEMS + 1):
            problem = random_problem(seed, 2 + seed % 2)
            solution = solve(problem, tol=1e-12)
            r, mu, q = solution.reactions, problem.mu.copy(), problem.q.copy()
            u = problem.displacements(r, solution.multipliers)
            size = np.linalg.norm(r[:, 1:], axis=1)
            opens, sticks = r[:, 0] == 0, (r[:, 0] > 0) & (size < 0.999 * mu * r[:, 0])
            there = opens if edge == "open / closed" else sticks
            if not solution.solved or not there.any():
                continue
            place = int(np.flatnonzero(there)[0])
            if edge == "open / closed":
                q[place, 0] -= u[place, 0]
            else:
                mu[place] = size[place] / r[place, 0]
            count += 1
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                found = jax.grad(
                    lambda x, p=problem, mu=mu: jax_solve(p.Q, x, mu, p.V, p.s)[0].sum()
                )(q)
                jax.block_until_ready(found)
            named += any(f" {place} ({edge})" in str(one.message) for one in said)
        rows.append({"edge": edge, "planted": count, "named": named})
    return rows


TEXT = f"""Are the derivatives of certified solutions right, and what do they cost?
`contactopt.sensitivity` and `contactopt.gradient` are compared with differences of solved problems.
A relative error is the largest error over all forces, over the largest derivative of a force.

{{random}}

There are {PROBLEMS} random problems in each dimension, compared with central differences. Their Q
is positive definite, and every third Q is not symmetric. Every second problem has a plate. Two
kinds of problems are left out: those that were not solved to 1e-12, and those with a contact nearer
to a kink than 1e-4 of the largest force. There the two ends of a difference may lie on different
pieces of the solution.

**Scenes.** These are derivatives with respect to the parameters of a scene. There are two central
differences, with the relative steps 1e-4 and 1e-5, and the nearer one counts. Derivatives that are
far below the size of the quantity are compared with a thousandth of it. `shear_force`, `energy` and
the others are in units of N and mm:

{{scenes}}

**Cost.** The table has CPU seconds, medians on a shared machine, with `OMP_NUM_THREADS=1`. It
compares the gradient of one function with respect to all data (q, mu, s, Q, V) with the whole
solve. The gradient takes the certificate of the solution and one solve with the transposed
system. The dense rows use the Cholesky factor that Newton's method has made. This factor is kept
for the problem that was factorised last, as long as that problem is in use. The column "anew" is
the gradient of a copy of the problem, for which no factor is kept. With multigrid the certificate
takes one V-cycle, since the solution has the displacements of the bodies. The coupled linear
system is solved to the certificate of the solution, at most to 1e-11, because the matrix itself
is not known more exactly. Every V-cycle about halves the error. So ten digits of a gradient take
about as many V-cycles as all steps of Newton's method, which are inexact, and this row stays near
the whole solve.

{{costs}}

**JAX.** `contactopt.jax.solve` is compared with central differences along a random direction of q,
over the norms of the forces and of the weights. Times are medians of CPU milliseconds, compiled and
warm. The tasks of a row are timed in turn. For "gradient over value", JAX computes the value and
the gradient with respect to Q, q, mu and V together; the time of the value is subtracted, and the
rest is divided by it. The last column divides by the time of `contactopt.solve` without JAX. A
gradient takes no more calls of NumPy than the value: the call that solves the problem gives the
factors of the linear system as well, and XLA solves with them. "An empty call" has the arrays of
the value and computes nothing. "Factors" is the time to assemble and factorise that system alone.
No gradient can be faster. A curved contact takes eight to ten steps of Newton's method. A flat
punch takes two steps with one Cholesky factor, and problems without a plate are swept without any
factor: there the factors of the gradient weigh most.

{{jax}}

**Kinks.** In random problems one contact is put on an edge: a contact that is open gets the gap
zero, or one that sticks gets the friction coefficient that it uses. A warning must name it.

{{planted}}
"""


if __name__ == "__main__":
    parts: dict[str, Callable[[], list[dict[str, Any]]]] = {
        "random": lambda: [row for dim in (2, 3) for row in against_differences(dim)],
        "scenes": through_scenes,
        "costs": costs,
        "jax": through_jax,
        "planted": planted,
    }
    measure("sensitivity", "Derivatives of certified solutions", TEXT, parts)

"""How exact are the derivatives of a certified solution, and what do they cost?"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import contactopt
from contactopt import InterfaceProblem, Solution, scenes, solve
from contactopt.coupling.reduction import reduce_bodies
from contactopt.derivatives.states import chain_of
from contactopt.jax import solve as jax_solve
from contactopt.methods.driver import TOL
from contactopt.problem.scaling import immovable
from contactopt.readings.quantities import seeds_of
from contactopt.scenes.parameters import parameters
from contactopt.solving.solve_scene import Solved
from experiments.report import measure

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
        rows.append(
            {
                "problem": name,
                "contacts": problem.contacts,
                "Newton steps": steps,
                "whole solve [s]": whole,
                "gradient by all data [s]": own,
                "over the whole solve": own / whole,
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
    return [(name, reduce_bodies(make(), Q="explicit").problem) for name, make in made.items()]


def through_jax() -> list[dict[str, Any]]:
    """Error and CPU time of jax.value_and_grad by all data, compiled, beside the value alone."""
    jax.config.update("jax_enable_x64", True)
    rows = []
    for name, problem in of_contacts():
        arrays = tuple(jnp.asarray(x) for x in (problem.Q, problem.q, problem.mu, problem.V))
        s, turn = jnp.asarray(problem.s), np.random.default_rng(0).normal(size=problem.q.shape)
        weight = jnp.asarray(turn)

        def value(*data: Any, tol: float = TOL, s: Any = s, weight: Any = weight) -> Any:
            return (weight * jax_solve(*data, s, tol=tol)[0]).sum()

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
        acts = {
            "solve": partial(solve, problem),
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
                "gradient over value": more / spent["value"],
                "gradient over contactopt.solve": more / spent["solve"],
            }
        )
    return rows


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


TEXT = """Are the derivatives of certified solutions right, and what do they cost?
`contactopt.sensitivity` and `contactopt.gradient` are compared with differences of solved problems.
Tests hold random problems to differences, both directions to each other, and warnings to kinks.

**Scenes.** These are derivatives with respect to the parameters of a scene. There are two central
differences, with the relative steps 1e-4 and 1e-5, and the nearer one counts. Derivatives that are
far below the size of the quantity are compared with a thousandth of it. `shear_force`, `energy` and
the others are in units of N and mm:

{scenes}

**Cost.** The table has CPU seconds, medians on a shared machine, with `OMP_NUM_THREADS=1`. The
gradient of one function by all data (q, mu, s, Q, V) takes one factorisation with one solve, or one
coupled linear solve to the relative accuracy 1e-11. It also takes the certificate of the solution.
Components that are known at once leave the system. Cholesky's factors serve those that stick.

{costs}

**JAX.** `contactopt.jax.solve` is compared with central differences along a random direction of q,
over the norms of the forces and of the weights. Times are medians of CPU milliseconds, compiled and
warm. The acts of a row are timed in turn. The gradient by Q, q, mu and V takes one call of NumPy
from JAX more than the value, and one factorisation. That is a fifth of a curved contact's solve,
which takes eight to ten steps of Newton's method. A flat punch takes two steps: there one
factorisation and what JAX takes for a call are more than half of the solve.

{jax}
"""


if __name__ == "__main__":
    parts: dict[str, Callable[[], list[dict[str, Any]]]] = {
        "scenes": through_scenes,
        "costs": costs,
        "jax": through_jax,
    }
    measure("sensitivity", "Derivatives of certified solutions", TEXT, parts)

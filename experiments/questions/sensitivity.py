"""How exact are the derivatives of a certified solution, and what do they cost?"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np

import contactopt
from contactopt import InterfaceProblem, Solution, scenes, solve
from contactopt.coupling.reduction import reduce_bodies
from contactopt.derivatives.states import chain_of
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


def random_problem(seed: int, dim: int) -> InterfaceProblem:
    """Positive definite Q, every third unsymmetric, every second with a plate; 8 to 20 contacts."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(8, 21))
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

**Cost.** The table has CPU seconds, medians on a shared machine, with `OMP_NUM_THREADS=1`. The
gradient of one function by all data (q, mu, s, Q, V) takes one factorisation with one solve, or one
coupled linear solve to the relative accuracy 1e-11. It also takes the certificate of the solution.
About half of the time of the gradient is spent around the factorisation: on the dimensionless copy
of Q, on the check of the certificate, and on the check whether the bonded system is symmetric.

{{costs}}
"""


if __name__ == "__main__":
    parts: dict[str, Callable[[], list[dict[str, Any]]]] = {
        "random": lambda: [row for dim in (2, 3) for row in against_differences(dim)],
        "scenes": through_scenes,
        "costs": costs,
    }
    measure("sensitivity", "Derivatives of certified solutions", TEXT, parts)

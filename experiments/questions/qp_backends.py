"""Do all QP backends give the same answer, and which needs the crossover for it?"""

from __future__ import annotations

import time

from contactopt import InterfaceProblem, reduce, scenes, solve
from contactopt.methods.backends import QP
from contactopt.methods.kernels import splitting
from experiments.report import write

REPEATS = 5
SCENES = (("punch-2d", {}), ("sphere", {}), ("punch-3d", {"elements": 8}))
# force, length
UNITS = {"N, mm": (1.0, 1.0), "kN, m": (1e-3, 1e-3), "uN, nm": (1e6, 1e6), "GN, km": (1e-9, 1e-6)}


def measure(name: str, exact, problem) -> dict[str, object]:  # type: ignore[no-untyped-def]
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        solution = solve(problem, "alternating", normal=name, tangential=name, tol=1e-9)
        times.append(time.perf_counter() - start)
    raw = without_crossover(name, problem)
    return {
        "backend": name,
        "version": QP[name].version,
        "status": str(solution.status),
        "residual": solution.residual,
        "approach, relative difference": abs(solution.multipliers[0] / exact.multipliers[0] - 1),
        "peak, relative difference": abs(
            solution.reactions[:, 0].max() / exact.reactions[:, 0].max() - 1
        ),
        "status without crossover": str(raw.status),
        "residual without crossover": raw.residual,
        "median seconds": sorted(times)[REPEATS // 2],
    }


def without_crossover(name: str, problem):  # type: ignore[no-untyped-def]
    saved = splitting.certified
    splitting.certified = as_it_comes
    try:
        return solve(
            problem, "alternating", normal=name, tangential=name, tol=1e-9, max_iterations=40
        )
    finally:
        splitting.certified = saved


def as_it_comes(solvers, equations):  # type: ignore[no-untyped-def]
    """The first answer of the first try, in place of `semismooth.certified`."""
    r, multipliers = next(iter(solvers))[1]()
    return r.reshape(equations.q.shape), multipliers


def in_all_units(name: str) -> dict[str, object]:
    """The scenes' normal problems (mu = 0), certified at 1e-10 in four systems of units."""
    row: dict[str, object] = {"backend": name}
    for unit, (force, length) in UNITS.items():
        worst, certified = 0.0, 0
        for scene, changes in SCENES:
            p = reduce(scenes.make_scene(scene, mu=0.0, **changes))
            scaled = InterfaceProblem(p.Q * length / force, p.q * length, p.mu, p.V, p.s * force)
            solution = solve(scaled, "alternating", normal=name, tol=1e-10)
            worst, certified = max(worst, solution.residual), certified + solution.solved
        row[unit] = f"{certified} of {len(SCENES)}, worst {worst:.0e}"
    return row


TEXT = """Do all solvers of quadratic programs lead to the same answer? The problem is the default
`punch-2d` (17 contacts, mu = .5). The same backend solves its normal and its tangential problem, at
the tight settings of contactopt.methods.backends. The answer is certified at 1e-9. Differences are
relative to a solve at 1e-13. contactopt makes the answer of a backend exact by a few more steps,
which is called crossover. "Without crossover" takes the answers of the backend as they come, for at
most 40 iterations.

{rows}

The next table has the normal problems (mu = 0) of the three scenes, with the certificate 1e-10 and
the input written in other units:

{units}
"""

if __name__ == "__main__":
    problem = reduce(scenes.flat_punch(2))
    exact = solve(problem, tol=1e-13)
    rows = [measure(name, exact, problem) for name in QP if QP[name].installed]
    units = [in_all_units(name) for name in QP if QP[name].installed]
    write(
        "qp_backends",
        "The same answer from every QP backend",
        TEXT,
        {"rows": rows, "units": units},
        {},
    )

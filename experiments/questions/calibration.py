"""Are friction and stiffness found from a sheared contact, and are the intervals honest?"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

import contactopt
from contactopt import HalfSpace, Material
from contactopt.derivatives.states import along, solved_chain
from contactopt.problem.contact_status import contact_status
from contactopt.readings.quantities import seeds_of
from contactopt.scenes.parameters import parameter
from experiments.report import write

E, MU, FORCE = 5.0, 0.5, 100.0  # MPa, -, N
# mm; the half-width of contact is about 22
RADIUS, THICK, REACH, DEPTH = 4000.0, 400.0, 32.0, 1000.0
LOADS = (0.0, 16.0, 30.0, 42.0, 14.0, -16.0, -42.0, -14.0, 16.0, 42.0)
NOISE = 0.01  # of the largest shift
REPEATS = 100
START = {"E": 6.5, "mu": 0.7}
AMPLITUDES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)


def loop(cells: int, loads: Sequence[float] = LOADS) -> list[contactopt.Scene]:
    """Two equal cylinders as half-planes; the upper one is pressed, then pushed load by load."""
    x = REACH * (2 * np.arange(cells) + 1 - cells) / cells
    upper = HalfSpace(
        "upper",
        Material(E, 0.3),
        x,
        lambda place: -(place[0] ** 2) / (2 * RADIUS),
        {"x": 0.0, "y": -FORCE},
        depth=DEPTH,
    )
    lower = HalfSpace("lower", Material(E, 0.3), x, depth=DEPTH)
    scene = contactopt.Scene("cylinders", upper, lower, MU, thickness=THICK, units=("mm", "MPa"))
    push = parameter("force:upper:x", scene)
    return [push.put(scene, load) for load in loads]


def shifts(states: list[contactopt.Scene]) -> np.ndarray:
    return np.array(
        [seeds_of("shift", step).value for step in solved_chain(states, 1e-12, Q="explicit").steps]
    )


def row(name: str, found: contactopt.Fit) -> dict[str, Any]:
    return {
        "data": name,
        "E": found.values["E"],
        "error of E": abs(found.values["E"] / E - 1),
        "mu": found.values["mu"],
        "error of mu": abs(found.values["mu"] / MU - 1),
        "evaluations": found.evaluations,
        "largest certificate": max(found.certificates),
        "singular values": ", ".join(f"{s:.3g}" for s in found.singular),
    }


def clean() -> list[dict[str, Any]]:
    states, rows = loop(40), []
    for name, data in (
        ("the same grid", shifts(states)),
        ("a grid 4 times finer", shifts(loop(160))),
    ):
        found = contactopt.fit(states, {"shift": data}, ("E", "mu"), start=START, Q="explicit")
        rows.append(row(name, found))
    return rows


def repetitions() -> list[dict[str, Any]]:
    """How often the intervals of 95 % hold the truth, with a known noise."""
    states, rng = loop(24), np.random.default_rng(19)
    exact = shifts(states)
    sigma = NOISE * float(np.abs(exact).max())
    hits, evaluations, begin = np.zeros(2), 0, time.process_time()
    for _ in range(REPEATS):
        data = {"shift": exact + sigma * rng.normal(size=len(exact))}
        found = contactopt.fit(states, data, ("E", "mu"), start=START, noise=sigma, Q="explicit")
        evaluations += found.evaluations
        hits += [
            low <= truth <= high for truth, (low, high) in zip((E, MU), found.intervals.values())
        ]
    return [
        {
            "noise": "known",
            "repetitions": REPEATS,
            "E in its interval": int(hits[0]),
            "mu in its interval": int(hits[1]),
            "evaluations each": evaluations / REPEATS,
            "CPU [s] each": (time.process_time() - begin) / REPEATS,
        }
    ]


def knowledge() -> list[dict[str, Any]]:
    """Relative deviation of mu from half a loop up to T = share mu P, with NOISE in the data."""
    rows = []
    for share in AMPLITUDES:
        states = loop(32, np.linspace(0.0, 1.0, 5) * share * MU * FORCE)
        chain = solved_chain(states, 1e-10, Q="explicit")
        seeds = [seeds_of("shift", step) for step in chain.steps]
        sigma = NOISE * max(abs(seed.value) for seed in seeds)
        J = []
        for one in (parameter(name, states[0]) for name in ("E", "mu")):
            moved = chain.forward({one: 1.0})
            J.append([along(seed, motion, {one: 1.0}) for seed, motion in zip(seeds, moved)])
        scaled = np.array(J).T / sigma * [E, MU]
        last = chain.steps[-1]
        singular = np.linalg.svd(scaled, compute_uv=False)
        blind = not singular[1] > 1e-8 * singular[0]
        deviation = np.inf if blind else np.sqrt(np.linalg.inv(scaled.T @ scaled)[1, 1])
        slipping = contact_status(last.problem, last.solution.reactions).slip.sum()
        row = {"T / (mu P)": share, "contacts that slip": int(slipping)}
        rows.append(row | {"relative deviation of mu": float(deviation)})
    return rows


TEXT = f"""How well do measurements of a sheared contact determine friction and stiffness?
Two cylinders are pressed by {FORCE:g} N and pushed to and fro by {len(LOADS)} shear forces up
to {max(LOADS):g} N. They are half-planes with E = {E:g} MPa, nu = 0.3 and mu = {MU:g}. One has a
radius of {RADIUS:g} mm, and the other is flat. The shift of the upper one is measured. From
it `contactopt.fit` finds E of both bodies and mu. It starts from E = {START["E"]:g}, mu =
{START["mu"]:g}.

**Without noise.** The data come from the same grid of 40 points, or from a finer grid. In the
second case the error that is left is that of the coarse grid:

{{clean}}

**With noise.** Normal noise of {NOISE:.0%} of the largest shift is added, in {REPEATS} repetitions.
The 95 % intervals should contain the truth about 95 times, and a binomial count of 100 varies by
2.2. For mu the count may be lower: the interval is computed from a linear model, but the true one
has a kink at every point that begins to slip:

{{repetitions}}

**Where mu cannot be known.** The table has the standard deviation of mu that remains after five
states up to the shear T. It is computed from the derivatives at the truth. The slip zone shrinks
with T, and with it the information about mu in the shift. If no point of the grid slips, mu has no
influence at all, and `fit` says so. The numbers go up and down, because the points of the grid
begin to slip one by one:

{{knowledge}}
"""


if __name__ == "__main__":
    tables = {"clean": clean(), "repetitions": repetitions(), "knowledge": knowledge()}
    write("calibration", "Calibration from a Cattaneo-Mindlin loop", TEXT, tables, {})

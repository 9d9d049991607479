"""Are friction and stiffness found from a Cattaneo-Mindlin loop, are the intervals honest, and where is mu not in the data?"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

import contactopt
from contactopt import plots, scenes
from contactopt.derivatives.outputs import seeds_of
from contactopt.derivatives.parameters import parameter, put_all
from contactopt.derivatives.states import along, solved_chain
from experiments.report import write

E, MU, FORCE = 5.0, 0.5, 100.0
LOADS = (0.0, 16.0, 30.0, 42.0, 14.0, -16.0, -42.0, -14.0, 16.0, 42.0)
NOISE = 0.01  # of the largest shift
REPEATS = 100
START = {"E": 6.5, "mu": 0.7}
AMPLITUDES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
FRICTIONS = (0.2, 0.35, 0.5, 0.7)


def loop(elements: int, loads: Sequence[float] = LOADS) -> list[contactopt.Scene]:
    scene = scenes.make_scene("cattaneo-2d", elements=elements, shear=0.0, force=FORCE)
    push = parameter("force:upper:x", scene)
    return [push.put(scene, load) for load in loads]


def shifts(states: list[contactopt.Scene]) -> np.ndarray:
    return np.array([seeds_of("shift", step).value for step in solved_chain(states, 1e-12).steps])


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
    states = loop(6)
    rows = [row("the same mesh", contactopt.fit(states, {"shift": shifts(states)}, ("E", "mu"), start=START))]
    finer = shifts(loop(16))
    rows.append(row("a mesh 2.7 times finer", contactopt.fit(loop(6), {"shift": finer}, ("E", "mu"), start=START)))
    return rows


def repetitions() -> tuple[list[dict[str, Any]], contactopt.Fit]:
    """How often the intervals of 95 % hold the truth, with a known noise and with one estimated from the residuals."""
    states, rng = loop(5), np.random.default_rng(19)
    exact = shifts(states)
    sigma = NOISE * float(np.abs(exact).max())
    rows = []
    for known in (True, False):
        hits, evaluations, begin = np.zeros(2), 0, time.process_time()
        for _ in range(REPEATS):
            data = {"shift": exact + sigma * rng.normal(size=len(exact))}
            found = contactopt.fit(states, data, ("E", "mu"), start=START, noise=sigma if known else None)
            evaluations += found.evaluations
            hits += [low <= truth <= high for truth, (low, high) in zip((E, MU), found.intervals.values())]
        rows.append(
            {
                "noise": "known" if known else "estimated",
                "repetitions": REPEATS,
                "E in its interval": int(hits[0]),
                "mu in its interval": int(hits[1]),
                "evaluations each": evaluations / REPEATS,
                "CPU [s] each": (time.process_time() - begin) / REPEATS,
            }
        )
    return rows, found


def knowledge() -> tuple[list[dict[str, Any]], np.ndarray]:
    """Standard deviation of mu, relative, from half a loop of the amplitude T = share mu P, data with NOISE of their largest shift."""
    out, rows = np.zeros((len(FRICTIONS), len(AMPLITUDES))), []
    for i, mu in enumerate(FRICTIONS):
        for j, share in enumerate(AMPLITUDES):
            top = share * mu * FORCE
            states = [put_all(s, {parameter("mu", s): mu}) for s in loop(12, np.linspace(0.0, 1.0, 5) * top)]
            chain = solved_chain(states, 1e-10)
            seeds = [seeds_of("shift", step) for step in chain.steps]
            sigma = NOISE * max(abs(seed.value) for seed in seeds)
            which = [parameter(name, states[0]) for name in ("E", "mu")]
            J = [[along(s, m, {one: 1.0}) for s, m in zip(seeds, chain.forward({one: 1.0}))] for one in which]
            scaled = np.array(J).T / sigma * [E, mu]
            slipping = int(chain.steps[-1].problem.law.slipping(chain.steps[-1].solution.reactions).sum())
            singular = np.linalg.svd(scaled, compute_uv=False)
            blind = not singular[1] > 1e-8 * singular[0]
            out[i, j] = np.inf if blind else float(np.sqrt(np.linalg.inv(scaled.T @ scaled)[1, 1]))
            if mu == MU:
                rows.append(
                    {"T / (mu P)": share, "contacts that slip": slipping, "relative deviation of mu": out[i, j]}
                )
    return rows, out


def figure(deviation: np.ndarray, found: contactopt.Fit) -> Any:
    from matplotlib.figure import Figure

    made = Figure(figsize=(10.0, 4.2), layout="constrained")
    left, right = made.subplots(1, 2)
    for mu, line, mark in zip(FRICTIONS, deviation, "osD^"):
        seen = np.isfinite(line)
        left.semilogy(np.array(AMPLITUDES)[seen], line[seen], f"{mark}-", ms=4, lw=1, label=f"mu = {mu:g}")
        left.plot(
            np.array(AMPLITUDES)[~seen],
            np.full((~seen).sum(), 0.9),
            "x",
            color="k",
            transform=left.get_xaxis_transform(),
        )
    left.axhline(1.0, color="0.5", lw=0.8)
    left.set(
        xlabel="largest shear / (mu P)", ylabel="standard deviation of mu / mu", title="x: mu is not in the data at all"
    )
    left.legend(frameon=False)
    plots.fit(found, right)
    return made


TEXT = f"""The scene `cattaneo-2d` (two cylinders, E = {E:g} MPa, mu = {MU:g}, pressed by {FORCE:g} N) is pushed to and fro by {len(LOADS)} shear forces up
to {max(LOADS):g} N. The shift of the plate is measured, E of both bodies and mu are fitted from E = {START["E"]:g}, mu = {START["mu"]:g}.

Without noise, data from the same mesh, and data from a finer mesh, where what is left is the error of the coarse mesh:

{{clean}}

With normal noise of {NOISE:.0%} of the largest shift, {REPEATS} repetitions. The 95 % intervals should hold the truth about 95 times; a binomial
count of 100 varies by 2.2:

{{repetitions}}

Where mu cannot be known: the standard deviation of mu that five states up to the shear T leave, from the Jacobian at the truth. The
slip zone shrinks with T, and with it what the shift tells of mu. Where no node of the mesh slips, mu does not enter at all, and `fit`
says so (mu = {MU:g}; the figure has other values):

{{knowledge}}

The right half of the figure shows the residuals of the last repetition.
"""


if __name__ == "__main__":
    counted, last = repetitions()
    known, deviation = knowledge()
    tables = {"clean": clean(), "repetitions": counted, "knowledge": known}
    write(
        "calibration",
        "Calibration from a Cattaneo-Mindlin loop",
        TEXT,
        tables,
        {"calibration": figure(deviation, last)},
    )

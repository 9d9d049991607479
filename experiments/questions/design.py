"""Which profile of a punch makes its pressure even, and is it the known one?"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import contactopt
from contactopt import HalfSpace, Material, Part, Rigid, Scene, Support
from contactopt.figures.style import COLOURS, GREY, add_legend, label_ends, paper_axes, symbols
from contactopt.meshes.structured import graded, rename, tensor_mesh
from experiments.report import figures_alone, save_figures, write

HALF, FORCE, MATERIAL = 10.0, 100.0, Material(5.0, 0.3)


def on_half_plane(cells: int, mu: float) -> Scene:
    """A rigid punch on a half-plane without a mesh, whose points are the face of the punch."""
    h = 2 * HALF / cells
    x = -HALF + h * (np.arange(cells) + 0.5)
    lower = HalfSpace("half-plane", MATERIAL, x)
    return Scene(
        f"half-plane, mu = {mu:g}",
        Rigid("punch", normal=(0, 1), force={"y": -FORCE}),
        lower,
        mu,
        units=("mm", "MPa"),
    )


def on_block(elements: int, mu: float) -> Scene:
    """A rigid punch on the middle of an elastic block, clamped below: no known profile."""
    half = np.linspace(0.0, HALF, elements + 1)
    rest = graded(3 * HALF, HALF / elements, 1.3)[1:]
    x = np.concatenate([-(HALF + rest[::-1]), -half[:0:-1], half, HALF + rest])
    depth = graded(3 * HALF, HALF / elements, 1.3)
    mesh = rename(tensor_mesh(x, -depth[::-1]), top="y+", bottom="y-")
    mesh = mesh.with_boundaries({"contact": lambda p: (p[1] == 0) & (np.abs(p[0]) < HALF)})
    lower = Part("block", mesh, MATERIAL, supports=(Support("bottom"),))
    return Scene(
        f"block, mu = {mu:g}",
        Rigid("punch", normal=(0, 1), force={"y": -FORCE}),
        lower,
        mu,
        units=("mm", "MPa"),
    )


def free(places: np.ndarray) -> np.ndarray:
    return np.eye(places.shape[1])


def polynomials(places: np.ndarray) -> np.ndarray:
    x = places[0] / HALF
    return np.stack([np.polynomial.legendre.Legendre.basis(2 * j)(x) for j in range(1, 7)], axis=1)


def known_profile(x: np.ndarray) -> np.ndarray:
    """Displacement of a half-plane under even pressure (Johnson 1985, section 2.5) [length]."""
    modulus = MATERIAL.E / (1 - MATERIAL.nu**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        shape = (1 + x) * np.log((1 + x) ** 2) + (1 - x) * np.log((1 - x) ** 2)
    return FORCE / (2 * HALF) / (np.pi * modulus) * HALF * shape


CASES = (
    ("half-plane, mu = 0", lambda: on_half_plane(64, 0.0), "free", free),
    ("half-plane, mu = 0", lambda: on_half_plane(64, 0.0), "6 polynomials", polynomials),
    ("half-plane, mu = 0.3", lambda: on_half_plane(64, 0.3), "free", free),
    ("half-plane, mu = 0.3", lambda: on_half_plane(64, 0.3), "6 polynomials", polynomials),
    ("block, mu = 0.3", lambda: on_block(16, 0.3), "free", free),
    ("block, mu = 0.3", lambda: on_block(16, 0.3), "6 polynomials", polynomials),
)


def measure() -> tuple[list[dict[str, Any]], dict[str, contactopt.Design]]:
    rows, kept = [], {}
    for name, make, label, shapes in CASES:
        begin = time.process_time()
        found = contactopt.design(make(), shapes)
        seconds = time.process_time() - begin
        x = found.reduction.problem.chart.places[0] / HALF
        exact = known_profile(x)
        apart = (found.gap - found.gap.mean()) - (exact - exact.mean())
        compared = name == "half-plane, mu = 0"
        area = found.reduction.problem.areas
        rows.append(
            {
                "scene": name,
                "profile": label,
                "contacts": len(area),
                "flat punch, peak/mean": found.visits[0].peak * float(area.sum()) / FORCE,
                "designed, peak/mean": found.peak * float(area.sum()) / FORCE,
                "states visited": len(found.visits),
                "largest certificate": max(visit.certificate for visit in found.visits),
                "off the known profile": (
                    float(np.abs(apart).max() / np.ptp(exact)) if compared else "-"
                ),
                "CPU [s]": seconds,
            }
        )
        kept[f"{name}, {label}"] = found
    return rows, kept


def figure(kept: dict[str, contactopt.Design]) -> Any:
    made, (left, right) = paper_axes(2, wide=True)
    scenes, ends = list(dict.fromkeys(name for name, *_ in CASES)), []
    for (name, _, label, _), found in zip(CASES, kept.values()):
        x, colour = found.reduction.problem.chart.places[0] / HALF, COLOURS[scenes.index(name)]
        points = {"ls": "none", "marker": "o", "mfc": "none", "markevery": 3}
        look = points if label == "free" else {}
        left.plot(x, found.gap - found.gap.min(), color=colour, **look)
        pressure = found.pressure * 2 * HALF / FORCE
        right.plot(x, pressure, color=colour, **look)
        if label == "free":
            ends.append((x[-1], pressure[-1], symbols(name), colour))
    x = np.linspace(-0.9999, 0.9999, 400)
    known = known_profile(x) - known_profile(np.zeros(1))
    left.plot(x, known, "k:", label=symbols("known, uniform pressure, mu = 0"))
    left.plot([], [], "o", color=GREY, mfc="none", label="free")
    left.plot([], [], color=GREY, label="6 polynomials")
    left.set(xlabel="$x / a$ [-]", ylabel="initial gap [mm]")
    add_legend(left)
    right.set(xlabel="$x / a$ [-]", ylabel="pressure / mean pressure [-]", ylim=(0.94, 1.06))
    label_ends(right, ends)
    return made


TEXT = f"""Which profile makes the pressure under a punch even? A rigid flat punch of the half-width
{HALF:g} mm carries {FORCE:g} N. Its pressure is infinite at the corners. On a mesh the pressure is
largest at the last contact. `contactopt.design` looks for the profile whose largest pressure is as
small as possible. The profile has one free height per contact, or it is a sum of six Legendre
polynomials. The mean pressure is the force over the face of the punch.

On a half-plane without friction the answer is known: it is the displacement under a uniform
pressure (Johnson 1985, section 2.5). For the block of finite elements, and with friction, the best
profile is not known.

{{designs}}
"""


if __name__ == "__main__":
    rows, kept = measure()
    figures = {"design": figure(kept)}
    if figures_alone():
        save_figures("design", figures)
    else:
        write("design", "The punch with an even pressure", TEXT, {"designs": rows}, figures)

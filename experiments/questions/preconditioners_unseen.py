"""Do the constants of `neumann`, fitted on a few bodies, hold on bodies that had no part in the
fit?
"""

from __future__ import annotations

from contextlib import ExitStack
from unittest.mock import patch

import numpy as np

from contactopt import InterfaceProblem, Material, Part, Scene, Support, reduce
from contactopt.meshes.structured import graded, rename, simplices, tensor_mesh
from contactopt.methods.preconditioners import deflated, preconditioner, smooth_motions
from experiments.questions.preconditioners import blocks, condition, iterations, solids
from experiments.report import write

RUBBER = Material(5.0, 0.3)
EVEN = np.linspace(-2.0, 2.0, 65)
ROOM = "contactopt.methods.preconditioners"
# The same numbers as a half-space and slowly varying meshes have them, without any fit.
UNFITTED = {f"{ROOM}.neumann": {"DISPERSION": 0.0}, f"{ROOM}.grid": {"CELL": 0.5, "EDGE": 0.0}}
CHOICES = ("none", "p21", "neumann, no constant fitted", "neumann")


def plane(
    line: np.ndarray = EVEN,
    height: float = 4.0,
    margin: float = 6.0,
    depth: float = 8.0,
    upper: Material = RUBBER,
    lower: Material = RUBBER,
    cut: bool = False,
    notch: bool = False,
    growth: float = 1.15,
) -> InterfaceProblem:
    """A block on a foundation, held on top and below, in contact along `line` [length].

    height  of the block;  margin, depth  of the foundation beside and below the contact;  cut  into
            triangles
    notch   the block is an L: its right half ends at a quarter of its height
    """
    h = float(np.diff(line).min())
    rise = graded(height, h, growth)
    block = rename(tensor_mesh(line, rise), contact="y-")
    if notch:
        middle = block.p[:, block.t].mean(axis=1)
        block = block.restrict(np.flatnonzero(~((middle[0] > 0) & (middle[1] > height / 4))))
        block = block.with_boundaries({"contact": lambda x: x[1] < 1e-9})
    block = block.with_boundaries({"top": lambda x: x[1] > height - 1e-9})
    out = graded(margin, h * growth, growth)[1:] if margin else np.zeros(0)
    across = np.concatenate([line[0] - out[::-1], line, line[-1] + out])
    ground = rename(tensor_mesh(across, -graded(depth, h, growth)[::-1]), bottom="y-")
    low, high = line[0], line[-1]
    ground = ground.with_boundaries(
        {"contact": lambda x: (x[1] > -1e-9) & (x[0] > low) & (x[0] < high)}
    )
    meshes = [simplices(mesh) if cut else mesh for mesh in (block, ground)]
    first = Part("block", meshes[0], upper, (Support("top"),))
    second = Part("ground", meshes[1], lower, (Support("bottom"),))
    return reduce(Scene("unseen", first, second, 0.5), Q="explicit")


def solid(
    sides: tuple[np.ndarray, np.ndarray],
    height: float,
    margin: float,
    upper: Material,
    lower: Material,
) -> InterfaceProblem:
    """The same in space: contact on the rectangle of two lines."""
    h = min(float(np.diff(side).min()) for side in sides)
    block = rename(tensor_mesh(*sides, graded(height, h, 1.4)), contact="z-", top="z+")
    out = graded(margin, 1.4 * h, 1.4)[1:]
    across = [np.concatenate([side[0] - out[::-1], side, side[-1] + out]) for side in sides]
    ground = rename(tensor_mesh(*across, -graded(2 * margin, h, 1.4)[::-1]), bottom="z-")
    x, y = sides
    ground = ground.with_boundaries(
        {
            "contact": lambda p: (
                (p[2] > -1e-9) & (p[0] > x[0]) & (p[0] < x[-1]) & (p[1] > y[0]) & (p[1] < y[-1])
            )
        }
    )
    first, second = (
        Part("block", block, upper, (Support("top"),)),
        Part("ground", ground, lower, (Support("bottom"),)),
    )
    return reduce(Scene("unseen", first, second, 0.5, kind="solid"), Q="explicit")


def towards_one_end(k: int, ratio: float) -> np.ndarray:
    """k places in [-2, 2], whose spacing grows from the left to the right by `ratio` in all."""
    steps = ratio ** (np.arange(k - 1) / (k - 2))
    return np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum() * 4 - 2


def jumps(k: int) -> np.ndarray:
    """k places in [-2, 2] whose spacing alternates between coarse and fine stretches, three times
    finer.
    """
    steps = np.where((np.arange(k - 1) // 8) % 2 == 0, 3.0, 1.0)
    return np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum() * 4 - 2


def in_the_plane() -> dict[str, InterfaceProblem]:
    soft, stiff = Material(1.0, 0.3), Material(10.0, 0.3)
    return {
        "fitted on: as high as wide, even": blocks(65, 5.0, 5.0, 0.3),
        "column, 8 times as high as wide": plane(height=32.0),
        "plate, an eighth as high as wide": plane(height=0.5),
        "thin layer below, a sixteenth of the width": plane(depth=0.25),
        "foundation as narrow as the block": plane(margin=0.0),
        "L-shaped block": plane(notch=True),
        "spacing 20 times smaller at one end": plane(towards_one_end(65, 20.0)),
        "spacing that jumps by 3 every 8 nodes": plane(jumps(65)),
        "triangles": plane(cut=True),
        "nu = 0 on nu = 0.4": plane(upper=Material(5.0, 0.0), lower=Material(5.0, 0.4)),
        "nu = 0.15": plane(upper=Material(5.0, 0.15), lower=Material(5.0, 0.15)),
        "10 times stiffer block": plane(upper=stiff, lower=soft),
        "10 times stiffer foundation": plane(upper=soft, lower=stiff),
    }


def in_space() -> dict[str, InterfaceProblem]:
    rubber, stiff, low = RUBBER, Material(50.0, 0.3), Material(5.0, 0.1)
    side = np.linspace(-2.0, 2.0, 11)
    return {
        "fitted on: as high as wide, even": solids(11, 5.0, 5.0),
        "rectangle 3 by 1, even cells": solid(
            (np.linspace(-3, 3, 19), np.linspace(-1, 1, 7)), 4.0, 4.0, rubber, rubber
        ),
        "cells 3 times as long as wide": solid(
            (np.linspace(-6, 6, 11), side), 4.0, 4.0, rubber, rubber
        ),
        "column, 4 times as high as wide": solid((side, side), 16.0, 4.0, rubber, rubber),
        "plate, an eighth as high as wide": solid((side, side), 0.5, 4.0, rubber, rubber),
        "spacing 6 times smaller at one end, both ways": solid(
            (towards_one_end(11, 6.0),) * 2, 4.0, 4.0, rubber, rubber
        ),
        "nu = 0.1 on nu = 0.3, 10 times as stiff": solid((side, side), 4.0, 4.0, low, stiff),
    }


def judge(name: str, problem: InterfaceProblem) -> dict[str, object]:
    """Condition numbers and PCG iterations on one pair of bodies; all with the smooth motions
    deflated, but for none.
    """
    row: dict[str, object] = {"bodies": name, "contacts": problem.contacts}
    Z = smooth_motions(problem)
    for choice in CHOICES:
        if choice == "none":
            P, number = None, float(np.linalg.cond(problem.Q))
        else:
            with ExitStack() as stack:
                for module, changes in UNFITTED.items() if choice.startswith("neumann,") else ():
                    stack.enter_context(patch.multiple(module, **changes))
                P = deflated(preconditioner(problem, choice.split(",")[0]), problem.Q, Z)
            number = condition(P, problem.Q)
        row[choice] = f"{number:.3g} ({iterations(P, problem.Q)})"
    return row


def worst(rows: list[dict[str, object]], choice: str) -> tuple[float, int]:
    """Largest condition number and most iterations over the bodies that had no part in the fit."""
    pairs = [str(row[choice]).rstrip(")").split(" (") for row in rows[1:]]
    return max(float(number) for number, _ in pairs), max(int(count) for _, count in pairs)


def helped(rows: list[dict[str, object]]) -> str:
    """How often the fitted constants give the smaller condition number."""
    pairs = [[float(str(row[choice]).split(" ")[0]) for choice in CHOICES[2:]] for row in rows[1:]]
    better = sum(fitted < free for free, fitted in pairs)
    return f"{better} of {len(pairs)}"


TEXT = """Does the preconditioner `neumann` also work on bodies that it was not fitted on? Its constants (`contactopt/methods/preconditioners/constants.py`)
were fitted on the bodies of [Preconditioners](../preconditioners.md). Here it meets bodies that had
no part in the fit. The entries are condition numbers, with the iterations of preconditioned
conjugate gradients from a random right-hand side to 1e-8 in brackets. Smooth motions are deflated
(solved for exactly), except in the column "none".

1. **In the plane** the worst of {plane_count} unseen pairs has condition {plane_worst} and takes {plane_steps} iterations; the pair
   that was fitted on takes {plane_fitted}. Without any fitted constant the worst is {plane_free}. The fit helps on {plane_helped}.
2. **In space** the worst of {space_count} unseen pairs has condition {space_worst} and takes {space_steps} iterations; the pair
   that was fitted on takes {space_fitted}. Without any fitted constant the worst is {space_free}. The fit helps on {space_helped}.
3. The worst pair is {plane_name} in the plane and {space_name} in space.

**In the plane**, 65 contacts:

{plane}

**In space**:

{space}

"neumann, no constant fitted" has DISPERSION = 0, CELL = 1/2 and EDGE = 0.
"""


def main() -> None:
    tables = {
        "plane": [judge(name, problem) for name, problem in in_the_plane().items()],
        "space": [judge(name, problem) for name, problem in in_space().items()],
    }
    facts: dict[str, object] = {}
    for key, rows in tables.items():
        number, count = worst(rows, "neumann")
        facts |= {
            f"{key}_count": len(rows) - 1,
            f"{key}_worst": f"{number:g}",
            f"{key}_steps": count,
            f"{key}_fitted": rows[0]["neumann"],
            f"{key}_free": f"{worst(rows, CHOICES[2])[0]:g}",
            f"{key}_helped": helped(rows),
            f"{key}_name": next(
                f'"{row["bodies"]}"'
                for row in rows[1:]
                if float(str(row["neumann"]).split(" ")[0]) == number
            ),
        }
    text = TEXT
    for key, value in facts.items():
        text = text.replace(f"{{{key}}}", str(value))
    write(
        "preconditioners_unseen",
        "The preconditioner `neumann` on bodies that it was not fitted on",
        text,
        tables,
        {},
    )


if __name__ == "__main__":
    main()

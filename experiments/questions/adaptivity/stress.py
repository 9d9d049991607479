"""Unknowns and time until a stress, or the peak pressure of a ball, stays within 1 %: refined
locally and everywhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from contactopt import Scene, analytic
from contactopt.accuracy import Estimate, refine
from contactopt.accuracy.marking import divisible, with_bent_edges
from contactopt.readings.quantities import find_quantity
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import Options, Solved, solve_scene
from experiments.questions.adaptivity.parts import STEEL, ball, bearing, bracket, pin_in_bush

BOUND = 0.01
# unknowns, value, processor seconds of the mesh alone, and with all before
Found = tuple[int, float, float, float]


@dataclass(frozen=True)
class Case:
    """make  (degree, divided) -> scene;   most  divisions of the whole mesh, by degree"""

    make: Callable[..., Scene]
    quantity: str
    most: dict[int, int]


CASES = {
    "bracket on a block": Case(bracket, "von_mises:bracket:fillet", {1: 5, 2: 4}),
    "pin in a bush": Case(pin_in_bush, "von_mises:bush", {1: 5, 2: 4}),
    "bearing from files": Case(bearing, "von_mises:bearing:fillet", {1: 5, 2: 4}),
}


def read(solved: Solved, quantity: str) -> float:
    """A quantity of a solved scene."""
    asked = find_quantity(quantity, solved.reduction.scene)
    return asked.read(solved.reduction, solved.solution).value


def locally(
    scene: Scene, quantity: str, accuracy: float, most: int
) -> tuple[list[Found], Estimate]:
    """The meshes of local refinement, with processor time, and the estimate."""
    begin, ends = time.process_time(), []
    options = Options(
        note=lambda text: (
            ends.append(time.process_time() - begin) if "estimated error" in text else None
        )
    )
    _, estimate = refine([scene], quantity, accuracy, options, Limits(most), adaptive=True)
    alone = [end - before for before, end in zip([0.0, *ends], ends)]
    return [
        (level.unknowns, level.value, *spent) for level, *spent in zip(estimate.levels, alone, ends)
    ], estimate


def everywhere(case: Case, degree: int, truth: float) -> list[Found]:
    """Meshes of smaller and smaller elements everywhere, until two in turn are within the bound;
    without the time of Gmsh.
    """
    found: list[Found] = []
    for divided in range(case.most[degree] + 1):
        scene = with_bent_edges(*divisible(case.make(degree, divided), True))
        begin = time.process_time()
        solved = solve_scene(scene)
        value = read(solved, case.quantity)
        alone = time.process_time() - begin
        found.append(
            (solved.reduction.dofs, value, alone, alone + (found[-1][3] if found else 0.0))
        )
        if len(found) > 1 and all(abs(value / truth - 1) <= BOUND for _, value, *_ in found[-2:]):
            break
    return found


def within(found: list[Found], truth: float) -> dict[str, Any]:
    """The first mesh from which on all errors are within the bound, or the last one if there is
    none.
    """
    good = [abs(value / truth - 1) <= BOUND for _, value, *_ in found]
    first = len(good) - (good[::-1].index(False) if False in good else len(good))
    unknowns, value, alone, whole = found[min(first, len(found) - 1)]
    more = "" if first < len(found) else "> "
    return {
        "unknowns": f"{more}{unknowns}",
        "its error": value / truth - 1,
        "seconds of this mesh": alone,
        "with all before": whole,
    }


def stress() -> list[dict[str, Any]]:
    """For every part and degree, unknowns and processor seconds until the error stays within 1 %."""
    return [row for name in CASES for row in one_part(name)]


def one_part(name: str) -> Iterator[dict[str, Any]]:
    """The rows of one part; the truth is the extrapolated value of a very fine mesh of quadratic
    elements.
    """
    case = CASES[name]
    fine = refine([case.make(2)], case.quantity, 1e-4, limits=Limits(80_000), adaptive=True)[1]
    truth = fine.extrapolated
    for degree in (1, 2):
        local, _ = locally(case.make(degree), case.quantity, BOUND / 5, 40_000)
        whole = everywhere(case, degree, truth)
        for refined, found in (("adaptive", local), ("everywhere", whole)):
            yield {
                "part": name,
                "quantity": case.quantity,
                "degree": degree,
                "refined": refined,
                **within(found, truth),
                "reference": truth,
                "its last change": abs(fine.levels[-1].value / fine.levels[-2].value - 1),
            }


def hertz3d() -> list[dict[str, Any]]:
    """The peak pressure of a ball on a block against Hertz's, tetrahedra refined locally and
    everywhere.
    """
    exact = analytic.hertz_point(7692.0, 20.0, analytic.contact_modulus(STEEL, STEEL))
    rows = []
    for degree, most in ((1, 30_000),):
        local, _ = locally(ball(degree), "pressure", 2e-3, most)
        case = Case(ball, "pressure", {1: 3})
        for refined, found in (
            ("adaptive", local),
            ("everywhere", everywhere(case, degree, exact.peak)),
        ):
            for unknowns, value, alone, whole in found:
                rows.append(
                    {
                        "refined": refined,
                        "degree": degree,
                        "unknowns": unknowns,
                        "error of the peak": value / exact.peak - 1,
                        "seconds of this mesh": alone,
                        "with all before": whole,
                    }
                )
    return rows

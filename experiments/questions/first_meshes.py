"""Does the answer depend on the first mesh, and is its claimed error true? Five parts by Gmsh, six
first meshes each.

    python -m experiments.questions.first_meshes [quick] [PART ...]

The meshes know neither where the parts touch nor their shape: curved boundaries are chords, or
edges of second order, without a `curve`. References are made in another way: Lame's formulas, a
half-plane without a mesh, or a mesh that Gmsh makes fine.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contactopt import (
    BodyForce,
    HalfSpace,
    InputError,
    Material,
    Part,
    Rigid,
    Scene,
    Support,
    Traction,
    load_mesh,
)
from contactopt.accuracy import refine
from contactopt.readings.quantities import find_quantity
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import solve_scene
from experiments.questions.adaptivity.parts import rounded, save
from experiments.report import write

STEEL = Material(210e3, 0.3)
TARGET, SECONDS = 0.02, 30.0  # accuracy asked for, and time for one search
SURE = 1e-3  # least relative error of a reference
EFFECTIVE = 0.5, 3.0


@dataclass(frozen=True)
class First:
    """A first mesh: size of the elements over that of the part, whether it is graded to the
    contact, order and degree.
    """

    size: float
    graded: bool
    order: int

    @property
    def name(self) -> str:
        return f"{'graded' if self.graded else 'even'} {self.size:g}, order {self.order}"


MESHES = [
    First(size, graded, order)
    for order in (1, 2)
    for size, graded in ((1.0, False), (0.5, False), (1.0, True))
]
FINE = First(0.5, True, 2)


class Mesher:
    """Meshes of one scene, all of one kind; a graded one is fine where `distance`, a formula in x
    and y, is small.
    """

    def __init__(self, first: First, size: float, distance: str, small: float):
        self.first, self.size, self.distance, self.small = first, size * first.size, distance, small

    def __call__(self, name: str, make: Callable[[Any], Any], side: Callable[..., str]) -> Any:
        import gmsh

        gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.option.setNumber("Mesh.MeshSizeMax", self.size)
            gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 20 / self.first.size)
            gmsh.option.setNumber("Mesh.ElementOrder", self.first.order)
            body = make(gmsh)
            gmsh.model.occ.synchronize()
            if self.first.graded:
                self._grade(gmsh)
            with TemporaryDirectory() as folder:
                return load_mesh(save(gmsh, Path(folder) / f"{name}.msh", body, side))
        finally:
            gmsh.finalize()

    def _grade(self, gmsh: Any) -> None:
        """Size as a function of the distance."""
        field = gmsh.model.mesh.field
        number = field.add("MathEval")
        field.setString(number, "F", f"min({self.size},{self.small}+0.3*({self.distance}))")
        field.setAsBackgroundMesh(number)


# from where flanks meet roundings
ENDS = "min(sqrt((x-5.73)^2+(y-0.27)^2),sqrt((x-8.77)^2+(y+2.77)^2))"


def dovetail(first: First, small: float = 0.3) -> Scene:
    """Half a blade that is pulled out of a slot; both ends of its flat flank are rounded, one on
    each body.
    """
    mesh = Mesher(first, 1.5, ENDS, small)

    def side(centre: np.ndarray, kind: str, length: float) -> str:
        x, y, _ = centre
        flank = abs(x + y - 6) < 0.6 and 4.4 < x < 11.5 and length > 0.1
        if flank and y < 5:
            return "contact"
        names = {"axis": abs(x) < 1e-6, "top": y > 5.99, "wall": abs(x - 14) < 1e-6}
        return next((name for name, there in names.items() if there), "free")

    blade = [(0, 6, 0), (4.5, 6, 0), (4.5, 1.5, 0.8), (9, -3, 0.8), (9, -6, 0), (0, -6, 0)]
    disc = [(5.5, 0.5, 0.8), (11, -5, 0), (14, -5, 0), (14, 4, 0), (5.5, 4, 0)]
    bodies = (
        Part("blade", mesh("blade", lambda g: rounded(g, blade), side), STEEL, (Support("axis", {"x": 0.0}),),
             (Traction("top", (0.0, 100.0)),)),
        Part("disc", mesh("disc", lambda g: rounded(g, disc), side), STEEL, (Support("wall"),)),
    )  # fmt: skip
    return Scene("dovetail", *bodies, 0.2, degree=first.order, copies=2)


def _round(
    first: First, pin: float, hole: float, outer: float, drop: float, small: float
) -> tuple[Any, Any]:
    """Meshes of a pin and of a ring around it."""
    mesh = Mesher(first, outer / 6, f"abs(sqrt(x^2+y^2)-{hole})", small)

    def side(centre: np.ndarray, kind: str, length: float) -> str:
        return "contact" if length < 2 * np.pi * (hole + outer) / 2 else "outer"

    def ring(gmsh: Any) -> Any:
        occ = gmsh.model.occ
        return occ.cut(
            [(2, occ.addDisk(0, 0, 0, outer, outer))], [(2, occ.addDisk(0, 0, 0, hole, hole))]
        )[0]

    disc = mesh("pin", lambda gmsh: [(2, gmsh.model.occ.addDisk(0, -drop, 0, pin, pin))], side)
    return disc, mesh("ring", ring, side)


def lug(first: First, small: float = 0.5) -> Scene:
    """A pin with some clearance in an eye, with friction."""
    pin, eye = _round(first, 9.95, 10.0, 20.0, 0.05, small)
    weight = BodyForce((0.0, -1500.0 / (np.pi * 9.95**2)))
    bodies = Part("pin", pin, STEEL, (), (weight,)), Part("lug", eye, STEEL, (Support("outer"),))
    return Scene("lug", *bodies, 0.3, degree=first.order)


def pin_in_bush(first: First, small: float = 0.5) -> Scene:
    """A pin with much clearance in a bush, with little friction."""
    pin, bush = _round(first, 19.8, 20.0, 45.0, 0.2, small)
    weight = BodyForce((0.0, -3000.0 / (np.pi * 19.8**2)))
    bodies = Part("pin", pin, STEEL, (), (weight,)), Part("bush", bush, STEEL, (Support("outer"),))
    return Scene("pin in a bush", *bodies, 0.1, degree=first.order)


INNER, JOINT, OUTER, OVER = 10.0, 20.0, 40.0, 0.01


def press_fit(first: First, small: float = 0.8) -> Scene:
    """A quarter of a tube in a hub, with interference."""
    mesh = Mesher(first, 5.0, f"abs(sqrt(x^2+y^2)-{JOINT})", small)

    def tube(inner: float, outer: float) -> Callable[[Any], Any]:
        def make(gmsh: Any) -> Any:
            occ = gmsh.model.occ
            ring = occ.cut(
                [(2, occ.addDisk(0, 0, 0, outer, outer))], [(2, occ.addDisk(0, 0, 0, inner, inner))]
            )[0]
            return occ.intersect(ring, [(2, occ.addRectangle(0, 0, 0, outer, outer))])[0]

        return make

    def side(names: tuple[str, str], middle: float) -> Callable[..., str]:
        def name(centre: np.ndarray, kind: str, length: float) -> str:
            x, y, _ = centre
            if min(abs(x), abs(y)) < 1e-6:
                return "x" if abs(x) < 1e-6 else "y"
            return names[int(length > middle)]

        return name

    held = Support("x", {"x": 0.0}), Support("y", {"y": 0.0})
    shaft = mesh(
        "shaft",
        tube(INNER, JOINT + OVER),
        side(("bore", "contact"), np.pi / 2 * (INNER + JOINT) / 2),
    )
    hub = mesh(
        "hub", tube(JOINT, OUTER), side(("contact", "outer"), np.pi / 2 * (JOINT + OUTER) / 2)
    )
    bodies = Part("shaft", shaft, STEEL, held), Part("hub", hub, STEEL, held)
    return Scene("press fit", *bodies, 0.0, law="frictionless", copies=4, degree=first.order)


def lame() -> dict[str, float]:
    """Pressure in the joint and the von Mises stress at the bore, in plane strain."""
    E, nu = STEEL.E / (1 - STEEL.nu**2), STEEL.nu / (1 - STEEL.nu)
    hub = JOINT / E * ((OUTER**2 + JOINT**2) / (OUTER**2 - JOINT**2) + nu)
    shaft = JOINT / E * ((JOINT**2 + INNER**2) / (JOINT**2 - INNER**2) - nu)
    pressure = OVER / (hub + shaft)
    hoop = 2 * pressure * JOINT**2 / (JOINT**2 - INNER**2)
    return {
        "pressure": pressure,
        "von_mises:shaft:bore": hoop * np.sqrt(1 - STEEL.nu + STEEL.nu**2),
    }


FLAT, ROUNDING, FORCE = 1.0, 10.0, 20e3


def profile(x: np.ndarray) -> np.ndarray:
    """The gap under a flat punch with rounded edges."""
    return np.asarray(np.maximum(np.abs(x[0]) - FLAT, 0) ** 2 / (2 * ROUNDING))


def punch(first: First, small: float = 0.2) -> Scene:
    """A rigid flat-and-rounded punch on a block that is large beside the contact."""
    mesh = Mesher(first, 12.0, "sqrt(x^2+y^2)", small)
    sides = {0.0: "contact", -80.0: "bottom"}
    block = mesh(
        "block", lambda g: [(2, g.model.occ.addRectangle(-80, -80, 0, 160, 80))],
        lambda centre, kind, length: sides.get(round(centre[1], 6), "side"),
    )  # fmt: skip
    body = Part("block", block, STEEL, (Support("bottom"),))
    tool = Rigid("punch", (0.0, 1.0), profile, force={"y": -FORCE})
    return Scene("flat-and-rounded", tool, body, 0.0, law="frictionless", degree=first.order)


def half_plane() -> dict[str, float]:
    """The largest pressure under the punch on a half-plane, from 8,192 points."""
    x = (np.arange(8192) + 0.5) / 8192 * 4 - 2
    plane = HalfSpace("plane", STEEL, x, depth=80.0)
    tool = Rigid("punch", (0.0, 1.0), profile, force={"y": -FORCE})
    return values(Scene("half-plane", tool, plane, 0.0, law="frictionless"), ("pressure",))


def values(scene: Scene, quantities: tuple[str, ...]) -> dict[str, float]:
    """Quantities of a scene on its own mesh."""
    solved = solve_scene(scene)
    return {
        name: find_quantity(name, scene).read(solved.reduction, solved.solution).value
        for name in quantities
    }


@dataclass(frozen=True)
class Case:
    """make  (first mesh, size at the contact) -> scene;   exact  quantities known in another way;
    small  for references
    """

    make: Callable[..., Scene]
    quantities: tuple[str, ...]
    small: float
    exact: Callable[[], dict[str, float]] | None = None

    def reference(self) -> tuple[dict[str, float], dict[str, float]]:
        """The references, and their relative errors: that of a mesh is by how much one twice as
        coarse differs.
        """
        if self.exact is not None:
            return self.exact(), dict.fromkeys(self.quantities, SURE)
        coarse, fine = (
            values(self.make(FINE, factor * self.small), self.quantities) for factor in (2, 1)
        )
        return fine, {
            name: max(abs(coarse[name] / fine[name] - 1), SURE) for name in self.quantities
        }


CASES = {
    "dovetail": Case(dovetail, ("pressure", "energy"), 0.0005),
    "lug": Case(lug, ("pressure", "energy", "von_mises:lug:contact"), 0.24),
    "press fit": Case(press_fit, ("pressure", "von_mises:shaft:bore"), 0.5, lame),
    "flat-and-rounded": Case(punch, ("pressure",), 0.01, half_plane),
    "pin in a bush": Case(pin_in_bush, ("pressure", "energy"), 0.4),
}


def rows_of(name: str, meshes: list[First], modes: tuple[bool, ...]) -> list[dict[str, Any]]:
    """All searches of one part."""
    case, rows = CASES[name], []
    truth, slacks = case.reference()
    for first in meshes:
        for quantity in case.quantities:
            slack = slacks[quantity]
            for adaptive in modes:
                begin = time.process_time()
                row = {"part": name, "quantity": quantity, "first mesh": first.name,
                       "refined": "locally" if adaptive else "everywhere"}  # fmt: skip
                try:
                    scene = case.make(first)
                    _, found = refine(
                        [scene], quantity, TARGET, limits=Limits(seconds=SECONDS), adaptive=adaptive
                    )
                except InputError as error:
                    rows.append(row | {"said": str(error)[:60]})
                    print(rows[-1], flush=True)
                    continue
                true = abs(found.value / truth[quantity] - 1)
                claim = np.inf if found.error is None else found.error
                rows.append(
                    row | {
                        "value": found.value, "reference": truth[quantity], "true error": true, "of the reference": slack,
                        "claimed": claim,
                        "geometry": found.geometry_error, "reached": found.reached,
                        "within": bool(true <= claim + slack),
                        "effectivity": claim / max(true, slack),
                        "unknowns": found.levels[-1].unknowns, "seconds": time.process_time() - begin, "said": "",
                    }
                )  # fmt: skip
                print(
                    {key: f"{x:.4g}" if isinstance(x, float) else x for key, x in rows[-1].items()},
                    flush=True,
                )
    return rows


def main(arguments: list[str]) -> None:
    quick = "quick" in arguments
    chosen = [name for name in arguments if name in CASES] or list(CASES)
    meshes = MESHES[::3] if quick else MESHES
    rows = [
        row for name in chosen for row in rows_of(name, meshes, (True,) if quick else (True, False))
    ]
    done = [row for row in rows if "value" in row]
    reached = [row for row in done if row["reached"]]
    # smaller errors are luck, or the reference's
    sized = [row for row in reached if row["true error"] > TARGET / 20]
    good = sum(EFFECTIVE[0] <= row["effectivity"] <= EFFECTIVE[1] for row in sized)
    missed = [
        f"{row['part']}, {row['quantity']}, {row['first mesh']}"
        for row in done
        if not row["within"]
    ]
    refused = [
        f"{row['part']}, {row['quantity']}, {row['first mesh']}: {row['said']}"
        for row in rows
        if row["said"]
    ]
    text = f"""{sum(row["within"] for row in done)} of {len(rows)} searches give an answer that agrees with the reference within their
claimed error. {len(reached)} of them reached the target, {sum(row["within"] for row in reached)} of
these agree. The effectivity, the claimed error over the true one, lies between {EFFECTIVE[0]} and
{EFFECTIVE[1]} for {good} of {len(sized)} searches that reached the target with a true error above
{TARGET / 20:g}. Smaller true errors are luck, or those of the reference.

Outside their claims are: {"; ".join(missed) or "none"}. No answer came from:
{"; ".join(refused) or "none"}.

The pressure of the dovetail has no limit in the linearised model. Where the flank meets the
rounding, the curvature of the surface jumps. The normals there turn, and a blade that slides by u
closes the gap by u times their angle. So the gap has a kink. For a jump k of the curvature the
pressure there grows by E* k u ln 2 / (2 pi) with every halving of the elements once they are
smaller than about u. Searches that go so far say that no mesh bounds it. Their claim is then
infinite, and counts as agreeing. The reference of the dovetail, whose elements are about as large
as u there, does not show this.

Each search asked for {TARGET:g} within {SECONDS:g}
s{", of two first meshes (`quick`)" if quick else ""}. The meshes know neither where the parts touch
nor their shape. A reference is Lame's formula, a half-plane of 8,192 points, or a mesh that Gmsh
makes fine; its error is then its difference from one that is twice as coarse.

{{searches}}
"""
    head = list(max(rows, key=len))
    write(
        "first_meshes",
        "First meshes",
        text,
        {"searches": [{key: row.get(key, "") for key in head} for row in rows]},
        {},
    )


if __name__ == "__main__":
    main(sys.argv[1:])

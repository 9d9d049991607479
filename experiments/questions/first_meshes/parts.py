"""Parts meshed by Gmsh, which knows neither where they touch nor their shape.

Lengths are in mm, forces in N, stresses in MPa.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contactopt import (
    BodyForce,
    HalfSpace,
    Material,
    Part,
    Rigid,
    Scene,
    Support,
    Traction,
    load_mesh,
)

STEEL = Material(210e3, 0.3)


@dataclass(frozen=True)
class First:
    """A first mesh: size over that of the part, graded to the contact or not, order."""

    size: float
    graded: bool
    order: int

    @property
    def name(self) -> str:
        return f"{'graded' if self.graded else 'even'} {self.size:g}, order {self.order}"


def save(gmsh: Any, file: Path, body: list[tuple[int, int]], side: Callable[..., str]) -> Path:
    """Mesh a body and write it; `side` names boundaries by centre, kind of curve, and length."""
    gmsh.model.occ.synchronize()
    dim = body[0][0]
    gmsh.model.addPhysicalGroup(dim, [tag for _, tag in body], name=file.stem)
    sides: dict[str, list[int]] = {}
    for _, face in gmsh.model.getBoundary(body, oriented=False):
        centre = np.array(gmsh.model.occ.getCenterOfMass(dim - 1, face))
        name = side(
            centre, gmsh.model.getType(dim - 1, face), gmsh.model.occ.getMass(dim - 1, face)
        )
        sides.setdefault(name, []).append(face)
    for name, faces in sides.items():
        gmsh.model.addPhysicalGroup(dim - 1, faces, name=name)
    gmsh.model.mesh.generate(dim)
    gmsh.write(str(file))
    gmsh.clear()
    return file


def rounded(gmsh: Any, corners: list[tuple[float, float, float]]) -> list[tuple[int, int]]:
    """The surface inside a polygon with corners (x, y, radius), rounded unless the radius is 0."""
    occ = gmsh.model.occ
    ends = []
    for i, (x, y, radius) in enumerate(corners):
        here = np.array([x, y])
        before, after = (np.array(corners[j % len(corners)][:2]) - here for j in (i - 1, i + 1))
        a, b = before / np.linalg.norm(before), after / np.linalg.norm(after)
        if radius == 0:
            point = occ.addPoint(x, y, 0)
            ends.append((point, point, None))
            continue
        half = np.arccos(np.clip(a @ b, -1, 1)) / 2
        reach, away = radius / np.tan(half), radius / np.sin(half)
        middle = here + away * (a + b) / np.linalg.norm(a + b)
        ends.append(
            (occ.addPoint(*(here + reach * a), 0), occ.addPoint(*(here + reach * b), 0), middle)
        )
    curves = []
    for (first, last, middle), (following, _, _) in zip(ends, ends[1:] + ends[:1]):
        if middle is not None:
            curves.append(occ.addCircleArc(first, occ.addPoint(*middle, 0), last))
        curves.append(occ.addLine(last, following))
    return [(2, occ.addPlaneSurface([occ.addCurveLoop(curves)]))]


class Mesher:
    """Meshes of one scene; a graded one is fine where `distance`, a formula, is small."""

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
    """Half a blade that is pulled out of a slot; both ends of its flat flank are rounded."""
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
        Part(
            "blade",
            mesh("blade", lambda g: rounded(g, blade), side),
            STEEL,
            (Support("axis", {"x": 0.0}),),
            (Traction("top", (0.0, 100.0)),),
        ),
        Part("disc", mesh("disc", lambda g: rounded(g, disc), side), STEEL, (Support("wall"),)),
    )
    return Scene("dovetail", *bodies, 0.2, degree=first.order, copies=2)


def _round(
    first: First, pin: float, hole: float, outer: float, drop: float, small: float, ends: str = ""
) -> tuple[Any, Any]:
    """Meshes of a pin and of a ring around it, a FINER-th as large at the distance 0 from `ends`, a
    formula.
    """
    distance = f"abs(sqrt(x^2+y^2)-{hole})"
    if ends:
        distance = f"min({distance},{ends}-{(small - small / FINER) / 0.3})"
    mesh = Mesher(first, outer / 6, distance, small)

    def side(centre: np.ndarray, kind: str, length: float) -> str:
        return "contact" if length < 2 * np.pi * (hole + outer) / 2 else "outer"

    def ring(gmsh: Any) -> Any:
        occ = gmsh.model.occ
        return occ.cut(
            [(2, occ.addDisk(0, 0, 0, outer, outer))], [(2, occ.addDisk(0, 0, 0, hole, hole))]
        )[0]

    disc = mesh("pin", lambda gmsh: [(2, gmsh.model.occ.addDisk(0, -drop, 0, pin, pin))], side)
    return disc, mesh("ring", ring, side)


FINER = 60
ENDS_OF_CONTACT = "sqrt((abs(x)-4.793)^2+(y+8.777)^2)"  # of the lug


def lug(first: First, small: float = 0.5, ends: bool = False) -> Scene:
    """A pin with some clearance in an eye, with friction; with `ends` meshes are finer at the ends
    of the contact, where the stress is largest.
    """
    pin, eye = _round(first, 9.95, 10.0, 20.0, 0.05, small, ENDS_OF_CONTACT if ends else "")
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


def half_plane() -> Scene:
    """The punch on a half-plane, of 8,192 points."""
    x = (np.arange(8192) + 0.5) / 8192 * 4 - 2
    plane = HalfSpace("plane", STEEL, x, depth=80.0)
    tool = Rigid("punch", (0.0, 1.0), profile, force={"y": -FORCE})
    return Scene("half-plane", tool, plane, 0.0, law="frictionless")

"""Machine parts meshed by Gmsh, which knows nothing of where they touch: a bracket, a pin in a
bush, a bearing, a ball.

Lengths are in mm, forces in N, stresses in MPa. `size` is that of the elements, `divided` how often
each is cut in 2^dim.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contactopt import BodyForce, Material, Part, Plate, Scene, Support, Traction, load_mesh
from contactopt.scenes.scene_files import read_scene_file

STEEL = Material(210e3, 0.3)
ROUND = 5  # elements on a quarter of a circle, at least
BEARING = """\
name = "a bearing from three mesh files"
units = {{ length = "mm", stress = "MPa" }}
degree = {degree}
[bodies.pin]
mesh = "pin.msh"
material = {{ E = 210e3, nu = 0.3 }}
contact = "rim"
curve = {{ radius = 12, centre = {{ x = 0, y = 49.95 }} }}
body_force = {{ y = -4.0, x = 0.8 }}
[bodies.bearing]
mesh = "bearing.msh"
material = {{ E = 110e3, nu = 0.34 }}
contact = "hole"
curve = {{ radius = 12.05, centre = {{ x = 0, y = 50 }} }}
[bodies.ground]
mesh = "ground.msh"
material = {{ E = 70e3, nu = 0.33 }}
contact = "top"
supports = [{{ boundary = "bottom" }}]
[[contacts]]
upper = "pin"
lower = "bearing"
mu = 0.15
[[contacts]]
upper = "bearing:base"
lower = "ground"
mu = 0.3
"""


@contextmanager
def gmsh_model(size: float, divided: int) -> Iterator[Any]:
    """A model of Gmsh, whose mesh is made of elements of one size, but for arcs; `divided` times
    each is then cut.
    """
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size / 2**divided)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 4 * ROUND * 2**divided)
        yield gmsh
    finally:
        gmsh.finalize()


def save(gmsh: Any, file: Path, body: list[tuple[int, int]], side: Callable[..., str]) -> Path:
    """Mesh a body and write it, with its boundaries named by a function of their centre, kind of
    curve, and length or area.
    """
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
    """The surface inside a polygon whose corners (x, y, radius) are rounded where the radius is not
    zero.
    """
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


def bracket(degree: int = 1, divided: int = 0, size: float = 8.0) -> Scene:
    """An L-shaped bracket with a fillet of 4 mm, held on a block by a bolt, pulled at the end of
    its upright leg.
    """

    def side(centre: np.ndarray, kind: str, length: float) -> str:
        x, y, _ = centre
        if kind in ("Circle", "Ellipse"):
            return "fillet"
        return {0.0: "foot", 80.0: "end"}.get(
            round(y, 6), "bolt" if abs(y - 12) < 1e-6 and 35 < x < 50 else "side"
        )

    with TemporaryDirectory() as name, gmsh_model(size, divided) as gmsh:
        outline = [
            (0, 0, 0),
            (70, 0, 0),
            (70, 12, 0),
            (50, 12, 0),
            (35, 12, 0),
            (12, 12, 4),
            (12, 80, 0),
            (0, 80, 0),
        ]
        upper = load_mesh(save(gmsh, Path(name) / "bracket.msh", rounded(gmsh, outline), side))
        ground = [(2, gmsh.model.occ.addRectangle(-20, -40, 0, 110, 40))]
        sides = {0.0: "top", -40.0: "bottom"}
        lower = load_mesh(
            save(
                gmsh,
                Path(name) / "block.msh",
                ground,
                lambda centre, kind, length: sides.get(round(centre[1], 6), "side"),
            )
        )
    bolt, pull = Plate("bolt", {"y": -3000.0}), Traction("end", (-4.0, 0.0))
    held = (Support("bottom"),)
    bodies = (
        Part("bracket", upper, STEEL, (), (bolt, pull), "foot"),
        Part("block", lower, STEEL, held, (), "top"),
    )
    return Scene("bracket on a block", *bodies, 0.3, degree=degree, units=("mm", "MPa"))


def circle(*sphere: float) -> Callable[[np.ndarray], np.ndarray]:
    """The function that puts points on the circle or sphere of a centre and a radius."""
    middle, radius = np.array(sphere[:-1])[:, None], sphere[-1]
    return lambda x: middle + radius * (x - middle) / np.linalg.norm(x - middle, axis=0)


def pin_in_bush(degree: int = 1, divided: int = 0, size: float = 6.0) -> Scene:
    """A steel pin of 19.9 mm in a bush with a hole of 20 mm, clamped at its outside of 45 mm,
    pressed down.
    """
    with TemporaryDirectory() as name, gmsh_model(size, divided) as gmsh:
        occ = gmsh.model.occ
        disc = [(2, occ.addDisk(0, -0.1, 0, 19.9, 19.9))]
        pin = load_mesh(
            save(gmsh, Path(name) / "pin.msh", disc, lambda centre, kind, length: "rim")
        )
        ring, _ = occ.cut([(2, occ.addDisk(0, 0, 0, 45, 45))], [(2, occ.addDisk(0, 0, 0, 20, 20))])
        bush = load_mesh(
            save(
                gmsh,
                Path(name) / "bush.msh",
                ring,
                lambda centre, kind, length: "hole" if length < 200 else "outside",
            )
        )
    force = BodyForce((0.0, -3000.0 / (np.pi * 19.9**2)))
    bodies = (
        Part("pin", pin, STEEL, (), (force,), "rim", circle(0.0, -0.1, 19.9)),
        Part("bush", bush, STEEL, (Support("outside"),), (), "hole", circle(0.0, 0.0, 20.0)),
    )
    return Scene("pin in a bush", *bodies, 0.2, degree=degree, units=("mm", "MPa"))


def bearing(degree: int = 1, divided: int = 0, size: float = 8.0) -> Scene:
    """A bearing with two shoulder fillets of 5 mm that stands on the ground and carries a pin, from
    a scene file.
    """

    def side(centre: np.ndarray, kind: str, length: float) -> str:
        x, y, _ = centre
        if kind not in ("Circle", "Ellipse"):
            return "base" if abs(y) < 1e-6 else "side"
        return "hole" if abs(x) < 1e-6 and abs(y - 50) < 1 else "fillet" if y < 30 else "head"

    with TemporaryDirectory() as name, gmsh_model(size, divided) as gmsh:
        occ, folder = gmsh.model.occ, Path(name)
        outline = [
            (-45, 0, 0),
            (45, 0, 0),
            (45, 12, 0),
            (20, 12, 5),
            (20, 72, 8),
            (-20, 72, 8),
            (-20, 12, 5),
            (-45, 12, 0),
        ]
        body, _ = occ.cut(rounded(gmsh, outline), [(2, occ.addDisk(0, 50, 0, 12.05, 12.05))])
        save(gmsh, folder / "bearing.msh", body, side)
        disc = [(2, occ.addDisk(0, 49.95, 0, 12, 12))]
        save(gmsh, folder / "pin.msh", disc, lambda centre, kind, length: "rim")
        ground = [(2, occ.addRectangle(-70, -50, 0, 140, 50))]
        sides = {0.0: "top", -50.0: "bottom"}
        save(
            gmsh,
            folder / "ground.msh",
            ground,
            lambda centre, kind, length: sides.get(round(centre[1], 6), "side"),
        )
        (folder / "bearing.toml").write_text(BEARING.format(degree=degree))
        return read_scene_file(folder / "bearing.toml").states[0]


def ball(degree: int = 1, divided: int = 0, size: float = 7.0, force: float = 7692.0) -> Scene:
    """A steel ball of radius 20 on a steel block 60 x 60 x 30, a quarter of both by symmetry,
    tetrahedra of one size.
    """

    def side(centre: np.ndarray, kind: str, length: float) -> str:
        x, y, z = np.round(centre, 6)
        planes = {
            "x": x == 0,
            "y": y == 0,
            "top": z in (0.0, 20.0) and kind == "Plane",
            "bottom": z == -30.0,
        }
        return next(
            (name for name, there in planes.items() if there),
            "sphere" if kind == "Sphere" else "side",
        )

    with TemporaryDirectory() as name, gmsh_model(size, divided) as gmsh:
        occ = gmsh.model.occ
        whole = [(3, occ.addSphere(0, 0, 20, 20))]
        upper, _ = occ.intersect(whole, [(3, occ.addBox(0, 0, 0, 20, 20, 20))])
        sphere = load_mesh(save(gmsh, Path(name) / "ball.msh", upper, side))
        block = load_mesh(
            save(gmsh, Path(name) / "block.msh", [(3, occ.addBox(0, 0, -30, 30, 30, 30))], side)
        )
    planes = (Support("x", {"x": 0.0}), Support("y", {"y": 0.0}))
    bodies = (
        Part(
            "ball",
            sphere,
            STEEL,
            planes,
            (Plate("top", {"z": -force}, glued=False),),
            "sphere",
            circle(0.0, 0.0, 20.0, 20.0),
        ),
        Part("block", block, STEEL, (*planes, Support("bottom")), (), "top"),
    )
    return Scene(
        "ball on a block",
        *bodies,
        0.0,
        kind="solid",
        copies=4,
        law="frictionless",
        degree=degree,
        units=("mm", "MPa"),
    )

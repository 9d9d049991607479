"""Triangles of Gmsh within an outline."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from contactopt import load_mesh

# a corner of an outline, the size of triangles there, the name of the next side
Corner = tuple[float, float, float, str]


def outlined(loop: list[Corner], order: int = 1, arcs: bool = False) -> Any:
    """A mesh read from a file of Gmsh; `arcs`: sides are of circles about the origin, but for those
    whose name begins with "straight".
    """
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        geo, groups = gmsh.model.geo, dict[str, list[int]]()
        middle = geo.addPoint(0, 0, 0) if arcs else 0
        points = [geo.addPoint(x, y, 0, size) for x, y, size, _ in loop]
        for i, (*_, name) in enumerate(loop):
            start, end = points[i], points[(i + 1) % len(loop)]
            bent = arcs and not name.startswith("straight")
            side = geo.addCircleArc(start, middle, end) if bent else geo.addLine(start, end)
            groups.setdefault(name, []).append(side)
        around = sorted(tag for tags in groups.values() for tag in tags)
        geo.addPlaneSurface([geo.addCurveLoop(around)], 1)
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="body")
        for name, tags in groups.items():
            gmsh.model.addPhysicalGroup(1, tags, name=name)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        with TemporaryDirectory() as folder:
            gmsh.write(f"{folder}/body.msh")
            return load_mesh(Path(folder) / "body.msh")
    finally:
        gmsh.finalize()

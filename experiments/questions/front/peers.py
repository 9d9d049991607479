"""Other codes on Hertz's contacts: the nodes and elements, or the points of Tamaas, are ours.

A rigid indenter is pressed into the graded block by the depth that our solution has. Each code says
which pressure it finds at the nodes of the block. The force that this pressure makes is the one to
which its peak and its half-width are compared, so that a slightly different depth is no error.
Some codes follow the displaced surfaces, in which Hertz's theory is the limit of small strains. The
indenter is therefore FLATTER times flatter than ours, and pressed FLATTER times less deep: then all
displacements and pressures of the linear theory are smaller by that factor, and nothing else
changes. Where a code needs a mesh of the indenter, its faces are REFINED times finer than those of
the block.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import Contact, Material, Part, Scene, Support, reduce_bodies
from contactopt.analytic import contact_modulus
from contactopt.bodies.calculix_deck import deck
from contactopt.errors import InputError
from contactopt.meshes.structured import tensor_mesh
from contactopt.solving.solve_scene import Options
from contactopt.solving.zone import solve_zone
from experiments.questions.accuracy.half_space import MATERIAL, indenter
from experiments.questions.calculix import run
from experiments.questions.front.bodies import LARGE, MARGIN, half_space, point

FLATTER = 100.0
REFINED = 4  # faces of the indenter over one of the block
STIFF = 1e5  # modulus of CalculiX's indenter over that of the block
LIMIT = 120.0  # s of wall time for one run
HERE = Path(__file__).parent
POINTS = (4, 8, 16, 32)  # of Tamaas, across the half-width of contact
# what a Python that has Tamaas runs: the file that is given, and that of the answer
TAMAAS = """
import sys, time, numpy as np, tamaas as tm
data = np.load(sys.argv[1])
gap, length, modulus = data["gap"], float(data["length"]), float(data["modulus"])
model = tm.Model(tm.model_type.basic_2d, [length, length], list(gap.shape))
model.E, model.nu = modulus, 0.0
kind = tm.PolonskyKeerRey.pressure
solver = tm.PolonskyKeerRey(model, gap.max() - gap, 1e-9, kind, kind)
tm.ModelFactory.registerNonPeriodic(model, "dcfft")
solver.setIntegralOperator("dcfft")
solver.max_iter = 5000
start = time.process_time()
solver.solve(float(data["pressure"]))
np.savez(sys.argv[2], seconds=time.process_time() - start, pressure=np.array(model.traction))
"""


class Model:
    """The block and the indenter of one size.

    block     mesh, and its nodes on the contact boundary, the axis of symmetry and the bottom
    depth     of the indenter [mm]
    radius    of the parabola y = x^2 / (2 radius) [mm]
    """

    def __init__(self, elements: int, size: float):
        self.scene = indenter("plane-strain", size, elements)
        solved = solve_zone(self.scene, options=Options(tol=1e-9))
        mesh = solved.reduction.bodies[1].body.basis.mesh  # type: ignore[attr-defined]
        self.block = mesh
        self.depth = abs(float(solved.solution.multipliers[0])) / FLATTER
        self.nodes = {name: np.unique(mesh.facets[:, mesh.boundaries[name]])
                      for name in ("contact", "axis", "bottom")}  # fmt: skip
        self.nodes["contact"] = self.nodes["contact"][np.argsort(mesh.p[0, self.nodes["contact"]])]
        self.x = mesh.p[0, self.nodes["contact"]]
        self.radius = FLATTER / 2 / float(self.scene.upper.gap(np.array([[1.0], [0.0]]))[0])  # type: ignore[operator]

    @property
    def indenter(self) -> skfem.MeshQuad:
        """One layer of elements whose lower face is the parabola at each of its nodes."""
        flat = np.linspace(0.0, 1.02 * self.x[-1], REFINED * len(self.x) + 1)
        mesh = tensor_mesh(flat, np.array([0.0, self.x[-1]]))
        p = mesh.p.copy()
        tip = p[1] == 0
        p[1, tip] = p[0, tip] ** 2 / (2 * self.radius)
        return skfem.MeshQuad(p, mesh.t)


def calculix(model: Model) -> tuple[np.ndarray, float]:
    """Pressure at the nodes of the contact boundary, and CPU seconds of ccx.

    The deck is that of `contactopt export`. The pressure is made of nodal forces, which are the
    stiffness times the displacements that ccx prints.
    """
    if shutil.which("ccx") is None:
        raise InputError("ccx is not installed: apt-get install calculix-ccx.")
    top = model.x[-1]
    on = {"contact": lambda x: (x[1] == 0) & (x[0] < top), "axis": lambda x: x[0] == 0}
    tip = model.indenter.with_boundaries(
        {"tip": lambda x: x[1] < top / 2, "top": lambda x: x[1] == top}
    )
    block = model.block.with_boundaries(on | {"bottom": lambda x: x[1] == model.block.p[1].min()})
    stiff = Material(STIFF * MATERIAL.E, 0.0)
    bodies = (
        Part("indenter", tip, stiff, (Support("top", {"x": 0.0, "y": -model.depth}),),
             contact="tip"),
        Part("block", block, MATERIAL, (Support("axis", {"x": 0.0}), Support("bottom")),
             contact="contact"),
    )  # fmt: skip
    pair = Contact("indenter", "block", 0.0, carrier="lower")
    scene = Scene("hertz", bodies=bodies, contacts=(pair,), kind="plane-strain", copies=2)
    printed, _, seconds = run(deck(scene))
    if not len(printed):
        raise RuntimeError("ccx did not carry the whole load")
    first = tip.p.shape[1]
    u = printed[first : first + block.p.shape[1], :2].T
    basis = skfem.Basis(block, skfem.ElementVector(skfem.ElementQuad1()))
    K = linear_elasticity(*lame_parameters(MATERIAL.E, MATERIAL.nu)).assemble(basis)
    moved = np.zeros(basis.N)
    moved[basis.nodal_dofs] = u
    force = -(K @ moved)[basis.nodal_dofs[1, model.nodes["contact"]]]
    share = np.convolve(np.diff(model.x), [0.5, 0.5])
    return force / share, seconds


def in_python(variable: str, usual: str, code: list[str], given: dict[str, Any]) -> Any:
    """What a program writes in a Python of its own, named by an environment variable."""
    python = os.environ.get(variable, usual)
    with tempfile.TemporaryDirectory() as name:
        np.savez(Path(name) / "given.npz", **given)
        command = [python, *code, "given.npz", "answer.npz"]
        done = subprocess.run(command, cwd=name, timeout=LIMIT, capture_output=True, text=True)
        answer = Path(name) / "answer.npz"
        if not answer.exists():
            last = "".join((done.stderr or done.stdout).strip().splitlines()[-1:])
            raise RuntimeError(f"{variable} names no Python that does it: {last}")
        return dict(np.load(answer))


def getfem(model: Model) -> tuple[np.ndarray, float]:
    """Pressure at the nodes of the contact boundary, and CPU seconds of GetFEM."""
    tip = model.indenter
    given = {"p": model.block.p, "t": model.block.t, "indenter": tip.p, "cells": tip.t,
             "tip": np.flatnonzero(tip.p[1] < model.x[-1] / 2), "depth": model.depth,
             "radius": model.radius, "E": MATERIAL.E, "nu": MATERIAL.nu}  # fmt: skip
    script = [str(HERE / "getfem_hertz.py")]
    found = in_python("GETFEM", "/usr/bin/python3", script, given | model.nodes)
    return found["pressure"], float(found["seconds"])


def round_contact(distance: np.ndarray, pressure: np.ndarray, a: float) -> dict[str, float]:
    """Peak and half-width of p^2 = p0^2 (1 - r^2 / a^2), fitted inside and near the edge of about
    a; nan where too few points say it.
    """
    inner, edge = distance < 0.5 * a, (distance > 0.5 * a) & (distance < 0.95 * a)
    degree, width = min(2, int(inner.sum()) - 1), np.nan
    top = np.polyfit(distance[inner] ** 2, pressure[inner] ** 2, degree)[-1]
    if edge.sum() > 2:
        slope, at = np.polyfit(distance[edge] ** 2, pressure[edge] ** 2, 1)
        width = float(np.sqrt(-at / slope))
    return {"peak": float(np.sqrt(top)), "width": width}


def hertz_line(code: str, elements: int, size: float) -> dict[str, float]:
    """Seconds, and errors of the peak pressure and of the half-width."""
    model = Model(elements, size)
    pressure, seconds = (calculix if code == "CalculiX" else getfem)(model)
    pressure = FLATTER * pressure
    load = 2 * float(np.trapezoid(pressure, model.x))
    exact = model.scene.reference
    share = np.sqrt(load / abs(float(model.scene.upper.force["y"])))
    found = round_contact(model.x, pressure, exact.half_width * share)
    peak, width = exact.peak * share, exact.half_width * share
    return {"cpu": seconds, "peak": found["peak"] / peak - 1, "width": found["width"] / width - 1}


def hertz_point(points: int) -> dict[str, float]:
    """The same of Tamaas, on the points of our half-space."""
    known = point()
    problem = reduce_bodies(half_space(known), elements=points).problem
    places, a = problem.chart.places, known.exact.half_width
    side = 2 * int(np.ceil(MARGIN * points)) * a / points
    count = round(np.sqrt(problem.contacts))
    given = {"gap": known.profile(places).reshape(count, count), "length": side}
    given |= {"pressure": known.force / side**2, "modulus": contact_modulus(MATERIAL)}
    found = in_python("TAMAAS", "python3", ["-c", TAMAAS], given)
    read = round_contact(np.linalg.norm(places, axis=0), found["pressure"].ravel(), a)
    errors = {"peak": read["peak"] / known.exact.peak - 1, "width": read["width"] / a - 1}
    return {"cpu": float(found["seconds"])} | errors


def peers() -> Iterator[dict[str, Any]]:
    """The other codes on meshes or points that are ours."""
    for code in ("CalculiX", "GetFEM", "Tamaas"):
        for n in POINTS:
            row: dict[str, Any] = {"scene": "Hertz, point" if code == "Tamaas" else "Hertz, line"}
            row |= {"model": code, "mesh": n, "cpu": np.nan, "peak": np.nan, "width": np.nan}
            try:
                found = hertz_point(n) if code == "Tamaas" else hertz_line(code, n, LARGE)
                yield row | found | {"end": "solved"}
            except Exception as error:
                yield row | {"end": str(error).partition(".")[0][:80]}

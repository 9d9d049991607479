"""Other finite-element codes on Hertz's line contact: the nodes and elements are ours.

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
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import Contact, Material, Part, Scene, Support
from contactopt.bodies.calculix_deck import deck
from contactopt.errors import InputError
from contactopt.meshes.structured import tensor_mesh
from contactopt.solving.solve_scene import Options
from contactopt.solving.zone import solve_zone
from experiments.questions.accuracy.half_space import MATERIAL, indenter
from experiments.questions.calculix import run
from experiments.questions.whole_way.ours import round_contact

FLATTER = 100.0
REFINED = 4  # faces of the indenter over one of the block
STIFF = 1e5  # modulus of CalculiX's indenter over that of the block
LIMIT = 120.0  # s of wall time for one run
HERE = Path(__file__).parent
# code -> how to install it, environment variable that names its Python, and the usual one
PYTHONS = {
    "GetFEM": ("apt-get install python3-getfem", "GETFEM", "/usr/bin/python3"),
    "Kratos": ("pip install KratosContactStructuralMechanicsApplication", "KRATOS", "python3"),
}


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
        self.radius = FLATTER / 2 / float(self.scene.upper.gap(np.array([[1.0], [0.0]]))[0])

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


def other(code: str) -> Callable[[Model], tuple[np.ndarray, float]]:
    """The peer `code`, whose script stands beside this file and runs in a Python of its own."""

    def solved(model: Model) -> tuple[np.ndarray, float]:
        line, variable, usual = PYTHONS[code]
        python = os.environ.get(variable, usual)
        tip = model.indenter
        given = {"p": model.block.p, "t": model.block.t, "indenter": tip.p, "cells": tip.t,
                 "tip": np.flatnonzero(tip.p[1] < model.x[-1] / 2), "depth": model.depth,
                 "radius": model.radius, "E": MATERIAL.E, "nu": MATERIAL.nu}  # fmt: skip
        with tempfile.TemporaryDirectory() as name:
            np.savez(Path(name) / "given.npz", **given, **model.nodes)
            command = [python, str(HERE / f"{code.lower()}_hertz.py"), "given.npz", "answer.npz"]
            done = subprocess.run(command, cwd=name, timeout=LIMIT, capture_output=True,
                                  text=True)  # fmt: skip
            answer = Path(name) / "answer.npz"
            if not answer.exists():
                last = "".join((done.stderr or done.stdout).strip().splitlines()[-1:])
                absent = "ModuleNotFoundError" in last
                raise RuntimeError(f"not installed: {line}" if absent else f"failed: {last}")
            found = np.load(answer)
            return found["pressure"], float(found["seconds"])

    return solved


CODES: dict[str, Callable[[Model], tuple[np.ndarray, float]]] = {
    "CalculiX": calculix,
    "GetFEM": other("GetFEM"),
    "Kratos": other("Kratos"),
}


def hertz_line(code: str, elements: int, size: float) -> dict[str, Any]:
    """Unknowns, seconds, and errors of the peak pressure and of the half-width."""
    model = Model(elements, size)
    pressure, seconds = CODES[code](model)
    pressure = FLATTER * pressure
    load = 2 * float(np.trapezoid(pressure, model.x))
    exact = model.scene.reference
    share = np.sqrt(load / abs(float(model.scene.upper.force["y"])))
    found = round_contact(model.x, pressure, exact.half_width * share)
    errors = {
        "peak": found["peak"] / (exact.peak * share) - 1,
        "width": found["width"] / (exact.half_width * share) - 1,
    }
    return {"unknowns": model.block.p.size, "seconds": seconds} | errors

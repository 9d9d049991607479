"""One run of CalculiX (ccx): start it with limits, read what it printed, compare forces."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import skfem

from contactopt import InterfaceProblem, Material, Scene, scenes, solve
from contactopt.coupling.back_to_bodies import recover
from contactopt.coupling.reduction import Reduction, reduce_bodies
from experiments.questions.calculix.deck import Contact, Model, deck, model

ELEMENTS, MU = 32, 0.2
STIFF = 5e5  # MPa: strain 1e-7, so that displaced surfaces are as good as undisplaced ones
STICK = 0.1  # stick slope over penalty stiffness, as ccx's manual advises
RIGID = 1e7  # factor of the stick slope where the normal direction needs none
LIMIT = 40.0  # seconds for one run of ccx
GAUSS = (1 - 1 / np.sqrt(3)) / 2


@dataclass(frozen=True, eq=False)
class Run:
    """One run of ccx. failure is '' if it reached the whole load, and then:

    displacement (2, N) [mm], nodal forces (n,) on each body [N], reactions on the upper and minus
    those on the lower body, each (k, 2) [N] as in contactopt.Solution where nodes match. Iterations
    and seconds are known in any case: seconds as ccx says, its start excluded, reading the deck and
    writing results included.
    """

    failure: str
    iterations: int
    attempts: int
    seconds: float
    displacement: np.ndarray
    forces: tuple[np.ndarray, ...]
    reactions: tuple[np.ndarray, ...]


def punch(elements: int = ELEMENTS, modulus: float = STIFF, mu: float = MU) -> Scene:
    material = Material(modulus, 0.3)
    return scenes.flat_punch(2, elements=elements, mu=mu, upper=material, lower=material)


def penalty(scene: Scene, law: str, factor: float) -> Contact:
    """The law of a dimensionless factor: stiffness = factor E / h, h the length of an element."""
    stiffness = factor * scene.upper.material.E * scene.elements / 20.0
    return Contact(
        law, stiffness, stiffness if law == "mortar" else STICK * stiffness, master="top"
    )


def run(program: str, bodies: Model, reduction: Reduction, contact: Contact) -> Run:
    """Write the deck into a temporary folder, run ccx on it, read what it wrote."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "job.inp").write_text(deck(bodies, contact))
        late, code = False, 0
        with open(folder / "log", "w") as log:
            one_thread = os.environ | {"OMP_NUM_THREADS": "1"}
            command, io = [program, "job"], {"stdout": log, "stderr": subprocess.STDOUT}
            try:
                done = subprocess.run(command, cwd=folder, env=one_thread, timeout=LIMIT, **io)
                code = done.returncode
            except subprocess.TimeoutExpired:
                late = True
        log_text = (folder / "log").read_text(errors="replace")
        cycles = _rows(folder / "job.cvg", 4)
        attempts = _rows(folder / "job.sta", 2)
        failure = _failure(code, log_text, late)
        displacement, forces = np.zeros((2, 0)), (np.zeros(0),) * 2
        reactions = (np.zeros((0, 2)),) * 2
        if not failure:
            tables = printed(folder / "job.dat")
            displacement = tables["displacements"][:, 1:3].T
            forces = tuple(_forces(bodies, reduction, tables["stresses"]))
            reactions = tuple(
                (B @ force).reshape(-1, 2) for B, force in zip(reduction.maps, forces)
            )
    seconds = re.search(r"Total CalculiX Time:\s*([\d.]+)", log_text)
    spent = float(seconds[1]) if seconds else LIMIT
    return Run(failure, cycles, attempts, spent, displacement, forces, reactions)


def _rows(path: Path, head: int) -> int:
    return max(0, len(path.read_text().strip().splitlines()) - head) if path.exists() else 0


def _failure(code: int, log: str, late: bool) -> str:
    if late:
        return f"no answer in {LIMIT:g} s"
    error = re.search(r"\*ERROR:?\s*(.+)", log)
    if code == 0 and "Job finished" in log:
        return ""
    return error[1].strip() if error else f"ended with code {code}"


def printed(path: Path) -> dict[str, np.ndarray]:
    """The tables of a .dat file by their first word, the last of each; seven significant digits."""
    tables: dict[str, list[list[float]]] = {}
    rows: list[list[float]] = []
    for line in path.read_text().splitlines():
        words = line.split()
        if words and words[0][0].isalpha():
            rows = tables[words[0]] = []
        elif words:
            rows.append([float(word) for word in words])
    return {name: np.array(table) for name, table in tables.items()}


def _forces(bodies: Model, reduction: Reduction, stresses: np.ndarray) -> list[np.ndarray]:
    """Nodal forces (n,) on each body from the stresses in the integration points, f_i = int sigma :
    grad phi_i.

    They need neither our stiffness nor ccx's contact law, and keep the seven digits that
    differences of printed displacements would lose. Both layers of points of a brick count half.
    Held components carry the support's force and are left out.
    """
    scene = bodies.scene
    mesh = skfem.MeshQuad(bodies.points, bodies.quads)
    points = np.array([[GAUSS, 1 - GAUSS, GAUSS, 1 - GAUSS], [GAUSS, GAUSS, 1 - GAUSS, 1 - GAUSS]])
    basis = skfem.Basis(
        mesh, skfem.ElementVector(skfem.ElementQuad1()), quadrature=(points, np.full(4, 0.25))
    )
    # xx, yy, zz, xy, xz, yz
    layers = stresses[: 8 * bodies.quads.shape[1], 2:].reshape(-1, 2, 4, 6)
    xx, yy, _, xy, _, _ = np.moveaxis(layers.mean(axis=1), 2, 0)
    form = skfem.LinearForm(
        lambda v, w: (
            w.xx * v.grad[0, 0] + w.yy * v.grad[1, 1] + w.xy * (v.grad[0, 1] + v.grad[1, 0])
        )
    )
    force = (
        form.assemble(basis, xx=xx, yy=yy, xy=xy)[basis.nodal_dofs] * scene.thickness * scene.copies
    )
    return _by_body(bodies, reduction, force)


def _by_body(
    bodies: Model, reduction: Reduction, values: np.ndarray, free: bool = True
) -> list[np.ndarray]:
    """Values (2, points) of all nodes of the model as vectors (n,) of each body, zero on its
    unknowns that are held.

    The latter only where `free`; otherwise the values on all unknowns are kept.
    """
    out = []
    for first, reduced in zip(bodies.first_node, reduction.bodies):
        unknowns, vector = reduced.body.unknowns, np.zeros(reduced.body.unknowns.size)
        vector[unknowns] = values[:, first : first + unknowns.shape[1]]
        if free:
            vector[np.setdiff1d(np.arange(len(vector)), reduced.body.free)] = 0.0
        out.append(vector)
    return out


def difference(values: np.ndarray, exact: np.ndarray) -> tuple[float, float]:
    """Largest, over the peak, and in L2, over the norm."""
    gap = values - exact
    return float(np.abs(gap).max() / np.abs(exact).max()), float(
        np.linalg.norm(gap) / np.linalg.norm(exact)
    )


def linear(program: str) -> dict[str, Any]:
    """The bodies bonded at the contacts, in both codes: displacements and forces between them."""
    scene = punch()
    bodies, reduction = model(scene), reduce_bodies(scene)
    answer = run(program, bodies, reduction, Contact("bonded"))
    if answer.failure:
        raise RuntimeError(f"ccx failed on the linear problem: {answer.failure}")
    problem = reduction.problem.explicit()
    plates = len(problem.s)
    matrix = np.block([[problem.Q, problem.V], [problem.V.T, np.zeros((plates, plates))]])
    # the component held by symmetry in both bodies has no compliance: least squares give it no
    # force
    unknowns = np.linalg.lstsq(matrix, -np.concatenate([problem.q.ravel(), problem.s]), rcond=None)[
        0
    ]
    solution = replace(solve(problem), reactions=unknowns[:-plates].reshape(problem.q.shape))
    solution = replace(solution, multipliers=unknowns[-plates:])
    fields = recover(reduction, solution)
    displacement = np.hstack([field.displacement for field in fields])
    return {
        "nodes": bodies.points.shape[1],
        "elements": bodies.quads.shape[1],
        "displacements, largest difference": difference(answer.displacement, displacement)[0],
        "normal forces, largest difference": difference(
            answer.reactions[0][:, 0], solution.reactions[:, 0]
        )[0],
        "tangential forces, largest difference": difference(
            answer.reactions[0][:, 1], solution.reactions[:, 1]
        )[0],
    }


def softened(problem: InterfaceProblem, scene: Scene, factor: float) -> np.ndarray:
    """Reactions under the node-to-surface law: compliances 1 / (stiffness area) added to Q."""
    law = penalty(scene, "node-to-surface", factor)
    added = 1 / np.outer(problem.areas, [law.stiffness, law.stick])
    return solve(replace(problem, Q=problem.Q + np.diag(added.ravel())), tol=1e-11).reactions


class Bench:
    """One scene solved by contactopt, against which runs of ccx are put."""

    def __init__(self, program: str, scene: Scene):
        self.program, self.scene = program, scene
        self.bodies, self.reduction = model(scene), reduce_bodies(scene)
        self.problem = self.reduction.problem.explicit()
        self.exact = solve(self.problem, tol=1e-11)
        self.top = int(np.argmax(self.bodies.points[1]))

    def run(self, law: str, factor: float) -> Run:
        return run(self.program, self.bodies, self.reduction, penalty(self.scene, law, factor))

    def errors(self, answer: Run) -> dict[str, Any]:
        """Differences from contactopt; empty cells for a run that failed."""
        keys = (
            "force",
            "normal, largest",
            "normal, L2",
            "tangential, largest",
            "tangential, L2",
            "approach",
            "overlap",
        )
        if answer.failure:
            return dict.fromkeys(keys, "")
        r, exact = answer.reactions[0], self.exact.reactions
        approach = -float(self.exact.multipliers[0])
        displaced = _by_body(self.bodies, self.reduction, answer.displacement, free=False)
        jump = sum(B @ U for B, U in zip(self.reduction.maps, displaced)).reshape(r.shape)
        values = (
            float(abs(r[:, 0].sum() / exact[:, 0].sum() - 1)),
            *difference(r[:, 0], exact[:, 0]),
            *difference(r[:, 1], exact[:, 1]),
            float(abs(-answer.displacement[1, self.top] / approach - 1)),
            float(max(0.0, np.max(-jump[:, 0])) / approach),
        )
        return dict(zip(keys, values))

    def row(self, law: str, factor: float) -> dict[str, Any]:
        answer = self.run(law, factor)
        row = {
            "contact": law,
            "factor": "none" if law == "mortar" else factor,
            **self.errors(answer),
        }
        same = ""
        if law == "node-to-surface" and not answer.failure:
            own = softened(self.problem, self.scene, factor)
            same = max(difference(answer.reactions[0][:, i], own[:, i])[0] for i in (0, 1))
        counts = {
            "attempts": answer.attempts,
            "iterations": answer.iterations,
            "seconds": answer.seconds,
        }
        return row | {"same law": same} | counts | {"end": answer.failure or "converged"}

"""Does CalculiX, an independent finite-element code, find the same contact forces on the same mesh, and at what cost?"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

import re  # noqa: E402
import shutil  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import threading  # noqa: E402
import time  # noqa: E402
from dataclasses import dataclass, replace  # noqa: E402
from pathlib import Path  # noqa: E402
from statistics import median  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
import skfem  # noqa: E402

from contactopt import Material, Scene, scenes, solve  # noqa: E402
from contactopt.recover import recover  # noqa: E402
from contactopt.reduction import Reduction, reduce_bodies  # noqa: E402
from experiments.calculix_deck import Contact, Model, deck, model  # noqa: E402
from experiments.report import write  # noqa: E402

ABSENT = (
    "CalculiX is not installed, so nothing was compared: on Debian or Ubuntu `apt-get install calculix-ccx` provides "
    "its solver, ccx."
)
ELEMENTS, MU = 32, 0.2
STIFF = 5e5  # MPa: strain 1e-7, so that displaced surfaces are as good as undisplaced ones
STRAINS = (5.0, 500.0, 5e4, STIFF)
FACTORS = tuple(10.0**k for k in range(-1, 10))
STICK = 0.1  # stick slope over penalty stiffness, as ccx's manual advises
RIGID = 1e7  # factor of the stick slope where the normal direction needs none
SIZES = (32, 64)
LIMIT = 12.0  # seconds for one run of ccx
REPEATS = 3
GAUSS = (1 - 1 / np.sqrt(3)) / 2


@dataclass(frozen=True, eq=False)
class Run:
    """One run of ccx. failure is '' if it reached the whole load, and then:

    displacement (2, N) [mm], reactions on the upper and minus those on the lower body, each (k, 2) [N] as in
    contactopt.Solution. Iterations and seconds are known in any case: seconds as ccx says (its start excluded, reading the
    deck and writing results included), wall with its start, memory [MB] at the peak.
    """

    failure: str
    iterations: int
    increments: int
    seconds: float
    wall: float
    memory: float
    displacement: np.ndarray
    reactions: tuple[np.ndarray, np.ndarray]


def punch(elements: int = ELEMENTS, modulus: float = STIFF, mu: float = MU) -> Scene:
    material = Material(modulus, 0.3)
    return scenes.flat_punch(2, elements=elements, mu=mu, upper=material, lower=material)


def penalty(scene: Scene, law: str, factor: float) -> Contact:
    """The law of a dimensionless factor: stiffness = factor E / h, h the length of an element on the contact."""
    stiffness = factor * scene.upper.material.E * scene.elements / 20.0
    return Contact(law, stiffness, stiffness if law == "mortar" else STICK * stiffness)


def run(program: str, bodies: Model, reduction: Reduction, contact: Contact, limit: float = LIMIT) -> Run:
    """Write the deck into a temporary folder, run ccx on it, read what it wrote."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "job.inp").write_text(deck(bodies, contact))
        start = time.perf_counter()
        with open(folder / "log", "w") as log:
            process = subprocess.Popen([program, "job"], cwd=folder, stdout=log, stderr=subprocess.STDOUT)
            timer = threading.Timer(limit, process.kill)
            timer.start()
            _, status, usage = os.wait4(process.pid, 0)
            timer.cancel()
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)  # so that Popen does not wait for it again
        log_text = (folder / "log").read_text(errors="replace")
        cycles = _rows(folder / "job.cvg", 4)
        increments = _rows(folder / "job.sta", 2)
        failure = _failure(process.returncode, log_text, wall >= limit)
        displacement, reactions = np.zeros((2, 0)), (np.zeros((0, 2)), np.zeros((0, 2)))
        if not failure:
            tables = printed(folder / "job.dat")
            displacement = tables["displacements"][:, 1:3].T
            reactions = _reactions(bodies, reduction, tables["stresses"])
    seconds = re.search(r"Total CalculiX Time:\s*([\d.]+)", log_text)
    spent = float(seconds[1]) if seconds else wall
    return Run(failure, cycles, increments, spent, wall, usage.ru_maxrss / 1024, displacement, reactions)


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


def _reactions(bodies: Model, reduction: Reduction, stresses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contact forces from the stresses in the integration points, f_i = int sigma : grad phi_i, normal first.

    They need neither our stiffness nor ccx's contact law, and keep the seven digits that differences of printed
    displacements would lose. Both layers of points of a brick count half. Held components carry the support's force and
    are left out.
    """
    scene = bodies.scene
    mesh = skfem.MeshQuad(bodies.points, bodies.quads)
    points = np.array([[GAUSS, 1 - GAUSS, GAUSS, 1 - GAUSS], [GAUSS, GAUSS, 1 - GAUSS, 1 - GAUSS]])
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad1()), quadrature=(points, np.full(4, 0.25)))
    layers = stresses[: 8 * bodies.quads.shape[1], 2:].reshape(-1, 2, 4, 6)  # xx, yy, zz, xy, xz, yz
    xx, yy, _, xy, _, _ = np.moveaxis(layers.mean(axis=1), 2, 0)
    form = skfem.LinearForm(
        lambda v, w: w.xx * v.grad[0, 0] + w.yy * v.grad[1, 1] + w.xy * (v.grad[0, 1] + v.grad[1, 0])
    )
    force = form.assemble(basis, xx=xx, yy=yy, xy=xy)[basis.nodal_dofs] * scene.thickness * scene.copies
    out = []
    for nodes, first, sign, reduced in zip(reduction.nodes, bodies.first_node, (1.0, -1.0), reduction.bodies):
        assert reduced is not None
        free = np.isin(reduced.body.unknowns[:, nodes], reduced.body.free)
        local = np.where(free, sign * force[:, nodes + first], 0.0)
        out.append(np.einsum("kij,jk->ki", reduction.frames, local))
    return out[0], out[1]


def difference(values: np.ndarray, exact: np.ndarray) -> tuple[float, float]:
    """Largest, over the peak, and in L2, over the norm."""
    gap = values - exact
    return float(np.abs(gap).max() / np.abs(exact).max()), float(np.linalg.norm(gap) / np.linalg.norm(exact))


def linear(program: str) -> dict[str, Any]:
    """The bodies bonded at the contact nodes, in both codes: all displacements and the forces that hold them together."""
    scene = punch()
    bodies, reduction = model(scene), reduce_bodies(scene)
    answer = run(program, bodies, reduction, Contact("bonded"))
    if answer.failure:
        raise RuntimeError(f"ccx failed on the linear problem: {answer.failure}")
    problem = reduction.problem.explicit()
    plates = len(problem.s)
    matrix = np.block([[problem.Q, problem.V], [problem.V.T, np.zeros((plates, plates))]])
    # the component held by symmetry in both bodies has no compliance: least squares give it no force
    unknowns = np.linalg.lstsq(matrix, -np.concatenate([problem.q.ravel(), problem.s]), rcond=None)[0]
    solution = replace(solve(problem), reactions=unknowns[:-plates].reshape(problem.q.shape))
    solution = replace(solution, multipliers=unknowns[-plates:])
    fields = recover(reduction, solution)
    displacement = np.hstack([field.displacement for field in fields])
    return {
        "nodes": bodies.points.shape[1],
        "elements": bodies.quads.shape[1],
        "displacements, largest difference": difference(answer.displacement, displacement)[0],
        "normal forces, largest difference": difference(answer.reactions[0][:, 0], solution.reactions[:, 0])[0],
        "tangential forces, largest difference": difference(answer.reactions[0][:, 1], solution.reactions[:, 1])[0],
    }


def softened(problem: Any, scene: Scene, factor: float) -> np.ndarray:
    """Reactions of contactopt under the law of node-to-surface penalty: compliances 1 / (stiffness area) added to Q."""
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
        upper, lower = (
            answer.displacement[1, nodes + first] for nodes, first in zip(self.reduction.nodes, self.bodies.first_node)
        )
        values = (
            float(abs(r[:, 0].sum() / exact[:, 0].sum() - 1)),
            *difference(r[:, 0], exact[:, 0]),
            *difference(r[:, 1], exact[:, 1]),
            float(abs(-answer.displacement[1, self.top] / approach - 1)),
            float(max(0.0, np.max(lower - upper)) / approach),
        )
        return dict(zip(keys, values))

    def row(self, law: str, factor: float) -> dict[str, Any]:
        answer = self.run(law, factor)
        row = {"contact": law, "factor": "none" if law == "mortar" else factor, **self.errors(answer)}
        same = ""
        if law == "node-to-surface" and not answer.failure:
            own = softened(self.problem, self.scene, factor)
            same = max(difference(answer.reactions[0][:, i], own[:, i])[0] for i in (0, 1))
        counts = {"increments": answer.increments, "iterations": answer.iterations, "seconds": answer.seconds}
        return row | {"same law": same} | counts | {"end": answer.failure or "converged"}


def strain(program: str, modulus: float) -> dict[str, Any]:
    """How much of a difference is the displacement of the surfaces, which contactopt leaves out."""
    bench = Bench(program, punch(modulus=modulus))
    row: dict[str, Any] = {"E [MPa]": modulus, "approach / height": -float(bench.exact.multipliers[0]) / 40.0}
    for law, factor in (("node-to-surface", 1e6), ("surface-to-surface", 1e3), ("mortar", RIGID)):
        answer = bench.run(law, factor)
        errors = bench.errors(answer)
        row[f"{law}: normal"] = errors["normal, L2"] if not answer.failure else answer.failure
        row[f"{law}: tangential"] = errors["tangential, L2"]
    return row


def costs(program: str, elements: int, sweep: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Medians of runs in turn: contactopt, and each contact of ccx at its most accurate factor."""
    scene = punch(elements)
    bench = Bench(program, scene)
    own, answers = [], dict[str, list[Run]]()
    for _ in range(REPEATS):
        start = time.perf_counter()
        reduction = reduce_bodies(scene)
        solution = solve(reduction.problem)
        recover(reduction, solution)
        own.append(time.perf_counter() - start)
        for law in ("node-to-surface", "surface-to-surface", "mortar"):
            answers.setdefault(law, []).append(bench.run(law, best_factor(sweep, law)))
    rows = [
        {
            "contacts": bench.problem.contacts,
            "solver": "contactopt",
            "factor": "none",
            "normal, L2": difference(solution.reactions[:, 0], bench.exact.reactions[:, 0])[1],
            "tangential, L2": difference(solution.reactions[:, 1], bench.exact.reactions[:, 1])[1],
            "iterations": solution.iterations,
            "seconds": median(own),
            "over contactopt": 1.0,
            "memory [MB]": own_memory(elements),
            "end": solution.status.label,
        }
    ]
    for law, runs in answers.items():
        errors, ratio = bench.errors(runs[-1]), median(run.seconds / t for run, t in zip(runs, own))
        rows.append(
            {
                "contacts": bench.problem.contacts,
                "solver": f"ccx, {law}",
                "factor": "none" if law == "mortar" else best_factor(sweep, law),
                "normal, L2": errors["normal, L2"],
                "tangential, L2": errors["tangential, L2"],
                "iterations": runs[-1].iterations,
                "seconds": median(run.seconds for run in runs),
                "over contactopt": ratio,
                "memory [MB]": median(run.memory for run in runs),
                "end": runs[-1].failure or "converged",
            }
        )
    return rows


def best_factor(sweep: list[dict[str, Any]], law: str) -> float:
    """The most accurate of the factors at which ccx took the whole load at once."""
    if law == "mortar":
        return RIGID
    good = [row for row in sweep if row["contact"] == law and row["end"] == "converged" and row["increments"] == 1]
    return float(min(good, key=lambda row: row["normal, L2"])["factor"])


MEMORY = """
import resource, sys
from contactopt import solve
from contactopt.recover import recover
from contactopt.reduction import reduce_bodies
from experiments.calculix import punch
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
scene, before = punch(int(sys.argv[1])), peak()
reduction = reduce_bodies(scene)
recover(reduction, solve(reduction.problem))
print(peak() - before)
"""


def own_memory(elements: int) -> float:
    """Peak of a fresh process of contactopt above its peak after the imports [MB]."""
    arguments = [sys.executable, "-c", MEMORY, str(elements)]
    return float(subprocess.run(arguments, capture_output=True, text=True, check=True).stdout)


def version(program: str) -> str:
    text = subprocess.run([program, "-v"], capture_output=True, text=True).stdout
    return text.split()[-1] if text.split() else "of unknown version"


def slope(rows: list[dict[str, Any]], law: str) -> float:
    """Exponent of the normal error over the factor from 10 to 1e4, where neither softness nor rounding rules."""
    good = [r for r in rows if r["contact"] == law and r["end"] == "converged" and 10 <= r["factor"] <= 1e4]
    return float(np.polyfit(*np.log([[r["factor"], r["normal, L2"]] for r in good]).T, 1)[0])


def findings(check: dict[str, Any], sweep: list[dict[str, Any]], cost: list[dict[str, Any]]) -> str:
    mortar = next(row for row in sweep if row["contact"] == "mortar")
    agreement = (
        f"the nodal forces differ from contactopt's by {mortar['normal, largest']:.1e} (normal) and "
        f"{mortar['tangential, largest']:.1e} (tangential) of their peak"
        if mortar["end"] == "converged"
        else f"there was no answer ({mortar['end']})"
    )
    parts = []
    for law in ("node-to-surface", "surface-to-surface"):
        rows = [row for row in sweep if row["contact"] == law]
        failed = [row["factor"] for row in rows if row["end"] != "converged"]
        best = min((row for row in rows if row["end"] == "converged"), key=lambda row: row["normal, L2"])
        lost = f"no answer at {', '.join(f'{f:.0e}' for f in failed)}" if failed else "an answer at every factor"
        parts.append(
            f"{law} like factor^{slope(sweep, law):.2f} down to {best['normal, L2']:.0e} at {best['factor']:.0e}, {lost}"
        )
    size = max(row["contacts"] for row in cost)
    group = [row for row in cost if row["contacts"] == size]
    own = group[0]
    prices = "; ".join(
        f"{row['solver']} {row['over contactopt']:.1f} times the time, {row['iterations']} iterations, "
        f"{row['memory [MB]']:.0f} MB"
        for row in group[1:]
    )
    return f"""1. **Two independent codes agree.** Bonded, all displacements differ by {check["displacements, largest difference"]:.0e} of the
   largest, so that mesh, thickness, supports and load are the same. With friction and ccx's mortar contact, which is hard
   and needs no normal factor, {agreement}.
2. **A penalty costs accuracy, then convergence.** The L2 error of the normal forces falls: {"; ".join(parts)}. contactopt has
   no factor to choose.
3. **Time.** At {size} contacts contactopt takes {own["seconds"]:.2g} s, {own["iterations"]} iterations, {own["memory [MB]"]:.0f} MB; {prices}."""


TEXT = """{findings}

The scene is the 2D punch (half model, plane strain, rigid plate glued to its top under 100 N, foundation clamped below),
mu = {mu}, {contacts} contacts, in CalculiX {version} on the very same nodes and elements, by a deck written from the meshes.
CPE4 is expanded by ccx into one layer of bricks C3D8 as thick as the section: full integration, no incompatible modes, hence
our bilinear element; mortar contact needs these bricks written out. The material is stiff (E = {modulus:g} MPa): the linear
problem scales with E, and the strain of 1e-7 keeps apart what ccx does to displaced surfaces, which the third table shows.
One static step, full load in one increment unless ccx cuts it; its default criteria. Nodal forces are integrated from the
stresses that ccx prints with seven digits, whatever its contact law; contactopt is solved to a certificate of 1e-11.

Bonded, without contact; differences relative to the largest value:

{{linear}}

Penalty stiffness K = factor E / h, stick slope K / 10, which is what the manual advises; mortar: no normal factor, stick slope
{rigid:.0e} E / h. Differences of nodal forces from contactopt, largest over the peak and in L2; `force` is the relative error
of the total normal force (equilibrium), `approach` that of the plate's displacement, `overlap` the largest penetration over the
approach; `same law`: from contactopt with the compliances of the same penalty added to Q, normal and tangential together.
Iterations count cut increments too.

{{rows}}

The same with softer bodies: ccx follows the displaced surfaces, contactopt does not. L2 differences at factor 1e6
(node-to-surface), 1e3 (surface-to-surface) and mortar.

{{strain}}

Time and memory, medians of {repeats} runs in turn on one thread; the ratio is the median of the ratios. ccx at the most accurate
factor of the second table at which it took the load in one increment. Its time is the one that it states, without the start of
the process but with reading the deck and writing the results; contactopt's covers meshes, assembly, reduction, solution and
stresses, without importing Python packages. Memory is the peak of the ccx process, and of a Python process above its peak
after imports.

{{costs}}

Massless contact of ccx is for explicit dynamics only, so it has no row. What a deck must respect here: ccx 2.20 never returns
from mortar contact where a slave node is held in two directions, so one of them is held by a stiff spring.
"""


def figure(bench: Bench, sweep: list[dict[str, Any]]) -> Any:
    """Error, iterations and time over the penalty factor; failed runs at the upper edge."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawing, axes = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained")
    factors = np.array(FACTORS)
    own = [softened(bench.problem, bench.scene, f) for f in factors]
    exact = bench.exact.reactions
    for i, line in enumerate(("-", "--")):
        label = ("normal", "tangential")[i] + ", same law in contactopt"
        error = [difference(r[:, i], exact[:, i])[1] for r in own]
        axes[0].loglog(factors, error, line, color="0.6", label=label, zorder=0)
    for law, colour in (("node-to-surface", "C0"), ("surface-to-surface", "C1")):
        rows = [row for row in sweep if row["contact"] == law]
        good = [row for row in rows if row["end"] == "converged"]
        lost = [row["factor"] for row in rows if row["end"] != "converged"]
        x = [row["factor"] for row in good]
        axes[0].loglog(x, [row["normal, L2"] for row in good], "o", color=colour, label=f"normal, {law}")
        tangential = [row["tangential, L2"] for row in good]
        axes[0].loglog(x, tangential, "s", color=colour, mfc="none", label=f"tangential, {law}")
        for axis, key in zip(axes[1:], ("iterations", "seconds")):
            axis.loglog(x, [row[key] for row in good], "o", color=colour, label=law)
            if lost:
                height = [row[key] for row in rows if row["end"] != "converged"]
                axis.loglog(lost, height, "x", color=colour, label=f"{law}, no answer")
    mortar = next(row for row in sweep if row["contact"] == "mortar")
    if mortar["end"] == "converged":
        for axis, key in zip(axes, ("normal, L2", "iterations", "seconds")):
            axis.axhline(mortar[key], color="C2", ls=":", label="mortar" + (", normal" if axis is axes[0] else ""))
    for axis, title in zip(axes, ("L2 error of nodal forces [-]", "iterations of ccx", "time of ccx [s]")):
        axis.set(xlabel="penalty factor K h / E [-]", ylabel=title)
        axis.legend(fontsize=7)
        axis.grid(alpha=0.3)
    return drawing


def main() -> None:
    program = shutil.which("ccx")
    if program is None:
        print(ABSENT)
        return
    name = version(program)
    check = linear(program)
    bench = Bench(program, punch())
    laws = [(law, factor) for law in ("node-to-surface", "surface-to-surface") for factor in FACTORS]
    sweep = [bench.row(law, factor) for law, factor in [*laws, ("mortar", RIGID)]]
    cost = [row for elements in SIZES for row in costs(program, elements, sweep)]
    tables = {
        "linear": [check],
        "rows": sweep,
        "strain": [strain(program, modulus) for modulus in STRAINS],
        "costs": cost,
    }
    text = TEXT.format(
        findings=findings(check, sweep, cost),
        mu=MU,
        contacts=bench.problem.contacts,
        version=name,
        modulus=STIFF,
        rigid=RIGID,
        repeats=REPEATS,
    )
    drawing = figure(bench, sweep)
    tables = {stem: [row | {"ccx": name} for row in rows] for stem, rows in tables.items()}
    write("calculix", "CalculiX on the same mesh", text, tables, {"penalty": drawing})


if __name__ == "__main__":
    main()

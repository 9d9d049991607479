"""Does CalculiX, an independent finite-element code, find the same contact forces on the same mesh, and at what cost?"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

import shutil  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from pathlib import Path  # noqa: E402
from statistics import median  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

from contactopt import solve  # noqa: E402
from contactopt.figures.style import BLUE, GREEN, ORANGE  # noqa: E402
from contactopt.interface.recovery import recover  # noqa: E402
from contactopt.interface.reduction import reduce_bodies  # noqa: E402
from experiments.questions.calculix.deck import LEAST  # noqa: E402
from experiments.questions.calculix.run import (  # noqa: E402
    MU,
    RIGID,
    STIFF,
    Bench,
    Run,
    difference,
    linear,
    punch,
    softened,
)
from experiments.report import write  # noqa: E402

ABSENT = (
    "CalculiX is not installed, so nothing was compared: on Debian or Ubuntu `apt-get install calculix-ccx` provides "
    "its solver, ccx."
)
DECADES = {"node-to-surface": range(-1, 10), "surface-to-surface": range(-1, 7)}
STRAINS = (5.0, 500.0, 5e4)  # MPa
SIZES = (32, 64)
REPEATS = 3


def strain(program: str, modulus: float) -> dict[str, Any]:
    """How much of a difference comes with the displacement of the surfaces, which contactopt leaves out."""
    bench = Bench(program, punch(modulus=modulus))
    row: dict[str, Any] = {"E [MPa]": modulus, "approach / height": -float(bench.exact.multipliers[0]) / 40.0}
    for law, factor in (("node-to-surface", 1e3), ("surface-to-surface", 1e3), ("mortar", RIGID)):
        measured = bench.row(law, factor)
        failed = measured["end"] != "converged"
        row[f"{law}: normal"] = measured["end"] if failed else measured["normal, L2"]
        row[f"{law}: tangential"] = measured["tangential, L2"]
        row[f"{law}: attempts"] = measured["attempts"]
    return row


def costs(program: str, elements: int, sweep: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Medians of runs in turn: contactopt, and each contact of ccx at its most accurate factor."""
    scene = punch(elements)
    bench = Bench(program, scene)
    factors = {law: best_factor(sweep, law) for law in DECADES} | {"mortar": RIGID}
    own: list[float] = []
    answers: dict[str, list[Run]] = {law: [] for law in factors}
    for _ in range(REPEATS):
        start = time.perf_counter()
        reduction = reduce_bodies(scene)
        solution = solve(reduction.problem)
        recover(reduction, solution)
        own.append(time.perf_counter() - start)
        for law, runs in answers.items():
            runs.append(bench.run(law, factors[law]))
    row = {"contacts": bench.problem.contacts, "solver": "contactopt", "factor": "none", "normal, L2": "reference"}
    row |= {"tangential, L2": "reference", "iterations": solution.iterations, "seconds": median(own)}
    rows = [row | {"over contactopt": 1.0, "memory [MB]": own_memory(elements), "end": solution.status.label}]
    for law, runs in answers.items():
        errors = bench.errors(runs[-1])
        row = {"contacts": bench.problem.contacts, "solver": f"ccx, {law}"}
        row |= {"factor": "none" if law == "mortar" else factors[law]}
        row |= {key: errors[key] for key in ("normal, L2", "tangential, L2")}
        row |= {"iterations": runs[-1].iterations, "seconds": median(run.seconds for run in runs)}
        row |= {"over contactopt": median(run.seconds / t for run, t in zip(runs, own))}
        row |= {"memory [MB]": median(run.memory for run in runs), "end": runs[-1].failure or "converged"}
        rows.append(row)
    return rows


def converged(sweep: list[dict[str, Any]], law: str) -> list[dict[str, Any]]:
    return [row for row in sweep if row["contact"] == law and row["end"] == "converged"]


def best_factor(sweep: list[dict[str, Any]], law: str) -> float:
    """The most accurate of the factors at which ccx needed no second attempt."""
    at_once = [row for row in converged(sweep, law) if row["attempts"] == 1]
    return float(min(at_once, key=lambda row: row["normal, L2"])["factor"])


MEMORY = """
import sys
from contactopt import solve
from contactopt.interface.recovery import recover
from contactopt.interface.reduction import reduce_bodies
from experiments.questions.calculix.run import peak_memory, punch
reduction = reduce_bodies(punch(int(sys.argv[1])))
recover(reduction, solve(reduction.problem))
print(peak_memory())
"""


def own_memory(elements: int) -> float:
    """Peak memory of a fresh process of contactopt, Python and its packages included [MB]."""
    arguments = [sys.executable, "-c", MEMORY, str(elements)]
    folder = Path(__file__).parents[3]
    return float(subprocess.run(arguments, capture_output=True, text=True, check=True, cwd=folder).stdout)


def version(program: str) -> str:
    text = subprocess.run([program, "-v"], capture_output=True, text=True).stdout
    return text.split()[-1] if text.split() else "of unknown version"


def decay(sweep: list[dict[str, Any]], law: str) -> str:
    """In words: how the error falls with the factor, where it ends and where there is no answer."""
    good = converged(sweep, law)
    straight = [row for row in good if 10 <= row["factor"] <= 1e5]
    slope = np.polyfit(*np.log([[row["factor"], row["normal, L2"]] for row in straight]).T, 1)[0]
    best = min(good, key=lambda row: row["normal, L2"])
    cut = [f"{row['factor']:.0e}" for row in good if row["attempts"] > 1]
    lost = [f"{row['factor']:.0e}" for row in sweep if row["contact"] == law and row["end"] != "converged"]
    text = f"{law} like factor^{slope:.2f} from 10 to 1e5, least {best['normal, L2']:.0e} at {best['factor']:.0e}"
    text += f", more than one attempt at {', '.join(cut)}" if cut else ""
    return text + (f", no convergence at {', '.join(lost)}" if lost else ", converged at every factor")


def findings(check: dict[str, Any], sweep: list[dict[str, Any]], cost: list[dict[str, Any]]) -> str:
    mortar = next(row for row in sweep if row["contact"] == "mortar")
    agreement = f"there was no answer ({mortar['end']})"
    if mortar["end"] == "converged":
        agreement = (
            f"the nodal forces differ from contactopt's by {mortar['normal, largest']:.1e} (normal) and "
            f"{mortar['tangential, largest']:.1e} (tangential) of their peak"
        )
    same = max(row["same law"] for row in converged(sweep, "node-to-surface"))
    size = max(row["contacts"] for row in cost)
    own, *others = (row for row in cost if row["contacts"] == size)
    prices = "; ".join(
        f"{row['solver'].removeprefix('ccx, ')} {row['over contactopt']:.0f} times as long, {row['iterations']} "
        f"iterations, {row['memory [MB]']:.0f} MB"
        for row in others
    )
    return f"""1. **Two independent codes agree.** Bonded, all displacements differ by {check["displacements, largest difference"]:.0e} of the largest: mesh,
   thickness, supports and load are the same. With friction and ccx's mortar contact, hard and without a normal factor,
   {agreement}. Node-to-surface penalty, put into contactopt as a compliance
   added to Q, gives the same forces to {same:.0e} wherever ccx converged.
2. **A penalty trades accuracy for convergence.** L2 error of the normal forces: {"; ".join(decay(sweep, law) for law in DECADES)}.
   contactopt has no factor to choose.
3. **Cost.** At {size} contacts contactopt takes {own["seconds"]:.2g} s, {own["iterations"]} iterations, {own["memory [MB]"]:.0f} MB, Python included; ccx: {prices}.
   Each iteration of ccx factorises both bodies anew, each of contactopt solves a dense system of the contact unknowns alone."""


TEXT = """{findings}

The scene is the 2D punch (half model, plane strain, rigid plate glued to its top under 100 N, foundation clamped below),
mu = {mu}, {contacts} contacts, in CalculiX {version} on the very same nodes and elements, by a deck written from the meshes.
CPE4 is expanded by ccx into one layer of bricks C3D8 as thick as the section: full integration, no incompatible modes, hence
our bilinear element; mortar contact needs these bricks written out. The material is stiff (E = {modulus:g} MPa): contactopt's
forces do not depend on E, and a strain of 1e-7 keeps apart what ccx does to displaced surfaces, which the third table shows.
One static step, full load in one increment unless ccx cuts it, down to {least:g} of the load; its default criteria. The upper body
is the slave; the master is the foundation's whole top, for nodes slide over the edge of a master as wide as the punch.
Nodal forces are integrated from the stresses that ccx prints with seven digits, whatever its contact law; contactopt is
solved to a certificate of 1e-11.

Bonded, without contact; differences relative to the largest value:

{{linear}}

Penalty stiffness K = factor E / h, stick slope K / 10, which is what the manual advises; mortar: no normal factor, stick slope
{rigid:.0e} E / h. Differences of nodal forces from contactopt, largest over the peak and in L2; `force` is the relative error
of the total normal force (equilibrium), `approach` that of the plate's displacement, `overlap` the largest penetration over the
approach; `same law`: from contactopt with the compliances of the same penalty added to Q, the larger of normal and tangential.
`attempts` at increments of the load, failed ones included, which ccx repeats or cuts; `iterations` of all of them.

{{rows}}

The same with softer bodies, L2 differences at factor 1e3: those of node-to-surface contact grow with the displacements, even
without NLGEOM, which suggests that its normals turn with the surfaces; surface-to-surface and mortar contact do not depend
on them, nor does contactopt.

{{strain}}

Time and memory, medians of {repeats} runs in turn on one thread; the ratio is the median of the ratios. ccx at the most accurate
factor of the second table at which one attempt was enough. Its time is the one that it states, without the start of
the process but with reading the deck and writing the results; contactopt's covers meshes, assembly, reduction, solution and
stresses, without importing Python packages. Memory is the peak of the process, of ccx or of Python with all packages that contactopt loads.

{{costs}}

Massless contact of ccx is for explicit dynamics only, so it has no row. What a deck must respect here: ccx {version} does not
return from mortar contact where a slave node is held in two directions, so a stiff spring holds one of them.
"""


def figure(bench: Bench, sweep: list[dict[str, Any]]) -> Any:
    """Error, iterations and time over the penalty factor; crosses: no convergence."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawing, axes = plt.subplots(1, 3, figsize=(13, 5.2), layout="constrained")
    factors = 10.0 ** np.arange(-1, 10)
    own = [softened(bench.problem, bench.scene, f) for f in factors]
    for i, (component, line) in enumerate((("normal", "-"), ("tangential", "--"))):
        error = [difference(r[:, i], bench.exact.reactions[:, i])[1] for r in own]
        axes[0].loglog(factors, error, line, color="0.6", label=f"{component}, same law in contactopt", zorder=0)
    for law, colour in zip(DECADES, (BLUE, ORANGE)):
        good = converged(sweep, law)
        lost = [row for row in sweep if row["contact"] == law and row["end"] != "converged"]
        for component, style in (("normal", {"marker": "o"}), ("tangential", {"marker": "s", "mfc": "none"})):
            points = [(row["factor"], row[f"{component}, L2"]) for row in good]
            axes[0].loglog(*zip(*points), ls="", color=colour, label=f"{component}, {law}", **style)
        for axis, key in zip(axes[1:], ("iterations", "seconds")):
            for rows, marker, label in ((good, "o", law), (lost, "x", f"{law}, no convergence")):
                if rows:
                    points = [(row["factor"], row[key]) for row in rows]
                    axis.loglog(*zip(*points), ls="", marker=marker, color=colour, label=label)
    for row in converged(sweep, "mortar"):
        for axis, key in zip(axes, ("normal, L2", "iterations", "seconds")):
            axis.axhline(row[key], color=GREEN, ls=":", label="normal, mortar" if axis is axes[0] else "mortar")
    for axis, title in zip(axes, ("L2 error of nodal forces [-]", "iterations of ccx", "time of ccx [s]")):
        axis.set(xlabel="penalty factor K h / E [-]", ylabel=title)
        axis.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=2 if axis is axes[0] else 1)
        axis.grid(alpha=0.3)
    return drawing


def main() -> None:
    program = shutil.which("ccx")
    if program is None:
        print(ABSENT)
        return
    name, check, bench = version(program), linear(program), Bench(program, punch())
    laws = [(law, 10.0**decade) for law, decades in DECADES.items() for decade in decades]
    sweep = [bench.row(law, factor) for law, factor in [*laws, ("mortar", RIGID)]]
    cost = [row for elements in SIZES for row in costs(program, elements, sweep)]
    soft = [strain(program, modulus) for modulus in STRAINS]
    text = TEXT.format(
        findings=findings(check, sweep, cost),
        mu=MU,
        contacts=bench.problem.contacts,
        version=name,
        modulus=STIFF,
        least=LEAST,
        rigid=RIGID,
        repeats=REPEATS,
    )
    tables = {"linear": [check], "rows": sweep, "strain": soft, "costs": cost}
    tables = {stem: [row | {"ccx": name} for row in rows] for stem, rows in tables.items()}
    write("calculix", "CalculiX on the same mesh", text, tables, {"penalty": figure(bench, sweep)})


if __name__ == "__main__":
    main()

"""Does CalculiX, another code, find the same forces on the same mesh, and at what cost?"""

from __future__ import annotations

import shutil
import subprocess
import time
from statistics import median
from typing import Any

import numpy as np

from contactopt import solve
from contactopt.coupling.back_to_bodies import recover
from contactopt.coupling.reduction import reduce_bodies
from contactopt.figures.style import BLUE, GREEN, GREY, ORANGE, add_legend, label_ends, paper_axes
from experiments.questions.calculix.deck import LEAST
from experiments.questions.calculix.run import (
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
from experiments.report import figures_alone, save_figures, stored, write

ABSENT = (
    "CalculiX is not installed, so nothing was compared: on Debian or Ubuntu `apt-get install"
    " calculix-ccx` provides its solver, ccx."
)
DECADES = {"node-to-surface": range(-1, 10), "surface-to-surface": range(-1, 7)}
SIZES = (32, 64)
REPEATS = 3


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
    first = {"contacts": bench.problem.contacts, "solver": "contactopt", "factor": "none"}
    first |= {"normal, L2": "reference", "tangential, L2": "reference"}
    first |= {"iterations": solution.iterations, "seconds": median(own), "over contactopt": 1.0}
    rows = [first | {"end": solution.status.label}]
    for law, runs in answers.items():
        errors = bench.errors(runs[-1])
        row = {"contacts": bench.problem.contacts, "solver": f"ccx, {law}"}
        row |= {"factor": "none" if law == "mortar" else factors[law]}
        row |= {key: errors[key] for key in ("normal, L2", "tangential, L2")}
        row |= {"iterations": runs[-1].iterations, "seconds": median(run.seconds for run in runs)}
        row |= {"over contactopt": median(run.seconds / t for run, t in zip(runs, own))}
        row["end"] = runs[-1].failure or "converged"
        rows.append(row)
    return rows


def converged(sweep: list[dict[str, Any]], law: str) -> list[dict[str, Any]]:
    return [row for row in sweep if row["contact"] == law and row["end"] == "converged"]


def best_factor(sweep: list[dict[str, Any]], law: str) -> float:
    """The most accurate of the factors at which ccx needed no second attempt."""
    at_once = [row for row in converged(sweep, law) if row["attempts"] == 1]
    return float(min(at_once, key=lambda row: row["normal, L2"])["factor"])


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
    lost = [
        f"{row['factor']:.0e}"
        for row in sweep
        if row["contact"] == law and row["end"] != "converged"
    ]
    text = (
        f"With {law} contact it falls like factor^{slope:.2f} from 10 to 1e5, and is least at"
        f" {best['factor']:.0e}, {best['normal, L2']:.0e}."
    )
    text += f" ccx needed more than one attempt at {' and '.join(cut)}." if cut else ""
    return text + (
        f" It did not converge at {' and '.join(lost)}."
        if lost
        else " It converged at every factor."
    )


def findings(check: dict[str, Any], sweep: list[dict[str, Any]], cost: list[dict[str, Any]]) -> str:
    mortar = next(row for row in sweep if row["contact"] == "mortar")
    agreement = f"there was no answer ({mortar['end']})"
    if mortar["end"] == "converged":
        agreement = (
            f"the nodal forces differ from contactopt's by {mortar['normal, largest']:.1e} (normal)"
            f" and {mortar['tangential, largest']:.1e} (tangential) of their peak"
        )
    same = max(row["same law"] for row in converged(sweep, "node-to-surface"))
    size = max(row["contacts"] for row in cost)
    own, *others = (row for row in cost if row["contacts"] == size)
    prices = " ".join(
        f"ccx with {row['solver'].removeprefix('ccx, ')} contact takes {row['over contactopt']:.0f}"
        f" times as long, and {row['iterations']} iterations."
        for row in others
    )
    return f"""1. **Two independent codes agree.** For bonded bodies all displacements differ by
   {check["displacements, largest difference"]:.0e} of the largest: mesh, thickness, supports and
   load are the same. With friction and ccx's mortar contact, hard and without a normal factor,
   {agreement}. Node-to-surface penalty, put into contactopt as a compliance added to Q, gives the
   same forces to {same:.0e} wherever ccx converged.
2. **A penalty trades accuracy for convergence.** This is about the L2 error of the normal forces.
   {" ".join(decay(sweep, law) for law in DECADES)} contactopt has no factor to choose.
3. **Cost.** At {size} contacts contactopt takes {own["seconds"]:.2g} s and {own["iterations"]}
   iterations. {prices} Each iteration of ccx
   factorises both bodies anew. Each iteration of contactopt solves a dense system of the
   contact unknowns alone."""


TEXT = """{findings}

**The scene.** It is the 2D punch: half a model in plane strain, with a rigid plate that is glued to
its top and pressed with 100 N. The foundation is clamped below. mu = {mu}, and there are {contacts}
contacts. CalculiX {version} (called ccx below) has the very same nodes and elements, by a deck that
is written from the meshes. It expands its element CPE4 into one layer of bricks C3D8 that is as
thick as the section. With full integration and no incompatible modes, this is our bilinear element.
Mortar contact needs these bricks written out in the deck.

The material is stiff (E = {modulus:g} MPa). The forces of contactopt do not depend on E. With
strains of 1e-7 the comparison does not depend on what ccx does to displaced surfaces. There is one
static step with the full load in one increment. ccx may cut it down to {least:g} of the load, by
its default criteria. The upper body is the slave. The master is the whole top of the foundation,
because nodes would slide over the edge of a master that is as wide as the punch. For every contact
law the nodal forces are integrated from the stresses that ccx prints with seven digits. contactopt
solves to a certificate of 1e-11.

**Bonded, without contact.** The differences are relative to the largest value:

{{linear}}

**With contact.** The penalty stiffness is K = factor E / h, and the stick slope is K / 10, which
the manual advises. Mortar contact has no normal factor, and its stick slope is {rigid:.0e} E / h.
The table has the differences of the nodal forces from those of contactopt: the largest one over the
peak, and the one in L2. The other columns are:

- `force`: the relative error of the total normal force, which is an error of equilibrium;
- `approach`: the relative error of the plate's displacement;
- `overlap`: the largest penetration over the approach;
- `same law`: the difference from contactopt when the compliances of the same penalty are added to
  Q, the larger of normal and tangential;
- `attempts`: attempts at increments of the load, with the failed ones, which ccx repeats or cuts;
- `iterations`: those of all attempts.

{{rows}}

**Time.** The table has medians of {repeats} runs in turn on one thread. The ratio is the
median of the ratios. ccx runs at the most accurate factor of the second table at which one attempt
was enough. Its time is the one that it states. It leaves out the start of the process, and includes
reading the deck and writing the results. The time of contactopt covers meshes, assembly, reduction,
solution and stresses. It leaves out the import of Python packages.

{{costs}}

**What was left out.** Massless contact of ccx is for explicit dynamics only, so it has no row. ccx
{version} does not return from mortar contact if a slave node is held in two directions. Therefore a
stiff spring holds one of them.
"""


def figure(bench: Bench, sweep: list[dict[str, Any]]) -> Any:
    """Error, iterations and time over the penalty factor; crosses: no convergence."""
    drawing, axes = paper_axes(3, wide=True)
    factors = 10.0 ** np.arange(-1, 10)
    own = [softened(bench.problem, bench.scene, f) for f in factors]
    ends = []
    for i, (component, mark) in enumerate((("normal", "o"), ("tangential", "s"))):
        error = [difference(r[:, i], bench.exact.reactions[:, i])[1] for r in own]
        axes[0].loglog(factors, error, color="0.7", zorder=0)
        for law, colour in zip(DECADES, (BLUE, ORANGE)):
            points = [(row["factor"], row[f"{component}, L2"]) for row in converged(sweep, law)]
            axes[0].loglog(*zip(*points), mark, color=colour, mfc="white" if i else colour)
        axes[0].plot([], [], mark, color=GREY, mfc="white" if i else GREY, label=component)
    axes[0].plot([], [], color="0.7", label="same law in contactopt")
    for law, colour in zip(DECADES, (BLUE, ORANGE)):
        lost = [row for row in sweep if row["contact"] == law and row["end"] != "converged"]
        for axis, key in zip(axes[1:], ("iterations", "seconds")):
            for rows, mark in ((converged(sweep, law), "o"), (lost, "x")):
                axis.loglog([r["factor"] for r in rows], [r[key] for r in rows], mark, color=colour)
        last = max((row for row in sweep if row["contact"] == law), key=lambda r: r["factor"])
        ends.append((last["factor"], last["seconds"], law, colour))
    axes[1].plot([], [], "o", color=GREY, label="converged")
    axes[1].plot([], [], "x", color=GREY, label="no convergence")
    for row in converged(sweep, "mortar"):
        for axis, key in zip(axes, ("normal, L2", "iterations", "seconds")):
            axis.axhline(row[key], color=GREEN, ls=":")
        ends.append((factors[-1], row["seconds"], "mortar", GREEN))
    titles = ("L2 error of nodal forces [-]", "iterations of ccx [-]", "time of ccx [s]")
    for axis, title in zip(axes, titles):
        axis.set(xlabel="penalty factor $K h / E$ [-]", ylabel=title)
        add_legend(axis)
    label_ends(axes[2], ends)
    return drawing


def main() -> None:
    if figures_alone():
        sweep = stored("calculix", "rows")
        return save_figures("calculix", {"penalty": figure(Bench("", punch()), sweep)})
    program = shutil.which("ccx")
    if program is None:
        print(ABSENT)
        return
    name, check, bench = version(program), linear(program), Bench(program, punch())
    laws = [(law, 10.0**decade) for law, decades in DECADES.items() for decade in decades]
    sweep = [bench.row(law, factor) for law, factor in [*laws, ("mortar", RIGID)]]
    cost = [row for elements in SIZES for row in costs(program, elements, sweep)]
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
    tables = {"linear": [check], "rows": sweep, "costs": cost}
    tables = {stem: [row | {"ccx": name} for row in rows] for stem, rows in tables.items()}
    write("calculix", "CalculiX on the same mesh", text, tables, {"penalty": figure(bench, sweep)})


if __name__ == "__main__":
    main()

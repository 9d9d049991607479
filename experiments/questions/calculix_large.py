"""What do CalculiX and contactopt cost on the punch at more than a hundred thousand unknowns, in
the plane and in space?

`python -m experiments.questions.calculix_large [--limit seconds]` compares CPU times of whole runs,
because wall times need a machine without other work. CalculiX solves with its direct solver,
node-to-surface penalty contact, at the factor that the comparison of small problems (`python -m
experiments.questions.calculix`) found most accurate.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

import resource  # noqa: E402
import shutil  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

from contactopt import Material, Scene, Solution, scenes, solve  # noqa: E402
from contactopt.coupling.back_to_bodies import recover  # noqa: E402
from contactopt.coupling.reduction import Reduction, reduce_bodies  # noqa: E402
from experiments.questions.calculix.deck import LEAST, TENSION, Contact, deck, model  # noqa: E402
from experiments.questions.calculix.run import (  # noqa: E402
    MU,
    STICK,
    STIFF,
    peak_memory,
    penalty,
    printed,
    punch,
)
from experiments.report import write  # noqa: E402

PLANE, SPACE = 1230, (8, 11, 15, 20, 29)  # elements across the half-width
FACTOR = 1e6  # penalty stiffness over E / h
CORNERS = (
    (0, 0, 0),
    (1, 0, 0),
    (1, 1, 0),
    (0, 1, 0),
    (0, 0, 1),
    (1, 0, 1),
    (1, 1, 1),
    (0, 1, 1),
)  # of C3D8, in its order
LIMIT = 1200.0  # seconds for one run of ccx


def solid(elements: int) -> Scene:
    material = Material(STIFF, 0.3)
    return scenes.flat_punch(3, elements=elements, mu=MU, upper=material, lower=material)


def solid_deck(scene: Scene, factor: float) -> str:
    """The punch of a quarter in space, C3D8 on the same nodes; a quarter carries a quarter of the
    force.
    """
    meshes = [part.build_mesh(scene.elements, None) for part in (scene.upper, scene.lower)]  # type: ignore[union-attr]
    starts = 0, meshes[0].p.shape[1]
    lines = ["*NODE, NSET=ALL"]
    lines += [
        f"{i}, {x:.12e}, {y:.12e}, {z:.12e}"
        for i, (x, y, z) in enumerate(np.hstack([m.p for m in meshes]).T, 1)
    ]
    first = 1
    held, surfaces = ["*BOUNDARY"], []
    for body, (mesh, start, name) in enumerate(zip(meshes, starts, "UL")):
        corners = _bricks(mesh) + start + 1
        lines.append(f"*ELEMENT, TYPE=C3D8, ELSET={name}")
        lines += [f"{i}, " + ", ".join(map(str, own)) for i, own in enumerate(corners.T, first)]
        lines += [
            f"*MATERIAL, NAME={name}\n*ELASTIC\n{STIFF:.6e}, 0.3\n*SOLID SECTION, ELSET={name},"
            f" MATERIAL={name}"
        ]
        for boundary, components in (
            ("symmetry x", (1,)),
            ("symmetry y", (2,)),
            ("bottom", (1, 2, 3)),
            ("top", (1, 2)),
        ):
            if boundary in mesh.boundaries and (boundary, body) != ("top", 1):
                nodes = np.unique(mesh.facets[:, np.asarray(mesh.boundaries[boundary])]) + start + 1
                held += [f"{n}, {c}, {c}" for n in nodes for c in components]
        facets = np.asarray(mesh.boundaries["top" if body else "contact"])
        side = f"S{2 if body else 1}"  # the faces below and above a brick
        surfaces.append(
            f"*SURFACE, NAME=SURFACE{name}\n"
            + "\n".join(f"{e + first}, {side}" for e in mesh.f2t[0, facets])
        )
        first += corners.shape[1]
    top = np.unique(meshes[0].facets[:, np.asarray(meshes[0].boundaries["top"])]) + 1
    tied = [f"*EQUATION\n2\n{n}, 3, 1., {top[0]}, 3, -1." for n in top[1:]]
    area = float(np.prod(np.ptp(meshes[0].p, axis=1)[:2]))
    stiffness, load = factor * STIFF * scene.elements / 20.0, 100.0 / scene.copies
    law = [
        "*SURFACE INTERACTION, NAME=LAW",
        (
            f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{stiffness:.6e},"
            f" {TENSION * load / area:.6e}"
        ),
        f"*FRICTION\n{MU:.6e}, {STICK * stiffness:.6e}",
        "*CONTACT PAIR, INTERACTION=LAW, TYPE=NODE TO SURFACE, SMALL SLIDING\nSURFACEU, SURFACEL",
    ]
    step = (
        f"*STEP\n*STATIC\n1., 1., {LEAST}\n*CLOAD\n{top[0]}, 3, {-load:.12e}\n*NODE PRINT,"
        " NSET=ALL\nU\n*END STEP\n"
    )
    return "\n".join([*lines, *held, *tied, *surfaces, *law, step])


def _bricks(mesh: Any) -> np.ndarray:
    """Corners (8, c) of bricks along the axes, in the order of C3D8."""
    x = mesh.p[:, mesh.t]
    upper = x > x.mean(axis=1, keepdims=True)
    number = {corner: i for i, corner in enumerate(CORNERS)}
    place = np.array([[[number[i, j, k] for k in (0, 1)] for j in (0, 1)] for i in (0, 1)])
    order = place[tuple(upper.astype(int))]  # (8, c): where each corner goes
    return np.take_along_axis(mesh.t, np.argsort(order, axis=0), axis=0)


def run_ccx(program: str, text: str, limit: float) -> dict[str, Any]:
    """One run of ccx: its end, CPU time, iterations, memory and displacements (N, d) of all nodes
    in the order of the deck.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "job.inp").write_text(text)
        before, begin, memory = (
            resource.getrusage(resource.RUSAGE_CHILDREN),
            time.perf_counter(),
            0.0,
        )
        with open(folder / "log", "w") as log:
            process = subprocess.Popen(
                [program, "job"], cwd=folder, stdout=log, stderr=subprocess.STDOUT
            )
            while process.poll() is None:
                memory = max(memory, peak_memory(process.pid))
                if time.perf_counter() - begin > limit:
                    process.kill()
                time.sleep(0.05)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = process.returncode == 0 and "Job finished" in (folder / "log").read_text(
            errors="replace"
        )
        history = folder / "job.cvg"
        return {
            "end": (
                "converged"
                if done
                else f"no answer within {limit:.0f} s"
                if process.returncode < 0
                else "failed"
            ),
            "CPU [s]": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
            "iterations": (
                max(0, len(history.read_text().strip().splitlines()) - 4) if history.exists() else 0
            ),
            "memory [MB]": memory,
            "displacements": printed(folder / "job.dat")["displacements"][:, 1:] if done else None,
        }


def own_run(scene: Scene) -> tuple[dict[str, Any], Reduction, Solution]:
    begin = time.process_time()
    reduction = reduce_bodies(scene)
    solution = solve(reduction.problem)
    recover(reduction, solution)
    spent = time.process_time() - begin
    row = {
        "end": solution.status.label,
        "CPU [s]": spent,
        "iterations": solution.iterations,
        "memory [MB]": "",
    }
    return row, reduction, solution


def compared(
    program: str, name: str, scene: Scene, text: str, limit: float
) -> list[dict[str, Any]]:
    own, reduction, solution = own_run(scene)
    head = {"scene": name, "unknowns": reduction.dofs, "contacts": reduction.problem.contacts}
    found = run_ccx(program, text, limit)
    U = np.concatenate(
        [
            displaced[body.body.unknowns].T
            for body, displaced in zip(reduction.bodies, reduction.displaced(solution))
        ]  # type: ignore[attr-defined]
    )
    moved = found.pop("displacements")
    error = (
        "" if moved is None else float(np.abs(moved[:, : U.shape[1]] - U).max() / np.abs(U).max())
    )
    ratio = found["CPU [s]"] / own["CPU [s]"]
    return [
        head
        | {
            "solver": "contactopt",
            **own,
            "displacements, largest difference": "reference",
            "over contactopt": 1.0,
        },
        head
        | {
            "solver": "ccx",
            **found,
            "displacements, largest difference": error,
            "over contactopt": ratio,
        },
    ]


TEXT = """How long do CalculiX and contactopt take for the same large problem? The scene is the punch with friction, mu = {mu}, from a cold start. Both
codes have the very same nodes and elements: bilinear elements in the plane, and trilinear ones on a
quarter of the scene in three dimensions. Each code runs once.

The time of contactopt, at its defaults, includes meshes, assembly, reduction, solution and
stresses. CalculiX uses its direct solver and node-to-surface penalty contact with the factor
{factor:.0e}. Its time includes the reading of the deck. Times are CPU seconds, because other
programs had a share of the machine. Memory is that of ccx alone: all runs of contactopt share one
process. If a run was ended at its time limit, the ratio is a lower bound.

{{rows}}

{{growth}}
"""


def growth(rows: list[dict[str, Any]]) -> str:
    """One sentence: the exponents of the CPU times in space by the number of unknowns, over the
    runs that ended.
    """
    said = []
    for solver, good in (("ccx", "converged"), ("contactopt", "solved")):
        own = [
            row
            for row in rows
            if (row["scene"], row["solver"], row["end"]) == ("punch in space", solver, good)
        ]
        if len(own) > 1:
            n, seconds = (
                np.log([float(row[key]) for row in own]) for key in ("unknowns", "CPU [s]")
            )
            said.append(f"{solver} as the power {np.polyfit(n, seconds, 1)[0]:.2f}")
    return (
        f"In space the time grows, by {' and by '.join(said)} of the number of unknowns, over the"
        " runs that ended."
    )


def main() -> None:
    program = shutil.which("ccx")
    if program is None:
        print(
            "CalculiX is not installed; on Debian or Ubuntu `apt-get install calculix-ccx` provides"
            " its solver, ccx."
        )
        return
    limit = float(sys.argv[sys.argv.index("--limit") + 1]) if "--limit" in sys.argv else LIMIT
    plane = punch(PLANE)
    contact = penalty(plane, "node-to-surface", FACTOR)
    plane_deck = deck(model(plane), Contact(contact.law, contact.stiffness, contact.stick, "top"))
    rows = compared(program, "punch in the plane", plane, plane_deck, limit)
    for elements in SPACE:
        space = solid(elements)
        rows += compared(program, "punch in space", space, solid_deck(space, FACTOR), limit)
    write(
        "calculix_large",
        "CalculiX at a hundred thousand unknowns",
        TEXT.format(mu=MU, factor=FACTOR).replace("{growth}", growth(rows)),
        {"rows": rows},
        {},
    )


if __name__ == "__main__":
    main()

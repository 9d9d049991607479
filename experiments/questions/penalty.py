"""What does a penalty factor cost, and what do augmented Lagrangian iterations repair?"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from statistics import median
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, cg, eigsh

from contactopt import InterfaceProblem, natural_map_residual, reduce_bodies, scenes, solve
from contactopt.coupling.reduction import Reduction
from contactopt.figures.style import (
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    LETTERS,
    ORANGE,
    label_ends,
    paper_axes,
)
from contactopt.problem import Solution
from contactopt.problem.contact_status import contact_status
from contactopt.readings.quantities import value_of
from experiments.report import measure, template

Row = dict[str, Any]
SIZE = 25.0  # of the bodies, over the half-width of contact
MESHES = 8, 16, 32  # elements across the half-width of contact
FACTORS = 10.0 ** np.arange(-2, 7)  # nodal stiffness over E h
RECIPES = {0.1: "explicit codes: 0.1 E/h", 1.0: "E/h", 10.0: "10 E/h", 100.0: "100 E/h"}
STEPS = (0, 1, 2, 5, 10)  # augmented Lagrangian iterations
CG = 1e-8  # relative residual at which conjugate gradients end
CERTIFIED, REPEATS = 1e-8, 3  # certificate asked for
MOST = {"augmented Lagrangian": 1000, "Uzawa": 4000, "lagrangian": 200}  # iterations


@cache
def scene_of(elements: int) -> tuple[Reduction, Solution, np.ndarray]:
    """Cattaneo's cylinders: interface problem, its solution by multipliers, and E h of each node.

    A penalty of E / h per area makes a node of area A as stiff as E A / h.
    """
    whole = scenes.cattaneo(2)
    scene = scenes.cattaneo(2, size=SIZE * whole.reference.half_width, elements=elements)
    reduction = reduce_bodies(scene, Q="explicit")
    problem = reduction.problem
    h = problem.areas / scene.thickness
    return reduction, solve(problem, tol=1e-12), scene.parts[0].material.E * problem.areas / h


def softened(
    problem: InterfaceProblem, kappa: np.ndarray, r: np.ndarray | float = 0.0
) -> InterfaceProblem:
    """The problem of which one step of the augmented Lagrangian from the forces r is the solution:
    r_new = P(r - kappa u). A penalty is the step from r = 0.
    """
    soft = np.repeat(1 / kappa, problem.dim)
    shifted = problem.q - np.broadcast_to(r, problem.q.shape) / kappa[:, None]
    return replace(problem, Q=problem.Q + np.diag(soft), q=shifted)


def gaps(problem: InterfaceProblem, solution: Solution) -> np.ndarray:
    """Relative displacements u (k, dim) of the surfaces, with the gap."""
    move = problem.Q @ solution.reactions.ravel() + problem.V @ solution.multipliers
    return np.asarray(move.reshape(problem.q.shape) + problem.q)


def recipes() -> list[Row]:
    """What a factor costs in penetration, slip, pressure and friction, and after some iterations.

    Everything is compared with multipliers on the same mesh: penetration over the height of the
    cylinder at the edge of contact, slip of sticking nodes over the largest slip; the other errors
    are relative.
    """
    rows = []
    for elements in MESHES:
        reduction, exact, unit = scene_of(elements)
        problem, reference = reduction.problem, reduction.scene.reference
        assert reference is not None
        status, true = contact_status(problem, exact.reactions), gaps(problem, exact)
        a, place = reference.half_width, np.abs(problem.coordinates[0])
        sag = float(
            np.interp(a, np.sort(place), problem.q[np.argsort(place), 0] - problem.q[:, 0].min())
        )
        slip = np.abs(true[status.slip, 1]).max()
        read = {q: value_of(q, reduction, exact) for q in ("pressure", "width", "stick")}
        for factor in RECIPES:
            r: np.ndarray | float = 0.0
            for step in range(max(STEPS) + 1):
                made = softened(problem, factor * unit, r)
                found = solve(made, tol=1e-12)
                r = found.reactions
                if step not in STEPS:
                    continue
                u = gaps(problem, found)
                shear = np.linalg.norm(r[:, 1] - exact.reactions[:, 1])
                rows.append(
                    {"elements": elements, "E/h times": factor, "steps": step}
                    | {"penetration": float(np.maximum(-u[:, 0], 0).max() / sag)}
                    | {"slip of stick": float(np.abs(u[status.stick, 1]).max() / slip)}
                    | {"friction": float(shear / np.linalg.norm(exact.reactions[:, 1]))}
                    | {q: value_of(q, reduction, found) / read[q] - 1 for q in read}
                    | {"mesh": read["pressure"] / reference.peak - 1}
                    | {"certificate": natural_map_residual(problem, r, found.multipliers)}
                )
    return rows


def stiffness(reduction: Reduction) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """The stiffness of both bodies in their free displacements and the motions of their plates, and
    the map from these to the relative displacements of the contacts.
    """
    blocks, maps = [], []
    for body, B in zip(reduction.bodies, reduction.maps):
        own: Any = body
        free = sp.identity(len(own.body.load), format="csr")[:, own.body.free]
        T = sp.hstack([free, sp.csr_matrix(own.body.motion)]).tocsr()
        blocks.append(T.T @ own.body.A @ T)
        maps.append(B @ T)
    return sp.block_diag(blocks).tocsr(), sp.hstack(maps).tocsr()


def iterations(A: Any, b: np.ndarray) -> int:
    """Steps of conjugate gradients with the diagonal as preconditioner; -1 where they fail."""
    scale = 1 / A.diagonal()
    M, count = LinearOperator(A.shape, lambda x: scale * np.ravel(x)), [0]

    def step(x: np.ndarray) -> None:
        count[0] += 1

    ended = cg(A, b, rtol=CG, maxiter=20000, M=M, callback=step)[1]
    return count[0] if ended == 0 else -1


def condition(A: sp.csr_matrix) -> float:
    """The condition number of a definite matrix whose diagonal is scaled to one."""
    scale = sp.diags(1 / np.sqrt(A.diagonal()))
    scaled = (scale @ A @ scale).tocsc()
    largest = eigsh(scaled, 1, which="LA", return_eigenvectors=False)[0]
    least = eigsh(scaled, 1, sigma=0.0, which="LM", return_eigenvectors=False)[0]
    return float(largest / least)


def forms() -> list[Row]:
    """Condition number and inner iterations of the last linear system, in both forms.

    Displacements are the unknowns of the stiffness K + B' kappa B, forces those of the compliance
    Q + 1 / kappa, on the forces that balance the loads. Only contacts that touch are in B, and
    their tangential component only where they stick.
    """
    rows, rng = [], np.random.default_rng(0)
    for elements in MESHES[:2]:
        reduction, exact, unit = scene_of(elements)
        problem = reduction.problem
        status = contact_status(problem, exact.reactions)
        active = np.flatnonzero(np.column_stack([status.touching, status.stick]).ravel())
        K, B = stiffness(reduction)
        B, V = B[active], problem.V[active]
        Z = np.linalg.svd(V.T)[2][np.linalg.matrix_rank(V) :].T  # of balanced forces
        load, push = rng.normal(size=K.shape[0]), rng.normal(size=Z.shape[1])
        for factor in FACTORS:
            kappa = factor * np.repeat(unit, problem.dim)[active]
            stiff = (K + B.T @ sp.diags(kappa) @ B).tocsr()
            soft = Z.T @ (problem.Q[np.ix_(active, active)] + np.diag(1 / kappa)) @ Z
            row: Row = {"elements": elements, "E/h times": float(factor)}
            row |= {"stiffness, condition": condition(stiff)}
            row |= {"stiffness, iterations": iterations(stiff, load)}
            row |= {"compliance, condition": float(np.linalg.cond(soft))}
            rows.append(row | {"compliance, iterations": iterations(soft, push)})
            print(rows[-1], flush=True)
    return rows


def ways(problem: InterfaceProblem, unit: np.ndarray) -> Iterator[tuple[str, float, Any]]:
    """Name, factor and a function that solves; a penalty ends where its own problem is solved."""
    mean = float(np.diag(problem.Q).mean() * unit.mean())  # takes E h to one over the compliance
    own = partial(solve, problem, tol=CERTIFIED)
    for factor in FACTORS:
        yield "penalty", factor, partial(solve, softened(problem, factor * unit), "newton", 1e-10)
        name = "augmented Lagrangian"
        step = {"rho": factor * mean, "max_iterations": MOST[name]}
        yield name, factor, partial(own, method="augmented_lagrangian", **step)
    yield "Newton on multipliers", np.nan, partial(own, method="newton")
    yield "lagrangian", np.nan, partial(own, method="lagrangian", max_iterations=MOST["lagrangian"])
    most = {"explicit": True, "max_iterations": MOST["Uzawa"]}
    yield "Uzawa", np.nan, partial(own, method="augmented_lagrangian", **most)


def times() -> list[Row]:
    """Seconds to a certificate, and the certificate and the error of the forces at the end."""
    rows = []
    for elements in MESHES:
        reduction, exact, unit = scene_of(elements)
        problem = reduction.problem
        solve(problem)
        for name, factor, act in ways(problem, unit):
            seconds = []
            for _ in range(REPEATS):
                begin = time.process_time()
                found = act()
                seconds.append(time.process_time() - begin)
                if seconds[0] > 1:
                    break
            off = np.linalg.norm(found.reactions - exact.reactions)
            reached = natural_map_residual(problem, found.reactions, found.multipliers)
            rows.append(
                {"elements": elements, "method": name, "E/h times": factor}
                | {"cpu": median(seconds), "iterations": found.iterations}
                | {"certificate": reached, "error": float(off / np.linalg.norm(exact.reactions))}
                | {"end": str(found.status)}
            )
            print(rows[-1], flush=True)
    return rows


def draw_recipes(rows: list[Row]) -> Any:
    """Errors of a penalty over its factor; bands are the meshes."""
    figure, (ax,) = paper_axes()
    first, ends = [row for row in rows if row["steps"] == 0], []
    kinds = {"penetration": "penetration", "slip of stick": "false slip"}
    kinds |= {"friction": "friction", "pressure": "peak pressure"}
    for (key, name), colour in zip(kinds.items(), COLOURS):
        found = np.array([[abs(r[key]) for r in first if r["elements"] == n] for n in MESHES])
        ax.fill_between(list(RECIPES), found.min(0), found.max(0), color=colour, alpha=0.2, lw=0)
        ax.loglog(list(RECIPES), found[1], "o-", color=colour)
        ends.append((list(RECIPES)[-1], float(found[1, -1]), name, colour))
    mesh = [abs(row["mesh"]) for row in first]
    ax.axhspan(min(mesh), max(mesh), color=GREY, alpha=0.3, lw=0)
    ax.text(0.1, max(mesh) * 0.85, "error of the mesh", color=GREY, fontsize=LETTERS, va="top")
    ax.axhline(0.01, color=GREY, lw=0.6, ls=":")
    ax.text(100, 0.011, "1 %", color=GREY, fontsize=LETTERS, ha="right", va="bottom")
    ax.set_xticks(list(RECIPES), ["0.1 E/h", "E/h", "10 E/h", "100 E/h"])
    ax.minorticks_off()
    ax.set(xlabel="penalty factor", ylabel="relative error [-]")
    label_ends(ax, ends)
    return figure


def draw_repair(rows: list[Row]) -> Any:
    """Error of friction over the iterations of the augmented Lagrangian."""
    figure, (ax,) = paper_axes()
    ends = []
    for factor, colour in zip(RECIPES, COLOURS):
        own = [r for r in rows if r["E/h times"] == factor]
        found = np.array([[r["friction"] for r in own if r["elements"] == n] for n in MESHES])
        found = np.maximum(found, 1e-12)
        ax.fill_between(STEPS, found.min(0), found.max(0), color=colour, alpha=0.2, lw=0)
        ax.semilogy(STEPS, found[1], "o-", color=colour)
        last = 2 if factor > 1 else -1
        ends.append((STEPS[last], float(found[1, last]), f"{factor:g} E/h", colour))
    ax.set(
        xlabel="augmented Lagrangian iterations", ylabel="error of friction [-]", ylim=(1e-10, 1)
    )
    ax.set_xticks(STEPS)
    for x, y, name, colour in ends:
        side = {"xytext": (3, 3), "textcoords": "offset points"}
        ax.annotate(name, (x, y), color=colour, fontsize=LETTERS, annotation_clip=False, **side)
    return figure


def draw_forms(rows: list[Row]) -> Any:
    """Inner iterations of both forms over the factor."""
    figure, (ax,) = paper_axes()
    ends = []
    for form, colour in (("stiffness", ORANGE), ("compliance", BLUE)):
        for n, style in zip(MESHES, ("s--", "o-")):
            own = [r for r in rows if r["elements"] == n]
            x, y = ([r[key] for r in own] for key in ("E/h times", f"{form}, iterations"))
            ax.loglog(x, y, style, color=colour, mfc="white" if "--" in style else colour)
        ends.append((x[-1], y[-1], "stiffness\n$K + \\kappa B^T B$" if form == "stiffness"
                     else "compliance\n$Q + 1/\\kappa$", colour))  # fmt: skip
    ax.axvspan(1, 100, color=GREY, alpha=0.15, lw=0)
    ax.text(10, 1.5, "usual recipes", color=GREY, fontsize=LETTERS, ha="center")
    ax.set(xlabel="penalty factor over E/h [-]", ylabel="inner iterations [-]", ylim=(1, None))
    label_ends(ax, ends)
    return figure


def draw_times(rows: list[Row]) -> Any:
    """Error of the forces over the time, on the finest mesh; crosses are failures."""
    figure, (ax,) = paper_axes()
    own = [row for row in rows if row["elements"] == MESHES[-1]]
    colours = {"penalty": ORANGE, "augmented Lagrangian": BLUE, "Newton on multipliers": GREEN}
    named = {"penalty": (0.01, 1.0, 100.0), "augmented Lagrangian": (0.01, 0.1)}  # factors
    for row in own:
        row["drawn"] = max(float(row["error"]), 1e-12)
    for name, colour in colours.items():
        x, y = np.array([(r["cpu"], r["drawn"]) for r in own if r["method"] == name]).T
        ax.loglog(x, y, "o-", color=colour, ms=4, lw=0.8)
    for row in own:
        colour, good = colours.get(row["method"], GREY), row["end"] == "solved"
        name = row["method"]
        if name in ("lagrangian", "Uzawa"):
            ax.loglog(row["cpu"], row["drawn"], "o" if good else "x", color=GREY, ms=4)
        if name in named:
            if row["E/h times"] not in named[name]:
                continue
            name = f"{row['E/h times']:g} E/h"
        way = -1 if colour == BLUE else 1  # of the label
        side = {"xytext": (4 * way, 3), "textcoords": "offset points", "annotation_clip": False}
        side["ha"] = "right" if way < 0 else "left"
        ax.annotate(name, (row["cpu"], row["drawn"]), color=colour, fontsize=LETTERS, **side)
    ax.text(0.98, 0.97, "penalty", color=ORANGE, transform=ax.transAxes, ha="right", va="top",
            fontsize=LETTERS)  # fmt: skip
    ax.text(0.98, 0.89, "augmented Lagrangian", color=BLUE, transform=ax.transAxes, ha="right",
            va="top", fontsize=LETTERS)  # fmt: skip
    ax.set(xlabel="CPU time [s]", ylabel="error of the forces [-]")
    return figure


if __name__ == "__main__":
    measure(
        "penalty",
        "Penalty, augmented Lagrangian, multipliers",
        template(__file__),
        {"recipes": recipes, "forms": forms, "times": times},
        lambda tables: {
            "recipes": draw_recipes(tables["recipes"]),
            "repair": draw_repair(tables["recipes"]),
            "forms": draw_forms(tables["forms"]),
            "times": draw_times(tables["times"]),
        },
    )

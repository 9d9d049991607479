"""Triangles or quadrilaterals, tetrahedra or hexahedra, linear or quadratic displacement: which is
cheapest?

A rigid sphere is pressed on a half-space without friction; the exact answer is that of Hertz. All
meshes of a series are refinements of each other in every place, also far away.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from contactopt import Material, Part, Rigid, Scene, Support, reduce_bodies, solve
from contactopt.analytic import contact_modulus, hertz_point
from contactopt.bodies import elements
from contactopt.figures.style import BLUE, ORANGE, label_ends, paper_axes
from contactopt.meshes.structured import patch, rename, simplices, tensor_mesh
from contactopt.readings.edges import contact_edge
from experiments.report import measure, template

RUBBER, RADIUS = Material(5.0, 0.3), 50.0  # MPa; of the sphere, in contact half-widths
SIZE = {2: 30_000.0, 3: 20.0}  # of the body, in contact half-widths
# elements grow by 1 + FAR / n away from the contact, n of them across the half-width
FAR = {2: 3.0, 3: 4.0}
# (dim, degree) -> n
ACROSS = {(2, 1): (4, 8, 16, 32), (2, 2): (2, 4, 8, 16), (3, 1): (2, 4, 6, 8), (3, 2): (1, 2, 3)}
KINDS = {
    ("Q", 1): (BLUE, "s--"),
    ("Q", 2): (BLUE, "s-"),
    ("P", 1): (ORANGE, "^--"),
    ("P", 2): (ORANGE, "^-"),
}
CASES = {"sphere": 2, "sphere 3D": 3}
INNER = 0.6  # the ripple is looked for within this share of the contact radius


def grids(n: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Grid across, with node n at 1, and grid of depths."""

    def beyond(start: np.ndarray) -> np.ndarray:
        steps = [start[-1] - start[-2]]
        while sum(steps) < SIZE[dim] - start[-1]:
            steps.append(steps[-1] * (1 + FAR[dim] / n))
        far = np.cumsum(steps)
        return np.concatenate([start, start[-1] + far * (SIZE[dim] - start[-1]) / far[-1]])

    near = np.arange((n + max(2, n // 4) if dim == 3 else 2 * n) + 1) / n
    return beyond(near), -beyond(near[: n + 1])[::-1]


def scene(dim: int, n: int, degree: int, shape: str) -> Scene:
    """A sphere on a half-space, half-width 1: axisymmetric, or a quarter model in 3D."""
    across, rise = grids(n, dim)
    modulus = contact_modulus(RUBBER)
    force = 4 * modulus / (3 * RADIUS)
    limit, up = across[n + max(2, n // 4)], "yz"[dim - 2]
    mesh = rename(tensor_mesh(*[across] * (dim - 1), rise), bottom=f"{up}-", top=f"{up}+")
    mesh = patch(mesh, "top", "contact", [limit] * (dim - 1))
    mesh = simplices(mesh) if shape == "P" else mesh
    components = "rz" if dim == 2 else "xyz"
    sides = tuple(Support(f"{'xy'[i]}-", {components[i]: 0.0}) for i in range(dim - 1))
    rigid = Rigid(
        "indenter",
        normal=(*[0.0] * (dim - 1), 1.0),
        gap=lambda x: np.sum(x[:-1] ** 2, axis=0) / (2 * RADIUS),
        force={components[-1]: -force},
    )
    body = Part("half-space", mesh, RUBBER, (*sides, Support("bottom")))
    kind, exact = "axisymmetric" if dim == 2 else "solid", hertz_point(force, RADIUS, modulus)
    settings = {"copies": 4 ** (dim - 2), "degree": degree, "zone": 1.0, "reference": exact}
    return Scene("elements", rigid, body, 0.0, kind, **settings)


def solved(case: str, n: int, degree: int, shape: str) -> dict[str, object]:
    """One solve, repeated where it is short: relative errors, unknowns, median processor time."""
    dim = 3 if case.endswith("3D") else 2
    made = scene(dim, n, degree, shape)
    times: list[float] = []
    while not times or (len(times) < 3 and sum(times) < 1.0):
        start = time.process_time()
        reduction = reduce_bodies(made)
        solution = solve(reduction.problem, tol=1e-9)
        times.append(time.process_time() - start)
    problem, exact = reduction.problem, made.reference
    assert solution.solved
    pressure = solution.reactions[:, 0] / problem.areas
    x = np.linalg.norm(problem.coordinates[: dim - 1], axis=0)
    row: dict[str, object] = {
        "case": case,
        "shape": shape,
        "degree": degree,
        "n": n,
        "unknowns": reduction.dofs,
    }
    row |= {"contacts": problem.contacts, "seconds": float(np.median(times))}
    approach = float(-solution.multipliers[0] / exact.approach - 1)
    row["approach"] = approach if dim == 2 else np.nan  # the body in 3D is too small for it
    error = pressure / exact.peak - exact.pressure(x) / exact.peak
    inner = x < INNER
    size = np.sum(problem.areas * (exact.pressure(x) / exact.peak) ** 2)
    return row | {
        "peak": float(pressure.max() / exact.peak - 1),
        "radius": (
            float(contact_edge(made, problem, solution.reactions) - 1) if dim == 2 else np.nan
        ),
        "traction": float(np.sqrt(np.sum(problem.areas * error**2) / size)),
        "ripple": float(np.std(error[inner])),
    }


def runs() -> list[dict[str, object]]:
    """All elements on all meshes."""
    return [
        solved(case, n, degree, shape)
        for shape, degree in KINDS
        for case, dim in CASES.items()
        for n in ACROSS[dim, degree]
    ]


@contextmanager
def contacts_at_all_nodes() -> Iterator[None]:
    """Quadratic simplices with contacts at the middles of edges too, as bricks have them."""
    kept = dict(elements.FACES)
    quarters = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    elements.FACES["RefTri"] = (*kept["RefTri"][:3], kept["RefQuad"][3])
    elements.FACES["RefTet"] = (*kept["RefTet"][:3], quarters)
    try:
        yield
    finally:
        elements.FACES.update(kept)


def other_contacts() -> list[dict[str, object]]:
    """Quadratic simplices with contacts at all nodes, on the finest meshes."""
    with contacts_at_all_nodes():
        return [solved(case, ACROSS[dim, 2][-1], 2, "P") for case, dim in CASES.items()]


QUANTITIES = {
    ("sphere", "peak"): "peak pressure",
    ("sphere", "radius"): "contact radius",
    ("sphere", "approach"): "approach",
    ("sphere 3D", "peak"): "peak pressure",
}


def draw(tables: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    figure, axes = paper_axes(2, rows=2, wide=True)
    for ax, ((case, quantity), title) in zip(axes, QUANTITIES.items()):
        solid = ("hexahedra", "tetrahedra") if CASES[case] == 3 else ("quads", "triangles")
        ends = []
        for (shape, degree), (colour, style) in KINDS.items():
            wanted = case, shape, degree
            own = [r for r in tables["runs"] if (r["case"], r["shape"], r["degree"]) == wanted]
            x, y = [r["unknowns"] for r in own], np.abs([r[quantity] for r in own])
            ax.loglog(x, y, style, color=colour, mfc="white" if degree == 1 else colour)
            ends.append((x[-1], y[-1], f"{solid[shape == 'P']}, degree {degree}", colour))
        ax.set(xlabel="displacement unknowns [-]", xlim=(7e2, 7e4))
        ax.set_ylabel(f"error of the {title} [-],\n{case}")
        label_ends(ax, ends)
    return {"errors": figure}


if __name__ == "__main__":
    tables = {"runs": runs, "all_nodes": other_contacts}
    measure("elements", "Shape and degree of the elements", template(__file__), tables, draw)

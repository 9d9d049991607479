"""An elastic 90-degree punch on a body of its own material: at which rates do errors fall on
uniform and on graded meshes?

The punch's edge is the only singular point: plates and supports let the sides slide.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from contactopt import Material, Part, Plate, Scene, Support, reduce_bodies, solve
from contactopt.analytic import corner
from contactopt.coupling.back_to_bodies import recover
from contactopt.meshes.structured import patch, rename, tensor_mesh

MATERIAL = Material(5.0, 0.3)
CASES = {
    "frictionless": (0.0, False, 0.0),
    "mu = .3": (0.3, False, 0.3),
    "bonded": (1e6, True, None),
}
UNIFORM, GRADED, REFERENCE = (4, 8, 16, 32), (8, 16, 32, 64), 64
GRADING = 2.5  # exponent: above 1 / exponent of the stress, 1.84 for the bonded punch
NEAR = 10  # halvings of the element at the edge of the reference mesh

Lines = Callable[[int], np.ndarray]  # n -> grid from the edge, 0, to 1


def uniform(n: int) -> np.ndarray:
    return np.linspace(0, 1, n + 1)


def graded(n: int) -> np.ndarray:
    return np.asarray(np.linspace(0, 1, n + 1) ** GRADING)


def reference(n: int) -> np.ndarray:
    """The uniform grid, its first element halved again and again: holds all coarser functions."""
    grid = uniform(n)
    return np.concatenate([[0.0], grid[1] / 2.0 ** np.arange(NEAR, 0, -1), grid[1:]])


def scene(lines: Lines, mu: float, bilateral: bool) -> Scene:
    """Half of a punch 2 wide and 1 high on a body 6 wide and 2 high, under unit force."""

    def punch(n: int, zone: float | None):  # type: ignore[no-untyped-def]
        return rename(tensor_mesh(1 - lines(n)[::-1], lines(n)), contact="y-", top="y+", axis="x-")

    def base(n: int, zone: float | None):  # type: ignore[no-untyped-def]
        near, even = lines(n), uniform(n)[1:]
        x = np.concatenate([1 - near[::-1], 1 + near[1:], 2 + even])
        mesh = tensor_mesh(x, -np.concatenate([near, 1 + even])[::-1])
        return patch(rename(mesh, top="y+", bottom="y-", axis="x-"), "top", "contact", [1.0])

    axis = Support("axis", {"x": 0.0})
    plate = Plate("top", {"y": -1.0}, glued=False)
    upper = Part("punch", punch, MATERIAL, (axis,), (plate,))
    lower = Part("base", base, MATERIAL, (axis, Support("bottom", {"y": 0.0})))
    return Scene("corner", upper, lower, mu, copies=2, law="bilateral" if bilateral else "coulomb")


def solved(lines: Lines, n: int, mu: float, bilateral: bool):  # type: ignore[no-untyped-def]
    reduction = reduce_bodies(scene(lines, mu, bilateral), n)
    return reduction, solve(reduction.problem, tol=1e-10)


def energy_norm(fine, coarse) -> float:  # type: ignore[no-untyped-def]
    """Of the difference of two solved scenes, the coarse one read at the nodes of the fine one."""
    total = 0.0
    for body, field, other in zip(fine[0].bodies, recover(*fine), recover(*coarse)):
        p = other.mesh.p
        grid = tuple(np.unique(np.round(p[i], 13)) for i in range(2))
        order, shape = np.lexsort((p[1], p[0])), tuple(map(len, grid))
        U = np.zeros(body.body.basis.N)
        for i in range(2):
            values = other.displacement[i][order].reshape(shape)
            coarse_part = RegularGridInterpolator(
                grid, values, bounds_error=False, fill_value=None
            )(field.mesh.p.T)
            U[body.body.basis.nodal_dofs[i]] = field.displacement[i] - coarse_part
        total += float(U @ (body.body.A @ U))
    return float(np.sqrt(total))


def orders(name: str) -> tuple[list[dict[str, object]], dict[str, np.ndarray]]:
    """Rows of the table, and the errors of the approach on uniform and on graded meshes."""
    mu, bilateral, ratio = CASES[name]
    exponent = corner(MATERIAL, MATERIAL, ratio).exponent
    dual = corner(MATERIAL, MATERIAL, None if ratio is None else -ratio).exponent
    approach = {n: -solved(graded, n, mu, bilateral)[1].multipliers[0] for n in GRADED}
    exact = approach[GRADED[-1]] + (approach[GRADED[-1]] - approach[GRADED[-2]]) / 3  # second order
    graded_error = np.array([exact - approach[n] for n in GRADED[:-1]])
    meshes = [solved(uniform, n, mu, bilateral) for n in UNIFORM]
    uniform_error = np.array([exact + solution.multipliers[0] for _, solution in meshes])
    finest = solved(reference, REFERENCE, mu, bilateral)
    norms = np.array([energy_norm(finest, mesh) for mesh in meshes])
    rest = exact + finest[1].multipliers[0]  # what the reference lacks, in the square of the norm
    norms = np.sqrt(norms**2 + rest)

    def rate(errors: np.ndarray, halvings: int = 2) -> float:
        return float(np.log2(errors[-1 - halvings] / errors[-1]) / halvings)

    rows = [
        {
            "contact": name,
            "mesh": "uniform",
            "error": "energy norm",
            "order": rate(norms),
            "theory": exponent,
        },
        {
            "contact": name,
            "mesh": "uniform",
            "error": "approach (force)",
            "order": rate(uniform_error),
            "theory": 2 * exponent,
        },
        {
            "contact": name,
            "mesh": "graded",
            "error": "energy norm",
            "order": rate(np.sqrt(np.abs(graded_error)), 1),
            "theory": 1.0,
        },
        {
            "contact": name,
            "mesh": "graded",
            "error": "approach (force)",
            "order": rate(graded_error, 1),
            "theory": 2.0,
        },
    ]
    for row in rows:
        row["difference"] = float(row["order"]) - float(row["theory"])  # type: ignore[arg-type]
    rows[1]["exponent + exponent of -mu"] = exponent + dual
    return rows, {"uniform": np.abs(uniform_error), "graded": np.abs(graded_error)}

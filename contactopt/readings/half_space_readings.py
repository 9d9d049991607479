"""What is asked of solved half-spaces: real contact area, pressures, stiffness, slip, maps."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from contactopt.bodies.half_space import HalfSpaceBody
from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.linear.operators import block
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.contact_status import contact_status


@dataclass(frozen=True, eq=False)
class SurfaceContact:
    """Numbers of one solved state.

    area, fraction      real contact area [length^2] and its share of all cells [-]
    stick_area, slip_area   areas of the sticking and of the slipping contacts [length^2]
    mean_pressure       normal force over the area of all cells [stress];  contact_pressure  over
                        the real contact area [stress]
    largest_pressure    [stress];  mean_gap  of the open contacts [length]
    slip_work           work of friction if the slip happened in this state's step, sum -r_t'u_t
                        [force length]: the dissipated energy of a state reached in one step from
                        contact without slip. For a load path it is
                        PathResult.history["friction_work"]
    """

    area: float
    fraction: float
    stick_area: float
    slip_area: float
    mean_pressure: float
    contact_pressure: float
    largest_pressure: float
    mean_gap: float
    slip_work: float


def surface_contact(problem: InterfaceProblem, solution: Solution) -> SurfaceContact:
    """The numbers that describe a solved state: areas, pressures, mean gap and friction's work."""
    r, areas = solution.reactions, problem.areas
    status, u = contact_status(problem, r), problem.displacements(r, solution.multipliers)
    area, whole = float(areas[status.touching].sum()), float(areas.sum())
    force, apart = float(r[:, 0].sum()), status.open
    return SurfaceContact(
        area=area,
        fraction=area / whole,
        stick_area=float(areas[status.stick].sum()),
        slip_area=float(areas[status.slip].sum()),
        mean_pressure=force / whole,
        contact_pressure=force / area if area > 0 else 0.0,
        largest_pressure=float((r[:, 0] / areas).max(initial=0.0)),
        mean_gap=float(np.average(u[apart, 0], weights=areas[apart])) if apart.any() else 0.0,
        slip_work=-float(np.sum(r[status.slip, 1:] * u[status.slip, 1:])),
    )


def pressure_distribution(
    problem: InterfaceProblem, solution: Solution, bins: int = 50
) -> tuple[np.ndarray, np.ndarray]:
    """Edges [stress] and density [1 / stress] of the pressure over the real contact area."""
    touching = contact_status(problem, solution.reactions).touching
    pressure = solution.reactions[touching, 0] / problem.areas[touching]
    density, edges = np.histogram(pressure, bins, weights=problem.areas[touching], density=True)
    return edges, density


def contact_stiffness(problem: InterfaceProblem, solution: Solution) -> np.ndarray:
    """The stiffness of the present contacts against relative motions, (dim, dim) along n, t1[, t2]
    [force / length], if no contact changes its state; slipping ones count normally only.
    """
    status = contact_status(problem, solution.reactions)
    takes_part = np.repeat(status.stick[:, None], problem.dim, axis=1)
    takes_part[:, 0] = status.touching
    rows = np.flatnonzero(takes_part.ravel())
    if not len(rows):
        return np.zeros((problem.dim, problem.dim))
    Q = block(problem.Q, rows)
    motions = np.tile(np.eye(problem.dim), (problem.contacts, 1))[rows]
    system = LinearOperator(Q.shape, matvec=lambda x: Q @ x, dtype=float)
    most = 10 * len(rows)
    forces = [cg(system, m, rtol=1e-8, maxiter=most)[0] for m in motions.T]
    return np.asarray(motions.T @ np.stack(forces, axis=1))


def surface_maps(reduction: Reduction, solution: Solution) -> dict[str, np.ndarray]:
    """Pressure, traction, gap, slip and status (0 open, 1 stick, 2 slip) on a half-space's grid."""
    found = [body for body in reduction.bodies if isinstance(body, HalfSpaceBody)]
    if not found:
        raise InputError(
            f"scene '{reduction.scene.name}' has no half-space; this is asked of half-spaces only."
        )
    problem, grid = reduction.problem, found[-1].grid
    r, areas = solution.reactions, problem.areas
    u, status = problem.displacements(r, solution.multipliers), contact_status(problem, r)
    return {
        "pressure": (r[:, 0] / areas).reshape(grid),
        "traction": (r[:, 1:] / areas[:, None]).reshape(*grid, -1),
        "gap": u[:, 0].reshape(grid),
        "slip": u[:, 1:].reshape(*grid, -1),
        "status": (status.stick + 2 * status.slip).reshape(grid),
    }

"""Contact quantities as fields on the surface of every pair and on the nodes of the bodies."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.bodies.views import elements_of
from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL
from contactopt.meshes.cells import area_vectors, facet_nodes
from contactopt.problem import Solution
from contactopt.problem.contact_status import contact_status
from contactopt.readings.peaks import nodal_pressure
from contactopt.readings.resultants import space_forces
from contactopt.scenes.scene import Part

# distances between contacts, beyond the gap, up to which a node of a body belongs to a contact
NEAR = 1.5
STATUS = ("open", "stick", "slip")
CELLS = {2: "line", 3: "triangle", 4: "quad"}  # by their corners


@dataclass(frozen=True, eq=False)
class ContactFields:
    """The k contacts of a pair of surfaces after the solve.

    Forces are those on the upper body, vectors those of space.

    points, cells  (dim, k) positions; (v, c) contacts at the corners of the cells, in space around
                   the normal
    areas          (k,) nodal areas [length^2]
    pressure       (k,) normal force over area [stress];  traction  (dim, k) whole contact force
                   over area [stress]
    gap            (k,) what remains of the gap [length];  slip  (dim, k) tangential motion of upper
                   against lower [length]
    status         (k,) 0 open, 1 stick, 2 slip
    normals        (k, dim) from the lower to the upper body;  first  (k,) initial gap [length]
    nodes          name of a body with a mesh -> (k,) its node that the contact lies at, as the
                   points of its VTU file are numbered, from 0 on; -1 where there is none
    """

    name: str
    points: np.ndarray
    cells: np.ndarray
    areas: np.ndarray
    pressure: np.ndarray
    traction: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    status: np.ndarray
    normals: np.ndarray
    first: np.ndarray
    nodes: dict[str, np.ndarray]

    @property
    def data(self) -> dict[str, np.ndarray]:
        """The quantities as arrays with one row per contact, vectors with three columns."""
        return {
            "contact_pressure": self.pressure,
            "contact_traction": _tall(self.traction),
            "contact_gap": self.gap,
            "contact_slip": _tall(self.slip),
            "contact_status": self.status.astype(float),
        }

    def rows(self, axes: Sequence[str], units: tuple[str, str]) -> tuple[list[str], list[Any]]:
        """The head of a table with units, and a row per contact, empty at no node of a body."""
        length, stress = units
        head = [*(f"{axis} [{length}]" for axis in axes), f"area [{length}^2]"]
        head += [f"pressure [{stress}]", *(f"traction_{axis} [{stress}]" for axis in axes)]
        head += [f"gap [{length}]", *(f"slip_{axis} [{length}]" for axis in axes), "status"]
        columns = [*self.points, self.areas, self.pressure, *self.traction]
        numbers = np.column_stack([*columns, self.gap, *self.slip]).tolist()
        words = np.array(STATUS)[self.status.astype(int)].tolist()
        found = [[*row, word] for row, word in zip(numbers, words)]
        for nodes in self.nodes.values():
            for row, node in zip(found, nodes.tolist()):
                row.append(node if node >= 0 else "")
        return [*head, *(f"node of {name}" for name in self.nodes)], found

    def write_vtu(self, path: Path) -> None:
        """The surface as a VTU file with its quantities at the contacts."""
        import meshio

        cells = [(CELLS[len(self.cells)], self.cells.T)]
        rest = {"contact_normal": _tall(self.normals.T), "contact_initial_gap": self.first}
        meshio.Mesh(_tall(self.points), cells, self.data | rest).write(path, file_format="vtu")


def _tall(x: np.ndarray) -> np.ndarray:
    """(m, 3) rows of vectors (dim, m)."""
    return np.pad(x, ((0, 3 - len(x)), (0, 0))).T


def _along(normals: np.ndarray, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The cells (v, c), in space turned to go around the normals (k, dim) positively."""
    if len(points) < 3:
        return cells
    against = np.einsum("ic,vci->c", area_vectors(points[:, cells]), normals[cells]) < 0
    return np.where(against, cells[::-1], cells)


def contact_fields(reduction: Reduction, solution: Solution) -> tuple[ContactFields, ...]:
    """The ContactFields of each pair, in the order of the pairs."""
    problem, r = reduction.problem, solution.reactions
    u, areas = reduction.moved(solution), problem.areas
    # the contact on an axis has no area
    share = np.divide(1.0, areas, out=np.zeros_like(areas), where=areas > 0)
    traction, status = space_forces(reduction, solution) * share, contact_status(problem, r)
    slip = np.einsum("kad,ka->dk", reduction.frames[:, 1:], u[:, 1:])
    state = np.where(status.open, 0, np.where(status.stick, 1, 2))
    made = []
    for pair, coupling in zip(problem.pairs, reduction.couplings):
        own = pair.contacts
        made.append(
            ContactFields(
                pair.name,
                coupling.positions,
                _along(coupling.frames[:, 0], coupling.positions, coupling.cells),
                areas[own],
                nodal_pressure(problem, solution)[own],
                traction[:, own],
                u[own, 0],
                slip[:, own],
                state[own],
                coupling.frames[:, 0],
                coupling.gap,
                _nodes(reduction, pair.name, coupling.positions),
            )
        )
    return tuple(made)


def _nodes(reduction: Reduction, name: str, places: np.ndarray) -> dict[str, np.ndarray]:
    """The nodes of both bodies of a pair at these places (dim, k), by the names of the bodies."""
    scene, found = reduction.scene, dict[str, np.ndarray]()
    (pair,) = (own for own in scene.pairs if own.name == name)
    near = EQUAL * (float(np.ptp(places, axis=1).max(initial=0.0)) or 1.0)
    for part, body in zip(scene.parts, reduction.bodies):
        elements = elements_of(body)
        if part.name not in pair.bodies or elements is None or not isinstance(part, Part):
            continue
        mesh = elements.basis.mesh
        surface = pair.surfaces[pair.bodies.index(part.name)] or part.contact
        nodes = facet_nodes(mesh, mesh.boundaries[surface])
        apart, nearest = KDTree(mesh.p[:, nodes].T).query(places.T)
        found[part.name] = np.where(apart <= near, nodes[nearest], -1)
    return found


def on_nodes(
    reduction: Reduction, fields: tuple[Fields, ...], surfaces: tuple[ContactFields, ...]
) -> tuple[Fields, ...]:
    """Put contact quantities on the nodes of surfaces, with the sign of each body; else zero."""
    default = {part.name: getattr(part, "contact", None) for part in reduction.scene.parts}
    made = []
    for body in fields:
        data = {
            name: np.zeros((body.mesh.p.shape[1], *value.shape[1:]))
            for name, value in surfaces[0].data.items()
        }
        for pair, surface, coupling in zip(reduction.scene.pairs, surfaces, reduction.couplings):
            for side, (name, boundary) in enumerate(zip(pair.bodies, pair.surfaces)):
                if name != body.name:
                    continue
                nodes = facet_nodes(body.mesh, body.mesh.boundaries[boundary or default[name]])
                tree, count = KDTree(surface.points.T), len(surface.gap)
                spacing = tree.query(surface.points.T, k=min(2, count))[0].reshape(count, -1)
                apart, nearest = tree.query(body.mesh.p[:, nodes].T)
                near = apart <= np.abs(coupling.gap[nearest]) + NEAR * spacing[nearest, -1]
                for key, value in surface.data.items():
                    sign = -1.0 if side == 1 and value.ndim == 2 else 1.0
                    data[key][nodes[near]] = sign * value[nearest[near]]
        made.append(replace(body, contact=data))
    return tuple(made)

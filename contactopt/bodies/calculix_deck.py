"""Input decks of CalculiX (ccx), so that anyone can check a scene with another code.

A deck has the nodes, elements, supports, plates and loads of our assembled bodies. CPE3, CPE4 and
CPE6 in plane strain and C3D4, C3D8 and C3D10 with straight edges in space are our elements: without
contact, displacements agree to the seven digits that ccx prints. Its quadratic quadrilaterals and
hexahedra have no nodes in their middle, and no deck is written with them. Those in plane stress are
solids, and differ from ours by the thickness. Axisymmetric ones are wedges of two degrees:
displacements of CAX4 differ by 1e-4, those of CAX3 and CAX6, which have fewer points of integration
than ours, by 2e-2 and 4e-4 on a coarse mesh and by a third of that on one with half the size
(tests/test_calculix_deck.py). The forces that ccx prints there are those of a wedge.

Tractions and body forces become the nodal forces f that we use. The nodes of a plate move together
by equations, and its total force acts on one of them. A half model carries half of the force: ccx
knows nothing of `copies`.

Contact in ccx is a penalty: pressure = K overclosure, and stick with the slope K / 10, which the
manual advises. K = factor E / h, with h the mean size of the slave's faces and E the smaller
modulus. At a factor of 100 the nodal forces of a flat punch differ from ours by two percent of the
largest, and at 1e4 by a fortieth of a percent (reports/calculix). On a pin in a bush ccx measures
gaps between polygons, and its forces approach ours as the mesh gets finer
(tests/test_calculix_deck.py). The carrier of the contacts is the slave. The master also has the
faces around the contact boundary: a node that slides over an edge is lost.

Source: G. Dhondt, CalculiX CrunchiX USER'S MANUAL.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from contactopt.bodies import assemble
from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.bodies.assembly import Assembly
from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.meshes.cells import elements_of, second_order
from contactopt.meshes.inp_elements import FACES
from contactopt.problem.laws import find_law
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Scene

FACTOR = 100.0
WEDGES = 180  # of two degrees make a ring
LEAST = 0.001  # increment of the load at which ccx gives up; the first is the whole load


def deck(scene: Scene, factor: float = FACTOR) -> str:
    """A scene of elastic bodies under Coulomb's law with one number mu, as an input deck that ccx
    runs unchanged; the contacts are as stiff as `factor`, in units of E / h.

    ccx prints the displacements of all nodes, U, and the forces of supports, plates and loads on
    them, RF, into its .dat file. InputError for what a deck cannot say.
    """
    _check(scene)
    check_number("the penalty factor of a deck of CalculiX", factor, low=0.0)
    bodies: list[_Numbered] = []
    for part in scene.parts:
        made = assemble(scene, part, scene.elements, scene.zone)
        assert isinstance(made, AssembledElastic)
        bodies.append(_Numbered(made.body, scene, bodies[-1].after if bodies else (0, 0)))
    named = {body.name: body for body in bodies}
    lines = [f"** {scene.name}, written by contactopt"]
    if scene.analysis.revolved:
        lines += [f"** ccx prints the forces of a wedge, 1/{WEDGES} of those of the ring"]
    lines += ["*NODE, NSET=NODES"]
    for step in (_Numbered.nodes, _Numbered.elements, _Numbered.held, _Numbered.plates):
        for body in bodies:
            lines += step(body)
    for number, pair in enumerate(scene.pairs, 1):
        lines += _contact(scene, pair, named, factor, number)
    lines += ["*STEP, INC=1000", f"*STATIC\n1., 1., {LEAST}"]
    for body in bodies:
        lines += body.loads()
    lines += ["*NODE PRINT, NSET=NODES\nU, RF", "*NODE FILE\nU, RF", "*EL FILE\nS", "*END STEP"]
    return "\n".join(lines) + "\n"


def _check(scene: Scene) -> None:
    """Raise InputError for what a deck cannot say."""
    for part in scene.parts:
        if not (part.elastic and part.meshed):
            raise InputError(
                f"body '{part.name}' has no mesh, and a deck of CalculiX needs one; make it a Part,"
                " stiff where it is rigid."
            )
    for part in scene.meshed.values():
        shape = part.build_mesh(scene.elements, scene.zone).refdom.__name__
        if scene.degree == 2 and shape not in ("RefTri", "RefTet"):
            raise InputError(
                f"body '{part.name}': quadratic quadrilaterals and hexahedra of CalculiX have no"
                " nodes in their middle, and are not those of this scene; give degree = 1, or a"
                " mesh of triangles or tetrahedra."
            )
    for pair in scene.pairs:
        law, number = find_law(pair.law), not callable(pair.mu) and np.ndim(pair.mu) == 0
        if not (law.plain_coulomb() and number) and (law.frictional or not law.opens):
            raise InputError(
                f"contact '{pair.name}': a deck of CalculiX takes Coulomb's law with one number mu,"
                " or no friction."
            )


class _Numbered:
    """An assembled body whose nodes and elements are numbered after those of the bodies before.

    cells  (corners, elements) nodes of the body, in the order and orientation of ccx
    """

    def __init__(self, body: Assembly, scene: Scene, before: tuple[int, int]):
        mesh = body.basis.mesh
        if scene.degree == 2:
            mesh = second_order(mesh, body.locations)
        self.body, self.name, self.scene, self.mesh = body, body.name, scene, mesh
        self.first_node, self.first_element = before
        self.after = before[0] + mesh.p.shape[1], before[1] + mesh.t.shape[1]
        self.kind, cells = elements_of(mesh)
        self.kind, self.cells = self.kind.rstrip("0123456789"), cells.T

    def nodes(self) -> Iterator[str]:
        for number, x in enumerate(self.mesh.p.T, self.first_node + 1):
            yield ", ".join([str(number), *map(_number, x)])

    def elements(self) -> Iterator[str]:
        """Elements, material and section."""
        name, material = f"BODY{self.first_element + 1}", self.body.material
        yield f"*ELEMENT, TYPE={self.scene.analysis.deck}{len(self.cells)}, ELSET={name}"
        for number, cell in enumerate(self.cells.T + self.first_node + 1, self.first_element + 1):
            yield ", ".join(map(str, [number, *cell]))
        constants = f"{_number(material.E)}, {_number(material.nu)}"
        yield f"*MATERIAL, NAME={name}\n*ELASTIC\n{constants}"
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"
        if self.scene.dim == 2 and not self.scene.analysis.revolved:
            yield _number(self.scene.thickness)

    def _places(self, mask: np.ndarray) -> Iterator[tuple[str, int]]:
        """'node, component' of the unknowns in a mask (n,), and their numbers."""
        for component, row in enumerate(self.body.unknowns, 1):
            for node in np.flatnonzero(mask[row]):
                yield f"{self.first_node + node + 1}, {component}", int(row[node])

    def held(self) -> Iterator[str]:
        """Displacements that supports and plates prescribe."""
        held = np.ones(len(self.body.load), dtype=bool)
        held[self.body.free] = False
        held[np.flatnonzero(abs(self.body.motion).sum(axis=1))] = False
        if held.any():
            yield "*BOUNDARY"
        for place, unknown in self._places(held):
            yield f"{place}, {place.split()[-1]}, {_number(self.body.prescribed[unknown])}"

    def plates(self) -> Iterator[str]:
        """The nodes of a plate move as its first one does."""
        for column in self.body.motion.T:
            first, *others = (place for place, _ in self._places(column != 0))
            for place in others:
                yield f"*EQUATION\n2\n{place}, 1., {first}, -1."

    def loads(self) -> Iterator[str]:
        """Nodal forces of one image, and the total forces of plates."""
        share = 1.0 / self.scene.copies
        yield from ["*CLOAD"] if self.body.load.any() or len(self.body.plate_forces) else []
        for place, unknown in self._places(self.body.load != 0):
            yield f"{place}, {_number(self.body.load[unknown] * share)}"
        for column, force in zip(self.body.motion.T, self.body.plate_forces):
            place, _ = next(self._places(column != 0))
            yield f"{place}, {_number(force * share)}"

    def facets(self, boundary: str, around: bool) -> np.ndarray:
        """Facets of a boundary; with those around it that go on smoothly, if asked for."""
        mesh, own = self.mesh, np.asarray(self.mesh.boundaries[boundary])
        if not around:
            return own
        outer = mesh.boundary_facets()
        beside = outer[np.isin(mesh.facets[:, outer], mesh.facets[:, own]).any(axis=0)]
        normals = self.body.basis.mapping.normals(
            np.full((mesh.dim(), len(beside), 1), 0.0), mesh.f2t[0, beside], beside, mesh.t2f
        )[:, :, 0]
        mean = normals[:, np.isin(beside, own)].mean(axis=1)
        return np.asarray(beside[np.isin(beside, own) | (mean @ normals > 0.7)])  # about smooth

    def surface(self, name: str, facets: np.ndarray) -> Iterator[str]:
        """A surface of ccx, by elements and the numbers of their faces."""
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
        elements = self.mesh.f2t[0, facets]
        ends = np.sort(self.mesh.facets[:, facets], axis=0)
        for number, corners in enumerate(FACES[self.kind], 1):
            here = np.sort(self.cells[list(corners)][:, elements], axis=0)
            for element in elements[(here == ends).all(axis=0)]:
                yield f"{self.first_element + element + 1}, S{number}"

    def size(self, facets: np.ndarray) -> float:
        """Mean length of edges, or root of the mean area of faces, of some facets."""
        ends = self.mesh.p[:, self.mesh.facets[:, facets]]
        first, last = ends[:, 1] - ends[:, 0], ends[:, -1] - ends[:, 0]
        if self.scene.dim == 2:
            return float(np.linalg.norm(first, axis=0).mean())
        half = np.linalg.norm(np.cross(first.T, last.T), axis=1) / (1 if len(ends[0]) == 4 else 2)
        return float(np.sqrt(half.mean()))


def _contact(
    scene: Scene, pair: Contact, bodies: dict[str, _Numbered], factor: float, number: int
) -> Iterator[str]:
    """Surfaces, law of contact and friction of a pair."""
    parts = scene.meshed
    sides = [(bodies[name], surface or parts[name].contact)
             for name, surface in zip(pair.bodies, pair.surfaces)]  # fmt: skip
    (slave, on), (master, under) = sides[::-1] if pair.carrier == "lower" else sides
    facets = slave.facets(on, around=False)
    yield from slave.surface(f"SLAVE{number}", facets)
    yield from master.surface(f"MASTER{number}", master.facets(under, around=True))
    modulus = min(slave.body.material.E, master.body.material.E)
    stiffness = factor * modulus / slave.size(facets)
    yield f"*SURFACE INTERACTION, NAME=LAW{number}"
    yield f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{_number(stiffness)}"
    mu: Any = pair.mu
    if find_law(pair.law).frictional and mu > 0:
        yield f"*FRICTION\n{_number(float(mu))}, {_number(stiffness / 10)}"
    yield f"*CONTACT PAIR, INTERACTION=LAW{number}, TYPE=SURFACE TO SURFACE"
    yield f"SLAVE{number}, MASTER{number}"


def _number(value: float) -> str:
    """At most 20 characters with a decimal point: ccx takes others for names or components."""
    return f"{value:.12e}"

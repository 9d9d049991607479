"""Input decks of CalculiX (ccx) from scenes in plane strain: the same nodes, elements, supports and
plate.

Nodes and elements are numbered from 1, upper body first. Elements are CPE4, which ccx expands into
one layer of bricks C3D8 as thick as the section, displacements across the layer held: 2 x 2 x 2
points, no incompatible modes (those are C3D8I), hence our bilinear element. Mortar contact refuses
the expansion's constraints on its surfaces; there we write the layer of bricks ourselves. A half
model carries half of the force: ccx knows nothing of `copies`. Source: G. Dhondt, CalculiX CrunchiX
USER'S MANUAL.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt import InputError, Part, Plate, Scene

LAWS = ("bonded", "node-to-surface", "surface-to-surface", "mortar")
# of ccx's smoothed law at large gaps, over the mean pressure; it shifts the pressure by as much
TENSION = 1e-9
LEAST = 0.05  # increment of the load at which ccx gives up; the first is the whole load
# stiffness that stands for a support where mortar contact allows none, over E thickness
SPRING = 1e6


@dataclass(frozen=True)
class Contact:
    """law, one of LAWS; pressure per penetration and traction per slip before sliding [stress /
    length], both for penalty.

    Mortar contact is hard in the normal direction and takes the `stick` slope only. `master` is the
    boundary of the lower body on which the contact boundary of the upper one rests; '' for the
    contact boundary of its own. With friction it must reach further: a node that slides over its
    edge is lost.
    """

    law: str
    stiffness: float = 0.0
    stick: float = 0.0
    master: str = ""


@dataclass(frozen=True, eq=False)
class Model:
    """Both bodies as one mesh: points (2, N), quads (4, M) anticlockwise, first nodes, elements."""

    scene: Scene
    meshes: tuple[Any, Any]
    points: np.ndarray
    quads: np.ndarray
    first_node: tuple[int, int]
    first_element: tuple[int, int]

    def nodes(self, body: int, boundary: str) -> np.ndarray:
        """Indices into `points` of a body's named boundary."""
        mesh = self.meshes[body]
        return (
            np.unique(mesh.facets[:, np.asarray(mesh.boundaries[boundary])]) + self.first_node[body]
        )

    def faces(self, body: int, boundary: str) -> list[tuple[int, int]]:
        """Elements (indices into `quads`) and their sides, 0 to 3, on a body's named boundary."""
        mesh = self.meshes[body]
        facets = np.asarray(mesh.boundaries[boundary])
        elements = mesh.f2t[0, facets] + self.first_element[body]
        ends = np.sort(mesh.facets[:, facets] + self.first_node[body], axis=0)
        corners = self.quads[:, elements]
        sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=0)]), axis=0)  # (2, 4, facets)
        return list(zip(elements, np.argmax((sides == ends[:, None]).all(axis=0), axis=0)))


def model(scene: Scene, elements: int | None = None) -> Model:
    """Number a plane scene of two elastic bodies; InputError for what the deck cannot say."""
    parts = scene.upper, scene.lower
    if scene.kind != "plane-strain" or scene.degree != 1 or scene.law != "coulomb":
        raise InputError(
            "the deck is written for unilateral contact in plane strain at degree 1 only."
        )
    if not all(isinstance(part, Part) for part in parts):
        raise InputError("the deck needs two elastic bodies; make the rigid one elastic.")
    count = scene.elements if elements is None else elements
    upper, lower = (part.build_mesh(count, scene.zone) for part in parts)  # type: ignore[union-attr]
    if any(mesh.t.shape[0] != 4 or mesh.p.shape[0] != 2 for mesh in (upper, lower)):
        raise InputError("the deck is written for meshes of quadrilaterals only.")
    points = np.hstack([upper.p, lower.p])
    quads = np.hstack([upper.t, lower.t + upper.p.shape[1]])
    (x, y), (x_next, y_next) = points[:, quads], points[:, np.roll(quads, -1, axis=0)]
    clockwise = np.sum(x * y_next - x_next * y, axis=0) < 0
    quads = np.where(clockwise, quads[::-1], quads)
    return Model(scene, (upper, lower), points, quads, (0, upper.p.shape[1]), (0, upper.t.shape[1]))


def deck(bodies: Model, contact: Contact) -> str:
    """The whole input deck. Raises InputError on an unknown law."""
    if contact.law not in LAWS:
        raise InputError(f"unknown contact law {contact.law!r}; choose from {', '.join(LAWS)}.")
    layered = contact.law == "mortar"
    held = _held(bodies)
    plate, component = _plate(bodies.scene)
    driven = _both_layers(bodies, bodies.nodes(0, plate.boundary), layered)
    blocks = [
        _mesh(bodies, layered),
        *_boundaries(bodies, held, layered),
        *(_equation([(node, component, 1.0), (driven[0], component, -1.0)]) for node in driven[1:]),
        *(_bond(bodies, held) if contact.law == "bonded" else _contact(bodies, contact)),
        f"*STEP\n*STATIC\n1., 1., {LEAST}",
        (
            f"*CLOAD\n{driven[0] + 1}, {component + 1},"
            f" {_number(_force(bodies.scene) / bodies.scene.copies)}"
        ),
        "*NODE PRINT, NSET=PLANE\nU\n*EL PRINT, ELSET=BODIES\nS\n*END STEP",
    ]
    return "\n".join(blocks) + "\n"


def _number(value: float) -> str:
    """At most 20 characters with a decimal point: *SPRING takes others for a component."""
    return f"{value:.12e}"


def _list(values: Iterable[Any]) -> str:
    texts = [str(value) for value in values]
    return ",\n".join(", ".join(texts[i : i + 8]) for i in range(0, len(texts), 8))


def _both_layers(bodies: Model, nodes: np.ndarray, layered: bool) -> np.ndarray:
    return np.concatenate([nodes, nodes + bodies.points.shape[1]]) if layered else nodes


def _mesh(bodies: Model, layered: bool) -> str:
    """Nodes, elements, materials, and the sets PLANE (its nodes) and BODIES (all elements)."""
    count, thickness = bodies.points.shape[1], bodies.scene.thickness
    lines = ["*NODE, NSET=PLANE"]
    lines += [f"{i}, {_number(x)}, {_number(y)}" for i, (x, y) in enumerate(bodies.points.T, 1)]
    if layered:
        lines.append("*NODE, NSET=BACK")
        lines += [
            f"{i}, {_number(x)}, {_number(y)}, {_number(thickness)}"
            for i, (x, y) in enumerate(bodies.points.T, count + 1)
        ]
    corners = np.vstack([bodies.quads, bodies.quads + count]) if layered else bodies.quads
    ends = (*bodies.first_element[1:], bodies.quads.shape[1])
    for name, start, end, part in zip(
        "UL", bodies.first_element, ends, (bodies.scene.upper, bodies.scene.lower)
    ):
        assert isinstance(part, Part)
        lines.append(f"*ELEMENT, TYPE={'C3D8' if layered else 'CPE4'}, ELSET={name}")
        lines += [f"{i + 1}, {_list(corners[:, i] + 1)}" for i in range(start, end)]
        lines.append(
            f"*MATERIAL, NAME={name}\n*ELASTIC\n{_number(part.material.E)},"
            f" {_number(part.material.nu)}"
        )
        lines.append(f"*SOLID SECTION, ELSET={name}, MATERIAL={name}\n{_number(thickness)}")
    return "\n".join([*lines, "*ELSET, ELSET=BODIES\nU, L"])


def _held(bodies: Model) -> dict[tuple[int, int], float]:
    """(node, component) -> prescribed displacement, of supports and of held plates."""
    held = {}
    components = bodies.scene.components
    for body, part in enumerate((bodies.scene.upper, bodies.scene.lower)):
        assert isinstance(part, Part)
        for support in part.supports:
            values = (
                dict.fromkeys(components, 0.0)
                if support.displacement is None
                else support.displacement
            )
            for name, value in values.items():
                held |= {
                    (int(n), components.index(name)): value
                    for n in bodies.nodes(body, support.boundary)
                }
    plate, component = _plate(bodies.scene)
    return held | {(int(n), 1 - component): 0.0 for n in bodies.nodes(0, plate.boundary)}


def _plate(scene: Scene) -> tuple[Plate, int]:
    """The plate on the upper body and the component in which it moves."""
    assert isinstance(scene.upper, Part)
    loads = scene.upper.loads + (scene.lower.loads if isinstance(scene.lower, Part) else ())
    if (
        len(loads) != 1
        or not isinstance(loads[0], Plate)
        or not scene.upper.loads
        or len(loads[0].force) != 1
    ):
        raise InputError(
            "the deck needs one load: a plate on the upper body, with a force in one component."
        )
    if not loads[0].glued:
        raise InputError("the deck is written for a plate that is glued to the body.")
    return loads[0], scene.components.index(next(iter(loads[0].force)))


def _force(scene: Scene) -> float:
    return float(next(iter(_plate(scene)[0].force.values())))


def _boundaries(bodies: Model, held: dict[tuple[int, int], float], layered: bool) -> list[str]:
    """Supports in the plane and, of bricks, across it.

    ccx 2.20 never returns from mortar contact if a slave node is held in two directions: a stiff
    spring holds the second.
    """
    count = bodies.points.shape[1]
    lines = ["*BOUNDARY"]
    for (node, component), value in held.items():
        for n in _both_layers(bodies, np.array([node]), layered):
            lines.append(f"{n + 1}, {component + 1}, {component + 1}, {_number(value)}")
    if not layered:
        return ["\n".join(lines)]
    slaves = bodies.nodes(0, _part(bodies, 0).contact)
    sprung = _both_layers(
        bodies, np.array([n for n in slaves if (n, 0) in held or (n, 1) in held], dtype=int), True
    )
    lines += [f"{n + 1}, 3, 3" for n in np.setdiff1d(np.arange(2 * count), sprung)]
    if not len(sprung):
        return ["\n".join(lines)]
    springs = ["*ELEMENT, TYPE=SPRING1, ELSET=ACROSS"]
    springs += [f"{i}, {n + 1}" for i, n in enumerate(sprung, bodies.quads.shape[1] + 1)]
    stiffness = SPRING * _part(bodies, 0).material.E * bodies.scene.thickness
    return [
        "\n".join(lines),
        "\n".join([*springs, f"*SPRING, ELSET=ACROSS\n3\n{_number(stiffness)}"]),
    ]


def _part(bodies: Model, body: int) -> Part:
    part = (bodies.scene.upper, bodies.scene.lower)[body]
    assert isinstance(part, Part)
    return part


def _equation(terms: list[tuple[int, int, float]]) -> str:
    """sum factor * displacement = 0; the first unknown is eliminated."""
    return f"*EQUATION\n{len(terms)}\n" + _list(
        f"{n + 1}, {c + 1}, {factor}" for n, c, factor in terms
    )


def _bond(bodies: Model, held: dict[tuple[int, int], float]) -> list[str]:
    """Upper and lower contact nodes move together; matched by their position along the contact."""
    pairs = [bodies.nodes(body, _part(bodies, body).contact) for body in (0, 1)]
    upper, lower = (nodes[np.argsort(bodies.points[0, nodes])] for nodes in pairs)
    return [
        _equation([(u, c, 1.0), (low, c, -1.0)])
        for u, low in zip(upper, lower)
        for c in range(2)
        if (int(u), c) not in held
    ]


def _contact(bodies: Model, contact: Contact) -> list[str]:
    """Surfaces, law of contact and friction; the upper body is the slave."""
    side = 3 if contact.law == "mortar" else 1  # the sides of a brick are its faces S3 to S6
    blocks = []
    for body, name in enumerate(("UPPER", "LOWER")):
        faces = bodies.faces(body, (contact.master if body else "") or _part(bodies, body).contact)
        blocks.append(
            f"*SURFACE, NAME={name}\n" + "\n".join(f"{e + 1}, S{s + side}" for e, s in faces)
        )
    scene, slaves = bodies.scene, bodies.points[0, bodies.nodes(0, _part(bodies, 0).contact)]
    blocks.append("*SURFACE INTERACTION, NAME=LAW")
    if contact.law != "mortar":
        pressure = abs(_force(scene)) / (scene.copies * scene.thickness * np.ptp(slaves))
        line = f"{_number(contact.stiffness)}, {_number(TENSION * pressure)}"
        blocks.append(f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{line}")
    if scene.mu > 0:
        blocks.append(f"*FRICTION\n{_number(scene.mu)}, {_number(contact.stick)}")
    kind = contact.law.replace("-", " ").upper() + (
        ", SMALL SLIDING" if contact.law == "node-to-surface" else ""
    )
    return [*blocks, f"*CONTACT PAIR, INTERACTION=LAW, TYPE={kind}\nUPPER, LOWER"]

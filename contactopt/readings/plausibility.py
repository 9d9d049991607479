"""Input that can be solved and is probably not what is meant: units that do not fit each other,
bodies that are misplaced, loads on a surface that may touch. `check` and `run` say the same.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from contactopt.cards import count
from contactopt.checks import remembered
from contactopt.coupling.coupling import Coupling
from contactopt.coupling.planes_of_symmetry import SymmetryPlane
from contactopt.scenes.material_library import STRESSES
from contactopt.scenes.matrix_part import MatrixPart
from contactopt.scenes.scene import Part, Scene

# of the extent of a surface, up to which a closed gap is small, however fine its facets are
SHARE = 0.02
STIFFEST, SOFTEST = 1.3e12, 1e2  # Young's moduli [Pa]: above that of diamond, below that of gels

UNPUSHED = (
    "nothing pushes the bodies: there is no load, no displacement of a support and no overlap;"
    " is a load missing?"
)


def doubts(
    scene: Scene,
    couplings: Sequence[Coupling],
    planes: Sequence[SymmetryPlane],
    states: Sequence[Scene] = (),
    bears: Callable[[int, str], bool] = lambda number, boundary: True,
) -> list[str]:
    """One sentence for each thing in a scene that is probably a mistake. `planes` are the planes of
    symmetry, `states` the scenes of its load path, if it has one. bears(body, boundary) says
    whether a force acts on this supported boundary of the body of this number.
    """
    meshed = [part for part in scene.meshed.values() if part.given]
    found, names = [], [part.name for part in scene.parts]
    for part in meshed:
        found += [*_loaded_contacts(scene, part), *_faint_loads(scene, part)]
        found += _pointed(part, partial(bears, names.index(part.name)))
    if not any(_pushed(state, couplings) for state in states or (scene,)):
        found.append(UNPUSHED)
    found += _missing_planes(scene, planes)
    return [*found, *_stiffness(scene), *_sizes(scene), *_gaps(scene, couplings)]


def _pushed(scene: Scene, couplings: Sequence[Coupling]) -> bool:
    """Whether loads, supports or an overlap push the bodies of a scene."""
    given: list[Any] = []
    for part in scene.parts:
        given += [load.values(scene.components) for load in getattr(part, "loads", ())]
        given += [support.displacement for support in getattr(part, "supports", ())]
        given += [getattr(part, name, None) for name in ("force", "displacement")]
    values = [list(own.values()) if isinstance(own, Mapping) else own for own in given]
    return any(np.any(own) for own in values) or any(np.any(own.gap < 0) for own in couplings)


def _missing_planes(scene: Scene, planes: Sequence[SymmetryPlane]) -> list[str]:
    """Images of a body without the planes that they are images in."""
    known = len(scene.meshed) + len(scene.rigid) == len(scene.parts)
    if not known or 2 ** len(planes) >= scene.copies:
        return []
    return [
        f"copies = {scene.copies}, but {count(len(planes), 'plane')} of symmetry"
        f" {'is' if len(planes) == 1 else 'are'} found, which makes {2 ** len(planes)}: all forces"
        f" are those of {scene.copies} bodies together; drop copies, hold the bodies in each plane"
        " of symmetry along its normal alone, or name the axes across which the planes lie, as in"
        f' mirror = "{scene.components[0]}".'
    ]


def _pointed(part: Part, bears: Callable[[str], bool]) -> list[str]:
    """Supports where the stress of a force is infinite."""
    notes, known = [], part.mesh.boundaries or {}
    for support in part.supports:
        if (many := len(support.faces(known))) > 1 and bears(support.boundary):
            what = "a point" if many >= part.mesh.dim() else "an edge"
            notes.append(
                f"the support on '{support.boundary}' of body '{part.name}' holds {what}: the"
                " stress of a force there is infinite, and on finer meshes the displacement grows"
                " without end; hold a face unless this support carries no force."
            )
    return notes


def said_of_meshes(scene: Scene) -> list[str]:
    """What was said of the meshes of a scene when their files were read."""
    given = [part.mesh for part in scene.meshed.values() if part.given]
    said = (own for mesh in given for own in remembered(mesh).items())
    return [text for text, kind in said if kind != scene.kind]


def _loaded_contacts(scene: Scene, part: Part) -> list[str]:
    """Loads on facets that may touch."""
    notes = []
    for load in part.loads:
        if not load.boundary or not any(load.values(scene.components).values()):
            continue
        loaded = np.asarray(part.mesh.boundaries[load.boundary])
        for name in scene.surfaces_of(part):
            if shared := len(np.intersect1d(loaded, part.mesh.boundaries[name])):
                notes.append(
                    f"the {load.what} on {load.boundary!r} of body '{part.name}' acts on"
                    f" {count(shared, 'facet')} of {name!r}, which may touch: it acts beside"
                    " the contact forces, and where the surfaces are open; is another"
                    " boundary meant?"
                )
    return notes


def _faint_loads(scene: Scene, part: Part) -> list[str]:
    """Loads that strain a body by next to nothing."""
    area = float(np.linalg.norm(np.ptp(part.mesh.p, axis=1))) ** (scene.dim - 1)
    depth = _depth(scene, part.mesh.p)
    stress = 0.0
    for load in (load for load in part.loads if load.boundary):
        largest = max(map(abs, load.values(scene.components).values()), default=0.0)
        stress = max(stress, largest / (area * depth * scene.copies if load.total else 1.0))
    strain = stress / part.material.E
    if not 0 < strain < 1e-9:  # no load on a solid strains it less
        return []
    return [
        f"the loads strain body '{part.name}' by about {strain:.0e} only: are its loads and"
        f" E = {part.material.E:.3g} in the same unit, as N and MPa with lengths in mm?"
    ]


def _depth(scene: Scene, x: np.ndarray) -> float:
    """How deep a body is across its section, around an axis at its mean radius; 1 in space."""
    radius = float(abs(x[0]).mean()) if scene.analysis.revolved else 1.0
    return scene.analysis.measure(scene.thickness) * radius


def _stiffness(scene: Scene) -> list[str]:
    """Young's moduli that no solid has, or that are far from each other."""
    notes, unit = [], scene.units[1]
    moduli = _moduli(scene)
    for name, (E, asked) in moduli.items() if unit in STRESSES else ():
        if not SOFTEST < E * STRESSES[unit] < STIFFEST:
            hard = E * STRESSES[unit] >= STIFFEST
            like = "stiffer than diamond" if hard else "softer than any solid"
            notes.append(f"body '{name}' has E = {E:.3g} {unit}, {like}: {asked} in {unit}?")
    for names in combinations(moduli, 2):
        soft, stiff = sorted(names, key=lambda name: moduli[name][0])
        ratio = moduli[stiff][0] / moduli[soft][0]
        if ratio > 3e5:  # ratio of Young's moduli: that of steel to soft rubber is 1e5
            notes.append(
                f"body '{stiff}' is {ratio:.1e} times as stiff as '{soft}': are both given in the"
                " same unit? A body that does not deform can be a rigid one."
            )
    return notes


def _moduli(scene: Scene) -> dict[str, tuple[float, str]]:
    """name -> Young's modulus [stress] and the words that ask for its unit; where a body is given
    by its matrices, its order of size: K_ii of a point is some E h^(dim - 2) times the depth.
    """
    known: dict[str, tuple[float, str]] = {}
    for part in scene.parts:
        if isinstance(part, MatrixPart):
            diagonal = part.K.diagonal()
            if diagonal.any():
                x = part.coordinates(scene.dim)
                h = float(np.prod(np.ptp(x, axis=1)) / x.shape[1]) ** (1 / scene.dim)
                usual = float(np.median(diagonal[diagonal > 0]))
                own = usual * h ** (2 - scene.dim) / (_depth(scene, x) * scene.copies)
                known[part.name] = own, "are K and its points in the units of the scene, stress"
        elif hasattr(part, "material"):
            known[part.name] = part.material.E, "is it"
    return known


def _sizes(scene: Scene) -> list[str]:
    """Bodies of which one vanishes beside the other."""
    notes = []
    points = {part.name: part.mesh.p for part in scene.meshed.values() if part.given}
    matrices = [part for part in scene.parts if isinstance(part, MatrixPart)]
    points |= {part.name: part.coordinates(scene.dim) for part in matrices}
    size = {name: float(np.linalg.norm(np.ptp(x, axis=1))) for name, x in points.items()}
    for names in combinations(size, 2):
        small, large = sorted(names, key=lambda name: size[name])
        ratio = size[large] / size[small]
        if ratio > 300.0:  # metres beside millimetres
            notes.append(
                f"body '{large}' is {ratio:.4g} times as large as '{small}': are both given in the"
                " unit of length of the scene?"
            )
    return notes


def _gaps(scene: Scene, couplings: Sequence[Coupling]) -> list[str]:
    """Surfaces that overlap much or are far apart."""
    notes, length = [], scene.units[0]
    for pair, own in zip(scene.pairs, couplings):
        size = float(np.ptp(own.positions, axis=1).max(initial=0.0)) or 1.0
        least = float(own.gap.min())
        how = f"overlap by up to {-least:.4g} {length}"
        how = how if least < 0 else f"are {least:.4g} {length} or more apart"
        if abs(least) > SHARE * size:
            notes.append(
                f"the surfaces of '{pair.name}' {how}, more than {SHARE:.0%} of their extent: is a"
                " body misplaced, or a unit of length wrong?"
            )
    return notes

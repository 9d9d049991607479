"""How the contacts of an interface problem see the displacements of the bodies.

A coupling is made once for each pair of surfaces of a scene and kept with its reduction. It says where the contacts are,
how their local frames lie, how far apart the bodies are there, and how the displacements U of both bodies make the relative
displacement

    u = T_upper U_upper - T_lower U_lower + gap n,

so that contact forces r act on the bodies with the nodal forces T_upper' r and -T_lower' r. Reduction, recovery, energies
and load paths use these maps alone. How they come about is known only to the kind of the coupling.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.protocol import AssembledBody, Surface
from contactopt.errors import InputError
from contactopt.interface.charts import SymmetryPlane
from contactopt.problem.chart import Chart
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Scene

log = logging.getLogger(__name__)

# name -> (module, function (scene, pair, upper, lower) -> Coupling, what it is)
COUPLINGS = {
    "matching": (
        "contactopt.interface.matching",
        "couple_nodes",
        "contacts are the nodes of a body, whose partners on the other body lie on the same normals",
    ),
    "mortar": (
        "contactopt.interface.surfaces",
        "couple_surfaces",
        "contacts are the nodes of the finer surface, displacements are averaged where the surfaces overlap",
    ),
}


@dataclass(frozen=True, eq=False)
class Coupling:
    """The coupling of two surfaces at k contacts.

    upper, lower  sparse maps T (k dim, n) from the displacement unknowns of each body to the components of its
                  displacement in the frames, contact by contact, normal component first
    frames        (k, dim, dim) rows n, t1[, t2]; n is the outward normal of the lower body
    gap           (k,) initial gap along n [length]
    areas         (k,) nodal areas [length^2]
    positions     (dim, k) positions of the contacts in space [length]
    chart         places of the contacts on the contact surface
    cells         (v, c) contacts at the corners of the linear cells of the surface, for figures and files
    planes        planes that cut the surface and on which the bodies are held along the normal only
    """

    upper: sp.csr_matrix
    lower: sp.csr_matrix
    frames: np.ndarray
    gap: np.ndarray
    areas: np.ndarray
    positions: np.ndarray
    chart: Chart
    cells: np.ndarray
    planes: tuple[SymmetryPlane, ...]


def couple(
    scene: Scene, pair: Contact, upper: AssembledBody, lower: AssembledBody, kind: str | None = None
) -> Coupling:
    """The coupling of a pair of surfaces of two assembled bodies.

    Parameters
    ----------
    scene, pair
        The scene and one of its pairs.
    upper, lower
        Its bodies.
    kind
        A name in COUPLINGS, or 'auto'; by default that of the pair. 'auto' is matching nodes where they match, or where a
        body has no mesh, and otherwise mortar.

    Raises
    ------
    InputError
        For an unknown kind, and for surfaces that this kind cannot couple.
    """
    kind = kind or pair.coupling
    if kind == "auto":
        kind = "mortar" if pair.carrier is not None else "matching"
        if upper.meshed and lower.meshed and kind == "matching":
            try:
                return _kind(kind)(scene, pair, upper, lower)
            except InputError as error:
                log.info("contact '%s' is coupled by mortar: %s", pair.name, error)
            kind = "mortar"
    return _kind(kind)(scene, pair, upper, lower)


def _kind(name: str) -> Callable[[Scene, Contact, AssembledBody, AssembledBody], Coupling]:
    if name not in COUPLINGS:
        raise InputError(f"unknown coupling {name!r}; choose from auto, {', '.join(COUPLINGS)}.")
    module, function, _ = COUPLINGS[name]
    made: Callable[[Scene, Contact, AssembledBody, AssembledBody], Coupling] = getattr(import_module(module), function)
    return made


def renumbered(cells: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Cells (v, c) in terms of contacts that were put in another order (k,)."""
    place = np.empty(len(order), dtype=int)
    place[order] = np.arange(len(order))
    return place[cells]


def local_map(surface: Surface, contacts: np.ndarray, frames: np.ndarray) -> sp.csr_matrix:
    """T (k dim, n): the body's unknowns -> the displacement of some of its contacts (k,) in the frames (k, dim, dim)."""
    k, dim = frames.shape[:2]
    rows, columns = np.arange(k * dim), np.repeat(np.arange(k), dim)
    parts = [
        sp.csr_matrix((frames[:, :, c].ravel(), (rows, columns)), (k * dim, k)) @ trace[contacts]
        for c, trace in enumerate(surface.traces)
    ]
    T = sp.csr_matrix(sum(parts[1:], parts[0]))
    T.eliminate_zeros()
    return T

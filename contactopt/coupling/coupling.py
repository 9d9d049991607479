"""How the contacts of an interface problem see the displacements of the bodies.

A coupling is made once for each pair of surfaces of a scene and kept with its reduction. It says
where the contacts are, how their local frames lie, how far apart the bodies are there, and how the
displacements U of both bodies make the relative displacement

    u = T_upper U_upper - T_lower U_lower + gap n,

so that contact forces r act on the bodies with the nodal forces T_upper' r and -T_lower' r.
Reduction, recovery, energies and load paths use these maps alone. How they come about is known only
to the kind of the coupling.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody, Surface
from contactopt.coupling.charts import SymmetryPlane
from contactopt.errors import InputError
from contactopt.problem.chart import Chart
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Scene

log = logging.getLogger(__name__)

# name -> (module, function (scene, pair, upper, lower) -> Coupling, what it is)
COUPLINGS = {
    "matching": (
        "contactopt.coupling.matching",
        "couple_nodes",
        (
            "contacts are the nodes of a body, whose partners on the other body lie on the same"
            " normals"
        ),
    ),
    "mortar": (
        "contactopt.coupling.mortar_surfaces",
        "couple_surfaces",
        "contacts are the nodes of one surface, displacements are averaged where both overlap",
    ),
}


@dataclass(frozen=True, eq=False)
class Coupling:
    """The coupling of two surfaces at k contacts.

    upper, lower  sparse maps T (k dim, n) from the displacement unknowns of each body to the
                  components of its displacement in the frames, contact by contact, normal component
                  first
    frames        (k, dim, dim) rows n, t1[, t2]; n is the outward normal of the lower body
    gap           (k,) initial gap along n [length]
    areas         (k,) nodal areas [length^2]
    positions     (dim, k) positions of the contacts in space [length]
    chart         places of the contacts on the contact surface
    cells         (v, c) contacts at the corners of the linear cells of the surface, for figures and
                  files
    planes        planes that cut the surface and on which the bodies are held along the normal only
    kind          name in COUPLINGS
    carrier       'upper' or 'lower': the side whose nodes carry the contacts
    share         (k,) part of the faces around each contact that the areas cover: less than one
                  where the other surface ends; None: all of them
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
    kind: str = "matching"
    carrier: str = "lower"
    share: np.ndarray | None = None


def couple(
    scene: Scene, pair: Contact, upper: AssembledBody, lower: AssembledBody, kind: str | None = None
) -> Coupling:
    """Make the coupling of a pair of surfaces of two assembled bodies.

    Parameters
    ----------
    scene, pair : The scene and one of its pairs.
    upper, lower : Its bodies.
    kind : A name in COUPLINGS, or 'auto'; by default that of the pair. 'auto' is matching nodes
        where they match, or where a body has no mesh, and otherwise mortar.

    Returns
    -------
    The contacts with their frames, gaps and areas, and the maps from the bodies' displacements to
    theirs.

    Raises
    ------
    InputError : For an unknown kind, and for surfaces that this kind cannot couple.
    """
    kind = kind or pair.coupling
    if kind != "auto":
        return _kind(kind)(scene, pair, upper, lower)
    meshed = upper.meshed and lower.meshed
    if pair.carrier is None or not meshed:
        try:
            return _kind("matching")(scene, pair, upper, lower)
        except InputError as error:
            if not meshed:
                raise
            log.info("contact '%s' is coupled by mortar: %s", pair.name, error)
    return _kind("mortar")(scene, pair, upper, lower)


def _kind(name: str) -> Callable[[Scene, Contact, AssembledBody, AssembledBody], Coupling]:
    if name not in COUPLINGS:
        raise InputError(f"unknown coupling {name!r}; choose from auto, {', '.join(COUPLINGS)}.")
    module, function, _ = COUPLINGS[name]
    made: Callable[[Scene, Contact, AssembledBody, AssembledBody], Coupling] = getattr(
        import_module(module), function
    )
    return made


def renumbered(cells: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Write cells in terms of contacts that were put in another order.

    Parameters
    ----------
    cells : (v, c) contacts at the corners of each cell.
    order : (k,) the old numbers of the contacts in their new order.

    Returns
    -------
    (v, c) the same cells in new numbers.
    """
    place = np.empty(len(order), dtype=int)
    place[order] = np.arange(len(order))
    return place[cells]


def local_map(surface: Surface, contacts: np.ndarray, frames: np.ndarray) -> sp.csr_matrix:
    """Make the map from a body's unknowns to the displacement of some of its contacts in their
    frames.

    Parameters
    ----------
    surface : The contact surface of the body, which has n unknowns.
    contacts : (k,) numbers of contacts on this surface.
    frames : (k, dim, dim) unit vectors n, t1[, t2] of each contact, as rows.

    Returns
    -------
    T (k dim, n), with dim rows for each contact, normal first.
    """
    k, dim = frames.shape[:2]
    if all(
        trace.nnz == trace.shape[0] and np.all(np.diff(trace.indptr) == 1)
        for trace in surface.traces
    ):
        return _from_single_unknowns(surface, contacts, frames)
    rows, columns = np.arange(k * dim), np.repeat(np.arange(k), dim)
    parts = [
        sp.csr_matrix((frames[:, :, c].ravel(), (rows, columns)), (k * dim, k)) @ trace[contacts]
        for c, trace in enumerate(surface.traces)
    ]
    T = sp.csr_matrix(sum(parts[1:], parts[0]))
    T.eliminate_zeros()
    return T


def _from_single_unknowns(
    surface: Surface, contacts: np.ndarray, frames: np.ndarray
) -> sp.csr_matrix:
    """local_map of a surface on which every component of a contact is one unknown of the body,
    times a number.
    """
    k, dim = frames.shape[:2]
    unknowns = np.stack([trace.indices[contacts] for trace in surface.traces], axis=1)  # (k, dim)
    values = np.stack([trace.data[contacts] for trace in surface.traces], axis=1)
    if frames.strides[0] == 0:  # one frame for all, which usually swaps axes and no more
        rows, columns = np.nonzero(frames[0])
        count = np.append(0, np.cumsum(np.tile(np.bincount(rows, minlength=dim), k)))
        data, indices = (
            (values[:, columns] * frames[0][rows, columns]).ravel(),
            unknowns[:, columns].ravel(),
        )
    else:
        used = frames != 0
        count = np.append(0, np.cumsum(np.count_nonzero(used, axis=2).ravel()))
        data = (frames * values[:, None, :])[used]
        indices = np.broadcast_to(unknowns[:, None, :], frames.shape)[used]
    T = sp.csr_matrix((data, indices, count), (k * dim, surface.traces[0].shape[1]))
    T.sort_indices()
    return T

"""How the contacts of an interface problem see the displacements of the bodies.

A coupling is made once for a scene and kept with its reduction. It says where the contacts are, how their local frames
lie, how far apart the bodies are there, and how the displacements U of both bodies make the relative displacement

    u = T_upper U_upper - T_lower U_lower + gap n,

so that contact forces r act on the bodies with the nodal forces T_upper' r and -T_lower' r. Reduction, recovery, energies
and load paths use these maps alone. How they come about is known only to the kind of the coupling: matching contact nodes
is the present one.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.protocol import AssembledBody, Surface
from contactopt.errors import InputError
from contactopt.problem.chart import Chart
from contactopt.scenes.scene import Scene

# name -> (module, function (scene, upper, lower) -> Coupling, what it is)
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
    """The coupling of two bodies at k contacts.

    upper, lower  sparse maps T (k dim, n) from the displacement unknowns of each body to the components of its
                  displacement in the frames, contact by contact, normal component first
    frames        (k, dim, dim) rows n, t1[, t2]; n is the outward normal of the lower body
    gap           (k,) initial gap along n [length]
    areas         (k,) nodal areas [length^2]
    positions     (dim, k) positions of the contacts in space [length]
    chart         places of the contacts on the contact surface
    """

    upper: sp.csr_matrix
    lower: sp.csr_matrix
    frames: np.ndarray
    gap: np.ndarray
    areas: np.ndarray
    positions: np.ndarray
    chart: Chart


def couple(scene: Scene, upper: AssembledBody, lower: AssembledBody, kind: str = "matching") -> Coupling:
    """The coupling of two assembled bodies by one of the kinds in COUPLINGS.

    Raises
    ------
    InputError
        For an unknown kind, and for surfaces that this kind cannot couple.
    """
    if kind not in COUPLINGS:
        raise InputError(f"unknown coupling {kind!r}; choose from {', '.join(COUPLINGS)}.")
    module, function, _ = COUPLINGS[kind]
    made: Coupling = getattr(import_module(module), function)(scene, upper, lower)
    return made


def local_map(surface: Surface, contacts: np.ndarray, frames: np.ndarray) -> sp.csr_matrix:
    """T (k dim, n): the body's unknowns -> the displacement of some of its contacts (k,) in the frames (k, dim, dim)."""
    k, dim = frames.shape[:2]
    if all(trace.nnz == trace.shape[0] and np.all(np.diff(trace.indptr) == 1) for trace in surface.traces):
        return _from_single_unknowns(surface, contacts, frames)
    rows, columns = np.arange(k * dim), np.repeat(np.arange(k), dim)
    parts = [
        sp.csr_matrix((frames[:, :, c].ravel(), (rows, columns)), (k * dim, k)) @ trace[contacts]
        for c, trace in enumerate(surface.traces)
    ]
    T = sp.csr_matrix(sum(parts[1:], parts[0]))
    T.eliminate_zeros()
    return T


def _from_single_unknowns(surface: Surface, contacts: np.ndarray, frames: np.ndarray) -> sp.csr_matrix:
    """local_map of a surface on which every component of a contact is one unknown of the body, times a number."""
    k, dim = frames.shape[:2]
    unknowns = np.stack([trace.indices[contacts] for trace in surface.traces], axis=1)  # (k, dim)
    values = np.stack([trace.data[contacts] for trace in surface.traces], axis=1)
    if frames.strides[0] == 0:  # one frame for all, which usually swaps axes and no more
        rows, columns = np.nonzero(frames[0])
        count = np.append(0, np.cumsum(np.tile(np.bincount(rows, minlength=dim), k)))
        data, indices = (values[:, columns] * frames[0][rows, columns]).ravel(), unknowns[:, columns].ravel()
    else:
        used = frames != 0
        count = np.append(0, np.cumsum(np.count_nonzero(used, axis=2).ravel()))
        data = (frames * values[:, None, :])[used]
        indices = np.broadcast_to(unknowns[:, None, :], frames.shape)[used]
    T = sp.csr_matrix((data, indices, count), (k * dim, surface.traces[0].shape[1]))
    T.sort_indices()
    return T

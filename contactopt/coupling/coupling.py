"""How the contacts of an interface problem see the displacements of the bodies.

A coupling is made once for each pair of surfaces of a scene and kept with its reduction. It says
where the contacts are, how their local frames lie, how far apart the bodies are there, and how the
displacements U of both bodies make the relative displacement

    u = T_upper U_upper - T_lower U_lower + gap n,

so that contact forces r act on the bodies with the nodal forces T_upper' r and -T_lower' r.
Reduction, recovery, energies and load paths use these maps alone. How they come about is known only
to the kind of the coupling.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody, UndividedBody
from contactopt.cards import count
from contactopt.checks import place_words
from contactopt.coupling.patch_test import misfit
from contactopt.coupling.planes_of_symmetry import ContactPoints, SymmetryPlane, symmetry_planes
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.problem.chart import Chart
from contactopt.problem.laws import Law, Place, make_law
from contactopt.scenes.contact import Contact, unread
from contactopt.scenes.scene import Scene

ROUNDING = 2.0**-48  # of the difference of two places, over their size
COVERED = 0.99  # a contact with less than this share of its faces lies where the other surface ends
log = logging.getLogger(__name__)

# name -> (module, function (scene, pair, upper, lower) -> Coupling, what it is)
COUPLINGS = {
    "matching": (
        "contactopt.coupling.matching",
        "couple_nodes",
        "contacts are nodes of a body, whose partners on the other body lie on the same normals",
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
    conforming    whether the facets of both sides have the same contacts at their corners
    why           why surfaces are coupled in this way; empty where this way was asked for
    tight         (k,) contacts of a tie at which others join its bodies, too, and which it could
                  not give up (contactopt.coupling.crosspoints); None: nowhere
    doubt         a sentence for the reader where the carrier does not suit the bodies, or empty
    fails         a sentence for the reader where the coupling fails the patch test, or empty
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
    conforming: bool = False
    why: str = ""
    tight: np.ndarray | None = None
    doubt: str = ""
    fails: str = ""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences for the reader on what this coupling cannot do well."""
        return tuple(text for text in (self.doubt, self.fails) if text)


def couple(
    scene: Scene, pair: Contact, upper: AssembledBody, lower: AssembledBody, kind: str | None = None
) -> Coupling:
    """Make the coupling of a pair of surfaces of two assembled bodies.

    `kind` is a name in COUPLINGS or 'auto', by default that of the pair. 'auto' is matching nodes
    where they match and pass the patch test (contactopt.coupling.patch_test), or where a body has
    no mesh, and otherwise mortar. InputError for an unknown kind, and for surfaces that this kind
    cannot couple.
    """
    kind = kind or pair.coupling
    ways, why = [kind], "the scene asks for it"
    if kind == "auto":
        meshed, free = upper.meshed and lower.meshed, pair.carrier is None
        ways = ["matching", "mortar"] if meshed and free else ["mortar" if meshed else "matching"]
        why = "nodes and facets match" if free else "the contact names the side that carries it"
    for way in ways:
        try:
            with _about(pair):
                made = tested(_kind(way)(scene, pair, upper, lower), pair, (upper, lower))
        except InputError as error:
            if way == ways[-1]:
                raise
            why = str(error).partition(";")[0]
        else:
            if way == ways[-1] or not made.fails:
                break
            why = f"the nodes match, but {made.fails.partition(': ')[2].partition(';')[0]}"
    if made.kind != ways[0]:
        log.info("contact '%s' is coupled by %s: %s", pair.name, made.kind, why)
    if made.share is not None and (ends := int(np.sum(made.share < COVERED))):
        why += (
            f"; the other surface ends within the faces of {count(ends, 'contact')}, whose"
            " pressure is the force over the part that it covers"
        )
    return replace(made, why=why)


def tested(made: Coupling, pair: Contact, bodies: tuple[AssembledBody, AssembledBody]) -> Coupling:
    """Every coupling's contract: constant pressure gives consistent nodal forces, or it `fails`."""
    surfaces = tuple(
        None if isinstance(body, UndividedBody) else body.surface(name)
        for body, name in zip(bodies, pair.surfaces)
    )
    if (found := misfit(made, surfaces)) is None:
        return replace(made, fails="") if made.fails else made
    where = place_words(found.place)
    instead = "coupling = 'mortar'" if made.kind == "matching" else "nodes that match"
    said = (
        f"contact '{pair.name}', coupled by {made.kind}: a constant pressure gives body"
        f" '{bodies[found.side].name}' wrong forces near ({where}), by {100 * found.error:.3g} %"
        " at a node; pressures and stresses around it may be wrong by as much: take"
        f" {instead} there, or refine the meshes."
    )
    return replace(made, fails=said)


def _kind(name: str) -> Callable[..., Coupling]:
    if name not in COUPLINGS:
        raise InputError(f"unknown coupling {name!r}; choose from auto, {', '.join(COUPLINGS)}.")
    module, function, _ = COUPLINGS[name]
    return getattr(import_module(module), function)


def law_of(pair: Contact, made: Coupling) -> Law:
    """The law of the contacts of a pair of surfaces, with one parameter for each contact."""
    place = Place(made.areas, made.frames, pair.direction)
    if said := unread(pair.mu, pair.law):  # laws are compared by changing their name alone
        log.warning("contact '%s': %s", pair.name, said)
    with _about(pair):
        return make_law(pair.law, pair.mu, place, made.positions)


@contextmanager
def _about(pair: Contact) -> Iterator[None]:
    """Within this block errors name the pair."""
    try:
        yield
    except InputError as error:
        if f"'{pair.name}'" in str(error):
            raise
        raise InputError(f"contact '{pair.name}': {error}") from error


def of_contacts(
    kind: str,
    carrier: str,
    points: ContactPoints,
    laid_out: tuple[Chart, np.ndarray, np.ndarray],
    maps: tuple[sp.csr_matrix, sp.csr_matrix],
    share: np.ndarray | None = None,
) -> Coupling:
    """The coupling at contacts, from their chart, frames and order, and maps in this order."""
    chart, frames, order = laid_out
    gap, areas = points.gap[order], points.areas[order]
    places = np.take(points.points, order, axis=1)  # each component by itself in memory
    # the places of both sides are rounded
    gap = np.where(np.abs(gap) > ROUNDING * np.abs(places).max(initial=0.0), gap, 0.0)
    cells = points.cells if chart.cells is None else chart.cells
    planes = tuple(symmetry_planes(points))
    share = None if share is None else share[order]
    return Coupling(*maps, frames, gap, areas, places, chart, cells, planes, kind, carrier, share)


def local_map(
    traces: Sequence[sp.csr_matrix], contacts: np.ndarray, frames: np.ndarray
) -> sp.csr_matrix:
    """T (k dim, n) from a body's unknowns to the displacement of the contacts (k,) of a surface in
    their frames (k, dim, dim), from a trace (m, n) for each component in space.
    """
    k, dim = frames.shape[:2]
    shape = k * dim, traces[0].shape[1]
    if all(np.array_equal(trace.indptr, np.arange(trace.shape[0] + 1)) for trace in traces):
        # every component of a contact is one unknown of the body, times a number
        if frames.strides[0] == 0 and np.all(np.count_nonzero(frames[0], axis=1) == 1):
            # one frame for all, which swaps axes and no more
            columns = np.empty((k, dim), traces[0].indices.dtype)
            data = np.empty((k, dim))
            for row, c in enumerate(np.argmax(frames[0] != 0, axis=1)):
                columns[:, row] = traces[c].indices[contacts]
                np.multiply(traces[c].data[contacts], frames[0, row, c], out=data[:, row])
            ends = np.arange(k * dim + 1, dtype=columns.dtype)
            return sp.csr_matrix((data.ravel(), columns.ravel(), ends), shape)
        unknowns = np.stack([trace.indices[contacts] for trace in traces], axis=1)
        values = np.stack([trace.data[contacts] for trace in traces], axis=1)
        used = frames != 0
        count = np.count_nonzero(used, axis=2)
        data = (frames * values[:, None])[used]
        columns = np.broadcast_to(unknowns[:, None], frames.shape)[used]
        ends = np.append(0, np.cumsum(count))
        T = sp.csr_matrix((data, columns, ends), shape)
        T.sort_indices()
        return T
    rows, own = np.arange(k * dim), np.repeat(np.arange(k), dim)
    T = sp.csr_matrix(shape)
    for c, trace in enumerate(traces):
        along = sp.csr_matrix((frames[:, :, c].ravel(), (rows, own)), (k * dim, k))
        T = T + along @ trace[contacts]
    T.eliminate_zeros()
    return sp.csr_matrix(T)


def guided(
    T: sp.csr_matrix,
    alone: Sequence[sp.csr_matrix],
    contacts: np.ndarray,
    frames: np.ndarray,
    held: np.ndarray,
) -> sp.csr_matrix:
    """A map T (k dim, n) to contacts (k,) of a surface whose slip along supports is that of their
    nodes, from the displacement `alone` (m, n) of the nodes at the contacts, in space.

    Where supports or plates hold both bodies along an axis e, held (dim, k), that leans on the
    contact's normal n, the nodes slip by u_e, so that u_t e_t = u_e - n_e u_n. In contact u_n = 0,
    and friction along e_t acts on what holds the bodies. Otherwise it would be a part of the normal
    force under another name, and neither would be unique.
    """
    if not held.any():
        return T
    leaning = held.T & (np.abs(frames[:, 0]) > EQUAL)
    some = np.flatnonzero(leaning.any(axis=1))
    if not len(some):
        return T
    k, dim = frames.shape[:2]
    keep = np.broadcast_to(np.eye(dim), frames.shape).copy()
    slips = np.zeros((len(some), dim, dim))
    for j, i in enumerate(some):
        across = frames[i, 1:][:, leaning[i]]
        inverse = np.linalg.pinv(across, rcond=EQUAL)
        keep[i, 1:, 1:] -= across @ inverse
        slips[j, 1:, leaning[i]] = inverse
    blocks = sp.bsr_matrix((keep, np.arange(k), np.arange(k + 1)))
    rows = dim * some[:, None] + np.arange(dim)
    added = sp.csr_matrix(T.shape)
    for c, trace in enumerate(alone):
        at = np.repeat(np.arange(len(some)), dim)
        along = sp.csr_matrix((slips[:, :, c].ravel(), (rows.ravel(), at)), (k * dim, len(some)))
        added = added + along @ trace[contacts[some]]
    T = sp.csr_matrix(blocks @ T + added)
    T.eliminate_zeros()
    return T

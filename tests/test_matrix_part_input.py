"""Matrices that lie, have another unit, or cannot do what is asked are told in a sentence."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from scipy.sparse.linalg import spsolve
from test_matrix_part import block, given, matrices, pressed, solved_on

from contactopt import (
    InputError,
    MatrixPart,
    Rigid,
    Scene,
    Support,
    Traction,
    gradient,
    reduce_bodies,
    run,
    simplify,
)
from contactopt.bodies.solvers import solver_type
from contactopt.readings.plausibility import doubts

BRICK = {2: skfem.MeshQuad, 3: skfem.MeshHex}


def scaled_row(K, i, factor):
    K = K.tolil()
    K[i] = factor * K[i]
    return K.tocsr()


def added(K, i, j, value):
    K = K.tolil()
    K[i, j] += value
    return K.tocsr()


def isolated(K, i):
    K = K.tolil()
    K[i, :] = K[:, i] = 0.0
    K[i, i] = 1.0
    return K.tocsr()


WRONG = {
    "unsymmetric": (lambda a: {"K": scaled_row(a["K"], 20, 2.0)}, "K is not symmetric: entry"),
    "rows of conditions": (lambda a: {"K": added(a["K"], 3, 9, 9.0)}, "K is not symmetric: entry"),
    "sign": (lambda a: {"K": -a["K"]}, "turn its sign"),
    "multiplier": (lambda a: {"K": added(a["K"], 20, 20, -600.0)}, "not positive semidefinite"),
    "weakened": (lambda a: {"K": added(a["K"], 20, 20, -80.0)}, "scaled eigenvalues"),
    "not square": (lambda a: {"K": a["K"][:-1]}, "K must be square"),
    "empty": (lambda a: {"K": sp.csr_matrix((32, 32))}, "K must be square and not empty"),
    "complex": (lambda a: {"K": a["K"] * 1j}, "K must be real"),
    "one triangle": (lambda a: {"K": sp.tril(a["K"])}, "one side of its diagonal only"),
    "nan in K": (lambda a: {"K": a["K"] * np.nan}, "K holds a number that is not finite"),
    "text": (lambda a: {"K": "K.mtx"}, "must be an array of numbers"),
    "f of another size": (lambda a: {"f": a["f"][:-2]}, "f needs 32 numbers"),
    "f by nodes": (lambda a: {"f": a["f"].reshape(16, 2)}, "in one row, as K has rows"),
    "f not finite": (lambda a: {"f": a["f"] + np.inf}, "loads f of body 'bed' holds"),
    "K of fewer points": (
        lambda a: {"K": a["K"][:-2, :-2], "f": a["f"][:-2], "fixed": [0, 1, 2]},
        "K has 30 rows, but 32 unknowns belong to the points",
    ),
    "points of space": (
        lambda a: {"points": np.pad(a["points"], ((0, 0), (0, 1)))}, "need 2 coordinates each"
    ),
    "points not finite": (lambda a: {"points": a["points"] * np.nan}, "points of body 'bed' holds"),
    "another unit along x": (lambda a: {"points": a["points"] * [1e3, 1.0]}, "another unit along"),
    "bent points": (lambda a: {"points": a["points"] ** 3}, "rotations of the points"),
    "the wrong order": (lambda a: {"order": "component"}, "take that one, or 'auto'"),
    "an unknown order": (lambda a: {"order": "by row"}, "order must be one of auto, node"),
    "numbers twice": (lambda a: {"order": np.zeros((16, 2))}, "each number from 0 to 31 once"),
    "no contact": (lambda a: {"facets": {"top": [[0, 1]]}}, "names 'contact'"),
    "facets from 1": (
        lambda a: {"facets": {"contact": a["facets"]["contact"] + 1}}, "need 1 subtracted"
    ),
    "facets of a solid": (lambda a: {"facets": {"contact": [[0, 1, 2, 3]]}}, "one row of 2, 3"),
    "facets inside": (lambda a: {"facets": {"contact": [[5, 6], [9, 10]]}}, "inside the body"),
    "a facet twice": (lambda a: {"facets": {"contact": [[3, 7], [7, 3]]}}, "a facet twice"),
    "a point twice": (lambda a: {"facets": {"contact": [[3, 3]]}}, "a point twice"),
    "a contact node fixed": (
        lambda a: {"fixed": [*a["fixed"], *2 * a["facets"]["contact"][0, 0] + np.arange(2)]},
        "held in all its components",
    ),
    "all fixed": (lambda a: {"fixed": np.arange(32)}, "held"),
    "a mask": (lambda a: {"fixed": np.arange(32) < 8}, "of a mask give numpy.flatnonzero"),
    "nothing is held": (lambda a: {"fixed": None}, "hold one of them by a support"),
    "fixed beyond": (lambda a: {"fixed": [99]}, "from 0 to 31; got 99"),
    "penalty": (
        lambda a: {"K": added(a["K"], 0, 0, 1e30), "fixed": None}, "and 1 such unknowns in all"
    ),
    "rows left as ones": (
        lambda a: {"K": isolated(a["K"], 0), "fixed": a["fixed"][a["fixed"] != 0]},
        "which is what a boundary condition leaves there",
    ),
    "a point without an element": (
        lambda a: {
            "K": sp.block_diag([a["K"], sp.csr_matrix((2, 2))]).tocsr(),
            "f": np.append(a["f"], [0, 0]), "points": np.append(a["points"], [[5.0, 5.0]], 0),
        },
        "leave out points that belong to no element",
    ),
    "a hinge": (
        lambda a: {
            "K": sp.block_diag([a["K"], sp.csr_matrix([[1.0, -1.0], [-1.0, 1.0]])]).tocsr(),
            "f": np.append(a["f"], [0, 0]), "points": np.append(a["points"], [[5.0, 5.0]], 0),
        },
        "no stiffness against some motion",
    ),
    "motions that strain": (lambda a: {"motions": np.ones((32, 1))}, "motion 1 is not free"),
    "constraints of another size": (
        lambda a: {"constraints": sp.identity(30)}, "a row for each of the 32 unknowns"
    ),
    "a traction": (lambda a: {"loads": (Traction("far", (0, 1)),)}, "other loads belong in f"),
    "a support nowhere": (lambda a: {"supports": (Support("left"),)}, "no facets 'left'"),
    "a function that adds": (
        lambda a: {"K": lambda load: load + 1.0, "order": "node"}, "does not solve K U = F"
    ),
    "a function of another size": (
        lambda a: {"K": lambda load: load[:-1], "order": "node"}, "an array of shape"
    ),
    "stresses of another shape": (lambda a: {"stress": lambda u: u.T}, "to stresses"),
    "a function without an order": (lambda a: {"K": lambda load: load}, "knows the numbering"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_input_that_lies_is_found(name):
    change, said = WRONG[name]
    base = given()
    with pytest.raises(InputError, match=said.replace("(", r"\(")) as caught:
        solved_on(**{**base, **change(base)})
    assert str(caught.value).endswith(".") and str(caught.value).count(". ") == 0


@pytest.mark.parametrize(
    ("solver", "Q", "most"), [("superlu", "explicit", 3), ("superlu", "implicit", 14),
                              ("multigrid", "implicit", 4)],
)  # fmt: skip
def test_a_stiffness_is_proved_definite_by_few_solves(solver, Q, most, monkeypatch):
    """Where factors or conjugate gradients prove it, two solves find motions without stiffness, in
    place of twelve; the others are those of the loads and of the size of Q.
    """
    kind, count = solver_type(solver, 1, 2), []
    plain = kind.solve
    monkeypatch.setattr(kind, "solve", lambda self, *a: count.append(1) or plain(self, *a))
    punch = Rigid("punch", force={"y": -1.0}, gap=lambda x: x[0] ** 2)
    scene = Scene("by matrices", punch, MatrixPart("bed", **given()), 0.3)
    reduce_bodies(scene, Q=Q, solver=solver)
    assert len(count) <= most


def test_conjugate_gradients_find_that_a_stiffness_is_not_definite():
    """A spring that takes away a little more than the stiffness of one point, deep in a block."""
    made = matrices(block(skfem.MeshTet, [6, 6, 4], [-1, -1, -1], [1, 1, 0], "above"), 1)
    fixed = made["order"][np.unique(made["facets"]["far"])].ravel()
    K, inner = made["K"], np.setdiff1d(np.arange(made["K"].shape[0]), fixed)
    deep = made["order"][np.argmin(np.abs(made["points"] - [0, 0, -0.5]).sum(axis=1)), 0]
    unit = (inner == deep).astype(float)
    least = 1 / spsolve(K[inner][:, inner].tocsc(), unit)[unit > 0][0]
    punch = Rigid("punch", force={"z": -1.0}, gap=lambda x: x[0] ** 2 + x[1] ** 2)
    for solver in ("superlu", "multigrid"):
        for share, right in ((0.9, True), (1.2, False)):
            made["K"] = added(K, deep, deep, -share * least)
            part = MatrixPart("bed", fixed=fixed, **made)
            scene = Scene("by matrices", punch, part, 0.3, kind="solid")
            with nullcontext() if right else pytest.raises(InputError, match="semidefinite"):
                reduce_bodies(scene, solver=solver)


UNITS = {
    "K in N/m beside mm": ((1e6, 1e6, 1, 1), ("mm", "MPa"), "than diamond: are K and its points"),
    "one K in another unit": ((1, 1e6, 1, 1), ("a", "b"), "times as stiff as 'upper'"),
    "points in m": ((1, 1, 1e-3, 1), ("a", "b"), "times as large as 'upper'"),
    "all is well": ((1, 1, 1, 1), ("mm", "MPa"), None),
}


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", UNITS)
def test_matrices_in_another_unit_than_the_scene_are_told(name, dim):
    (upper, lower, small, large), units, said = UNITS[name]
    kind = BRICK[dim]
    scene = pressed(dim, kind, 1, as_matrices=True)
    bodies = [
        replace(part, K=factor * part.K, points=size * np.asarray(part.points))
        for part, factor, size in zip(scene.parts, (upper, lower), (small, large))
    ]
    scene = replace(scene, upper=bodies[0], lower=bodies[1], units=units)
    notes = doubts(scene, reduce_bodies(scene).couplings, ())
    assert (not notes) if said is None else any(said.split(",")[-1] in note for note in notes), (
        notes
    )


def test_what_needs_elements_is_refused_in_a_sentence():
    scene = Scene("s", Rigid("wall", force={"y": -1.0}), MatrixPart("bed", **given()), 0.3)
    for act, said in (
        (lambda: gradient(run(scene), "approach", ["E:bed"]), "has matrices and no material"),
        (lambda: run(scene, quantity="pressure", accuracy=0.1), "are as fine as they are"),
    ):
        with pytest.raises(InputError, match=said):
            act()
    assert "nothing that could be left out" in str(simplify(scene))
    assert np.isfinite(gradient(run(scene), "approach", ["mu"]).by["mu"])

"""A body given by its matrices stands wherever one with a mesh does."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from scipy.io import mmread
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import (
    HalfSpace,
    InputError,
    Material,
    MatrixPart,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    follow,
    reduce,
    reduce_bodies,
    run,
    scenes,
    solve,
)
from contactopt.bodies.fields import von_mises
from contactopt.coupling.matrices import matrices_of, write_matrices

E, NU = 70.0, 0.3
ELEMENTS = {
    (skfem.MeshTri, 1): skfem.ElementTriP1, (skfem.MeshTri, 2): skfem.ElementTriP2,
    (skfem.MeshQuad, 1): skfem.ElementQuad1, (skfem.MeshQuad, 2): skfem.ElementQuad2,
    (skfem.MeshTet, 1): skfem.ElementTetP1, (skfem.MeshTet, 2): skfem.ElementTetP2,
    (skfem.MeshHex, 1): skfem.ElementHex1, (skfem.MeshHex, 2): skfem.ElementHex2,
}  # fmt: skip


def block(kind, cells, low, high, contact):
    """A mesh of a block with the boundaries contact and far, below or above."""
    dim = len(low)
    mesh = kind.init_tensor(*(np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells)))
    ends = {"contact": low, "far": high} if contact == "below" else {"contact": high, "far": low}
    level = {name: end[-1] for name, end in ends.items()}
    return mesh.with_boundaries(
        {name: lambda x, y=y: np.isclose(x[dim - 1], y) for name, y in level.items()}
    )


def matrices(mesh, degree, load=None):
    """K, f under a traction on far, points, order and facets, by scikit-fem alone."""
    dim = len(mesh.p)
    element = skfem.ElementVector(ELEMENTS[type(mesh), degree]())
    basis = skfem.Basis(mesh, element, intorder=2 * degree)
    K = linear_elasticity(*lame_parameters(E, NU)).assemble(basis)
    faces = skfem.FacetBasis(mesh, element, facets=mesh.boundaries["far"], intorder=6)
    load = np.zeros(dim) if load is None else np.asarray(load)
    f = skfem.LinearForm(lambda v, w: sum(load[i] * v[i] for i in range(dim))).assemble(faces)
    component = np.empty(basis.N, dtype=int)
    for i in range(dim):
        component[basis.get_dofs(elements=True).all([f"u^{i + 1}"])] = i
    order = np.stack([np.flatnonzero(component == i) for i in range(dim)], axis=1)
    points = basis.doflocs[:, order[:, 0]].T
    order = np.stack([own[KDTree(basis.doflocs[:, own].T).query(points)[1]] for own in order.T], 1)
    facets = {}
    for name, own in mesh.boundaries.items():
        corners = mesh.p[:, mesh.facets[:, own]]
        parts = [corners]
        if degree == 2:
            after = np.roll(corners, -1, axis=1)
            parts.append((corners + after)[:, : 1 if dim == 2 else None] / 2)
            if corners.shape[1] == 4:
                parts.append(corners.mean(axis=1, keepdims=True))
        places = np.concatenate(parts, axis=1)
        facets[name] = KDTree(points).query(np.moveaxis(places, 0, -1))[1].T
    return {"K": K, "f": f, "points": points, "order": order, "facets": facets}


def pressed(dim, kind, degree, ratio=1, law="coulomb", t=0.0, forces=(), as_matrices=False):
    """A block pressed on another by a plate, or by a traction; both as parts or by matrices."""
    n = 3 if dim == 2 else 2 if degree == 1 else 1
    top = block(kind, [n] * dim, [-0.5] * (dim - 1) + [0.0], [0.5] * (dim - 1) + [0.8], "below")
    cells, wide = [n if ratio == 1 else 2 * n] * (dim - 1) + [n], [ratio / 2] * (dim - 1)
    bed = block(kind, cells, [*(-half for half in wide), -1.0], [*wide, 0.0], "above")
    x, y = ("x", "y") if dim == 2 else ("x", "z")
    plates = (Plate("far", {y: -1.0, x: t}),) if forces == () else ()
    if as_matrices:
        lower = matrices(bed, degree)
        far = lower["order"][np.unique(lower["facets"]["far"])].ravel()
        upper = MatrixPart("upper", loads=plates, **matrices(top, degree, forces or None))
        lower = MatrixPart("lower", fixed=far, **lower)
    else:
        loads = plates or (Traction("far", forces),)
        upper = Part("upper", top, Material(E, NU), loads=loads)
        lower = Part("lower", bed, Material(E, NU), supports=(Support("far"),))
    kind = "solid" if dim == 3 else "plane-strain"
    mu = 0.4 if law == "coulomb" else 0.0
    return Scene("pressed", upper, lower, mu, kind=kind, degree=degree, law=law)


def compared(one, other):
    """The largest differences of forces and displacements, relative to the largest."""
    (a, r), (b, s) = one, other
    found = [(r.reactions, s.reactions), *zip(a.displaced(r), b.displaced(s))]
    return [np.abs(u - v).max() / np.abs(u).max() for u, v in found]


CASES = [
    (2, skfem.MeshTri, 1), (2, skfem.MeshQuad, 1), (2, skfem.MeshTri, 2),
    (2, skfem.MeshQuad, 2), (3, skfem.MeshTet, 1),
    (3, skfem.MeshHex, 1), (3, skfem.MeshTet, 2),
    pytest.param(3, skfem.MeshHex, 2, marks=pytest.mark.slow),
]  # fmt: skip


@pytest.mark.parametrize(("law", "ratio"), [("coulomb", 1), ("coulomb", 1.5), ("tied", 1.5)])
@pytest.mark.parametrize(("dim", "kind", "degree"), CASES)
def test_matrices_of_another_code_give_the_same_answer(dim, kind, degree, ratio, law):
    made = []
    for as_matrices in (False, True):
        scene = pressed(dim, kind, degree, ratio, law, 0.1, as_matrices=as_matrices)
        reduction = reduce_bodies(scene, Q="explicit")
        assert reduction.coupling.kind == ("matching" if ratio == 1 else "mortar")
        made.append((reduction, solve(reduction.problem, tol=1e-13)))
        assert made[-1][1].solved
    assert max(compared(*made)) < 1e-10


def test_a_floating_body_and_a_load_path():
    paths = []
    for as_matrices in (False, True):
        loads = [(0.0, -1.0), (0.2, -1.0), (-0.2, -0.8)]
        states = [
            pressed(2, skfem.MeshTri, 1, 1, "coulomb", 0.0, t, as_matrices=as_matrices)
            for t in loads
        ]
        paths.append(follow(states, Q="explicit", tol=1e-13))
    for step in range(3):
        one, other = (path.states[step] for path in paths)
        pairs = zip(
            (one.solution.reactions, *one.bodies), (other.solution.reactions, *other.bodies)
        )
        assert max(np.abs(u - v).max() / np.abs(u).max() for u, v in pairs) < 1e-9
    histories = [path.history["energy_error"] for path in paths]
    assert np.allclose(*histories, atol=1e-9)


def given(**changes):
    """The arguments of a block of ours, given by node, held below, with changes."""
    mesh = block(skfem.MeshTri, [3, 3], [-1.0, -1.0], [1.0, 0.0], "above")
    made = matrices(mesh, 1)
    order = made.pop("order")
    number = order.ravel()
    made["K"], made["f"] = made["K"][number][:, number].tocsr(), made["f"][number]
    far = np.unique(made["facets"]["far"])
    made["fixed"] = np.concatenate([2 * far, 2 * far + 1])
    return {**made, **changes}


def solved_on(**changes):
    """A rigid punch on it: its problem, reactions and displacements of the points."""
    punch = Rigid("punch", force={"y": -1.0}, gap=lambda x: x[0] ** 2)
    reduction = reduce_bodies(Scene("by matrices", punch, MatrixPart("bed", **changes), 0.3))
    solution = solve(reduction.problem, tol=1e-12)
    U = reduction.displaced(solution)[1]
    return solution.reactions, reduction.bodies[1].view.at_points(U)


def test_every_way_to_give_a_body_gives_the_same_answer():
    base = given()
    r, u = solved_on(**base)
    n, fixed = len(base["f"]), base["fixed"]
    free = np.setdiff1d(np.arange(n), fixed)
    K, f = base["K"], base["f"]
    by_component = np.arange(n).reshape(-1, 2).T.ravel()
    shuffled = np.random.default_rng(0).permutation(n)
    T = sp.identity(n, format="csr")[:, free]
    factors = splu(K[free][:, free].tocsc())

    def solves(load):
        out = np.zeros(n)
        out[free] = factors.solve(load[free])
        return out

    eliminated = K.tolil()
    eliminated[fixed, :] = eliminated[:, fixed] = 0.0
    eliminated[fixed, fixed] = 1.0
    ways = {
        "component": {
            "K": K[by_component][:, by_component], "f": f[by_component],
            "fixed": np.flatnonzero(np.isin(by_component, fixed)),
        },
        "numbers": {
            "K": K[shuffled][:, shuffled], "f": f[shuffled],
            "order": np.argsort(shuffled).reshape(-1, 2),
            "fixed": np.flatnonzero(np.isin(shuffled, fixed)),
        },
        "points in columns": {"points": base["points"].T},
        "supports": {"fixed": None, "supports": (Support("far"),)},
        "values": {"fixed": dict.fromkeys(fixed.tolist(), 0.0)},
        "left out": {"K": K[free][:, free], "f": f[free], "constraints": T, "fixed": None},
        "left out by us": {"constraints": T, "fixed": None},
        "eliminated": {"K": eliminated.tocsr()},
        "dense": {"K": K.toarray()},
        "turned facets": {"facets": {k: v[:, ::-1] for k, v in base["facets"].items()}},
        "function": {
            "K": solves, "order": "node",
            "facets": {k: v[:, ::-1] for k, v in base["facets"].items()},
        },
    }  # fmt: skip
    for name, changes in ways.items():
        again = solved_on(**{**base, **changes})
        assert np.allclose(again[0], r, atol=1e-10), name
        assert np.allclose(again[1], u, atol=1e-10), name


def test_multi_point_constraints_make_points_follow():
    """The far side moves as one: as a plate that is glued to it does."""
    base = given(fixed=None, f=None)
    n, far = base["K"].shape[0], np.unique(base["facets"]["far"])
    base["f"] = np.zeros(n)
    base["f"][2 * far + 1] = 1.0 / len(far)
    master, T = far[0], sp.identity(n, format="lil")
    for i in far[1:]:
        for c in (0, 1):
            T[2 * i + c, 2 * i + c] = 0.0
            T[2 * i + c, 2 * master + c] = 1.0
    T = T.tocsr()[:, np.flatnonzero(np.asarray(T.sum(axis=0)).ravel())]
    wall = Rigid("wall", gap=lambda x: 0.1 + x[0] ** 2)
    plate = Plate("far", {"y": 1.0})
    answers = []
    for part in (
        MatrixPart("bed", constraints=T, **base),
        MatrixPart("bed", loads=(plate,), **{**base, "f": 0 * base["f"]}),
    ):
        fixed = {"fixed": [2 * master]} if part.constraints is not None else {}
        part = MatrixPart(**{**{k: getattr(part, k) for k in (
            "name", "K", "f", "points", "facets", "loads", "constraints")}, **fixed})  # fmt: skip
        reduction = reduce_bodies(Scene("pulled", wall, part, 0.3))
        solution = solve(reduction.problem, tol=1e-12)
        answers.append(solution.reactions)
    assert np.allclose(*answers, atol=1e-9) and np.abs(answers[0]).max() > 0.1


def test_a_half_space_and_a_patch():
    """Bodies by matrices lie on half-spaces as on other bodies."""
    base = given()
    x = np.linspace(-1, 1, 7)
    space = HalfSpace("space", Material(E, NU), (x,), force={"y": -1.0})
    with pytest.raises(InputError, match="points must be those"):
        reduce_bodies(Scene("on", space, MatrixPart("bed", **base), 0.3))
    x = np.linspace(-1, 1, 4)
    space = HalfSpace("space", Material(E, NU), (x,), force={"y": -1.0})
    reduction = reduce_bodies(Scene("on", space, MatrixPart("bed", **base), 0.3))
    assert solve(reduction.problem).solved


def test_a_run_writes_displacements_and_pictures_of_the_contact(tmp_path):
    def stress(u):
        return np.stack([u[0], u[1], 0 * u[0], u[0]], axis=1)

    bed = MatrixPart("bed", stress=stress, **given())
    scene = Scene("s", Rigid("wall", force={"y": -1.0}), bed, 0.3)
    result = run(scene, out=tmp_path)
    assert result.solution.solved
    names = {path.name for path in tmp_path.iterdir()}
    assert {"bed.vtu", "pressure.png", "contact-wall-bed.csv", "summary.json"} <= names
    made = meshio.read(tmp_path / "bed.vtu")
    body, U = result.reduction.bodies[1], result.reduction.displaced(result.solution)[1]
    assert np.allclose(made.point_data["displacement"][:, :2], body.view.at_points(U).T)
    expected = stress(body.view.at_points(U))
    assert np.allclose(made.point_data["stress_yy"], expected[:, 1])
    assert np.allclose(made.point_data["von_mises"], von_mises(expected))
    total = made.point_data["force"].sum(axis=0)
    assert np.allclose(total[1:], [-1, 0], atol=1e-9)
    assert np.allclose(made.point_data["reaction"].sum(axis=0) + total, 0, atol=1e-9)


@pytest.mark.parametrize("form", ["npz", "mtx"])
@pytest.mark.parametrize("rigid", [False, True])
def test_what_export_writes_gives_the_same_problem(rigid, form, tmp_path):
    """By dense algebra alone: u(r) = sum B U(r) + gap is Q r + V lambda + q for every r that
    balances the loads; and as MatrixPart it reduces to the same problem.
    """
    out = tmp_path / "made"
    scene = scenes.flat_punch(2, elements=4)
    if rigid:
        scene = replace(scene, upper=Rigid("punch", force={"y": -1.0}))
    write_matrices(reduce_bodies(scene), out, form)
    problem = reduce(scene)

    def read(key):
        if form == "mtx":
            made = mmread(out / f"{key}.mtx")
            return made.toarray() if sp.issparse(made) else made
        with np.load(out) as file:
            if key in file:
                return file[key]
            own = (file[f"{key}.{part}"] for part in ("data", "indices", "indptr"))
            return sp.csr_matrix(tuple(own), file[f"{key}.shape"]).toarray()

    q, V = read("q").ravel(), read("V").reshape(problem.q.size, -1)
    s = read("s").ravel()
    assert np.allclose(read("Q"), problem.Q) and np.allclose(V, problem.V)
    r = np.random.default_rng(0).standard_normal(q.size)
    r -= V @ np.linalg.lstsq(V.T @ V, V.T @ r + s, rcond=None)[0] if V.size else 0
    u = 0 * r
    for part in scene.meshed.values():
        K, f, N, g, p, B = (read(f"{part.name}.{own}") for own in ("K", "f", "N", "g", "p", "B"))
        f, g, p = f.ravel(), g.ravel(), p.ravel()
        v = np.linalg.lstsq(N.T @ K @ N, N.T @ (f - K @ g + B.T @ r) + p, rcond=1e-12)[0]
        u += B @ (g + N @ v)
    gap = reduce_bodies(scene).gap
    rest = problem.Q @ r + q - u
    rest[:: problem.dim] -= gap
    rest -= V @ np.linalg.lstsq(V, rest, rcond=None)[0] if V.size else 0
    assert np.abs(rest).max() < 1e-9 * np.abs(u).max()
    (part, *_) = scene.meshed.values()
    N, K, f, g, p = (read(f"{part.name}.{own}") for own in ("N", "K", "f", "g", "p"))
    load = N.T @ (f.ravel() - K @ g.ravel()) + p.ravel()
    facets = {part.contact: read(f"{part.name}.facets.{part.contact}").astype(int)}
    given = MatrixPart(
        part.name, N.T @ K @ N, load, read(f"{part.name}.points"), facets, contact=part.contact,
        order=read(f"{part.name}.unknowns"), constraints=sp.csr_matrix(N),
    )  # fmt: skip
    again = reduce(scene.with_parts(lambda own: given if own is part else own))
    # the free motion of a plate is measured elsewhere, which moves Q along V
    forces = [solve(own, tol=1e-13).reactions for own in (again, problem)]
    assert np.allclose(*forces, atol=1e-10 * np.abs(forces[0]).max())
    assert np.allclose(np.abs(again.s), np.abs(problem.s))


def test_a_ring_by_its_matrices():
    """A graded mesh about an axis, whose elements differ by a thousand: its own matrices again."""
    scene = replace(scenes.rigid_punch("axisymmetric", elements=4), degree=1)
    reduction = reduce_bodies(scene)
    (part,), made = scene.meshed.values(), matrices_of(reduction)
    own = {key.removeprefix(f"{part.name}."): value for key, value in made.items()}
    held = np.setdiff1d(np.arange(len(own["f"])), own["N"].tocoo().row)
    facets = {part.contact: own[f"facets.{part.contact}"]}
    given = MatrixPart(
        part.name, own["K"], own["f"], own["points"], facets, held, contact=part.contact,
        order=own["unknowns"],
    )  # fmt: skip
    again = reduce(scene.with_parts(lambda body: given if body is part else body))
    assert np.allclose(again.Q, reduction.problem.Q, rtol=1e-8)

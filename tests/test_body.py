import numpy as np
import pytest
import skfem
from conftest import MATERIAL, block, two_blocks

from contactopt import (
    BodyForce,
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    reduce,
)
from contactopt.bodies.body import build_body
from contactopt.meshes.cells import split_twice

KINDS = ["plane-strain", "axisymmetric", "solid"]


def body_of(kind, **part):
    scene = two_blocks(kind)
    lower = scene.lower
    part = Part(
        **(
            dict(
                name="b", mesh=lower.mesh, material=MATERIAL, supports=lower.supports, contact="top"
            )
            | part
        )
    )
    return build_body(Scene("s", scene.upper, part, 0.0, kind=kind), part, 1, None)


@pytest.mark.parametrize(
    "kind,area,volume",
    [("plane-strain", 1, 2), ("axisymmetric", np.pi, 2 * np.pi), ("solid", 1, 2)],
)
def test_areas_and_loads_add_up(kind, area, volume):
    dim = 3 if kind == "solid" else 2
    traction = Traction("top", tuple(np.arange(1.0, dim + 1)))
    body = body_of(kind, loads=(traction,))
    assert body.trace.areas.sum() == pytest.approx(area)
    for i in range(dim):
        assert body.load[body.basis.nodal_dofs[i]].sum() == pytest.approx((i + 1) * area)
    heavy = body_of(kind, loads=(BodyForce((0.0,) * (dim - 1) + (-2.0,)),))
    assert heavy.load.sum() == pytest.approx(-2 * volume)


@pytest.mark.parametrize("kind", KINDS)
def test_normals_point_outward(kind):
    assert np.allclose(body_of(kind).trace.normals.T, np.eye(3 if kind == "solid" else 2)[-1])
    assert np.allclose(
        body_of(kind, contact="bottom").trace.normals.T, -np.eye(3 if kind == "solid" else 2)[-1]
    )


def test_normals_of_a_closed_surface_sum_to_zero():
    mesh = skfem.MeshTri.init_circle(3).with_boundaries(
        {"all": lambda x: np.ones_like(x[0], dtype=bool)}
    )
    part = Part("disc", mesh, MATERIAL, (Support("all"),), contact="all")
    body = build_body(Scene("s", part, two_blocks("plane-strain").lower, 0.0), part, 1, None)
    assert np.abs(body.trace.normals @ body.trace.areas).max() < 1e-12
    assert np.all(np.sum(body.trace.normals * body.points, axis=0) > 0)


@pytest.mark.parametrize("kind,supports,motions", [
    ("plane-strain", (),
     ["translation along x", "translation along y", "rotation in the x-y plane"]),
    ("plane-strain", ("side0",), ["translation along y"]),
    ("plane-strain", ({"top": "y"},), ["translation along x"]),
    ("plane-strain", ({"bottom": "xy"},), []),
    ("solid", ("side0", "side1"), ["translation along z"]),
    ("solid", ({"top": "z"},),
     ["translation along x", "translation along y", "rotation in the x-y plane"]),
    ("axisymmetric", ("side0",), ["translation along z"]),
    ("axisymmetric", (), ["translation along z"]),
])  # fmt: skip
def test_motions_that_nothing_holds_are_found(kind, supports, motions):
    """They strain nothing, and the fixing unknowns make the stiffness definite."""
    components = {"plane-strain": "xy", "axisymmetric": "rz", "solid": "xyz"}[kind]
    chosen = []
    for s in supports:
        if isinstance(s, dict):
            ((boundary, held),) = s.items()
        else:
            boundary, held = s, components[int(s[-1])]
        chosen.append(Support(boundary, dict.fromkeys(held, 0.0)))
    body = body_of(kind, supports=tuple(chosen))
    Z, held = body.rigid_motions.fields, np.setdiff1d(np.arange(len(body.load)), body.free)
    assert sorted(body.rigid_motions.names) == sorted(motions)
    assert Z.shape[1] == len(motions) and not np.any(Z[held])
    if not motions:
        return
    assert np.linalg.matrix_rank(Z) == len(motions)
    assert np.abs(body.A @ Z).max() < 1e-12 * abs(body.A).max()
    kept = np.setdiff1d(body.free, body.rigid_motions.fixing)
    assert np.linalg.eigvalsh(body.A[kept][:, kept].toarray()).min() > 0
    assert np.allclose(Z.T @ body.rigid_motions.forces, np.eye(len(motions)))


@pytest.mark.parametrize(
    "change,message",
    [
        (dict(contact="face"), "no boundary named 'face'.*bottom"),
        (dict(supports=(Support("floor"),)), "no boundary named 'floor'"),
        (dict(mesh=skfem.MeshTet()), "dimension 2"),
        (dict(mesh="block.msh"), "scikit-fem mesh of dimension 2.*got str"),
        (dict(material=5.0), "material must be a Material"),
        (dict(loads=(Plate("bottom", {"y": -1.0}),)), "plate .* moves in y, but the support"),
        (dict(supports=(Support("bottom"), Support("bottom", {"y": 1.0}))), "different value"),
    ],
)
def test_bad_bodies_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        body_of("plane-strain", **change)


def test_a_mesh_in_two_pieces_is_refused():
    mesh = block("plane-strain", -2, 0)
    loose = type(mesh)(
        np.hstack([mesh.p, mesh.p + 9]), np.hstack([mesh.t, mesh.t + mesh.p.shape[1]])
    )
    loose = loose.with_boundaries(
        {"top": lambda x: x[1] == 0, "bottom": lambda x: x[1] == -2, "side0": lambda x: x[0] == 0}
    )
    with pytest.raises(InputError, match="2 pieces"):
        body_of("plane-strain", mesh=loose)


@pytest.mark.parametrize("mesh", [skfem.MeshTri, skfem.MeshTet])
def test_an_element_that_lies_over_its_neighbour_is_refused(mesh):
    """A node is moved past the elements around it, whose volumes stay positive once renumbered."""
    mesh, top = mesh().refined(2), {"top": lambda x: x[-1] == 1, "bottom": lambda x: x[-1] == 0}
    kind = "plane-strain" if len(mesh.p) == 2 else "solid"
    places = mesh.p.copy()
    places[:, np.argmin(np.abs(places - 0.5).sum(axis=0))] = 0.95
    held = dict(supports=(Support("bottom"),))
    body_of(kind, mesh=mesh.with_boundaries(top), **held)
    with pytest.raises(InputError, match="'b': an element of the mesh lies over its neighbour"):
        body_of(kind, mesh=type(mesh)(places, mesh.t).with_boundaries(top), **held)


def test_negative_radius_is_refused():
    mesh = block("axisymmetric", -2, 0)
    with pytest.raises(InputError, match="r >= 0"):
        body_of("axisymmetric", mesh=mesh.translated((-0.5, 0.0)))


@pytest.mark.parametrize(
    "E,nu", [(0, 0.3), (-1, 0.3), (np.nan, 0.3), (1, 0.5), (1, -1), (1, np.inf), ("5", 0.3)]
)
def test_bad_materials_are_refused(E, nu):
    with pytest.raises(InputError, match="must be a finite number"):
        Material(E, nu)


def test_tetrahedra_that_split_a_common_side_differently_are_refused():
    """Two cubes of six tetrahedra whose common square has one diagonal from each side."""
    cube = skfem.MeshTet.init_tensor([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])
    x, y, z = cube.p
    other = skfem.MeshTet(np.stack([2 - x, y, z]), cube.t)
    turned = skfem.MeshTet(np.stack([1 + x, y, 1 - z]), cube.t)
    assert split_twice(cube) is None and split_twice(joined_meshes(cube, other)) is None
    found = split_twice(joined_meshes(cube, turned))
    assert np.allclose(found, [1.0, 0.5, 0.5])
    named = joined_meshes(cube, turned).with_boundaries({"contact": lambda x: x[2] == 0})
    part = Part("b", named, Material(1.0, 0.3))
    with pytest.raises(InputError, match=r"different diagonals, at \(1, 0.5, 0.5\)"):
        reduce(Scene("s", part, Rigid("floor"), 0.3, "solid"))


def joined_meshes(one, other):
    """Of both, with common nodes."""
    points = np.concatenate([one.p, other.p], axis=1)
    t = np.concatenate([one.t, other.t + one.p.shape[1]], axis=1)
    p, number = np.unique(points.round(9), axis=1, return_inverse=True)
    return skfem.MeshTet(p, np.ravel(number)[t])

"""Thin layers of quadratic elements follow the body beneath: contacts hold all their nodes."""

from functools import cache

import numpy as np
import pytest
import skfem
import turned

from contactopt import Contact, Material, Part, Rigid, Scene, Support, Traction, reduce_bodies, run
from contactopt.bodies.thickness import thin_facets
from contactopt.meshes.structured import graded, rename, simplices, tensor_mesh

STEEL = Material(2e5, 0.3)


def box(low, high, cells, cut):
    """A box of quadrilaterals or hexahedra, or cut into simplices; boundaries bottom and top."""
    mesh = tensor_mesh(*(np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells)))
    up = "xyz"[len(low) - 1]
    mesh = rename(mesh, bottom=f"{up}-", top=f"{up}+")
    return simplices(mesh) if cut else mesh


def layer(height, cut, cells=(9, 13), below=False, dim=2, **contact):
    """A thin layer pressed on a coarser block, or between it and a rigid floor."""
    flat, wide = dim - 1, 1.5 if dim == 2 else 0.8
    pressed = Traction("top", (0.02, *[0.0] * (dim - 2), -1.0))
    kind = "plane-strain" if dim == 2 else "solid"
    pair = {"mu": 0.3 * (contact.get("law") != "tied")} | contact
    if below:
        mesh = box([-0.5] * flat + [-height], [0.5] * flat + [0.0], [cells[0]] * flat + [2], cut)
        thin = Part("layer", mesh, STEEL, contact="top")
        mesh = box([-0.5] * dim, [0.5] * flat + [0.0], [cells[1]] * dim, True)
        block = Part(
            "block", mesh.translated([0.0] * flat + [0.5]), STEEL, (), (pressed,), "bottom"
        )
        pairs = Contact("block", "layer", **pair), Contact("layer:bottom", "floor", 0.3)
        return Scene("under", bodies=(block, thin, Rigid("floor")), contacts=pairs, degree=2)
    mesh = box([-0.5] * flat + [0.0], [0.5] * flat + [height], [cells[0]] * flat + [2], cut)
    thin = Part("layer", mesh, STEEL, (), (pressed,), "bottom")
    mesh = box([-wide] * flat + [-1.0], [wide] * flat + [0.0], [cells[1]] * flat + [3], False)
    block = Part("block", mesh, STEEL, (Support("bottom"),), (), "top")
    pairs = (Contact("layer", "block", **pair),)
    return Scene("layer", bodies=(thin, block), contacts=pairs, kind=kind, degree=2)


def farthest(scene) -> float:
    """The largest displacement of the layer."""
    result = run(scene, figures=())
    assert result.solution.solved
    fields = next(one for one in result.fields if one.name == "layer")
    return float(np.linalg.norm(fields.displacement, axis=0).max())


@cache
def of_quadrilaterals(height, law) -> float:
    return farthest(layer(height, False, (24, 24), law=law))


@pytest.mark.parametrize("law", ["coulomb", "tied"])
@pytest.mark.parametrize("height", [1e-2, 1e-4])
@pytest.mark.parametrize("cells", [(9, 13), (30, 13), (12, 36)])
def test_a_thin_layer_lies_on_a_block_whatever_its_elements_are(cells, height, law):
    """The block alone has nearly its displacement; on vertices alone, triangles are far off."""
    right = of_quadrilaterals(height, law)
    for cut in (False, True):
        assert farthest(layer(height, cut, cells, law=law)) == pytest.approx(right, rel=0.02)


@pytest.mark.parametrize("law", ["coulomb", "tied"])
def test_a_thin_layer_of_tetrahedra_lies_on_a_block(law):
    right, own = (farthest(layer(4e-3, cut, (4, 5), dim=3, law=law)) for cut in (False, True))
    assert own == pytest.approx(right, rel=0.01)


@pytest.mark.parametrize("cells", [(9, 5), (5, 9)])
def test_a_thin_layer_between_two_bodies_follows_both(cells):
    right, own = (farthest(layer(2e-3, cut, cells, below=True)) for cut in (False, True))
    assert own == pytest.approx(right, rel=0.05)


def test_a_carrier_that_lets_a_thin_layer_bulge_draws_a_remark():
    made = reduce_bodies(layer(1e-3, True, coupling="mortar", carrier="lower")).coupling
    assert made.carrier == "lower" and "'layer' is thin and has 0." in made.remarks[0]
    assert reduce_bodies(layer(1e-3, True)).coupling.carrier == "upper"
    assert not reduce_bodies(layer(1e-3, True)).coupling.remarks


@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
def test_facets_above_another_boundary_are_thin(dim, cut):
    """Also with several elements across it; not where flat elements lie on a thick body."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(dim, dim)))[0]
    for layers in (1, 3):
        for height, thin in ((0.02, True), (0.2, False)):
            mesh = box([0.0] * dim, [1.0] * (dim - 1) + [height], [5] * (dim - 1) + [layers], cut)
            facets = mesh.boundaries["bottom"]
            assert np.all(thin_facets(mesh, facets) == thin)
            moved = type(mesh)(1e3 * turn @ mesh.p, mesh.t)
            middle = moved.p[:, moved.facets].mean(axis=1)
            on = np.abs((turn.T @ middle)[-1]) < 1e-6
            assert np.all(thin_facets(moved, np.flatnonzero(on)) == thin)
    grids = [np.linspace(0.0, 1.0, 5)] * (dim - 1)
    mesh = rename(tensor_mesh(*grids, graded(1.0, 0.005, 1.5)), bottom=f"{'xyz'[dim - 1]}-")
    mesh = simplices(mesh) if cut else mesh
    assert not thin_facets(mesh, mesh.boundaries["bottom"]).any()


def test_discs_and_rings_are_not_thin():
    for mesh in (turned.ring(1.0, 2.0, 2, 24), skfem.MeshTri.init_circle(3)):
        assert not thin_facets(mesh, mesh.boundary_facets()).any()

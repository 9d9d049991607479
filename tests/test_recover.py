from dataclasses import replace

import meshio
import numpy as np
import pytest
from conftest import two_blocks

from contactopt import reduce_bodies, run, scenes, solve
from contactopt.bodies import views
from contactopt.coupling.back_to_bodies import recover
from contactopt.figures.pieces import outline
from contactopt.meshes.cells import elements_of
from contactopt.meshes.structured import simplices
from tests.mesh_samples import BRICK_EDGES


def solved(scene, **kw):
    reduction = reduce_bodies(scene, **kw)
    return recover(reduction, solve(reduction.problem))


@pytest.mark.parametrize("kind", ["plane-strain", "axisymmetric", "solid"])
def test_vtu_files_hold_what_was_computed(kind, tmp_path):
    for field in solved(two_blocks(kind)):
        field.write_vtu(tmp_path / f"{field.name}.vtu")
        back = meshio.read(tmp_path / f"{field.name}.vtu")
        dim = field.mesh.p.shape[0]
        assert np.allclose(back.points[:, :dim].T, field.mesh.p)
        assert np.allclose(back.point_data["displacement"][:, :dim].T, field.displacement)
        assert np.allclose(back.point_data["von_mises"], field.von_mises)
        assert {f"stress_{name}" for name in field.names} <= set(back.point_data)
        assert len(back.cells[0].data) == field.mesh.nelements


def test_hexahedra_are_written_with_positive_volume_in_vtk_order(tmp_path):
    """VTK: four corners around the base, then the four above them."""
    field = solved(two_blocks("solid"))[0]
    field.write_vtu(tmp_path / "u.vtu")
    back = meshio.read(tmp_path / "u.vtu")
    corners = back.points[back.cells[0].data]
    base, top = corners[:, :4], corners[:, 4:]
    # each upper corner above its lower one, for bricks
    assert np.allclose((top - base).std(axis=1), 0)
    assert np.allclose(base[:, 0] + base[:, 2], base[:, 1] + base[:, 3])
    normal = np.cross(base[:, 1] - base[:, 0], base[:, 3] - base[:, 0])
    assert np.all(np.sum(normal * (top - base)[:, 0], axis=1) > 0)


@pytest.mark.parametrize("degree", [1, 2])
def test_stress_below_hertz_contact(degree):
    """On the axis: sigma_z = -p0 / (1 + z^2/a^2), at the surface too where the displacement is
    quadratic; largest von Mises stress about .62 p0 at .48 a (nu = .3).
    """
    scene = scenes.make_scene("sphere", degree=degree, elements=32 // degree**2, mu=0.0)
    a, p0 = scene.reference.half_width, scene.reference.peak
    foundation = solved(scene, zone=a)[1]
    x, z = foundation.mesh.p
    axis = (x == 0) & (z > -3 * a)
    exact = -p0 / (1 + (z[axis] / a) ** 2)
    vertical = foundation.stress[axis, foundation.names.index("zz")]
    assert (
        np.abs(vertical - exact)[np.abs(z[axis]) > (0.1 * a if degree == 1 else -1)].max()
        < 0.02 * p0
    )
    deepest = np.argmax(np.where(axis, foundation.von_mises, 0))
    assert foundation.von_mises[deepest] == pytest.approx(0.62 * p0, rel=0.02)
    assert -z[deepest] == pytest.approx(0.48 * a, abs=0.05 * a)


def test_plane_strain_out_of_plane_stress():
    """sigma_zz = nu (sigma_xx + sigma_yy)."""
    for field in solved(scenes.flat_punch(2, elements=6)):
        s = dict(zip(field.names, field.stress.T))
        assert np.allclose(s["zz"], 0.3 * (s["xx"] + s["yy"]), atol=1e-12)


# corners whose middle each node of a cell of second order is, as in the documentation of VTK's file
# formats
EDGES = {
    "triangle6": (3, [(0, 1), (1, 2), (2, 0)]),
    "quad9": (4, [(0, 1), (1, 2), (2, 3), (3, 0), (0, 1, 2, 3)]),
    "tetra10": (4, [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]),
    "hexahedron27": (8, [
        *BRICK_EDGES, (0, 3, 4, 7), (1, 2, 5, 6), (0, 1, 4, 5), (2, 3, 6, 7), (0, 1, 2, 3),
        (4, 5, 6, 7), tuple(range(8)),
    ]),
}  # fmt: skip


@pytest.mark.parametrize("kind,cut,name", [
    ("plane-strain", True, "triangle6"), ("plane-strain", False, "quad9"),
    ("solid", True, "tetra10"), ("solid", False, "hexahedron27"),
])  # fmt: skip
def test_a_quadratic_displacement_is_kept_at_every_node(kind, cut, name, tmp_path):
    """u_i = x_i^2 (i + 1) + x_0 x_1 has a linear strain: stresses are exact at all nodes."""
    scene = two_blocks(kind)
    mesh = simplices(scene.upper.mesh) if cut else scene.upper.mesh
    scene = replace(scene, degree=2, upper=replace(scene.upper, mesh=mesh))
    body = reduce_bodies(scene).bodies[0]
    x, dim = body.body.locations, len(scene.components)
    moved = np.array([(i + 1) * x[i] ** 2 + x[0] * x[1] for i in range(dim)])
    U = np.zeros(moved.size)
    U[body.body.unknowns] = moved
    field = views.fields(body, U)
    assert field.displacement.shape == field.mesh.p.shape == x.shape
    assert np.allclose(field.mesh.p, x) and np.allclose(field.displacement, moved)
    gradient = np.zeros((3, 3, x.shape[1]))
    for i in range(dim):
        gradient[i, 0], gradient[i, 1] = x[1], x[0]
        gradient[i, i] += 2 * (i + 1) * x[i]
    strain = (gradient + gradient.swapaxes(0, 1)) / 2
    E, nu = body.body.material.E, body.body.material.nu
    stress = E / (1 + nu) * (strain + nu / (1 - 2 * nu) * np.trace(strain) * np.eye(3)[:, :, None])
    for part, values in zip(field.names, field.stress.T):
        assert np.allclose(values, stress["xyz".index(part[0]), "xyz".index(part[1])], atol=1e-9)
    field.write_vtu(tmp_path / "body.vtu")
    back = meshio.read(tmp_path / "body.vtu")
    (block,) = back.cells
    assert block.type == name
    corners, middles = EDGES[name]
    for number, among in enumerate(middles):
        places = back.points[block.data[:, list(among)]].mean(axis=1)
        assert np.allclose(back.points[block.data[:, corners + number]], places)
    assert np.allclose(back.point_data["displacement"][:, :dim].T, moved)
    if cut:
        sides = back.points[block.data[:, 1 : dim + 1], :dim] - back.points[block.data[:, :1], :dim]
        assert np.linalg.det(sides).min() > 0


def test_nodes_in_the_middle_of_curved_edges_lie_on_the_circle():
    result = run("press-fit", elements=4, degree=2)
    for field in result.fields:
        rim = outline(*elements_of(field.mesh))
        radius = np.hypot(*field.mesh.p)[rim]
        arcs = radius[np.isclose(radius[:, 0], radius[:, 2])]
        assert len(arcs) == 8 and np.allclose(arcs[:, 1], arcs[:, 0])

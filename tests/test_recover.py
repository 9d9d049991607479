import meshio
import numpy as np
import pytest
from conftest import two_blocks

from contactopt import reduce_bodies, scenes, solve
from contactopt.interface.recovery import recover


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
    assert np.allclose((top - base).std(axis=1), 0)  # each upper corner above its lower one, for bricks
    assert np.allclose(base[:, 0] + base[:, 2], base[:, 1] + base[:, 3])
    normal = np.cross(base[:, 1] - base[:, 0], base[:, 3] - base[:, 0])
    assert np.all(np.sum(normal * (top - base)[:, 0], axis=1) > 0)


def test_stress_below_hertz_contact():
    """On the axis: sigma_z = -p0 / (1 + z^2/a^2); largest von Mises stress about .62 p0 at .48 a (nu = .3)."""
    scene = scenes.sphere()
    a, p0 = scene.reference.half_width, scene.reference.peak
    foundation = solved(scene, zone=a)[1]
    x, z = foundation.mesh.p
    axis = (x == 0) & (z > -3 * a)
    exact = -p0 / (1 + (z[axis] / a) ** 2)
    vertical = foundation.stress[axis, foundation.names.index("zz")]
    assert np.abs(vertical - exact)[np.abs(z[axis]) > 0.1 * a].max() < 0.02 * p0
    deepest = np.argmax(np.where(axis, foundation.von_mises, 0))
    assert foundation.von_mises[deepest] == pytest.approx(0.62 * p0, rel=0.02)
    assert -z[deepest] == pytest.approx(0.48 * a, abs=0.05 * a)


def test_plane_strain_out_of_plane_stress():
    """sigma_zz = nu (sigma_xx + sigma_yy)."""
    for field in solved(scenes.flat_punch(2, elements=6)):
        s = dict(zip(field.names, field.stress.T))
        assert np.allclose(s["zz"], 0.3 * (s["xx"] + s["yy"]), atol=1e-12)

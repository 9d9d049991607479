import numpy as np
import pytest
from skfem import MeshQuad

from contactopt.meshes.discs import half_disc


@pytest.mark.parametrize("sectors,count", [(1, 3), (2, 8), (3, 12)])
def test_half_disc(sectors, count):
    radii = np.linspace(0.0, 2.0, count)
    p, t = half_disc(radii, sectors)
    x, y = p[:, t]
    area = 0.5 * sum(x[k] * y[(k + 1) % 4] - x[(k + 1) % 4] * y[k] for k in range(4))
    assert area.min() > 0  # no cell turned over
    n = 4 * sectors
    polygon = n / 2 * 4.0 * np.sin(np.pi / n)  # inscribed: rings of n sides
    assert area.sum() == pytest.approx(polygon if count > 2 * sectors else area.sum())
    assert len(np.unique(np.round(p, 9), axis=1).T) == p.shape[1]
    rim = np.linalg.norm(p[:, -(n + 1) :], axis=0)
    np.testing.assert_allclose(rim, 2.0)
    mesh = MeshQuad(p, t)
    # the rim and the diameter: nothing else is open
    assert mesh.boundary_facets().size == n + 2 * (count - 1)
    assert np.sum(np.abs(p[1]) < 1e-12) == 2 * count - 1
    mirrored = np.round(p * [[-1], [1]], 9)
    assert {tuple(c) for c in mirrored.T + 0.0} == {tuple(c) for c in np.round(p, 9).T + 0.0}

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skfem import Basis, ElementQuad1, Functional, MeshHex, MeshQuad, MeshTet, MeshTri

from contactopt.meshes.cells import facets_at
from contactopt.meshes.structured import contact_grid, graded, half_sphere_section


@given(st.floats(0.1, 1e4), st.floats(1e-3, 2), st.floats(1.05, 2))
def test_graded_grids_end_where_they_should_and_grow_slowly(length, fraction, growth):
    grid = graded(length, fraction * length, growth)
    steps = np.diff(grid)
    assert grid[0] == 0 and grid[-1] == pytest.approx(length)
    assert np.all(steps > 0)
    assert np.all(steps[1:] <= growth * steps[:-1] * (1 + 1e-6))
    assert np.all(steps[1:] >= steps[:-1] * (1 - 1e-6))
    assert steps[0] <= fraction * length * (1 + 1e-9)


def test_half_sphere_section_is_a_quarter_disc_with_positive_elements():
    radius = 50.0
    grid = contact_grid(4.0, 16, radius / np.sqrt(2), 1.2)
    mesh = half_sphere_section(radius, grid, graded(radius, 0.25, 1.2) / radius)
    basis = Basis(mesh, ElementQuad1())
    assert np.all(basis.dx > 0)
    volume = Functional(lambda w: 2 * np.pi * w.x[0]).assemble(basis)
    assert volume == pytest.approx(2 / 3 * np.pi * radius**3, rel=2e-3)
    arc = mesh.p[:, np.unique(mesh.facets[:, mesh.boundaries["arc"]])]
    assert np.allclose(np.hypot(arc[0], arc[1] - radius), radius)
    assert np.allclose(mesh.p[0, mesh.facets[:, mesh.boundaries["axis"]]], 0)
    assert np.allclose(mesh.p[1, mesh.facets[:, mesh.boundaries["top"]]], radius)


@pytest.mark.parametrize("kind", [MeshTri, MeshQuad, MeshTet, MeshHex])
def test_facets_are_found_by_their_corners(kind):
    """In any order of the corners; there is none at -1, nor at nodes within edges."""
    mesh = kind().refined(2)
    turned = np.random.default_rng(0).permuted(mesh.facets, axis=0)
    assert np.array_equal(facets_at(mesh, turned), np.arange(mesh.nfacets))
    for other in (-1, mesh.nvertices, mesh.nvertices + 7, mesh.facets[1, 0]):
        wrong = mesh.facets[:, :1].copy()
        wrong[0] = other
        assert facets_at(mesh, wrong) == -1

"""The cells of a contact surface in space have one orientation, that of its normal."""

import meshio
import numpy as np
import pytest
from test_chords import press_fit

import contactopt


@pytest.mark.parametrize(
    "scene, given",
    [
        ("punch-3d", {"elements": 4}),
        ("punch-3d", {"elements": 4, "simplices": True}),
        (press_fit((6, 6), dim=3, overlap=1e-3), {}),
    ],
    ids=["squares", "triangles", "curved"],
)
def test_neighbours_agree_and_look_along_the_normal(scene, given, tmp_path):
    """Two cells with one orientation go along the edge between them in opposite directions."""
    result = contactopt.run(scene, tmp_path, figures=(), **given)
    (file,) = tmp_path.glob("contact-*.vtu")
    mesh = meshio.read(file)
    cells = mesh.cells[0].data
    edges = np.concatenate([np.column_stack([a, np.roll(a, -1)]) for a in cells])
    assert len(np.unique(edges, axis=0)) == len(edges) > 3 * len(cells) - 1
    fan = mesh.points[cells] - mesh.points[cells[:, :1]]
    area = np.cross(fan[:, 1:-1], fan[:, 2:]).sum(axis=1)
    normals = result.reduction.frames[:, 0][cells].mean(axis=1)
    assert np.all(np.einsum("ij,ij->i", area, normals) > 0)

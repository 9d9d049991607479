"""VTU files that contactopt writes are read by others as they were meant."""

import meshio
import numpy as np
import pytest

from contactopt.vtu import CELLS, write_vtu


@pytest.mark.parametrize("kind", CELLS)
def test_meshio_reads_what_was_written(kind, tmp_path):
    random = np.random.default_rng(1)
    corners = meshio._mesh.num_nodes_per_cell[kind]
    points, cells = random.random((30, 3)), random.integers(0, 30, (5, corners))
    data = {"scalar": random.random(30), 'a "name" & <more>': random.random((30, 3))}
    write_vtu(tmp_path / "some.vtu", points, kind, cells, data)
    back = meshio.read(tmp_path / "some.vtu")
    (block,) = back.cells
    assert block.type == kind and np.array_equal(block.data, cells) and np.array_equal(back.points, points)
    for name, values in data.items():
        assert np.array_equal(back.point_data[name], values)


def test_places_in_the_plane_get_a_third_coordinate(tmp_path):
    write_vtu(tmp_path / "flat.vtu", np.eye(3)[:, :2], "triangle", np.array([[0, 1, 2]]), {})
    assert np.array_equal(meshio.read(tmp_path / "flat.vtu").points, [[1, 0, 0], [0, 1, 0], [0, 0, 0]])

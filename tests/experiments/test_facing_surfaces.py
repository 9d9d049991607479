"""The mortar coupling on random surfaces and on meshes of Gmsh, as the question measures it."""

import pytest

from experiments.questions.facing_surfaces import mesh, pair


@pytest.mark.parametrize("seed", range(40))
def test_areas_and_uniform_pressure_of_random_surfaces_at_any_gap(seed):
    found = pair(seed)
    # edges of pieces are straight
    assert found["share"] < (1e-10 if found["surfaces"] == "flat" else 5e-3)
    assert found["area"] < (1e-10 if found["surfaces"] == "flat" else 1e-3)
    assert found["uniform pressure"] < (1e-9 if found["surfaces"] == "flat" else 1e-2)


@pytest.mark.parametrize("shape", ["roller", "ball", "pin"])
@pytest.mark.parametrize("seed", [3, 5])
def test_exact_pressures_on_meshes_of_gmsh(shape, seed):
    found = mesh(shape, seed)
    assert (
        abs(found["peak"]) < 0.015
        and abs(found["half-width"]) < 0.02
        and found["status"] == "solved"
    )

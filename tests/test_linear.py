import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from contactopt import scenes
from contactopt.body import build_body
from contactopt.errors import InputError
from contactopt.linear import SOLVERS, make_solver


def system(scene, part, elements):
    """The arguments of a solver for one body of a scene, its contact unknowns last."""
    body = build_body(scene, part, elements, scene.zone)
    node, component = np.empty(len(body.load), int), np.empty(len(body.load), int)
    for i, dofs in enumerate(np.asarray(body.basis.nodal_dofs)):
        node[dofs], component[dofs] = np.arange(len(dofs)), i
    free = body.free
    contact = np.flatnonzero(np.isin(free, body.contact_dofs))
    return body.A[free][:, free].tocsr(), node[free], component[free], body.basis.mesh.p, contact


def bodies():
    plane, ring, solid = scenes.flat_punch(2), scenes.sphere(), scenes.flat_punch(3)
    return {
        "plane": system(plane, plane.lower, 16),
        "axisymmetric": system(ring, ring.upper, 8),
        "solid punch": system(solid, solid.upper, 5),
        "solid foundation": system(solid, solid.lower, 5),
    }


BODIES = bodies()


def made(name, args):
    if name != "superlu":
        pytest.importorskip({"pardiso": "pypardiso", "multigrid": "pyamg"}[name])
    return make_solver(name, *args)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("name", SOLVERS)
def test_solvers_agree_with_spsolve(name, body):
    A, *_ = args = BODIES[body]
    solver = made(name, args)
    b = np.random.default_rng(0).standard_normal((A.shape[0], 2))
    x = spsolve(A.tocsc(), b)
    limit = 1e-8 if name == "multigrid" else 1e-11
    assert np.linalg.norm(solver.solve(b) - x) <= limit * np.linalg.norm(x)
    single = solver.solve(b[:, 0])
    assert single.shape == b[:, 0].shape
    assert np.linalg.norm(single - x[:, 0]) <= limit * np.linalg.norm(x[:, 0])


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("name", ["superlu", "pardiso"])
def test_trailing_inverse_is_the_block_of_the_dense_inverse(name, body):
    A, *_, last = args = BODIES[body]
    C = made(name, args).trailing_inverse()
    dense = np.linalg.inv(A.toarray())[np.ix_(last, last)]
    assert np.abs(C - dense).max() <= 1e-11 * np.abs(dense).max()
    assert np.array_equal(C, C.T)


def test_names_that_do_not_exist():
    with pytest.raises(InputError, match="unknown body solver 'cholmod'"):
        make_solver("cholmod", *BODIES["plane"])
    with pytest.raises(InputError, match="last"):
        make_solver("superlu", *BODIES["plane"][:4]).trailing_inverse()

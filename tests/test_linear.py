import gc
import resource
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from contactopt import scenes
from contactopt.bodies.body import build_body
from contactopt.bodies.solvers import SOLVERS, choose, make_solver
from contactopt.bodies.solvers.constants import FACTORS_UP_TO, PARDISO_FROM
from contactopt.bodies.solvers.ordering import elimination_order
from contactopt.bodies.solvers.system import System
from contactopt.errors import InputError
from contactopt.linear.concurrency import Crew


def system(scene, part, elements):
    """The arguments of a solver for one body of a scene, its contact unknowns last."""
    body = build_body(scene, part, elements, scene.zone)
    node, component = np.empty(len(body.load), int), np.empty(len(body.load), int)
    for i, dofs in enumerate(np.asarray(body.basis.nodal_dofs)):
        node[dofs], component[dofs] = np.arange(len(dofs)), i
    free = body.free
    contact = np.flatnonzero(np.isin(free, body.contact_dofs))
    return System(
        body.A[free][:, free].tocsr(), node[free], component[free], body.basis.mesh.p, contact
    )


def bodies():
    plane, ring, solid = scenes.flat_punch(2), scenes.sphere(), scenes.flat_punch(3)
    return {
        "plane": system(plane, plane.lower, 16),
        "fine punch": system(plane, plane.upper, 64),  # entries of its factors vanish
        "axisymmetric": system(ring, ring.upper, 8),
        "solid punch": system(solid, solid.upper, 5),
        "solid foundation": system(solid, solid.lower, 3),
    }


BODIES = bodies()


def made(name, args):
    if name != "superlu":
        pytest.importorskip({"pardiso": "pypardiso", "multigrid": "pyamg"}[name])
    return make_solver(name, args)


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


@pytest.mark.parametrize("name", ["superlu", "pardiso"])
def test_a_negative_pivot_is_no_failure(name):
    """Rounding leaves thin bodies a least eigenvalue that is a little below zero."""
    system = BODIES["plane"]
    least = np.linalg.eigvalsh(system.A.toarray())[0]
    A = sp.csr_matrix(system.A - 1.5 * least * sp.eye(system.A.shape[0]))
    b = np.random.default_rng(0).standard_normal((A.shape[0], 2))
    x = spsolve(A.tocsc(), b)
    C = np.linalg.inv(A.toarray())[np.ix_(system.trailing, system.trailing)]
    solver = made(name, system._replace(A=A))
    assert np.linalg.norm(solver.solve(b) - x) <= 1e-9 * np.linalg.norm(x)
    assert np.abs(solver.trailing_inverse() - C).max() <= 1e-9 * np.abs(C).max()


SHORT_THREADS = """
import threading
import numpy as np, scipy.sparse as sp
from contactopt.bodies.solvers import System, make_solver
A = sp.csr_matrix(np.diag(np.arange(2.0, 7.0)) + 1.0)
system = System(A, np.zeros(5, int), np.zeros(5, int), np.zeros((2, 5)), np.arange(5))
for _ in range(100):
    made = []
    make = lambda: made.append(make_solver("pardiso", system))
    threads = [threading.Thread(target=make) for _ in range(12)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
"""


def test_pardiso_outlives_the_threads_that_call_it():
    pytest.importorskip("pypardiso")
    subprocess.run([sys.executable, "-c", SHORT_THREADS], check=True, timeout=300)


@pytest.mark.parametrize("name", SOLVERS)
def test_two_bodies_in_two_threads(name):
    systems = [BODIES["solid punch"], BODIES["solid foundation"]]
    solvers = [made(name, args) for args in systems]
    loads = [np.random.default_rng(0).standard_normal((args[0].shape[0], 5)) for args in systems]
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda solver, b: solver.solve(b), solvers, loads))
    for solver, b, x in zip(solvers, loads, answers):
        np.testing.assert_allclose(x, solver.solve(b), rtol=1e-12, atol=1e-12 * np.abs(x).max())


@pytest.mark.parametrize("name", SOLVERS)
def test_products_with_the_trailing_block(name):
    *_, last = args = BODIES["solid punch"]
    load = np.random.default_rng(0).standard_normal((len(last), 2))
    solver, right = made(name, args), made("superlu", args).trailing_inverse() @ load
    limit = (1e-8 if name == "multigrid" else 1e-11) * np.linalg.norm(right)
    assert np.linalg.norm(solver.trailing_product(load) - right) <= limit
    assert np.linalg.norm(solver.trailing_product(load[:, 0]) - right[:, 0]) <= limit


@pytest.mark.parametrize("name", ["superlu", "pardiso"])
def test_the_order_of_the_trailing_unknowns_is_the_callers(name):
    *system, last = BODIES["solid punch"]
    shuffled = np.random.default_rng(0).permutation(len(last))
    C, D = (
        made(name, System(*system, chosen)).trailing_inverse() for chosen in (last, last[shuffled])
    )
    assert np.abs(C[np.ix_(shuffled, shuffled)] - D).max() <= 1e-12 * np.abs(C).max()


@pytest.mark.parametrize("body", ["plane", "fine punch", "axisymmetric", "solid punch"])
@pytest.mark.parametrize("name", SOLVERS)
def test_restricted_products_are_those_of_the_block(name, body):
    system = BODIES[body]
    solver = made(name, System(*system[:4]))
    at = np.random.default_rng(1).permutation(system.trailing)
    act = solver.restricted(at)
    limit = 1e-8 if name == "multigrid" else 1e-11
    for load in (
        np.ones(len(at)),
        np.random.default_rng(0).standard_normal((len(at), 3)),
        np.zeros((len(at), 0)),
    ):
        full = np.zeros((system.A.shape[0], *load.shape[1:]))
        full[at] = load
        expected = made("superlu", system).solve(full)[at]
        assert act(load, None).shape == load.shape
        assert np.linalg.norm(act(load, None) - expected) <= limit * np.linalg.norm(expected)


def test_choice_of_a_solver():
    for pardiso, name in ((False, "superlu"), (True, "pardiso")):
        assert choose(FACTORS_UP_TO[name], 3, pardiso) == name
        assert choose(FACTORS_UP_TO[name] + 1, 3, pardiso) == "multigrid"
        assert choose(10**6, 2, pardiso) == name
        assert choose(PARDISO_FROM, 2, pardiso) == choose(PARDISO_FROM, 3, pardiso) == "superlu"
    assert make_solver("auto", BODIES["plane"]).name == "superlu"


GRIDS = {2: (40, 40), 3: (12, 12, 12)}


def grid(dim):
    """A matrix with the pattern of two unknowns per node of a grid in which neighbours meet, a face
    of it last.
    """
    points = np.stack(
        [c.ravel() for c in np.meshgrid(*map(np.arange, GRIDS[dim]), indexing="ij")]
    ).astype(float)
    line = [sp.diags([1.0, 1.0, 1.0], [-1, 0, 1], (k, k)) for k in GRIDS[dim]]
    nodes = line[0]
    for more in line[1:]:
        nodes = sp.kron(nodes, more)
    A = sp.kron(-nodes, np.ones((2, 2)))
    A = sp.csr_matrix(A + 4 * 3**dim * sp.eye(A.shape[0]))
    node, component = np.divmod(np.arange(A.shape[0]), 2)
    return A, node, component, points, np.flatnonzero(points[-1][node] == 0)


def fill(A, order):
    """Entries of the factor, counted on the graph itself: eliminating an unknown connects all its
    neighbours.
    """
    A = A[order][:, order].tocsr()
    rows = [set(A.indices[A.indptr[i] : A.indptr[i + 1]]) for i in range(A.shape[0])]
    count = 0
    for i, row in enumerate(rows):
        later = {j for j in row if j > i}
        count += len(later) + 1
        if later:
            rows[min(later)] |= later  # Liu: the first of them inherits the others
    return count


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("held", [False, True])
def test_elimination_orders_fill_less_than_either_textbook_order(dim, held):
    A, node, component, points, face = grid(dim)
    last = face if held else np.zeros(0, int)
    order = elimination_order(A, node, component, points, last)
    assert np.array_equal(np.sort(order), np.arange(A.shape[0]))
    assert np.array_equal(order[len(order) - len(last) :], last)
    rows = np.concatenate([np.setdiff1d(np.arange(A.shape[0]), last), last])  # as numbered: a band
    assert fill(A, order) < 0.75 * fill(A, rows)


def test_a_crew_does_everything_once_and_reports_failures():
    done = []
    Crew(4).each([partial(done.append, i) for i in range(50)])
    assert sorted(done) == list(range(50))
    with pytest.raises(ZeroDivisionError):
        Crew(2).each([lambda: 1 // 0] * 5)


def test_names_that_do_not_exist():
    with pytest.raises(InputError, match="unknown body solver 'cholmod'"):
        make_solver("cholmod", BODIES["plane"])
    with pytest.raises(InputError, match="trailing"):
        make_solver("superlu", System(*BODIES["plane"][:4])).trailing_inverse()


@pytest.mark.parametrize("name, package", [("pardiso", "pypardiso"), ("multigrid", "pyamg")])
def test_a_missing_package_is_named(monkeypatch, name, package):
    for module in [m for m in sys.modules if m.split(".")[0] == package] + [package]:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=f"pip install {package}"):
        make_solver(name, BODIES["solid foundation"])


def resident():
    """Memory of this process [MiB]."""
    statm = Path("/proc/self/statm")
    if not statm.exists():
        pytest.skip("reads the memory of the process from /proc")
    gc.collect()
    return int(statm.read_text().split()[1]) * resource.getpagesize() / 2**20


@pytest.mark.slow
def test_factors_are_freed_whatever_thread_made_them():
    """SuperLU forgets its memory where another thread frees it."""
    scene = scenes.flat_punch(3)
    arguments = system(scene, scene.lower, 8)
    before, sizes = set(threading.enumerate()), []  # threads of other tests may end meanwhile
    for _ in range(12):
        with ThreadPoolExecutor(1) as pool:
            solver = pool.submit(make_solver, "superlu", arguments).result()
        stored = 12 * solver.factors.nnz / 2**20  # MiB of L and U
        del solver
        end = time.monotonic() + 30
        # its thread frees them, and ends
        while set(threading.enumerate()) - before and time.monotonic() < end:
            time.sleep(0.01)
        assert not set(threading.enumerate()) - before
        sizes.append(resident())
    assert stored > 40
    assert sizes[-1] - sizes[3] < 2 * stored  # eight would be left


def test_factors_may_be_freed_at_any_moment():
    """The collector may free a solver while this thread holds the locks of a pool."""
    program = """
import gc
from concurrent.futures import ThreadPoolExecutor
import scipy.sparse as sp
from contactopt.bodies.solvers.superlu import FactorThread

class Prefix:
    def __str__(self):  # asked for while the pool starts a thread
        print("collected", gc.collect() > 0)
        return "pool"

gc.disable()
thread = FactorThread()
thread.factorise(sp.eye_array(3, format="csc"))
thread.itself = thread  # only the collector finds out that nobody needs it
del thread
with ThreadPoolExecutor(1, thread_name_prefix=Prefix()) as pool:
    assert pool.submit(abs, -1).result() == 1
"""
    ended = subprocess.run(
        [sys.executable, "-c", program], timeout=60, check=True, capture_output=True, text=True
    )
    assert "collected True" in ended.stdout


def test_threads_share_the_factors_of_pardiso():
    A, *_ = args = BODIES["solid punch"]
    solver = made("pardiso", args)
    loads = np.random.default_rng(0).standard_normal((24, A.shape[0], 3))
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(solver.solve, loads))
    for load, x in zip(loads, found):
        assert np.abs(A @ x - load).max() <= 1e-10 * np.abs(load).max()


@pytest.mark.slow
def test_memory_of_pardiso_is_given_back():
    pytest.importorskip("pypardiso")
    scene = scenes.flat_punch(3)
    arguments, sizes = system(scene, scene.lower, 12), []
    for _ in range(10):
        solver = make_solver("pardiso", arguments)
        solver.trailing_inverse()
        kept = resident()
        del solver
        end = time.monotonic() + 10
        while resident() > kept - 20 and time.monotonic() < end:
            time.sleep(0.01)  # a thread of PARDISO's frees them
        time.sleep(0.1)
        sizes.append(resident())
    assert kept - sizes[-1] > 20  # its factors were large enough to be seen
    assert sizes[-1] - sizes[2] < kept - sizes[-1]  # seven of them would be left

import numpy as np
import pytest
import scipy.linalg as la
from scipy.sparse.linalg import cg

from contactopt import InputError, InterfaceProblem, Material, Part, Scene, Support, reduce
from contactopt.mesh import graded, rename, tensor_mesh
from contactopt.preconditioners import (
    PRECONDITIONERS,
    deflated,
    norm,
    p21,
    p22,
    preconditioner,
    seminorm,
    smooth_motions,
)

# Condition numbers of the normal block on these bodies, measured on an independent prototype: k -> Q, P21 Q, P22 Q.
PROTOTYPE = {17: (15.0, 4.67, 6.24), 33: (29.4, 5.84, 6.88), 65: (58.1, 7.12, 7.35)}


def two_blocks(k: int, upper: float = 5.0, lower: float = 5.0, nu: float = 0.3) -> InterfaceProblem:
    """A punch 4 wide and high, held on top, on a foundation 16 x 8, clamped below; k nodes on the contact line."""
    h, zone = 4 / (k - 1), np.linspace(-2, 2, k)
    punch = rename(tensor_mesh(zone, graded(4, h, 1.15)), contact="y-", top="y+")
    punch = punch.with_boundaries({"pin": lambda x: (x[1] > 4 - 1e-9) & (np.abs(x[0] - h / 2) < h / 10)})
    out = 2 + graded(6, h * 1.15, 1.15)[1:]
    ground = tensor_mesh(np.concatenate([-out[::-1], zone, out]), -graded(8, h, 1.15)[::-1])
    ground = rename(ground, bottom="y-").with_boundaries({"contact": lambda x: (x[1] > -1e-9) & (np.abs(x[0]) < 2)})
    held = (Support("top", {"y": 0.0}), Support("pin", {"x": 0.0}))
    bodies = (
        Part("punch", punch, Material(upper, nu), held),
        Part("ground", ground, Material(lower, nu), (Support("bottom"),)),
    )
    return reduce(Scene("blocks", *bodies, 0.5))


def condition(P, Q: np.ndarray) -> float:
    L = la.cholesky((Q + Q.T) / 2, lower=True)
    values = la.eigvalsh(L.T @ (P @ L))
    assert values[0] > 0
    return values[-1] / values[0]


def normal_block(problem: InterfaceProblem, name: str) -> tuple[np.ndarray, np.ndarray]:
    P = preconditioner(problem, name) @ np.eye(2 * problem.contacts)
    return P[::2, ::2], problem.Q[::2, ::2]


@pytest.mark.parametrize("k", PROTOTYPE)
def test_condition_numbers_of_the_papers_preconditioners(k):
    problem = two_blocks(k)
    none, first, second = PROTOTYPE[k]
    assert np.linalg.cond(problem.Q[::2, ::2]) == pytest.approx(none, rel=0.02)
    assert condition(*normal_block(problem, "p21")) == pytest.approx(first, rel=0.02)
    assert condition(*normal_block(problem, "p22")) == pytest.approx(second, rel=0.02)


def test_neumann_is_flat_in_the_number_of_nodes_and_better():
    conditions = [condition(*normal_block(two_blocks(k), "neumann")) for k in PROTOTYPE]
    assert max(conditions) < 2.5 and np.ptp(conditions) < 0.1 * max(conditions)


@pytest.mark.parametrize("upper,lower,bound", [(5, 5, 3), (5e4, 5, 5), (5, 5e4, 5)])
def test_full_operator_with_four_motions_deflated(upper, lower, bound):
    for k in (17, 65):
        problem = two_blocks(k, upper, lower)
        P = deflated(preconditioner(problem, "neumann"), problem.Q, smooth_motions(problem))
        assert condition(P, problem.Q) < bound


def test_pcg_iterations_do_not_grow():
    for k in (17, 129):
        problem = two_blocks(k)
        P = deflated(preconditioner(problem, "neumann"), problem.Q, smooth_motions(problem))
        load, steps = np.random.default_rng(0).normal(size=2 * k), []
        x, failed = cg(problem.Q, load, rtol=1e-8, M=P, callback=steps.append)
        assert not failed and len(steps) <= 15
        assert np.linalg.norm(problem.Q @ x - load) <= 1.1e-8 * np.linalg.norm(load)


@pytest.mark.parametrize("m", [4, 16, 64])
def test_circulants_are_those_of_the_paper(m):
    column = seminorm(m)
    assert abs(column.sum()) < 1e-12  # a seminorm: constants are its kernel
    assert np.count_nonzero(column) == 2 * int(np.log2(m)) + 1 - (m == 1)
    assert column[1] == -1.0 and column[3] == pytest.approx(-(1 / 4 + 1 / 9))
    assert np.all(np.fft.fft(column).real >= -1e-12)
    assert np.allclose(np.fft.fft(norm(m, 0.5)).real, 0.5 + 4 * (1 - np.cos(np.pi * np.arange(2 * m) / m)))


@pytest.mark.parametrize("k", [5, 16, 33])
def test_products_are_those_of_the_dense_matrices(k):
    m = int(2 ** np.ceil(np.log2(k)))
    dense = la.circulant(seminorm(m))[:k, :k]
    assert np.allclose(p21((k,))(np.eye(k)), dense, atol=1e-13)
    symbol = np.fft.fft(seminorm(m)).real / np.fft.fft(norm(m, 4 / (k - 1))).real
    inner = la.circulant(np.fft.ifft(symbol).real)[:k, :k]
    assert np.allclose(p22((k,))(np.eye(k)) @ inner, np.eye(k), atol=1e-9)


@pytest.mark.parametrize("name", PRECONDITIONERS)
def test_they_are_symmetric_positive_definite_and_blind_to_order_and_units(name):
    problem = two_blocks(17)
    P = preconditioner(problem, name) @ np.eye(34)
    assert np.allclose(P, P.T, atol=1e-9 * np.abs(P).max()) and la.eigvalsh((P + P.T) / 2)[0] > 0
    order = np.random.default_rng(0).permutation(17)
    rows = (2 * order[:, None] + np.arange(2)).ravel()
    mixed = InterfaceProblem(
        problem.Q[np.ix_(rows, rows)], problem.q[order], 0.5, coordinates=1e3 * problem.coordinates[:, order]
    )
    assert np.allclose(preconditioner(mixed, name) @ np.eye(34), P[np.ix_(rows, rows)], atol=1e-9 * np.abs(P).max())


def test_deflation_is_exact_on_the_deflated_motions():
    problem = two_blocks(17)
    Z = smooth_motions(problem)
    P = deflated(preconditioner(problem, "p21"), problem.Q, Z)
    assert np.allclose(P @ (problem.Q @ Z), Z, atol=1e-10)


def test_bad_input():
    with pytest.raises(InputError, match="unknown preconditioner 'ilu'; choose from p21, p22, neumann"):
        preconditioner(two_blocks(17), "ilu")
    uneven = InterfaceProblem(np.eye(8), np.zeros((4, 2)), 0.1, coordinates=np.array([[0.0, 1.0, 2.0, 4.0]]))
    ragged = InterfaceProblem(
        np.eye(9), np.zeros((3, 3)), 0.1, coordinates=np.array([[0.0, 1, 2], [0, 1, 3], [0, 0, 0]])
    )
    for problem in (uneven, ragged):
        with pytest.raises(InputError, match="evenly spaced"):
            preconditioner(problem, "p21")
    with pytest.raises(InputError, match="choose p21 or neumann"):
        preconditioner(solid_blocks(5), "p22")


def solid_blocks(n: int) -> InterfaceProblem:
    """The same bodies in 3D, the punch held on top in every direction; n x n nodes on the contact surface."""
    h, zone = 4 / (n - 1), np.linspace(-2, 2, n)
    out = 2 + graded(6, 1.3 * h, 1.3)[1:]
    across = np.concatenate([-out[::-1], zone, out])
    punch = rename(tensor_mesh(zone, zone, graded(4, h, 1.3)), contact="z-", top="z+")
    ground = rename(tensor_mesh(across, across, -graded(8, h, 1.3)[::-1]), bottom="z-").with_boundaries(
        {"contact": lambda x: (x[2] > -1e-9) & (np.abs(x[0]) < 2) & (np.abs(x[1]) < 2)}
    )
    rubber = Material(5.0, 0.3)
    bodies = (Part("punch", punch, rubber, (Support("top"),)), Part("ground", ground, rubber, (Support("bottom"),)))
    return reduce(Scene("solid", *bodies, 0.5, kind="solid"))


@pytest.mark.parametrize("n", [5, 9])
def test_in_3d(n):
    problem = solid_blocks(n)
    size = problem.q.size
    first, second = (preconditioner(problem, name) for name in ("p21", "neumann"))
    for P in (first @ np.eye(size), second @ np.eye(size)):
        assert np.allclose(P, P.T, atol=1e-9 * np.abs(P).max())
    bare = np.linalg.cond(problem.Q)
    assert condition(first @ np.eye(size), problem.Q) < 0.6 * bare
    assert condition(deflated(second, problem.Q, smooth_motions(problem)), problem.Q) < 6

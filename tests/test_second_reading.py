"""Sentences of the pages that no assertion beside them holds are true."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshTri

from contactopt import (
    InterfaceProblem,
    Material,
    Part,
    Rigid,
    Scene,
    Traction,
    all_solutions,
    models,
    reduce,
    scenes,
    solve,
)
from contactopt.methods.preconditioners.circulant import seminorm

SHIFT = np.array([[0.001, -0.0003]])  # from a solution to a start near it [N]
NODE = np.linalg.inv([[4.0, -1.5], [-1.5, 1.0]])  # compliance of the node of tutorial 2 [mm/N]


def load_is_s():
    """A block under 1 MPa on 4 mm: s in the vertical motion [N]."""
    ticks = np.linspace(-2, 2, 9), np.linspace(0, 2, 5)
    sides = {"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 2}
    loads = (Traction("top", (0.0, -1.0)),)
    mesh = MeshTri.init_tensor(*ticks).with_boundaries(sides)
    block = Part("block", mesh, Material(5.0, 0.3), loads=loads, contact="bottom")
    return float(reduce(Scene("block", block, Rigid("floor"), mu=0.5)).s.min())


def returns(method):
    """How many of the three solutions of a node a method finds from a start near them."""
    problem = InterfaceProblem(NODE, [NODE @ [-1.0, 0.8]], 1.0)
    found = all_solutions(problem)
    near = [replace(one, reactions=one.reactions + SHIFT) for one in found]
    again = [solve(problem, method, start=start).reactions for start in near]
    return sum(np.allclose(a, one.reactions, atol=1e-6) for a, one in zip(again, found))


def sticking_traction():
    """Traction in the middle of a sheared cylinder at T = 0 after T = .8 mu P, over that before."""
    first = lambda share: 1 - np.sqrt(1 - share)  # noqa: E731
    return float((first(0.8) - 2 * first(0.4)) / first(0.8))


def least_factor(coupling):
    """Least factor of Acary and Cadoux's iteration over all mu below the threshold, Q_nn = Q_tt."""
    mu = np.linspace(0, 1 / coupling, 2001)[:-1]
    return float(np.min(mu * (mu - coupling) / (1 - 2 * mu * coupling + mu**2)))


def slipping(mu):
    """Nodes of the block of chapter 5 that slip."""
    r = solve(reduce(scenes.flat_punch(2, mu=mu, elements=24)), tol=1e-12).reactions
    return int(np.sum((np.abs(r[:, 1]) > mu * r[:, 0] * (1 - 1e-9)) & (r[:, 0] > 0)))


def share_at_the_end():
    """Force of the floor on the last node of a string that touches, over the weight of a node."""
    count, weight = 39, 8.0 / 40
    A = 40 * (2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1))
    Q = np.linalg.inv(A)
    problem = InterfaceProblem(np.eye(2 * count), np.zeros((count, 2)), 0.0)
    gaps = np.column_stack([0.25 - Q @ np.full(count, weight), np.zeros(count)])
    string = replace(problem, Q=np.kron(Q, np.eye(2)), q=gaps)
    r = solve(string, tol=1e-12).reactions[:, 0]
    return float(r[r > 1e-9 * weight][0] / weight)


def relaxed_force():
    """Distance of associated friction from Coulomb's forces where a plate slips as a whole."""
    plate = InterfaceProblem(np.eye(2), [[0.0, 3.0]], 0.5, [[1.0], [0.0]], [-1.0])
    program = models.associated(plate)
    program.problem.solve(solver="CLARABEL", tol_gap_abs=1e-12, tol_gap_rel=1e-12)
    return float(np.abs(program.variables["r"].value - solve(plate).reactions.ravel()).max())


def nitsche(gamma):
    """Largest second derivative of Nitsche's function of chapter 1, k = 2 N/mm."""
    return max(2.0 * (1 - 2.0 / gamma), gamma - 2.0)


# sentence, where it stands, number, what makes it true
CLAIMS = (
    ("s is the load", "chapters 4 and 6, course", load_is_s, lambda x: abs(x + 4) < 1e-9),
    ("Newton's method finds the solution near which it starts", "tutorial 2",
     lambda: returns("newton"), lambda x: x == 3),
    ("other methods need not (here Tresca's iteration)", "tutorial 2",
     lambda: returns("tresca"), lambda x: x < 3),
    ("in unloading the middle keeps its slip, and not its traction", "tutorial 3",
     sticking_traction, lambda x: abs(x - 1) > 0.1),
    ("the shift fails for some mu if Q_nt^2 > 8/9 Q_nn Q_tt", "chapter 2",
     lambda: least_factor(1.001 * np.sqrt(8 / 9)), lambda x: x < -1),
    ("and for none below", "chapter 2",
     lambda: least_factor(0.999 * np.sqrt(8 / 9)), lambda x: x > -1),
    ("in the end all nodes stick", "chapter 5", lambda: slipping(0.6), lambda x: x == 0),
    ("half the weight at a node where the contact ends", "chapter 3",
     share_at_the_end, lambda x: abs(x - 0.5) < 1e-6),
    ("Nitsche's function is concave if gamma < k", "chapter 1",
     lambda: nitsche(1.0), lambda x: x < 0),
    ("about 2 log2 N entries in a row, here over log2 N for N = 128", "tutorial 1",
     lambda: np.count_nonzero(seminorm(128)) / 7, lambda x: 2 <= x < 2.2),
    ("with a plate the forces of associated friction may be Coulomb's", "test set",
     relaxed_force, lambda x: x < 1e-6),
)  # fmt: skip


@pytest.mark.parametrize("sentence,where,number,holds", CLAIMS, ids=[claim[0] for claim in CLAIMS])
def test_the_sentence_is_true(sentence, where, number, holds):
    assert holds(number()), f"{where}: {sentence}"

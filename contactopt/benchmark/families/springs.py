"""Nodes on springs that stand on a floor: small problems with several solutions.

Each node has the stiffness K = [[4, -1.5], [-1.5, 1]], whose spring pushes it up when it is pushed
to the right, and weak springs to its neighbours. Without neighbours its solution is unique for all
loads below mu = 2/3; above, loads in a sector have three.
"""

import numpy as np
import scipy.linalg as la

from contactopt.problem import InterfaceProblem

NODE = np.array([[4.0, -1.5], [-1.5, 1.0]])


def springs(
    nodes: int = 1,
    mu: float = 1.0,
    push: float = 0.8,
    joined: float = 0.0,
    seed: int = 0,
    sides: int = 1,
) -> InterfaceProblem:
    """Nodes that are pressed by 1 and pushed along the floor by `push`, 1 % random.

    joined  stiffness of the springs between neighbours
    sides   1: all are pushed to the right; 2: every other one to the left, so that zero forces do
            not solve the problem
    """
    rng = np.random.default_rng(seed)
    joints = np.diff(np.eye(nodes), axis=0)  # (nodes - 1, nodes)
    K = la.block_diag(*[NODE] * nodes) + joined * np.kron(joints.T @ joints, np.eye(2))
    force = np.column_stack([-np.ones(nodes), np.full(nodes, push)])
    force *= 1 + 0.01 * rng.uniform(-1, 1, force.shape)
    if sides == 2:
        force[1::2, 1] *= -1
    Q = np.linalg.inv(K)
    return InterfaceProblem((Q + Q.T) / 2, (Q @ force.ravel()).reshape(-1, 2), mu)

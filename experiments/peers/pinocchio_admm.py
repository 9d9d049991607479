"""Pinocchio (INRIA): the ADMM and the PGS solver of its constraint solvers, Q as a dense matrix.

Installed by `pip install pin`, here or in the Python that the environment variable PINOCCHIO names.
Source: Carpentier, Le Lidec, Montaut (2024), From Compliant to Rigid Contact Simulation.
"""

import os
import sys

from contactopt.benchmark import Peer, method


def version():
    import pinocchio

    return pinocchio.__version__ if hasattr(pinocchio, "ADMMConstraintSolver") else ""


def prepare(problem, tol, settings):
    import numpy as np
    import pinocchio as pin
    import scipy.sparse as sp

    q, blocks = problem["q"], (problem["data"], problem["indices"], problem["indptr"])
    order = np.arange(q.size).reshape(-1, 3)[:, [1, 2, 0]].ravel()  # there the normal is last
    Q = sp.bsr_matrix(blocks, shape=(q.size, q.size)).toarray()[np.ix_(order, order)]
    world = pin.Model()
    models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    for mu in problem["mu"]:
        contact = pin.PointContactConstraintModel(world)
        contact.setFriction(float(mu))
        models.append(pin.ConstraintModel(contact))
        datas.append(models[-1].createData())
    name = settings["solver"]
    options = getattr(pin, name + "SolverSettings")()
    options.max_iterations = 1000000
    for kind in ("feasibility", "complementarity"):
        setattr(options, "absolute_" + kind + "_tol", tol)
        setattr(options, "relative_" + kind + "_tol", tol)
    result = getattr(pin, name + "SolverResult")()
    for key, value in settings.items():  # numbers, or the name of a rule
        if key != "solver":
            kinds = getattr(pin, "ADMMUpdateRule", None)
            setattr(options, key, getattr(kinds, value) if isinstance(value, str) else value)
    result.setConstraintImpulseGuess(problem["start"].ravel()[order])
    arguments = np.asfortranarray(Q), q.ravel()[order], models, datas, options, result
    return getattr(pin, name + "ConstraintSolver")(), arguments, order


def solve(prepared):
    import numpy as np
    import pinocchio as pin

    solver, (Q, *arguments), order = prepared
    claimed = solver.solve(pin.DelassusOperatorDense(Q), *arguments)
    r = np.zeros(len(order))
    r[order] = np.ravel(arguments[-1].retrieveConstraintImpulses())
    return r, claimed, arguments[-1].iterations


PEER = Peer("Pinocchio", "pip install pin", [os.environ.get("PINOCCHIO", sys.executable)],
            version, prepare, solve)  # fmt: skip


@method(peer=PEER)
def pinocchio(problem, tol=1e-8, time_limit=10.0, start=None, solver="ADMM", **settings):
    """Pinocchio's solver of the nonlinear complementarity problem, with settings of its own."""
    return PEER.answer(problem, tol, time_limit, (3,), start, solver=solver, **settings)

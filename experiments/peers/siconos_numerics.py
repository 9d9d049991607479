"""Siconos (INRIA): the solvers NSGS, PROX, ADMM and NSN_AC of its library of numerics.

Installed by `apt-get install python3-siconos`. Problems of the plane get a second tangent along
which nothing moves, so that the same solvers take them. Q goes over in sparse blocks.
Source: Acary, Bremond, Huber (2018), On solving contact problems with Coulomb friction.
"""

from contactopt.benchmark import Peer, method


def version():
    import siconos
    import siconos.numerics

    return siconos.version


def prepare(problem, tol, settings):
    import tempfile

    import numpy as np
    import siconos.numerics as sn

    q, blocks, columns = problem["q"], problem["data"], problem["indices"]
    k, size, number = len(q), q.size, len(columns)
    ends = 3 * np.arange(1, k + 1)
    numbers = [3, k, 1, size, size, number, k, k, *ends, *ends, k + 1, number]
    numbers += [*problem["indptr"], *columns]
    for i, block in enumerate(blocks):
        numbers += [i, *block.T.ravel().tolist()]
    numbers += [*q.ravel().tolist(), *problem["mu"].tolist()]
    with tempfile.NamedTemporaryFile("w", suffix=".dat") as file:
        file.write("\n".join(map(str, numbers)))
        file.flush()
        made = sn.frictionContact_new_from_filename(file.name)
    options = sn.SolverOptions(getattr(sn, "SICONOS_FRICTION_3D_" + settings["solver"]))
    options.dparam[sn.SICONOS_DPARAM_TOL] = tol
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 1000000
    return made, np.zeros(size), np.zeros(size), options


def solve(prepared):
    import siconos.numerics as sn

    made, r, v, options = prepared
    info = sn.fc3d_driver(made, r, v, options)
    return r, info == 0, options.iparam[sn.SICONOS_IPARAM_ITER_DONE]


PEER = Peer("Siconos", "apt-get install python3-siconos", ["python3", "/usr/bin/python3"],
            version, prepare, solve)  # fmt: skip


@method(peer=PEER)
def siconos(problem, tol=1e-8, time_limit=10.0, solver="NSGS"):
    """One of Siconos' solvers on the dimensionless problem."""
    return PEER.answer(problem, tol, time_limit, solver=solver)

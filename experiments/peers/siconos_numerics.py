"""Siconos (INRIA): the solvers of its library of numerics, in the plane and in space.

Installed by `apt-get install python3-siconos`. A problem of the plane goes to the solver of the
plane of that name, with Q as a dense matrix. The names that Siconos has in space only get such a
problem with a second tangent along which nothing moves. In space Q goes over in sparse blocks.
`option` sets Siconos' own parameters by their names there without "SICONOS_", numbers with a point
among the real ones, and `local` the solver of one contact: "FRICTION_3D_NSGS_SHUFFLE=1".
Source: Acary, Bremond, Huber (2018), On solving contact problems with Coulomb friction.
"""

from contactopt import InputError
from contactopt.benchmark import Peer, method

SOLVERS = {
    2: ("NSGS", "CPG", "LEMKE"),
    # Gauss-Seidel and proximal points; ADMM; Newton; projections; Tresca and Panagiotopoulos
    3: ("NSGS", "PROX", "ADMM", "NSN_AC", "NSN_AC_TEST", "NSN_FB", "NSN_NM", "VI_EG", "VI_FPP",
        "EG", "FPP", "HP", "DSFP", "TFP", "PFP", "ACLMFP"),
}  # fmt: skip


def version():
    import subprocess

    import siconos
    import siconos.numerics

    def said(*command):
        try:
            return subprocess.run(["dpkg-query", *command], capture_output=True, text=True).stdout
        except OSError:  # no Debian
            return ""

    # Debian's 4.4.0 calls itself 4.5.0: the package knows better
    package = said("-S", siconos.__file__).partition(":")[0]
    return (said("-W", "-f", "${Version}", package) if package else "") or siconos.version


def prepare(problem, tol, settings):
    import numpy as np
    import scipy.sparse as sp
    import siconos.numerics as sn

    q, blocks, columns = problem["q"], problem["data"], problem["indices"]
    (k, dim), size = q.shape, q.size
    options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_{dim}D_" + settings["solver"]))
    options.dparam[sn.SICONOS_DPARAM_TOL] = tol
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 1000000
    for name, _, value in (word.partition("=") for word in settings["option"].split()):
        if f"{5 - dim}D" in name:  # of the other dimension
            continue
        at = getattr(sn, "SICONOS_" + name)
        if "." in value:
            options.dparam[at] = float(value)
        else:
            options.iparam[at] = int(value)
    if settings["local"] and dim == 3:
        at = getattr(sn, "SICONOS_FRICTION_3D_ONECONTACT_" + settings["local"])
        sn.solver_options_update_internal(options, 0, at)
    r = problem["start"].ravel().copy()
    if dim == 2:
        Q = np.zeros((k, k, 2, 2))
        Q[np.repeat(np.arange(k), np.diff(problem["indptr"])), columns] = blocks
        Q = np.asfortranarray(Q.swapaxes(1, 2).reshape(size, size))
        made = sn.FrictionContactProblem(2, k, Q, q.ravel(), problem["mu"])
        return sn.fc2d_driver, made, r, np.zeros(size), options, Q
    Q = sp.csc_matrix(sp.bsr_matrix((blocks, columns, problem["indptr"]), shape=(size, size)))
    Q.indices, Q.indptr = Q.indices.astype(np.int64), Q.indptr.astype(np.int64)
    _, blocked = sn.SBM_from_csparse(3, Q)
    matrix, data = sn.NM_new_SBM(size, size, blocked), (q.ravel(), problem["mu"])
    made = sn.frictionContactProblem_new_with_data(3, k, matrix, *data)
    return sn.fc3d_driver, made, r, np.zeros(size), options, (blocked, matrix, data)  # kept alive


def solve(prepared):
    import siconos.numerics as sn

    driver, made, r, v, options, _ = prepared
    info = driver(made, r, v, options)
    return r, info == 0, options.iparam[sn.SICONOS_IPARAM_ITER_DONE]


PEER = Peer("Siconos", "apt-get install python3-siconos", ["python3", "/usr/bin/python3"],
            version, prepare, solve)  # fmt: skip


@method(peer=PEER)
def siconos(problem, tol=1e-8, time_limit=10.0, start=None, solver="NSGS", option="", local=""):
    """One of Siconos' solvers on the dimensionless problem."""
    dims = [dim for dim, names in SOLVERS.items() if solver in names]
    if not dims:
        names = sorted({name for known in SOLVERS.values() for name in known})
        raise InputError(f"unknown solver of Siconos {solver!r}; choose from {', '.join(names)}.")
    given = {"solver": solver, "option": option, "local": local}
    return PEER.answer(problem, tol, time_limit, dims, start, **given)

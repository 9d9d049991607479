"""Cone solvers, called directly, in the fixed point of Acary and Cadoux: one program after another

    min  r' Q r / 2 + (q + mu s n)' r   subject to  |r_t| <= mu r_n,   with s = |u_t| of the last r.

The answer is the cone solver's own. `share` is the accuracy that it is asked for, over the
tolerance of the fixed point. Installed by `pip install clarabel scs ecos qoco moreau`.
Source: Acary, Cadoux, Lemarechal, Malick (2011), A formulation of the linear discrete Coulomb
friction problem via convex optimization.
"""

import sys
from importlib.util import find_spec

from contactopt import InputError
from contactopt.benchmark import Peer, method

SOLVERS = ("clarabel", "scs", "ecos", "qoco", "moreau")


def version():
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as of

    found = []
    for name in ("clarabel", "scs", "ecos", "qoco", "moreau"):
        try:
            found.append(f"{name} {of(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(found)


def prepare(problem, tol, settings):
    import importlib

    import numpy as np
    import scipy.sparse as sp

    (k, dim), mu, name = problem["q"].shape, problem["mu"], settings["solver"]
    library = importlib.import_module(name)  # which is not timed
    blocks = problem["data"], problem["indices"], problem["indptr"]
    Q = sp.csc_matrix(sp.bsr_matrix(blocks, shape=(k * dim, k * dim)))
    Q = (Q + Q.T) / 2
    scale = np.ones((k, dim))
    scale[:, 0] = mu
    A, b = -sp.diags(scale.ravel()).tocsc(), np.zeros(k * dim)  # A r + y = b, y in the cones
    q, eps, upper = problem["q"].ravel(), max(settings["share"] * tol, 1e-13), sp.triu(Q).tocsc()
    three = {"abstol": eps, "reltol": eps}

    def clarabel():
        own = library.DefaultSettings()
        own.verbose, own.presolve_enable, own.max_threads = False, False, 1
        own.tol_gap_abs = own.tol_gap_rel = own.tol_feas = eps
        cones = [library.SecondOrderConeT(dim)] * k
        solver = library.DefaultSolver(upper, q, A, b, cones, own)

        def call(c):
            solver.update(q=c)
            return solver.solve().x

        return call

    def scs():
        data = {"P": upper, "A": A, "b": b, "c": q}
        limits = {"eps_abs": eps, "eps_rel": eps, "max_iters": 1_000_000}
        solver = library.SCS(data, {"q": [dim] * k}, verbose=False, **limits)

        def call(c):
            solver.update(c=c)
            return solver.solve()["x"]

        return call

    def ecos():
        w, U = np.linalg.eigh(Q.toarray())
        kept = w > 1e-14 * w.max()
        F = np.sqrt(w[kept])[:, None] * U[:, kept].T  # |F r|^2 <= t, as a cone of its own
        top = sp.csc_matrix((k * dim, 1))
        low = sp.csc_matrix(np.vstack([np.zeros((1, k * dim)), -2 * F, np.zeros((1, k * dim))]))
        last = np.zeros((len(F) + 2, 1))
        last[0], last[-1] = -1.0, 1.0
        G = sp.bmat([[A, top], [low, sp.csc_matrix(last)]], format="csc")
        h = np.zeros(G.shape[0])
        h[k * dim], h[-1] = 1.0, 1.0
        dims = {"l": 0, "q": [dim] * k + [len(F) + 2]}

        def call(c):
            limits = {"feastol": eps, "max_iters": 200, "verbose": False}
            return library.solve(np.append(c, 0.5), G, h, dims, **three, **limits)["x"][:-1]

        return call

    def qoco():
        solver = library.QOCO()
        sizes, cones = (k * dim, k * dim, 0), (0, k, np.full(k, dim))
        solver.setup(*sizes, Q, q, None, None, A, b, *cones, **three, max_iters=200)

        def call(c):
            solver.update_vector_data(c=c)
            return solver.solve().x

        return call

    def moreau():
        rows, P = A.tocsr(), Q.tocsr()
        own = {"tol_gap_abs": eps, "tol_gap_rel": eps, "tol_feas": eps}
        settings = library.Settings(device="cpu", batch_size=1, ipm_settings=own)
        at = [part.tolist() for m in (P, rows) for part in (m.indptr, m.indices)]
        cones = library.Cones(so_cone_dims=[dim] * k)
        solver = library.CompiledSolver(k * dim, k * dim, *at, cones=cones, settings=settings)
        solver.setup([P.data], [rows.data])
        return lambda c: solver.solve([c], [b]).x[0]

    made = {"clarabel": clarabel, "scs": scs, "ecos": ecos, "qoco": qoco, "moreau": moreau}
    return made[name], Q.tocsr(), problem["q"], mu, tol, problem["start"]


def solve(prepared):
    import numpy as np

    make, Q, q, mu, tol, r = prepared

    def opened(r):
        u = (Q @ r.ravel()).reshape(q.shape) + q
        return mu * np.linalg.norm(u[:, 1:], axis=1)

    call, best, stale, number = make(), np.inf, 0, 0
    opening = opened(r) if r.any() else np.zeros(len(q))
    while best > tol and stale < 20:
        c = q.copy()
        c[:, 0] += opening
        r = np.array(call(c.ravel())).reshape(q.shape)
        new = opened(r)
        moved, opening, number = np.abs(new - opening).max(), new, number + 1
        best, stale = (moved, 0) if moved < best else (best, stale + 1)
    return r, bool(best <= tol), number


PEER = Peer("cone solvers", "pip install clarabel scs ecos qoco moreau", [sys.executable],
            version, prepare, solve)  # fmt: skip


@method(peer=PEER)
def cone(problem, tol=1e-8, time_limit=10.0, start=None, solver="clarabel", share=0.1):
    """A cone solver in the fixed point of Acary and Cadoux, on the dimensionless problem."""
    if solver not in SOLVERS or find_spec(solver) is None:
        raise InputError(f"no cone solver {solver!r} is installed; pip install {solver}.")
    if not problem.symmetric:
        raise InputError("a cone program minimises an energy, which an unsymmetric Q has not.")
    if not problem.mu.all():
        raise InputError("this fixed point needs friction at every contact.")
    return PEER.answer(problem, tol, time_limit, (2, 3), start, solver=solver, share=share)

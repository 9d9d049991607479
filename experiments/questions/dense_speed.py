"""How much faster are our methods than generic backends on one dense normal and one dense
tangential problem?
"""

from __future__ import annotations

import os

# one thread for every library, before numpy is imported
os.environ.update(
    dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"), "1"
    )
)

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contactopt.methods.apg import accelerate
from contactopt.methods.backends import CONIC, QP, Backend
from contactopt.methods.backends.conic import DiscSOCP
from contactopt.methods.backends.qp import BoxQP
from contactopt.methods.kernels.mprgp import BoxResult, descend, eigenvalue_bound, mprgp
from contactopt.problem.cones import disc
from experiments.report import write

REPEATS = 3
TOL = 1e-8  # certificate that every answer must have
# asked of a backend, loosest first: the first that is certified counts
ACCURACIES = (1e-7, 1e-8, 1e-9)
# backends that are run at the largest size as well
LARGE = ("proxqp", "piqp", "daqp", "osqp", "scs")
# of the normal problem in single precision: accuracy asked of one round and its most steps; a round
# that leaves more than the next share of the residual is the last one; the residual after the last
# round, over what is asked for
SINGLE_ACCURACY, SINGLE_STEPS = 1e-4, 300
SINGLE_PROGRESS, ROUND_SHARE = 0.1, 0.3
DISCS = (16, 32)  # grids
NODES = (256, 1024, 2048)
ROUNDS = 20  # of disc_qp


def disc_qp(
    Q: np.ndarray,
    c: np.ndarray,
    radius: np.ndarray,
    start: np.ndarray | None = None,
    tol: float = 1e-10,
) -> tuple[np.ndarray, bool]:
    """Solve min t'Qt/2 + c't subject to |t_i| <= radius_i, the tangential problem (paper, eq (22)),
    natively.

    It works in rounds: the gradient is taken in double precision at the start of a round and its
    change in single precision, which halves the memory traffic. Q is (k d, k d), c and start (k,
    d), radius (k,). Returns t (k, d), and whether the natural map |t - P(t - step (Q t + c))| is at
    most tol max(|t|, step |c|).
    """
    single, none = Q.astype(np.float32), np.zeros(0)
    step = 1 / eigenvalue_bound(single)
    t = disc(np.zeros_like(c) if start is None else start, radius)
    before = np.inf
    for _ in range(ROUNDS):
        u = (Q @ t.ravel()).reshape(t.shape) + c
        # unit of the certificate
        size = max(float(np.linalg.norm(t)), step * float(np.linalg.norm(c)))
        error = float(np.linalg.norm(t - disc(t - step * u, radius)))
        if error <= tol * size:
            return t, True
        # single precision is not enough here: the last rounds in double precision
        if error > 0.5 * before:
            single = Q

        def gradient(
            y: np.ndarray, t: np.ndarray = t, u: np.ndarray = u, unit: float = error
        ) -> np.ndarray:
            change = ((y - t) / unit).astype(single.dtype)  # noqa: B023
            return u + unit * (single @ change.ravel()).reshape(y.shape).astype(float)  # noqa: B023

        before = error
        t, _ = accelerate(
            gradient,
            lambda y, lam: (disc(y, radius), lam),
            t,
            none,
            step,
            max(1e-4 * error, 0.3 * tol * size),
        )
    return t, False


def half_plane(k: int, half: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Compliance and linear term of a parabola on a half-plane, contact on the inner part `half` of
    k nodes.

    The kernel is -log of the distance over the width, pressures constant on elements, diagonal one;
    the parabola is the one that Hertz's pressure on the inner part makes.
    """
    x = -1 + (np.arange(k) + 0.5) * 2 / k
    d = np.arange(k).astype(float)
    F = lambda t: t * np.log(t) - t  # noqa: E731
    kernel = np.log(2 * k) - F(d + 0.5) + np.sign(d - 0.5) * F(np.abs(d - 0.5))
    Q = kernel[np.abs(np.arange(k)[:, None] - np.arange(k))] / kernel[0]
    p = np.sqrt(np.maximum(0, 1 - (x / half) ** 2))
    inner = np.abs(x) < 0.9 * half
    curvature, top = np.polyfit(x[inner] ** 2, (Q @ (p / p.mean()))[inner], 1)
    return Q, -(top + curvature * x**2)


def half_space(
    n: int, nu: float = 0.3, load: float = 0.55
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cerruti's kernel on a grid of n^2 points, linear term (k, 2) of a shift with a twist, radii
    with 12 % zeros.
    """
    x = (np.arange(n) + 0.5) * 2 / n - 1
    X, Y = (a.ravel() for a in np.meshgrid(x, x))
    dx, dy = X[:, None] - X, Y[:, None] - Y
    d = np.hypot(dx, dy)
    np.fill_diagonal(d, 1.0)
    K = np.empty((n * n, 2, n * n, 2))
    K[:, 0, :, 0], K[:, 1, :, 1] = (
        (1 - nu) / d + nu * dx**2 / d**3,
        (1 - nu) / d + nu * dy**2 / d**3,
    )
    K[:, 0, :, 1] = K[:, 1, :, 0] = nu * dx * dy / d**3
    own = 4 * np.log(1 + np.sqrt(2)) * n / 2 * (1 - nu / 2)  # mean over the point's own square
    i = np.arange(n * n)
    K[i, :, i, :] = own * np.eye(2)
    Q = K.reshape(2 * n * n, -1) / own
    square = X**2 + Y**2
    radius = np.sqrt(np.maximum(0, 1 - square / np.quantile(square, 0.88)))
    full = np.linalg.norm(
        (Q @ np.stack([radius, 0 * radius], axis=1).ravel()).reshape(-1, 2), axis=1
    ).max()
    return Q, np.stack([-load * full * (1 + 0.3 * Y), 0.15 * full * X], axis=1), radius


def residual(
    Q: np.ndarray, c: np.ndarray, r: np.ndarray, project: Callable[[np.ndarray], np.ndarray]
) -> float:
    """Natural map |r - P(r - rho u)| / max(|r|, rho |c|, rho |u|), rho = |r| / min(max(|u|, |c|),
    |Q r|).
    """
    image = (Q @ r.ravel()).reshape(r.shape)
    u = image + c
    size = max(np.linalg.norm(u), np.linalg.norm(c))
    rho = np.linalg.norm(r) / min(size, np.linalg.norm(image))
    return float(np.linalg.norm(r - project(r - rho * u)) / max(np.linalg.norm(r), rho * size))


def timed(solve: Callable[[], np.ndarray]) -> tuple[np.ndarray, float]:
    """The answer and the median wall time of REPEATS cold starts [s]."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        answer = solve()
        times.append(time.perf_counter() - start)
    return answer, sorted(times)[REPEATS // 2]


def at(backend: Backend, accuracy: float) -> Backend:
    """A backend with its tight settings at another accuracy."""
    settings = {
        k: accuracy if isinstance(v, float) and 0 < v < 1e-6 else v
        for k, v in backend.settings.items()
    }
    return replace(backend, settings=settings)


def best(
    backend: Backend, run: Callable[[Backend], np.ndarray], check: Callable[[np.ndarray], float]
):  # type: ignore[no-untyped-def]
    """The loosest accuracy whose answer is certified: accuracy, residual, seconds."""
    for accuracy in ACCURACIES:
        chosen = at(backend, accuracy)
        error = check(run(chosen))
        if error <= TOL or accuracy == ACCURACIES[-1]:
            answer, seconds = timed(lambda chosen=chosen: run(chosen))
            return accuracy, check(answer), seconds
    raise AssertionError


def row(
    name: str, size: int, accuracy: object, error: float, seconds: float, ours: float
) -> dict[str, object]:
    return {
        "method": name,
        "unknowns": size,
        "accuracy asked": accuracy,
        "certified residual": error,
        "median seconds": seconds,
        "times ours": seconds / ours,
    }


def box_qp(
    P: np.ndarray, c: np.ndarray, low: np.ndarray, tol: float, max_iterations: int = 10_000
) -> BoxResult:
    """Solve the same problem as `mprgp`, in less time where P does not fit the processor's cache.

    Iterative refinement: the correction d of x minimises d'Pd/2 + (P x + c)'d, d >= low - x, in
    single precision to a few digits, scaled so that no digit is lost; its gradient is taken anew in
    double precision. It ends in double precision if P is too ill-conditioned for that.
    """
    x, target = np.maximum(np.zeros_like(c), low), tol * float(np.linalg.norm(c))
    single = P.astype(np.float32)
    largest = eigenvalue_bound(single)
    residual, total = np.inf, 0
    while total < max_iterations:
        g = P @ x + c
        size = float(np.linalg.norm(np.where(x > low, g, np.minimum(g, 0))))
        if size <= target:
            return BoxResult(x, np.zeros(0), total, True)
        if size > SINGLE_PROGRESS * residual:
            break
        residual = size
        bound = (low - x) / size
        d, steps, _ = descend(
            single,
            (g / size).astype(np.float32),
            bound.astype(np.float32),
            np.zeros(len(c), np.float32),
            max(SINGLE_ACCURACY, ROUND_SHARE * target / size),
            SINGLE_STEPS,
            largest,
        )
        total += steps
        x = np.where(d > bound.astype(np.float32), np.maximum(x + size * d.astype(float), low), low)
    x, steps, met = descend(P, c, low, x, target, max_iterations - total, largest)
    return BoxResult(x, np.zeros(0), total + steps, met)


def normal(k: int) -> list[dict[str, object]]:
    Q, c = half_plane(k)
    low, none = np.zeros(k), np.zeros(0)
    check = lambda x: residual(Q, c, np.maximum(x, 0), lambda y: np.maximum(y, 0))  # noqa: E731
    x, ours = timed(lambda: box_qp(Q, c, low, tol=TOL).x)
    rows = [row("MPRGP, single precision refined", k, TOL, check(x), ours, ours)]
    x, seconds = timed(lambda: mprgp(Q, c, low, tol=TOL).x)
    rows.append(row("MPRGP", k, TOL, check(x), seconds, ours))
    for name in ("proxqp", "piqp", "daqp", "clarabel", "osqp", "scs"):
        if not QP[name].installed or (k > 1024 and name not in LARGE):
            continue

        def run(backend: Backend) -> np.ndarray:
            return BoxQP(backend, Q, np.zeros((0, k))).solve(c, none, low, np.full(k, np.inf))[0]

        rows.append(row(name, k, *best(QP[name], run, check), ours))
        print(rows[-1], flush=True)
    return rows


def tangential(n: int) -> list[dict[str, object]]:
    Q, c, radius = half_space(n)
    check = lambda t: residual(Q, c, disc(t.reshape(-1, 2), radius), lambda y: disc(y, radius))  # noqa: E731
    t, ours = timed(lambda: disc_qp(Q, c, radius, tol=0.1 * TOL)[0])
    slip = (np.linalg.norm(t, axis=1) >= radius * (1 - 1e-7)) & (radius > 0)
    print(f"{n * n} discs: {np.mean(radius == 0):.0%} without radius, {slip.mean():.0%} slip")
    rows = [row("accelerated gradients, refined", 2 * n * n, 0.1 * TOL, check(t), ours, ours)]

    def run(backend: Backend) -> np.ndarray:
        bridge = DiscSOCP.using(backend.name, Q, np.zeros((0, len(Q))))
        return replace(bridge, backend=backend).solve(c.ravel(), np.zeros(0), radius)[0]

    rows.append(
        row("clarabel through cvxpy", 2 * n * n, *best(CONIC["clarabel"], run, check), ours)
    )
    return rows


TEXT = """How fast are the methods of contactopt beside general solvers, if Q is a dense matrix? Every run has a cold start and one BLAS thread. Times are medians
of {repeats} runs. Every answer is brought to a natural-map residual of 1e-8 if its method can do
that. A backend is asked for the accuracies 1e-7, 1e-8 and 1e-9. The table has the loosest one whose
answer is certified, or the tightest one if none is. The column "times ours" is the ratio to the
first row of the same size.

## Normal problem

This is contact without friction on a half-plane, with the gap of Hertz. The kernel is logarithmic,
so all unknowns are coupled. Half of the nodes are in contact, and no force balance is asked for.
Backends that are much slower than the others are not run at the largest size.

{normal}

## Tangential problem

This is friction under given normal forces on a square grid, with Cerruti's kernel. Every node has a
disc with two unknowns. 12 % of the discs have the radius zero, and under half of the discs slip. No
force balance is asked for. The time of a backend includes the compilation by cvxpy.

{tangential}
"""

if __name__ == "__main__":
    tables = {
        "normal": [r for k in NODES for r in normal(k)],
        "tangential": [r for n in DISCS for r in tangential(n)],
    }
    text = TEXT.replace("{repeats}", str(REPEATS))
    write("dense_speed", "Our methods against generic backends on dense problems", text, tables, {})

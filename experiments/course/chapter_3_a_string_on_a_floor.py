# %% [markdown]
# # Chapter 3. A string on a floor: many nodes
#
# A heavy string sags until it lies on a floor. Now the question is *where* it touches. The programs of chapter 1 stay the
# same; the numbers become vectors and matrices. This obstacle problem has an exact solution, so we can measure errors.
#
# You need: chapter 1, and the idea of finite differences or finite elements. Time: 40 minutes with the exercises.

# %%
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, solve
from contactopt.teaching import Slider, check

# %% [markdown]
# ## The mechanical system
#
# A string of length $L$ and tension $T$ is fixed at both ends, at the height $d$ above a floor. Its weight per length is
# $f$. We divide it into $N$ elements of the length $h$, and call the gap at node $i$ between string and floor $u_i$, and the
# force of the floor on this node $r_i$, upwards.

# %%
L, T, f, d = 1.0, 1.0, 8.0, 0.25  # mm, N, N/mm, mm


def string(N):
    """Stiffness A, free gap q = d - A^-1 f h, and places x of the inner nodes."""
    h = L / N
    A = T / h * (2 * np.eye(N - 1) - np.eye(N - 1, k=1) - np.eye(N - 1, k=-1))
    weight = np.full(N - 1, f * h)
    return A, weight, np.linspace(0, L, N + 1)[1:-1]


A, weight, x = string(40)
Q = np.linalg.inv(A)
q = d - Q @ weight

# %% [markdown]
# ## Primal, dual, and what joins them
#
# | | primal | dual |
# |---|---|---|
# | unknowns | gaps $u$ | forces $r$ |
# | program | $\min_{u \ge 0} \tfrac12 (u - d)' A (u - d) + w' u$ | $\min_{r \ge 0} \tfrac12 r' Q r + q' r$ |
# | multiplier of the constraint | $r = A (u - d) + w$ | $u = Q r + q$ |
#
# Here $w$ is the weight of each node, $Q = A^{-1}$ and $q = d - Q w$. Both programs have the optimality conditions
# $u \ge 0$, $r \ge 0$ and $u_i r_i = 0$ at every node.

# %%
u = cp.Variable(len(x))
floor = u >= 0
cp.Problem(cp.Minimize(cp.quad_form(u - d, cp.psd_wrap(A)) / 2 + weight @ u), [floor]).solve(solver=cp.CLARABEL)

r = cp.Variable(len(x))
push = r >= 0
cp.Problem(cp.Minimize(cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q @ r), [push]).solve(solver=cp.CLARABEL)

assert np.allclose(u.value, push.dual_value, atol=1e-5)
assert np.allclose(r.value, floor.dual_value, atol=1e-3)

# %% [markdown]
# ## The exact solution
#
# Where the string hangs freely it is a parabola, $u'' = f / T$. It leaves the floor without a kink, at the distance $a$ from
# the end. So $u = \tfrac{f}{2T} (a - x)^2$, and the height at the end gives
#
# $$ d = \frac{f a^2}{2 T}, \qquad a = \sqrt{2 T d / f} . $$
#
# On the floor the string is straight, so the floor carries exactly the weight: $r_i = f h$.


# %%
def exact(height, places):
    a = np.sqrt(2 * T * height / f)
    return f / (2 * T) * np.maximum(a - np.minimum(places, L - places), 0) ** 2, a


truth, a = exact(d, x)
fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
left.plot(x, u.value, "C0.", label="computed")
left.plot(x, truth, "k-", lw=1, label="exact")
left.set(xlabel="x [mm]", ylabel="gap [mm]")
left.legend(frameon=False)
right.plot(x, r.value * 40 / L, "C1.")
right.axhline(f, color="k", lw=1)
right.set(xlabel="x [mm]", ylabel="force of the floor per length [N/mm]")

assert np.isclose(a, 0.25) and np.abs(u.value - truth).max() < 1e-3


# %%
def lowered(height):
    fig, ax = plt.subplots(figsize=(5.5, 2.8), layout="constrained")
    line = np.linspace(0, L, 201)
    height = max(height, 1e-9)
    if height < f * L**2 / (8 * T):
        gap, touch = exact(height, line)
        ax.set_title(f"height {height:.2f} mm: touches from {touch:.2f} to {L - touch:.2f} mm")
    else:
        gap = height - f / (2 * T) * line * (L - line)
        ax.set_title(f"height {height:.2f} mm: hangs freely")
    ax.axhspan(-0.2, 0, color="0.8", lw=0)
    ax.plot(line, gap, "C0")
    ax.set(xlabel="x [mm]", ylabel="gap [mm]", ylim=(-0.1, 1.3))
    return fig


Slider("height of the ends d [mm]", np.linspace(0, 1.25, 11), lowered, start=2)

# %% [markdown]
# ## Newton's method: guess the contact set
#
# If we knew which nodes touch, we would only have to solve a linear system: $u_i = 0$ there, and $r_i = 0$ elsewhere. The
# *primal-dual active set method* guesses the set, solves, and corrects: a node belongs to the new set if $r_i - \rho u_i > 0$.
# This is Newton's method for the equations $r = [\,r - \rho u\,]_+$, although these equations have kinks.


# %%
def active_set(Q, q, rho=1.0):
    r, steps = np.zeros(len(q)), 0
    touches = np.ones(len(q), bool)
    while True:
        steps += 1
        r = np.zeros(len(q))
        r[touches] = np.linalg.solve(Q[np.ix_(touches, touches)], -q[touches])
        new = r - rho * (Q @ r + q) > 0
        if np.array_equal(new, touches):
            return r, steps
        touches = new


counts = {}
for N in (20, 40, 80, 160, 320):
    A_N, w_N, _ = string(N)
    Q_N = np.linalg.inv(A_N)
    counts[N] = active_set(Q_N, d - Q_N @ w_N)[1]
print("steps of Newton's method:", counts)

assert np.allclose(active_set(Q, q)[0], r.value, atol=1e-3)
assert counts[320] <= 320 / 4

# %% [markdown]
# The number of steps grows with the number of nodes: from a far guess the set shrinks only node by node at its edge. A start
# from a coarser mesh cures that, and contactopt does so on large problems.
#
# ## Penalty and proximal Galerkin once more
#
# Both methods of chapter 1 work for vectors too. The penalty method adds a spring $\kappa$ per length below the floor. The
# proximal Galerkin method writes $u_i = e^{\psi_i}$ and solves, in each step, $\alpha\,(A (e^\psi - d) + w) + h (\psi -
# \psi_{\text{last}}) = 0$ by Newton's method.

# %%
h = L / 40


def penalty(kappa):
    touches = np.ones(len(x), bool)
    while True:
        gap = np.linalg.solve(A + kappa * h * np.diag(touches), A @ np.full(len(x), d) - weight)
        if np.array_equal(gap < 0, touches):
            return gap
        touches = gap < 0


def proximal_galerkin(steps, alpha=0.1):
    psi, errors = np.full(len(x), np.log(d)), []
    for _ in range(steps):
        last = psi
        for _ in range(100):
            gap = np.exp(psi)
            step = alpha * (A @ (gap - d) + weight) + h * (psi - last)
            change = np.linalg.solve(alpha * A * gap + h * np.eye(len(x)), -step)
            psi = psi + change * min(1.0, 2 / np.abs(change).max())  # the exponential allows no large step
            if np.abs(change).max() < 1e-10:
                break
        errors.append(np.abs(np.exp(psi) - truth).max())
    return np.exp(psi), errors


stiffness = 10.0 ** np.arange(2, 7)
depths = [-penalty(kappa).min() for kappa in stiffness]
gap, errors = proximal_galerkin(25)
fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
left.loglog(stiffness, depths, "o-")
left.set(xlabel=r"penalty stiffness $\kappa$ [N/mm$^2$]", ylabel="largest depth [mm]", title="penalty")
right.semilogy(range(1, 26), errors, "s-", color="C1", label="against the exact string")
right.set(xlabel="step [-]", ylabel="largest error of the gap [mm]", title="proximal Galerkin")

assert np.isclose(depths[-1] * stiffness[-1], f, rtol=0.05)  # the springs carry the weight
assert gap.min() > 0 and errors[-1] < 5e-3

# %% [markdown]
# The penalised string sinks in by $f / \kappa$, as deep as a bed of springs under its weight. The string of the proximal
# method never touches the floor, and comes closer in every step.
#
# ## What fails
#
# **Deciding from a loose answer.** An interior-point method ends with small positive numbers everywhere. Whether a node
# touches must be decided by comparing $r_i$ with $u_i$, each in its own scale, and not by `r > 0`.

# %%
loose = cp.Variable(len(x))
program = cp.Problem(cp.Minimize(cp.quad_form(loose, cp.psd_wrap(Q)) / 2 + q @ loose), [loose >= 0])
program.solve(solver=cp.CLARABEL, tol_gap_abs=1e-3, tol_gap_rel=1e-3, tol_feas=1e-3)
print("nodes with r > 0:", int(np.sum(loose.value > 0)), "; nodes that touch:", int(np.sum(active_set(Q, q)[0] > 0)))

assert np.sum(loose.value > 0) != np.sum(active_set(Q, q)[0] > 0)

# %% [markdown]
# **Conditioning.** The condition number of $Q$ grows like $N^2$ for a string, because its compliance divides a wave by the
# *square* of its wave number. On the surface of a solid body the compliance divides by the wave number itself, and the
# condition grows like $N$ only. Chapter 6 makes use of that.

# %%
conditions = {N: np.linalg.cond(string(N)[0]) for N in (20, 40, 80)}
print({N: round(c) for N, c in conditions.items()})

assert np.isclose(conditions[80] / conditions[40], 4, rtol=0.02)

# %% [markdown]
# ## Exercises
#
# **3.1** (Pen and paper.) The ends are only .09 mm above the floor. Where does the contact begin?

# %% tags=["exercise"]
answer = ...  # distance from the end [mm]

# %% [markdown] tags=["solution"]
# $a = \sqrt{2 T d / f} = \sqrt{0.18 / 8} = 0.15$ mm.

# %% tags=["solution"]
answer = 0.15

# %%
check("3.1", answer, 0.15)

# %% [markdown]
# **3.2** (Pen and paper.) Which part of the weight does the floor carry then?

# %% tags=["exercise"]
answer = ...  # between 0 and 1

# %% [markdown] tags=["solution"]
# The floor carries the weight of the part that lies on it, $(L - 2 a) / L = 0.7$.

# %% tags=["solution"]
answer = 0.7

# %%
check("3.2", answer, 0.7)

# %% [markdown]
# **3.3** A round hill rises from the floor, of the height $0.2 \, (1 - ((x - 0.5) / 0.2)^2)$ mm where that is positive. The
# ends stay at $d = 0.25$ mm. Change $q$ and solve for the 39 forces. The certificate grades them.

# %% tags=["exercise"]
answer = ...  # 39 forces [N]

# %% [markdown] tags=["solution"]
# The gap is now measured from the hill, so the height of the hill is subtracted from $q$. $Q$ does not change.

# %% tags=["solution"]
hill = np.maximum(0.2 * (1 - ((x - 0.5) / 0.2) ** 2), 0)
answer = active_set(Q, q - hill)[0]


# %%
def frictionless(Q, q):
    """The interface problem of forces r_n alone: tangential components get the same compliance, and no friction."""
    return InterfaceProblem(np.kron(Q, np.eye(2)), np.column_stack([q, np.zeros(len(q))]), 0.0)


hill_problem = frictionless(Q, q - np.maximum(0.2 * (1 - ((x - 0.5) / 0.2) ** 2), 0))
given = answer if answer is ... else np.column_stack([answer, np.zeros(len(x))])
check("3.3", given, hill_problem)

# %% [markdown]
# **3.4** Newton's method above starts with all nodes in contact. Start it on 320 elements from the contact set of 160
# elements. How many steps does it take? (`np.repeat` or `np.interp` carry a set to the finer mesh.)

# %% tags=["exercise"]
answer = ...  # number of steps

# %% tags=["solution"]
A_c, w_c, x_c = string(160)
A_f, w_f, x_f = string(320)
coarse = active_set(np.linalg.inv(A_c), d - np.linalg.solve(A_c, w_c))[0]
touches, Q_f, answer = np.interp(x_f, x_c, coarse > 0) >= 0.5, np.linalg.inv(A_f), 0
while True:
    answer += 1
    forces = np.zeros(len(x_f))
    forces[touches] = np.linalg.solve(Q_f[np.ix_(touches, touches)], -(d - Q_f @ w_f)[touches])
    new = forces - (Q_f @ forces + d - Q_f @ w_f) > 0
    if np.array_equal(new, touches):
        break
    touches = new

# %%
check("3.4", answer, lambda steps: 1 <= steps <= 5)

# %% [markdown]
# ## References
#
# - M. Hintermüller, K. Ito, K. Kunisch, The primal-dual active set strategy as a semismooth Newton method, *SIAM J. Optim.*
#   13 (2002), [doi:10.1137/S1052623401383558](https://doi.org/10.1137/S1052623401383558).
# - B. Keith, T. M. Surowiec, Proximal Galerkin, *Found. Comput. Math.* (2024),
#   [doi:10.1007/s10208-024-09681-8](https://doi.org/10.1007/s10208-024-09681-8).
#
# Next: [from bodies to the interface](chapter_4_from_bodies_to_the_interface.py).

# %% tags=["remove-cell"]
assert solve(hill_problem).solved
plt.show()  # opens the figures where this runs as a script

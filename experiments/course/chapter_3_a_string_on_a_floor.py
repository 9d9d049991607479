# %% [markdown]
# # Chapter 3. A string on a floor: many nodes
#
# A heavy string sags until it lies on a floor. The question is now *where* it touches the floor.
# The programs of chapter 1 stay the same, but their numbers become vectors and matrices. This
# problem has an exact solution, so we can measure the errors of every method.
#
# You need chapter 1, and the idea of finite differences or finite elements. The chapter takes 40
# minutes with its exercises.

# %%
import sys

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, solve
from contactopt.teaching import Slider

# the folder of the repository, where the exercises are
sys.path.extend([".", "../.."])
from experiments.course.grader import check, hint, table
from experiments.course.sketch import arrow

# %% [markdown]
# ## The mechanical system
#
# A string of length $L$ and tension $T$ is fixed at both ends, at the height $d$ above a floor. Its
# weight per length is $f$. We divide the string into $N$ elements of the length $h = L / N$. The
# gap between node $i$ and the floor is $u_i$. The force of the floor on node $i$ is $r_i$. Both are
# positive in the direction of the normal $n$, upwards. There is no friction in this chapter, so
# each node has a normal component only.

# %%
L, T, f, d = 1.0, 1.0, 8.0, 0.25  # mm, N, N/mm, mm

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(6.4, 3.0), layout="constrained")
ax.axhspan(-0.07, 0, color="0.8", lw=0)
ax.axhline(0, color="k", lw=1)
places = np.linspace(0, L, 17)
sag = 4 * np.maximum(0.25 - np.minimum(places, L - places), 0) ** 2
ax.plot(places, sag, "C0o-", ms=4)
ax.plot([0, L], [0.25, 0.25], "ks", ms=8)
for tail, head, name, color, at in (
    ((2 / 16, 0.22), (2 / 16, 0.08), "weight $f h$", "C3", (0.14, 0.19)),
    ((0.5, -0.065), (0.5, -0.005), "$r_i$", "C1", (0.515, -0.055)),
    ((-0.1, 0), (-0.1, 0.1), "$n$", "k", (-0.085, 0.08)),
    ((0, 0.25), (-0.09, 0.25), "$T$", "k", (-0.07, 0.265)),
    ((L, 0.25), (L + 0.09, 0.25), "$T$", "k", (L + 0.05, 0.265)),
):
    arrow(ax, tail, head, name, color, at)
arrow(ax, (0.0, 0.0), (0.0, 0.25), "$d$", "C2", (0.012, 0.03), "<->")
at_node = (15 / 16, 0.0), (15 / 16, sag[15])
arrow(ax, *at_node, "$u_i$", "C2", (0.95, 0.05), "<->")
ax.set(xlim=(-0.15, L + 0.15), ylim=(-0.075, 0.3))
_ = ax.axis("off")

# %% [markdown]
# We put the stiffness of the string into a matrix $A$. Its row for node $i$ is $\tfrac{T}{h} (2 u_i
# - u_{i-1} - u_{i+1})$, the force with which the tension resists the kink at the node. The weight
# of node $i$ is $w_i = f h$. Without the floor the gaps would be $q = d - A^{-1} w$. The compliance
# is $Q = A^{-1}$.


# %%
def string(N):
    """Stiffness [N/mm], weights [N] and places [mm] of the inner nodes."""
    h = L / N
    A = T / h * (2 * np.eye(N - 1) - np.eye(N - 1, k=1) - np.eye(N - 1, k=-1))
    weight = np.full(N - 1, f * h)
    return A, weight, np.linspace(0, L, N + 1)[1:-1]


A, weight, x = string(40)
Q = np.linalg.inv(A)
q = d - Q @ weight

# %% [markdown]
# ## Primal and dual
#
# The string takes the shape of least energy among all shapes above the floor (primal). The forces
# are the minimum of another function (dual). In these programs $u$, $r$, $w$ and $q$ are vectors
# with one number for each inner node. The difference $u - d$ says how high the nodes are relative
# to the ends; it is negative where the string sags.
#
# | | primal | dual |
# |---|---|---|
# | unknowns | gaps $u$ | forces $r$ |
# | program | $\min_{u \ge 0} \tfrac12 (u - d)' A (u - d) + w' u$ | $\min_{r \ge 0} \tfrac12 r' Q r + q' r$ |
# | multiplier of the constraint | $r = A (u - d) + w$ | $u = Q r + q$ |
#
# ## The optimality conditions
#
# Both programs have the same optimality conditions, those of Karush, Kuhn and Tucker (KKT
# conditions). They are equilibrium, and Signorini's conditions at every node:
#
# $$ u = Q\, r + q, \qquad u_i \ge 0, \qquad r_i \ge 0, \qquad u_i\, r_i = 0 . $$
#
# Here are both in `cvxpy`. The multipliers of one program are the unknowns of the other:

# %%
u = cp.Variable(len(x))
floor = u >= 0
cp.Problem(
    cp.Minimize(cp.quad_form(u - d, cp.psd_wrap(A)) / 2 + weight @ u), [floor]
).solve(solver=cp.CLARABEL)

r = cp.Variable(len(x))
push = r >= 0
cp.Problem(
    cp.Minimize(cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q @ r), [push]
).solve(solver=cp.CLARABEL)

assert np.allclose(u.value, push.dual_value, atol=1e-5)
assert np.allclose(r.value, floor.dual_value, atol=1e-3)

# %% [markdown]
# ## The exact solution
#
# Where the string hangs freely, it is a parabola, because $u'' = f / T$. It leaves the floor
# without a kink, at the distance $a$ from the end. So near the left end $u = \tfrac{f}{2T} (a -
# x)^2$. At the end itself, $x = 0$, the height is $d$:
#
# $$ d = \frac{f a^2}{2 T}, \qquad a = \sqrt{2 T d / f} . $$
#
# On the floor the string is straight, so its tension carries nothing. There the floor carries
# exactly the weight: $r_i = f h$, and half of it at a node where the contact ends.


# %%
def exact(height, places):
    a = np.sqrt(2 * T * height / f)
    return f / (2 * T) * np.maximum(
        a - np.minimum(places, L - places), 0
    ) ** 2, a


truth, a = exact(d, x)
fig, (left, right) = plt.subplots(
    1, 2, figsize=(6.4, 3.2), layout="constrained"
)
left.plot(x, u.value, "C0.", label="computed")
left.plot(x, truth, "k-", lw=1, label="exact")
left.set(xlabel="x [mm]", ylabel="gap [mm]")
left.legend(frameon=False)
right.plot(x, r.value * 40 / L, "C1.")
right.axhline(f, color="k", lw=1)
right.text(0.5, 1.03 * f, "weight $f$", ha="center")
right.set(xlabel="x [mm]", ylabel="force per length [N/mm]", ylim=(None, 9.2))

assert np.isclose(a, 0.25) and np.abs(u.value - truth).max() < 1e-3

# %% [markdown]
# The slider moves the ends up and down. If they are high enough, the string hangs freely.


# %% tags=["hide-input"]
def lowered(height):
    fig, ax = plt.subplots(figsize=(5.5, 2.8), layout="constrained")
    line = np.linspace(0, L, 201)
    height = max(height, 1e-9)
    if height < f * L**2 / (8 * T):
        gap, touch = exact(height, line)
        ends = f"{touch:.2f} to {L - touch:.2f} mm"
        ax.set_title(f"height {height:.2f} mm: touches from {ends}")
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
# If we knew which nodes touch the floor, we would only have to solve a linear system: $u_i = 0$ at
# these nodes, and $r_i = 0$ at all others. The *primal-dual active set method* guesses the set of
# nodes that touch, solves the linear system, and corrects the guess. A node belongs to the new set
# if $r_i - \rho u_i > 0$, where $\rho$ is any positive stiffness. The method ends when the set
# stays as it is.
#
# Signorini's conditions are the same as the equations $r_i = [\,r_i - \rho u_i\,]_+$ with $[x]_+ =
# \max(x, 0)$. These equations have kinks, but Newton's method can be applied to them, and it is
# exactly the active set method.


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
# The number of steps grows with the number of nodes. If the first guess is far from the answer, the
# set shrinks only by a few nodes at its edge in every step. A start from the answer on a coarser
# mesh cures this (exercise 3.4). contactopt does so on large problems.
#
# ## Penalty and proximal Galerkin once more
#
# Both methods of chapter 1 work for vectors too. The penalty method puts springs of the stiffness
# $\kappa$ per length below the floor. The proximal Galerkin method writes the gap at every node as
# $u_i = e^{\psi_i}$. Each of its steps solves these equations by Newton's method:
#
# $$ \alpha\,\bigl(A (e^\psi - d) + w\bigr) + h\, (\psi - \psi_{\text{last}}) = 0 . $$

# %%
h = L / 40


def penalty(kappa):
    touches = np.ones(len(x), bool)
    while True:
        gap = np.linalg.solve(
            A + kappa * h * np.diag(touches), A @ np.full(len(x), d) - weight
        )
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
            change = np.linalg.solve(
                alpha * A * gap + h * np.eye(len(x)), -step
            )
            psi = psi + change * min(
                1.0, 2 / np.abs(change).max()
            )  # the exponential allows no large step
            if np.abs(change).max() < 1e-10:
                break
        errors.append(np.abs(np.exp(psi) - truth).max())
    return np.exp(psi), errors


stiffness = 10.0 ** np.arange(2, 7)
depths = [-penalty(kappa).min() for kappa in stiffness]
gap, errors = proximal_galerkin(25)
fig, (left, right) = plt.subplots(
    1, 2, figsize=(6.4, 3.2), layout="constrained"
)
left.loglog(stiffness, depths, "o-")
left.set(
    xlabel=r"penalty stiffness $\kappa$ [N/mm$^2$]",
    ylabel="largest depth [mm]",
    title="penalty",
)
right.semilogy(
    range(1, 26), errors, "s-", color="C1", label="against the exact string"
)
right.set(
    xlabel="step [-]",
    ylabel="largest error of the gap [mm]",
    title="proximal Galerkin",
)

assert np.isclose(
    depths[-1] * stiffness[-1], f, rtol=0.05
)  # the springs carry the weight
assert gap.min() > 0 and errors[-1] < 5e-3

# %% [markdown]
# The string of the penalty method sinks into the floor by $f / \kappa$, as deep as a bed of springs
# gives way under its weight. The string of the proximal method never touches the floor, and comes
# closer in every step.
#
# ## Penalty in two forms
#
# Some books say that a penalty makes a problem badly conditioned. Others say that it makes it
# *better* conditioned. Both are right: they speak of two forms of the same equations.
#
# Let all springs have the stiffness $k_p = \kappa h$ per node, and let $P$ pick the nodes that touch
# (a matrix with one row for each of them). The *stiffness form* has the displacements $u$ as its
# unknowns. A touching node feels the string and its spring:
#
# $$ (A + k_p P'P)\, u = A d - w . $$
#
# The *compliance form* has the forces $r = -k_p P u$ of the springs as its unknowns. The gap of a
# touching node is $P(Q P' r + q)$, and it is also $-r / k_p$. So
#
# $$ (P Q P' + \tfrac{1}{k_p} I)\, r = -P q . $$
#
# Both give the same answer. But $k_p$ enters in opposite ways. In the stiffness form a *large* number
# stands on some entries of the diagonal. The largest eigenvalue is at least $A_{ii} + k_p$ at a
# touching node $i$. The smallest is at most that of $A_f$, the block of $A$ for the free nodes,
# because a shape that vanishes at the touching nodes does not feel the springs. So
#
# $$ \operatorname{cond} \;\ge\; \frac{A_{ii} + k_p}{\lambda_{\min}(A_f)} : $$
#
# it grows in proportion to $k_p$. (If all nodes touch, it does not: then $k_p$ is added to all
# eigenvalues.) In the compliance form a *small* number, $1 / k_p$, is added to all eigenvalues of $Q_c
# = P Q P'$:
#
# $$ \operatorname{cond} = \frac{\lambda_{\max}(Q_c) + 1/k_p}{\lambda_{\min}(Q_c) + 1/k_p} . $$
#
# This is always smaller than the condition number of $Q_c$, which the exact floor has. A soft
# penalty makes it nearly one. A stiff one leaves it as it is.

# %%
touching = active_set(Q, q)[0] > 0
P = np.eye(len(x))[touching]
springs = 10.0 ** np.arange(0, 8)  # N/mm for each node
stiffness_form = [np.linalg.cond(A + k_p * P.T @ P) for k_p in springs]
Q_c = P @ Q @ P.T
compliance_form = [
    np.linalg.cond(Q_c + np.eye(len(Q_c)) / k_p) for k_p in springs
]

k_p = 1e4
soft = np.linalg.solve(A + k_p * P.T @ P, A @ np.full(len(x), d) - weight)
forces = np.linalg.solve(Q_c + np.eye(len(Q_c)) / k_p, -P @ q)
assert np.allclose(forces, -k_p * P @ soft)  # the same answer
assert max(compliance_form) <= np.linalg.cond(Q_c) * (1 + 1e-9)
free = np.linalg.eigvalsh(A[np.ix_(~touching, ~touching)])[0]
bound = (A[0, 0] + springs) / free
assert np.all(stiffness_form > bound) and stiffness_form[-1] < 1.01 * bound[-1]

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(5.4, 3.4), layout="constrained")
ax.loglog(springs, stiffness_form, "C3o-")
ax.loglog(springs, compliance_form, "C0s-")
ax.axhline(np.linalg.cond(Q_c), color="C0", ls="--", lw=1)
ax.text(4e4, 2e5, "displacements", color="C3", ha="right")
ax.text(4, 6, "forces", color="C0")
ax.text(1.2, 1.2 * np.linalg.cond(Q_c), "forces, exact floor", color="C0")
_ = ax.set(
    xlabel="spring of one node $k_p$ [N/mm]", ylabel="condition number [-]"
)

# %% [markdown]
# So a code that works with displacements pays for a stiff penalty, and a code that works with forces
# gains by a soft one. Neither gets the exact answer. The price of accuracy is paid either in the
# condition number or in the depth below the floor.
#
# ## What fails
#
# **A decision from a rough answer is wrong.** The solver that we use here is an interior-point
# method. Its answers have a small positive force at every node. So we cannot ask `r > 0` to find
# out which nodes touch. Instead we compare $r_i$ with $u_i$, each in its own scale.

# %%
loose = cp.Variable(len(x))
program = cp.Problem(
    cp.Minimize(cp.quad_form(loose, cp.psd_wrap(Q)) / 2 + q @ loose),
    [loose >= 0],
)
program.solve(
    solver=cp.CLARABEL, tol_gap_abs=1e-3, tol_gap_rel=1e-3, tol_feas=1e-3
)
print(
    "nodes with r > 0:",
    int(np.sum(loose.value > 0)),
    "; nodes that touch:",
    int(np.sum(active_set(Q, q)[0] > 0)),
)

assert np.sum(loose.value > 0) != np.sum(active_set(Q, q)[0] > 0)

# %% [markdown]
# **Fine meshes are badly conditioned.** The condition number of $Q$ is the ratio of its largest to
# its smallest eigenvalue. Iterative methods become slow when it is large. For a string it grows
# like $N^2$, because the compliance divides a wave of force by the *square* of its wave number. On
# the surface of a solid body the compliance divides by the wave number itself, so that the
# condition number grows like $N$ only. Chapter 6 makes use of this.

# %%
conditions = {N: np.linalg.cond(string(N)[0]) for N in (20, 40, 80)}
print({N: round(c) for N, c in conditions.items()})

assert np.isclose(conditions[80] / conditions[40], 4, rtol=0.02)

# %% [markdown]
# ## Exercises
#
# Replace `...` by your answer and run the cell. It says what is wrong with your answer in terms of
# mechanics. `hint("3.1")` gives a hint, three times, and then the solution. `table(3)` shows what
# you have done since the notebook was started.
#
# Give numbers with at least three digits: 0.1 percent is close enough. Counts are exact. Forces and
# displacements are graded by the certificate, which must be at most $10^{-3}$.
#
# **3.1** (Pen and paper.) The ends of the string are only 0.07 mm above the floor. At which
# distance from the end does the contact begin?

# %% tags=["exercise"]
answer = ...  # distance from the end [mm]
check("3.1", answer)

# %% [markdown]
# **3.2** (Pen and paper.) Which part of the weight does the floor carry in exercise 3.1?

# %% tags=["exercise"]
answer = ...  # part of the weight [-]
check("3.2", answer)

# %% [markdown]
# **3.3** (Program.) A round hill rises from the floor. Its height is $0.2 \, (1 - ((x - 0.5) /
# 0.2)^2)$ mm where this number is positive. The ends of the string stay at $d = 0.25$ mm. Change
# $q$ and solve for the 39 forces. The certificate grades them.

# %% tags=["exercise"]
answer = ...  # 39 forces [N]
check("3.3", answer)

# %% [markdown]
# **3.4** (Program.) The active set method above starts with the guess that all nodes touch. Count
# its steps on 320 elements. Then start it from the set that it found on 160 elements, carried to
# the finer mesh by `np.interp(x_fine, x_coarse, touches) >= 0.5`, and count again.

# %% tags=["exercise"]
answer = (..., ...)  # steps from all nodes, steps from the coarse set
check("3.4", answer)

# %% [markdown]
# **3.5** (Program.) *Projected Gauss-Seidel* goes from node to node. At each it changes the force
# $r_i \ge 0$ of this node alone, so that $u_i = 0$, or $r_i = 0$ if this would need tension. Take
# four elements and $d = 0.07$ mm, start with $r = 0$, and make one sweep from left to right.

# %% tags=["exercise"]
answer = (..., ..., ...)  # three forces after one sweep [N]
check("3.5", answer)

# %% [markdown]
# **3.6** (Pen and paper.) Which penalty stiffness lets the string of this chapter sink by 0.0003 mm
# only, where it lies on the floor?

# %% tags=["exercise"]
answer = ...  # stiffness per length [N/mm^2]
check("3.6", answer)

# %% [markdown]
# **3.7** (Think.) The ends of a string of 40 elements are at $d = 0.19$ mm. Its floor is raised to
# a height $b$, so that $u_i \ge b$ while the ends stay. How large is the derivative of the minimum
# of the energy with respect to $b$, at $b = 0$?

# %% tags=["exercise"]
answer = ...  # derivative of the energy [N]
check("3.7", answer)

# %% [markdown]
# **3.8** (Think.) Give the condition number of $A$ for $N = 1000$ to three digits, without forming
# the matrix.

# %% tags=["exercise"]
answer = ...  # condition number [-]
check("3.8", answer)

# %% [markdown]
# **3.9** (Pen and paper.) The eigenvalues of $Q_c$ lie between 0.013 and 1.9 mm/N. What is the
# condition number of the compliance form with a penalty spring of 24 N/mm at each node?

# %% tags=["exercise"]
answer = ...  # condition number [-]
check("3.9", answer)

# %% [markdown]
# **3.10** (Program.) The string of this chapter ($L = 1$ mm, $T = 1$ N) is divided into four
# elements. Only the middle one of its three free nodes touches the floor. What is the condition
# number of the stiffness form with a spring of 700 N/mm at this node?

# %% tags=["exercise"]
answer = ...  # condition number [-]
check("3.10", answer)

# %%
table(3)

# %% [markdown]
# ## References
#
# - M. Hintermüller, K. Ito, K. Kunisch, The primal-dual active set strategy as a semismooth Newton
#   method, *SIAM J. Optim.* 13 (2002),
#   [doi:10.1137/S1052623401383558](https://doi.org/10.1137/S1052623401383558).
# - B. Keith, T. M. Surowiec, Proximal Galerkin, *Found. Comput. Math.* (2024),
#   [doi:10.1007/s10208-024-09681-8](https://doi.org/10.1007/s10208-024-09681-8).
#
# Next: [from bodies to the interface](chapter_4_from_bodies_to_the_interface.py).

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

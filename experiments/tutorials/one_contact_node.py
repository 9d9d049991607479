# %% [markdown]
# # 1. One contact node by hand
#
# One node of an elastic body comes down on a floor. Will it touch the floor? Will it slide? How
# large are the forces? This tutorial answers these questions three times, each time with another
# kind of mathematical program: a quadratic program (QP), a second-order cone program (SOCP), and a
# linear complementarity problem (LCP). The text explains each of them where it appears. Each
# program is written in `cvxpy`, a Python package for convex optimisation, in about five lines.
#
# Reading time: 10 minutes. You need linear algebra, and you should have seen a Lagrange multiplier
# before.

# %%
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import (
    InterfaceProblem,
    all_solutions,
    natural_map_residual,
    solve,
)
from contactopt.teaching import Slider

# %% [markdown]
# ## The problem
#
# Two bodies meet. The lower one is the floor, and the upper one is elastic. The unit vector $n$
# points out of the *lower* body, so it points up. The unit vector $t$ points along the floor, to
# the right. Every vector is written with its normal component first.
#
# - $r = (r_n, r_t)$ is the force of the floor on the *upper* body. If $r_n > 0$, the floor pushes
#   the body up, and the contact is compressed.
# - $u = (u_n, u_t)$ is the position of the node relative to the floor. $u_n \ge 0$ is the gap that
#   remains, and $u_t$ is the slip: how far the node has moved along the floor.

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(5, 3.4), layout="constrained")
ax.axhspan(-0.5, 0, color="0.8", lw=0)
ax.plot([-2, 2.6], [0, 0], "k", lw=1)
ax.fill(
    [-1.2, 1.2, 1.2, -1.2], [1.3, 1.3, 2.3, 2.3], color="C0", alpha=0.25, lw=0
)
ax.plot(
    [0, 0.15, -0.15, 0.15, -0.15, 0.15, 0],
    [1.3, 1.15, 1.0, 0.85, 0.7, 0.55, 0.45],
    "C0",
    lw=1.5,
)
ax.plot(0, 0.4, "o", ms=9, color="C0")
for tail, head, name, color, at in (
    ((1.7, 0), (1.7, 0.8), "$n$", "k", (1.78, 0.7)),
    ((1.7, 0), (2.5, 0), "$t$", "k", (2.4, 0.1)),
    ((0, -0.42), (0, 0.3), "$r_n$", "C1", (0.08, -0.35)),
    ((-0.75, 0.4), (-0.12, 0.4), "$r_t$", "C1", (-0.62, 0.48)),
    ((-1.1, 0), (-1.1, 0.4), "$u_n$", "C2", (-1.45, 0.14)),
):
    ax.annotate(
        "",
        head,
        tail,
        arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.8},
    )
    ax.text(*at, name, color=color, fontsize=12)
ax.text(-1.1, 1.75, "elastic body", color="C0")
ax.text(-1.9, -0.32, "floor", color="0.3")
ax.set(xlim=(-2, 2.6), ylim=(-0.5, 2.4), aspect="equal")
_ = ax.axis("off")

# %% [markdown]
# The arrows show the positive directions. The body is linear, so the displacement depends on the
# force by a small symmetric matrix:
#
# $$ u = Q\,r + q . $$
#
# The vector $q$ says where the node would go without any contact force. The matrix $Q$ is the
# *compliance* of the body. Its first column is the displacement under a unit normal force, and its
# second column the one under a unit tangential force. The entry $Q_{nt}$ off the diagonal says that
# a normal force also moves the node sideways.

# %%
Q = np.array([[1.0, 0.4], [0.4, 1.2]])  # mm / N
# mm: without contact the node would sink 1 mm into the floor, 0.9 mm to the right
q = np.array([-1.0, 0.9])
mu = 0.5  # friction coefficient

assert np.all(
    np.linalg.eigvalsh(Q) > 0
)  # every force stores energy in the body

# %% [markdown]
# ## Signorini: contact without friction is a QP
#
# Let us leave friction out for a moment, so that $r_t = 0$. Contact then obeys three rules,
# *Signorini's conditions*:
#
# $$ u_n \ge 0, \qquad r_n \ge 0, \qquad u_n\, r_n = 0 . $$
#
# The node does not penetrate the floor, the floor does not pull on the node, and there is a force
# only if the gap is closed. These rules are the optimality conditions of a *quadratic program*
# (QP), in which a quadratic cost is minimised under linear constraints:
#
# $$ \min_{r_n \ge 0} \; \tfrac12 Q_{nn} r_n^2 + q_n r_n . $$
#
# To see this, take the derivative of the cost. It is $Q_{nn} r_n + q_n$, which is the gap $u_n$. At
# the minimum this derivative is zero if $r_n > 0$, and it is not negative if $r_n = 0$. **The
# multiplier of the constraint is the gap.**

# %%
r_n = cp.Variable()
push = r_n >= 0
signorini = cp.Problem(cp.Minimize(Q[0, 0] * r_n**2 / 2 + q[0] * r_n), [push])
signorini.solve(solver=cp.CLARABEL)
print(f"r_n = {r_n.value:.3f} N, gap = {push.dual_value:.1e} mm")

assert np.isclose(r_n.value, 1.0)  # = -q_n / Q_nn
assert np.isclose(push.dual_value, 0.0, atol=1e-6)

# %% [markdown]
# Now lift the body by 3 mm and solve again. The node no longer touches the floor. The force is
# zero, and the multiplier is the gap of 2 mm.

# %%
lifted = cp.Problem(
    cp.Minimize(Q[0, 0] * r_n**2 / 2 + (q[0] + 3.0) * r_n), [push]
)
lifted.solve(solver=cp.CLARABEL)

assert np.isclose(r_n.value, 0.0, atol=1e-6)
assert np.isclose(push.dual_value, 2.0, atol=1e-5)

# %% [markdown]
# ## Coulomb's law
#
# Friction can hold the node back, but its force is bounded: $|r_t| \le \mu\, r_n$. If the node
# moves, the friction force reaches this bound, and it points against the motion:
#
# $$ u_t \ne 0 \;\Rightarrow\; r_t = -\mu\, r_n\, \frac{u_t}{|u_t|} . $$
#
# If the normal force were known, the bound $g = \mu r_n$ would be a number, and friction would
# again be a QP:
#
# $$ \min_{|r_t| \le g} \; \tfrac12 Q_{tt} r_t^2 + (q_t + Q_{tn} r_n)\, r_t . $$
#
# The derivative of this cost is the slip $u_t$. If the minimum lies inside the interval, the
# derivative vanishes and the node *sticks*. If the minimum lies at an end of the interval, the node
# *slips*, and the force at that end is opposite to the slip. The *alternating iteration* solves the
# two QPs in turn. Each of them uses the last answer of the other.

# %%
force = cp.Variable(2)
bound, pull, other = (
    cp.Parameter(nonneg=True),
    cp.Parameter(value=0.0),
    cp.Parameter(),
)
normal = cp.Problem(
    cp.Minimize(
        Q[0, 0] * force[0] ** 2 / 2 + (q[0] + Q[0, 1] * pull) * force[0]
    ),
    [force[0] >= 0],
)
friction = cp.abs(force[1]) <= bound
tangential = cp.Problem(
    cp.Minimize(
        Q[1, 1] * force[1] ** 2 / 2 + (q[1] + Q[1, 0] * other) * force[1]
    ),
    [friction],
)

path = []
for _ in range(14):
    normal.solve(solver=cp.CLARABEL)
    bound.value, other.value = (
        mu * max(float(force.value[0]), 0.0),
        float(force.value[0]),
    )
    tangential.solve(solver=cp.CLARABEL)
    pull.value = float(force.value[1])
    path.append([other.value, pull.value])
path = np.array(path)
print(np.round(path[:5], 4), "...", np.round(path[-1], 4))

assert np.allclose(path[-1], [1.25, -0.625], atol=1e-5)

# %% [markdown]
# Each pair of QPs brings the answer closer by the same factor. While the node slips to the right,
# the friction force is $r_t = -\mu r_n$, so an error in $r_n$ comes back multiplied by the slope
# $+\mu\, Q_{nt} / Q_{nn} = 0.2$.

# %%
error = np.abs(path[:6, 0] - 1.25)
assert np.allclose(error[1:] / error[:-1], mu * Q[0, 1] / Q[0, 0], rtol=1e-2)

# %% [markdown]
# Does more friction push this factor beyond one, so that the iteration fails? For this load it does
# not. From $\mu = 5/6$ on the node sticks. Then the friction force no longer depends on $\mu$, and
# the factor is $Q_{nt}^2 / (Q_{nn} Q_{tt}) = 0.13$, which is below one for every positive definite
# $Q$.
#
# The iteration can fail if the node keeps slipping. Pull it hard to the *left*, with $q = (-1, -5)$
# mm. Now $r_t = +\mu r_n$, and the slope is negative, $-\mu\, Q_{nt} / Q_{nn}$: the error changes
# its sign in every iteration. At $\mu = 2.6$ the slope is $-1.04$, and the iteration jumps to and
# fro for ever, although the problem has exactly one solution.

# %%
for much in (0.84, 2.6, 3.0, 10.0):
    sticking = solve(InterfaceProblem(Q, [q], much), "alternating")
    assert sticking.solved and sticking.iterations <= 12
    assert np.allclose(
        sticking.reactions, -np.linalg.solve(Q, q), atol=1e-6
    )  # u = 0: the node sticks
assert Q[0, 1] ** 2 / (Q[0, 0] * Q[1, 1]) < 0.14

for much in (0.5, 2.4, 2.6):
    pulled = InterfaceProblem(Q, [[-1.0, -5.0]], much)
    answer, exact = solve(pulled, "alternating"), all_solutions(pulled)
    print(
        f"pulled to the left, mu = {much}: {answer.status},"
        f" slope {-much * Q[0, 1] / Q[0, 0]:.2f}"
    )
    assert len(exact) == 1 and np.isclose(
        exact[0].reactions[0, 1], much * exact[0].reactions[0, 0]
    )  # it slips
    assert answer.solved == (much < 2.5)

# %% [markdown]
# Two things must be told apart. At a slope of $-1$ this *iteration* stops converging. But the
# solution stays unique, and other methods find it. At a slope of $+1$ the solution stops being
# *unique*: there are loads with several solutions, whatever the method. [Tutorial
# 3](no_one_or_three_solutions.py) shows both.

# %% [markdown]
# ## Both at once: an SOCP
#
# The forces that Coulomb's law admits form a cone, $K = \{\,|r_t| \le \mu\, r_n\}$. In 3D the
# tangential force has two components, and the cone is round. Such a constraint is called a
# second-order cone, and a program with it is a *second-order cone program* (SOCP). We write it in a
# form that would work in 3D too, and minimise the energy over the cone:

# %%
r = cp.Variable(2)
gap_shift = cp.Parameter(nonneg=True, value=0.0)
cone = cp.SOC(mu * r[0], r[1:])
energy = cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q @ r + mu * gap_shift * r[0]
socp = cp.Problem(cp.Minimize(energy), [cone])

socp.solve(solver=cp.CLARABEL)
u = Q @ r.value + q
print(
    f"force {np.round(r.value, 3)}, slip {u[1]:.3f},"
    f" gap {u[0]:.3f} = mu |slip| = {mu * abs(u[1]):.3f}"
)

assert np.isclose(u[0], mu * abs(u[1]), atol=1e-5)

# %% [markdown]
# Look at the gap. The node slips and presses on the floor, and yet it floats above the floor by
# $\mu |u_t|$. The minimum over the cone obeys another law, *associated friction*, in which a
# contact that slips also opens. The program is convex, and $Q$ is positive definite, so it has exactly one
# answer. But the answer is not Coulomb's. (We have left the shift in the cost at zero.)
#
# Acary and Cadoux found the cure: we shift the gap by exactly what the cone adds to it. With $s =
# |u_t|$ and the term $\mu s\, r_n$ added to the cost, the optimality condition becomes $u_n + \mu s
# = \mu |u_t|$, and therefore $u_n = 0$. The slip $s$ is not known beforehand, so we solve the
# program again and again, each time with the last slip.

# %%
for _ in range(12):
    socp.solve(solver=cp.CLARABEL)
    u = Q @ r.value + q
    gap_shift.value = abs(float(u[1]))
print(f"force {np.round(r.value, 4)}, slip {u[1]:.4f}, gap {u[0]:.1e}")

assert np.allclose(r.value, [1.25, -0.625], atol=1e-5)
assert np.isclose(u[0], 0.0, atol=1e-5)

# %% [markdown]
# ## No iteration at all: a complementarity problem
#
# In 2D the friction law has finitely many cases. It can be written as three pairs of numbers. None
# of these numbers is negative, and in every pair at least one is zero. Such a problem is called a
# *linear complementarity problem* (LCP). We need two new numbers. $x = r_t + \mu r_n$ says how far
# the friction force is from pulling to the left with all its strength. $y$ is the slip to the left,
# or zero if the node does not slip to the left.
#
# | the pair | what it says |
# |---|---|
# | $r_n$ and $u_n$ | Signorini's conditions |
# | $x$ and $u_t + y$ | the node slips to the right ($u_t > 0$, $y = 0$) only if $x = 0$: friction pulls to the left with all its strength |
# | $y$ and $2\mu r_n - x = \mu r_n - r_t$ | the node slips to the left ($u_t = -y$) only if $r_t = \mu r_n$: friction pulls to the right with all its strength |
#
# For each pair we have to decide which of the two numbers is zero. A binary variable $b$, which is
# 0 or 1, makes this decision. The constraints below need a number $M$ that is larger than any
# number in the answer. A mixed-integer solver tries the decisions until everything fits.

# %%
z, b, M = cp.Variable(3, nonneg=True), cp.Variable(3, boolean=True), 10.0
reaction = cp.hstack([z[0], z[1] - mu * z[0]])
w = cp.hstack(
    [
        Q[0] @ reaction + q[0],
        Q[1] @ reaction + q[1] + z[2],
        2 * mu * z[0] - z[1],
    ]
)
complementarity = cp.Problem(
    cp.Minimize(0), [w >= 0, z <= M * b, w <= M * (1 - b)]
)
complementarity.solve(solver=cp.SCIPY)

assert np.allclose(reaction.value, [1.25, -0.625], atol=1e-6)

# %% [markdown]
# Three programs have given one answer. `contactopt` gives it too, and also says how good it is. The
# *certificate*, also called the natural-map residual, is computed from the problem and the forces
# alone. It is zero exactly at the solutions of Coulomb's problem.

# %%
problem = InterfaceProblem(Q, [q], mu)  # one row of q per contact
solution = solve(problem)
print(
    solution.status,
    solution.reactions[0],
    f"certificate {solution.residual:.0e}",
)

assert solution.solved and np.allclose(solution.reactions, [[1.25, -0.625]])
for answer in (path[-1], r.value, reaction.value):
    assert natural_map_residual(problem, answer[None]) < 1e-4
assert (
    len(all_solutions(problem)) == 1
)  # the complementarity problem has no other solution

# %% [markdown]
# ## More friction, less slip
#
# Let us raise $\mu$. A node that sticks has $u = 0$, so its force is $r = -Q^{-1} q = (1.5,
# -1.25)$. The slip falls to zero at $\mu = |r_t| / r_n = 1.25 / 1.5$. From there on friction could
# carry more than it has to, and nothing changes any more.

# %%
coefficients = np.linspace(0, 1.2, 61)
answers = [solve(InterfaceProblem(Q, [q], value)) for value in coefficients]
forces = np.array([answer.reactions[0] for answer in answers])
slips = (forces @ Q + q)[:, 1]

fig, (left, right) = plt.subplots(
    1, 2, figsize=(6.4, 3.2), layout="constrained"
)
left.plot(coefficients, forces[:, 0], label="normal force $r_n$")
left.plot(coefficients, -forces[:, 1], label="friction force $-r_t$")
left.set(
    xlabel=r"friction coefficient $\mu$ [-]", ylabel="force [N]", ylim=(0, 1.7)
)
left.legend(frameon=False)
right.plot(coefficients, slips, color="C2")
right.axvline(1.25 / 1.5, color="grey", lw=1, ls="--")
right.text(1.25 / 1.5 + 0.02, 0.9, "stick", color="grey")
right.text(1.25 / 1.5 - 0.02, 0.9, "slip", color="grey", ha="right")
right.set(xlabel=r"friction coefficient $\mu$ [-]", ylabel="slip $u_t$ [mm]")

assert all(answer.solved for answer in answers)
assert np.all((slips > 1e-6) == (coefficients < 1.25 / 1.5))

# %% [markdown]
# Here is the same with a slider: the friction cone and the force in it. Every position shows an
# answer that was computed and certified.


# %% tags=["hide-input"]
def in_the_cone(value):
    answer = solve(InterfaceProblem(Q, [q], value))
    (normal, friction), slip = (
        answer.reactions[0],
        (Q @ answer.reactions[0] + q)[1],
    )
    assert answer.solved
    fig, ax = plt.subplots(figsize=(5, 3.4), layout="constrained")
    ax.fill([0, -2 * value, 2 * value], [0, 2, 2], color="C0", alpha=0.15, lw=0)
    arrow = {"arrowstyle": "-|>", "color": "C1", "lw": 2}
    ax.annotate("", (friction, normal), (0, 0), arrowprops=arrow)
    ax.plot([0, slip], [0.03, 0.03], "C2", lw=4)
    ax.set(xlim=(-1.7, 1.7), xlabel="friction force [N]; green: slip [mm]")
    ax.set(ylim=(0, 2), ylabel="normal force [N]")
    how = f"slips {slip:.3f} mm" if slip > 1e-6 else "sticks"
    ax.set_title(rf"$\mu$ = {value:.2f}: the node {how}")
    return fig


Slider(
    "friction coefficient [-]", np.linspace(0, 1.2, 13), in_the_cone, start=5
)

# %% [markdown]
# ## Exercises
#
# **1.** Press harder: $q = (-2, 0.9)$ mm. What is the smallest $\mu$ with which the node sticks?
# Guess first whether it needs more friction than before, or less.
#
# <details><summary>Solution</summary>
#
# The sticking force is $-Q^{-1}q$. The node sticks if the cone contains this force. If we press
# harder, the bound on the friction force is larger, so that a smaller coefficient is enough.
#
# ```python
# r_n, r_t = -np.linalg.solve(Q, [-2.0, 0.9])
# needed = abs(r_t) / r_n
# assert needed < 1.25 / 1.5
# sticking = solve(InterfaceProblem(Q, [[-2.0, 0.9]], needed * 1.1))
# assert np.allclose(sticking.reactions, [[r_n, r_t]])
# slipping = solve(InterfaceProblem(Q, [[-2.0, 0.9]], needed * 0.9))
# assert abs(slipping.reactions[0, 1]) < abs(r_t)
# ```
#
# </details>
#
# **2.** Add a second tangential direction. The components of the node are now $(n, t_1, t_2)$.
# Which of the three programs still works as it stands? Which one needs a change? Which one cannot
# be written at all?
#
# <details><summary>Solution</summary>
#
# The SOCP works as it stands: `r[1:]` has two components. The tangential QP becomes a small SOCP,
# over a disc instead of an interval. The complementarity problem lists the cases of a law with two
# directions. The circle has infinitely many directions. A polygon would have to take its place, and
# that is another law.
#
# ```python
# Q3 = np.block([[Q, np.zeros((2, 1))], [np.zeros((1, 2)), np.array([[1.2]])]])
# q3 = np.array([-1.0, 0.9, 0.3])
# r3, shift = cp.Variable(3), cp.Parameter(nonneg=True, value=0.0)
# cost = cp.quad_form(r3, cp.psd_wrap(Q3)) / 2 + q3 @ r3 + mu * shift * r3[0]
# program = cp.Problem(cp.Minimize(cost), [cp.SOC(mu * r3[0], r3[1:])])
# for _ in range(15):
#     program.solve(solver=cp.CLARABEL)
#     shift.value = float(np.linalg.norm((Q3 @ r3.value + q3)[1:]))
# in_3d = InterfaceProblem(Q3, [q3], mu)
# assert natural_map_residual(in_3d, r3.value[None]) < 1e-4
# assert np.allclose(r3.value, solve(in_3d).reactions, atol=1e-4)
# ```
#
# </details>
#
# Next: [what Q does to waves](why_the_preconditioner_works.py).

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

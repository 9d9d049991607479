# %% [markdown]
# # Chapter 7. Duality
#
# Chapters 1 and 2 had two programs each, one in displacements and one in forces. Both gave the same
# answer, and this chapter derives why. It also shows what the second program is good for: the
# difference of the two values is an error that you can compute without knowing the solution.
#
# Read this chapter directly after chapter 2, although its number is 7. The chapter takes 50
# minutes with its exercises.

# %%
import sys

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import (
    InterfaceProblem,
    Material,
    Part,
    Scene,
    Support,
    laws,
    models,
    reduce,
)
from contactopt.meshes.structured import tensor_mesh

# the folder of the repository, where the exercises are
sys.path.extend([".", "../.."])
from experiments.course.grader import check, hint, table
from experiments.course.sketch import arrow

# %% [markdown]
# ## The mechanical system
#
# We take the node of chapter 2 again. It hangs on two springs with the stiffness $K = Q^{-1}$, and
# the friction force cannot exceed a given bound $g$. Without contact the node would be at $q$.

# %%
Q, q, g = np.array([[1.0, -1.0], [-1.0, 2.0]]), np.array([-3.0, 5.0]), 1.0
K = np.linalg.inv(Q)
node = InterfaceProblem(Q, [q], laws.Tresca(np.array([g])))
print("K =", np.round(K, 6).tolist())

# %% [markdown]
# ## The primal problem
#
# The node goes to the minimum of its energy. The prime denotes a transposed vector:
#
# $$ \min_{u_n \ge 0} \; P(u) = \tfrac12 (u - q)' K (u - q) + g\,|u_t| . $$
#
# ## The Lagrangian
#
# Give the stretch of the springs a name of its own, $z = u - q$. It costs nothing, but now the
# energy of the springs depends on $z$ alone, and contact and friction depend on $u$ alone. A
# multiplier $r$ is the price of breaking the new equation:
#
# $$ L(u, z, r) = \tfrac12 z' K z + g\,|u_t| - r' (z - u + q), \qquad u_n \ge 0 . $$
#
# For every $r$ the minimum of $L$ is at most that of $P$, because $L = P$ wherever the equation
# holds. We can find this minimum part by part:
#
# - In $z$ the minimum of $\tfrac12 z'Kz - r'z$ is at $z = Qr$, and its value is $-\tfrac12 r'Qr$.
#   So $r = Kz$: the multiplier is the force in the springs, which is the contact force.
# - In $u_n \ge 0$ the minimum of $r_n u_n$ is zero if $r_n \ge 0$. Otherwise it is $-\infty$.
# - In $u_t$ the minimum of $g|u_t| + r_t u_t$ is zero if $|r_t| \le g$. Otherwise it is $-\infty$.
#
# The last line is a *conjugate function*. The conjugate of $f(v) = g|v|$ is
#
# $$ f^*(p) = \sup_v \; (p\,v - g|v|) = 0 \;\text{ if } |p| \le g, \qquad +\infty \;\text{ otherwise.} $$
#
# A cost that is proportional to the slip turns into a bound on the force.
#
# ## The dual problem
#
# The best of these lower bounds is the dual problem. It has the contact forces as unknowns:
#
# $$ \max_r \; D(r) = -\tfrac12 r' Q r - q' r \qquad \text{subject to} \qquad r_n \ge 0, \quad |r_t| \le g . $$
#
# In `cvxpy` both are a few lines. `contactopt.models` has them for any number of nodes. There the
# dual form minimises $-D$. A program prints its mathematics:

# %%
forces = models.tresca(node, form="dual")
displacements = models.tresca(node, form="primal")
for program in (forces, displacements):
    program.parameters["g"].value = [g]
    program.problem.solve(solver=cp.CLARABEL)
    print(program)
r, u = forces.variables["r"].value, displacements.variables["u"].value
print("forces", np.round(r, 4), "N; displacements", np.round(u, 4), "mm")
P, D = displacements.problem.value, -forces.problem.value
print(f"P = {P:.5f}, D = {D:.5f} N mm")

assert np.isclose(displacements.problem.value, -forces.problem.value, atol=1e-5)
assert np.allclose(displacements.multipliers["reaction"], r, atol=1e-4)
assert np.allclose(forces.multipliers["slip"], u[1], atol=1e-4)

# %% [markdown]
# The multipliers of each program are the variables of the other one. In the sketch every
# multiplier is an arrow. The forces are orange: they are the multipliers of the program in
# displacements. The slip is blue: it is the multiplier of the program in forces. The dotted node
# has not yet slipped.

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(4.6, 2.6), layout="constrained")
ax.axhspan(-0.85, 0, color="0.8", lw=0)
ax.axhline(0, color="k", lw=1)
for place, look in ((0, {"fc": "w", "ls": ":"}), (u[1], {"fc": "0.6"})):
    ax.add_patch(plt.Circle((place, 0.1), 0.1, ec="k", **look))
for tail, head, name, color in (
    ((u[1], -0.72), (u[1], -0.72 + 0.35 * r[0]), "$r_n$", "C1"),
    ((u[1] - 0.12, 0.1), (u[1] - 0.12 + 0.7 * r[1], 0.1), "$r_t$", "C1"),
    ((0, 0.6), (u[1], 0.6), "$u_t$", "C0"),
):
    arrow(ax, tail, head, name, color)
ax.set(xlim=(-0.6, u[1] + 0.9), ylim=(-0.85, 0.95), aspect="equal")
_ = ax.axis("off")

# %% [markdown]
# ## The optimality conditions
#
# Take any $u$ with $u_n \ge 0$ and any $r$ that the dual problem admits. Neither has to be the
# solution. Insert both, and use $u = z + q$:
#
# $$ P(u) - D(r) \;=\; \underbrace{\tfrac12 (z - Qr)' K (z - Qr)}_{\text{springs}}
# \;+\; \underbrace{r_n u_n}_{\text{contact}} \;+\; \underbrace{g|u_t| + r_t u_t}_{\text{friction}} . $$
#
# This is the *duality gap*. None of its three parts is ever negative. That is *weak duality*:
# $D(r) \le P(u)$. If the gap is zero, both are solutions. Then each part is zero, and these are the
# KKT conditions: $u = Qr + q$; no force where there is a gap; and a slip only against a force at its
# bound.
#
# *Strong duality* says that the gap of the two solutions is zero. It holds here, because there is a
# displacement with $u_n > 0$, at which no constraint is active. That is *Slater's condition*.
#
# ## The gap is an error bound
#
# Let $r^*$ be the solution. The function $-D$ curves like $Q$, so that for every admissible $r$
#
# $$ \tfrac12 (r - r^*)' Q (r - r^*) \;\le\; D(r^*) - D(r) \;\le\; P(u) - D(r) . $$
#
# The right side needs no $r^*$. We press two blocks together, whose outer sides are held, and take
# steps of a projected gradient. For $u$ we take $Qr + q$ and lift the nodes that penetrate.

# %%
axis = np.linspace(0, 1, 9)
sides = {
    "low": lambda x: x[1] == x[1].min(),
    "high": lambda x: x[1] == x[1].max(),
}
upper = tensor_mesh(axis, axis).with_boundaries(sides)
lower = tensor_mesh(axis, axis - 1).with_boundaries(sides)
pressed = (Support("high", {"x": 0.01, "y": -0.02}),)
blocks = (
    Part("upper", upper, Material(5.0, 0.3), pressed, contact="low"),
    Part(
        "lower", lower, Material(50.0, 0.3), (Support("low"),), contact="high"
    ),
)
pair = reduce(Scene("two blocks", *blocks, mu=0.3))
C, start, bound = pair.Q, pair.q.ravel(), 2e-3  # N per node
stiffness = np.linalg.inv(C)


def admissible(force):
    force = force.reshape(-1, 2)
    return np.column_stack(
        [np.maximum(force[:, 0], 0), np.clip(force[:, 1], -bound, bound)]
    ).ravel()


def parts_of_the_gap(force):
    moved = (C @ force + start).reshape(-1, 2)
    moved[:, 0] = np.maximum(moved[:, 0], 0)
    stretch, (f_n, f_t) = (
        moved.ravel() - start - C @ force,
        force.reshape(-1, 2).T,
    )
    friction = bound * np.abs(moved[:, 1]) + f_t * moved[:, 1]
    return stretch @ stiffness @ stretch / 2, f_n @ moved[:, 0], friction.sum()


program = models.tresca(pair)
program.parameters["g"].value = np.full(pair.contacts, bound)
program.problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-14, tol_gap_rel=1e-12)
best = program.variables["r"].value
force, gaps, errors = np.zeros(pair.q.size), [], []
for _ in range(150):
    gaps.append(parts_of_the_gap(force))
    errors.append((force - best) @ C @ (force - best) / 2)
    force = admissible(force - (C @ force + start) / np.linalg.norm(C, 2))
gap = np.sum(gaps, axis=1)
print(f"{len(gap)} steps: gap {gap[-1]:.1e} N mm, error {errors[-1]:.1e} N mm")

assert np.all(np.array(gaps) >= -1e-12) and np.all(
    gap >= np.array(errors) - 1e-10
)
assert gap[-1] < 0.02 * gap[0]

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(5, 3.4), layout="constrained")
ax.semilogy(gap, "k", lw=2)
ax.semilogy(errors, "C3--")
ax.text(75, 3e-6, "gap, mostly of contact")
ax.text(100, 2.5e-8, "error", color="C3")
for name, values, at in zip(
    ("springs", "", "friction"), np.transpose(gaps), (95, 0, 140)
):
    ax.semilogy(np.maximum(values, 1e-12), lw=1, color="0.6")
    ax.annotate(
        name,
        (at, values[at]),
        (-30, -20),
        textcoords="offset points",
        color="0.4",
    )
ax.set(xlabel="step [-]", ylabel="energy [N mm]", ylim=(1e-9, None))
_ = ax.margins(x=0)

# %% [markdown]
# ## What fails
#
# **Slater's condition.** In the program of associated friction the forces of a node lie in a cone
# (chapter 2). Let a rail guide the node in three dimensions. The direction of the rail lies on
# the edge of the cone: $\mu = 1$, $V = (1, -1, 0)'$, no load along the rail, and $q = (0, 0, 1)$
# mm. The forces must satisfy $V' r = 0$, that is $r_n = r_{t1}$, and $r_{t1}^2 + r_{t2}^2 \le
# r_n^2$. So $r_{t2} = 0$: no admissible force lies inside the cone, and Slater's condition fails
# for the program in forces. Its solution is $r = 0$ with the value zero.
#
# The program in displacements looks for $u = z + q + V\lambda$ with $u_n \ge |u_t|$. Without any
# stretch this would need $\lambda \ge \sqrt{\lambda^2 + 1}$, which no $\lambda$ satisfies. But
# the stretch that is needed falls like $1 / \lambda$. The energy comes as near to zero as we
# like, and never reaches it. The values of both programs are equal, but *no displacement is a
# solution*: the node runs away along the rail.

# %%
ways, energies = (1.0, 10.0, 100.0, 1000.0), []
for way in ways:
    z = cp.Variable(3)
    at = z + np.array([way, -way, 1.0])
    missing = cp.Problem(
        cp.Minimize(cp.sum_squares(z) / 2), [at[0] >= cp.norm(at[1:])]
    )
    missing.solve(solver=cp.CLARABEL)
    print(f"lambda {way:6g} mm: energy {missing.value:.2e} N mm")
    assert np.isclose(
        missing.value, (np.hypot(way, 1) - way) ** 2 / 4, rtol=0.1
    )
    energies.append(missing.value)

fig, ax = plt.subplots(figsize=(5, 3), layout="constrained")
ax.loglog(ways, energies, "o-")
ax.set(xlabel=r"way along the rail $\lambda$ [mm]", ylabel="energy [N mm]")
_ = ax.set_title("it falls like one over the square, and is never zero")

# %% [markdown]
# With a positive definite $Q$ and *without* rigid motions this cannot happen. Nothing restricts the
# forces but the cone, and a cone with $\mu > 0$ has an inside: Slater's condition holds for the
# program in forces. In other words, a node that runs away would stretch its springs.
#
# **Coulomb's law.** Its bound $g = \mu r_n$ is not given, but part of the answer. There is no
# convex energy $P$ whose conjugate would be this bound, and so there is no dual problem. One thing
# remains. For all $u$ with $u_n \ge 0$ and all $r$ in the cone
#
# $$ r'\left(u + \mu |u_t|\, n\right) = r_n u_n + \left(\mu r_n |u_t| + r_t' u_t\right) \;\ge\; 0 , $$
#
# and it is zero exactly if $u$ and $r$ satisfy Coulomb's law. With $u = Qr + q$ the solutions are
# the forces in the cone with $u_n \ge 0$ at which this function of $r$ is zero. But it is not convex,
# so that a minimiser may stop where it is not zero.
#
# | statement | is true if |
# |---|---|
# | $D(r) \le P(u)$ (weak duality) | always |
# | values of both programs are equal | Slater's condition holds for one of them |
# | the program in displacements has a solution | Slater's condition holds for the program in forces, and its value is finite |
# | the gap bounds the error of the forces | $Q$ is positive definite |
#
# The conditions are sufficient. In the plane all constraints are linear, and then the values are
# equal, and both programs have solutions, as soon as both have admissible points.
#
# ## Exercises
#
# Replace `...` by your answer and run the cell. It says what is wrong with your answer in terms of
# mechanics. `hint("7.1")` gives a hint, three times, and then the solution. `table(7)` shows what
# you have done since the notebook was started.
#
# Give numbers with at least three digits: 0.1 percent is close enough. Counts are exact. Forces and
# displacements are graded by the certificate, which must be at most $10^{-3}$.
#
# **7.1** (Pen and paper.) A penalty of stiffness $\kappa = 4.3$ N/mm replaces the floor: it costs
# $f(u_n) = \tfrac12 \kappa \max(-u_n, 0)^2$. Its conjugate enters the dual problem as $f^*(-r_n)$.
# What is $f^*(-r_n)$ for $r_n = 2.9$ N?

# %% tags=["exercise"]
answer = ...  # value of the conjugate [N mm]
check("7.1", answer)

# %% [markdown]
# **7.2** (Program.) Give the three parts of the gap for the node of this chapter, $u = (0.1, 1.7)$
# mm, $r = (2, -0.6)$ N and $g = 1$ N. Their sum is $P(u) - D(r)$.

# %% tags=["exercise"]
answer = (..., ..., ...)  # springs, contact, friction [N mm]
check("7.2", answer)

# %% [markdown]
# **7.3** (Pen and paper.) By how much, at most, can the energy $P$ still fall below that of $u =
# (0, 2.1)$ mm, if all you know is the admissible force $r = (2.1, -0.4)$ N?

# %% tags=["exercise"]
answer = ...  # bound [N mm]
check("7.3", answer)

# %% [markdown]
# **7.4** (Program.) Write the dual of Tresca's program for a floor that pulls, too: $u_n = 0$
# instead of $u_n \ge 0$, with $q = (1, 5.2)$ mm and $g = 1.1$ N. Give its forces.

# %% tags=["exercise"]
answer = (..., ...)  # r_n, r_t [N]
check("7.4", answer)

# %% [markdown]
# **7.5** (Program.) How large is the derivative of the minimum of $P$ with respect to the friction
# bound $g$, at $g = 0.83$ N? Which multiplier is it?

# %% tags=["exercise"]
answer = ...  # derivative [mm]
check("7.5", answer)

# %% [markdown]
# **7.6** (Program.) Find forces for the node of this chapter ($g = 1$ N) that are *not* the
# solution, but whose gap with $u = (0, 1)$ mm is below 0.01 N mm. By the error bound they are near
# the solution.

# %% tags=["exercise"]
answer = (..., ...)  # r_n, r_t [N]
check("7.6", answer)

# %% [markdown]
# **7.7** (Pen and paper.) The displacements of associated friction lie in the *dual cone* of the
# forces: no force with $|r_t| \le \mu r_n$ does negative work on them. How large must $u_n$ be at
# least, if $u_t = 1.3$ mm and $\mu = 0.35$?

# %% tags=["exercise"]
answer = ...  # smallest gap [mm]
check("7.7", answer)

# %% [markdown]
# **7.8** (Program.) Take the node on the rail with $q = (0, 0, 1.4)$ mm. How large is the energy
# that is needed at $\lambda = 17.3$ mm?

# %% tags=["exercise"]
answer = ...  # energy [N mm]
check("7.8", answer)

# %% [markdown]
# **7.9** (Think.) Grooves make friction depend on its direction: slip costs $f(v) = \sqrt{(1.2\,
# v_1)^2 + (0.5\, v_2)^2}$. Where its conjugate is zero, the forces are admissible. How large is the
# largest friction force in the direction $(1, 1) / \sqrt 2$?

# %% tags=["exercise"]
answer = ...  # largest friction force [N]
check("7.9", answer)

# %%
table(7)

# %% [markdown]
# ## References
#
# - I. Ekeland, R. Témam, *Convex Analysis and Variational Problems*, SIAM (1999),
#   [doi:10.1137/1.9781611971088](https://doi.org/10.1137/1.9781611971088).
# - S. Boyd, L. Vandenberghe, *Convex Optimization*, Cambridge University Press (2004),
#   [doi:10.1017/CBO9780511804441](https://doi.org/10.1017/CBO9780511804441), chapters 3 and 5.
# - J. Haslinger, I. Hlaváček, J. Nečas, Numerical methods for unilateral problems in solid
#   mechanics, *Handbook of Numerical Analysis* 4 (1996),
#   [doi:10.1016/S1570-8659(96)80005-6](https://doi.org/10.1016/S1570-8659(96)80005-6).
#
# Next: [many nodes without friction](chapter_3_a_string_on_a_floor.py).

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

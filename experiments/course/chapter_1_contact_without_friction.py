# %% [markdown]
# # Chapter 1. A spring, a node and a floor
#
# The smallest contact problem has one unknown. It already has all that every chapter of this course
# has: an energy that is minimised under a constraint, a second problem in the contact forces, the
# conditions that join the two, a program that a solver can read, and several ways to go wrong.
#
# You need derivatives, and the idea of a minimum under a constraint. The chapter takes 30 minutes
# with its exercises.

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
from experiments.course.sketch import arrow, spring

# %% [markdown]
# ## The mechanical system
#
# A node hangs on a spring of stiffness $k$ above a floor. Without load the gap between node and
# floor is $g_0$. A load $F$ pulls the node down. We call the gap that remains $u$, and the force of
# the floor on the node $r$. The normal $n$ points out of the floor, that is, upwards. The gap $u$
# and the force $r$ are positive in this direction.
#
# | letter | meaning | unit |
# |---|---|---|
# | $k$ | stiffness of the spring | N/mm |
# | $g_0$ | gap without load | mm |
# | $F$ | load, downwards | N |
# | $u \ge 0$ | gap that remains | mm |
# | $r \ge 0$ | force of the floor on the node, upwards | N |

# %%
k, g0, F = 2.0, 1.0, 5.0  # N/mm, mm, N

# %% tags=["hide-input"]


def sketch(ax, u, r):
    ax.axhspan(-0.5, 0, color="0.8", lw=0)
    ax.axhline(0, color="k", lw=1)
    spring(ax, (0, u), (0, 3))
    ax.plot([-0.6, 0.6], [3, 3], "k", lw=3)
    ax.plot(0, u, "o", ms=10, color="C0")
    arrow(ax, (0.5, u + 0.6), (0.5, u), "$F$", "C3")
    arrow(ax, (-0.5, u - 0.6), (-0.5, u), f"$r$ = {r:.1f} N", "C1")
    place = (1.15, max(u / 2, 0.2))
    arrow(ax, (1.1, 0), (1.1, u), f"$u$ = {u:.1f} mm", "C2", place, "<->")
    arrow(ax, (-1.3, 0), (-1.3, 0.8), "$n$")
    ax.set(xlim=(-1.5, 2.2), ylim=(-0.7, 3.2), aspect="equal")
    ax.axis("off")


fig, ax = plt.subplots(figsize=(4, 4), layout="constrained")
sketch(ax, 1.0, 0.0)

# %% [markdown]
# ## The primal problem: an energy in displacements
#
# The spring stores the energy $\tfrac12 k (u - g_0)^2$. The load does work when the node moves
# down, so its potential is $+F u$. The node goes to the place where the sum of both is smallest,
# among all places above the floor:
#
# $$ \min_{u \ge 0} \; E(u), \qquad E(u) = \tfrac12 k\,(u - g_0)^2 + F u . $$
#
# This is the *primal* problem. The derivative $E'(u) = k (u - g_0) + F$ is the force that is
# missing for equilibrium, and the floor supplies it. Solvers call this number the *Lagrange
# multiplier* of the constraint $u \ge 0$. For us it is the contact force:
#
# $$ r = E'(u) = k\,(u - g_0) + F . $$
#
# The Python package `cvxpy` reads such a problem nearly as it is written on paper. A constraint has
# its multiplier as `dual_value`.

# %%
u = cp.Variable()
floor = u >= 0
primal = cp.Problem(cp.Minimize(k * (u - g0) ** 2 / 2 + F * u), [floor])
primal.solve(solver=cp.CLARABEL)
print(f"gap u = {u.value:.4f} mm, multiplier r = {floor.dual_value:.4f} N")

assert np.isclose(u.value, 0.0, atol=1e-5)
assert np.isclose(floor.dual_value, F - k * g0, atol=1e-4)

# %% [markdown]
# ## The optimality conditions
#
# A minimum under constraints obeys the conditions of Karush, Kuhn and Tucker, the *KKT conditions*
# for short. Here they are the equilibrium of the node, and three conditions that are named after
# Signorini:
#
# $$ r = k\,(u - g_0) + F, \qquad u \ge 0, \qquad r \ge 0, \qquad u\, r = 0 . $$
#
# In words: the forces on the node balance. The node does not pass through the floor. The floor
# pushes, and never pulls. If there is a gap, there is no force, and if there is a force, there is
# no gap. Move the slider, and watch which of $u$ and $r$ is zero.


# %% tags=["hide-input"]
def state(load):
    gap = max(g0 - load / k, 0.0)
    force = max(load - k * g0, 0.0)
    fig, (left, right) = plt.subplots(
        1, 2, figsize=(6.0, 3.2), layout="constrained"
    )
    sketch(left, gap, force)
    w = np.linspace(-1, 2, 200)
    right.plot(w, k * (w - g0) ** 2 / 2 + load * w, "C0")
    right.axvspan(-1, 0, color="0.85", lw=0)
    right.plot(gap, k * (gap - g0) ** 2 / 2 + load * gap, "o", color="C1", ms=9)
    right.set(
        xlabel="gap $u$ [mm]",
        ylabel="energy [N mm]",
        title=f"load F = {load:.1f} N",
        ylim=(-5, 8),
    )
    return fig


Slider("load F [N]", np.linspace(0, 5, 11), state, start=10)

# %% [markdown]
# ## The dual problem: the same in forces
#
# Solve the equilibrium for the gap: $u = r / k + g_0 - F / k$. We write this as
#
# $$ u = Q\,r + q, \qquad Q = 1/k, \qquad q = g_0 - F/k . $$
#
# $Q$ is the *compliance* of the spring. $q$ is the gap that the node would have if the floor were
# not there. A negative $q$ means that the node would pass through the floor. Signorini's conditions
# now say that $r \ge 0$, that $Q r + q \ge 0$, and that at least one of the two is zero. These are
# the KKT conditions of another minimum:
#
# $$ \min_{r \ge 0} \; \tfrac12 Q\, r^2 + q\, r . $$
#
# This is the *dual* problem. The force $r$, which was the multiplier, has become the unknown. The
# gap $u$, which was the unknown, has become the multiplier. contactopt solves the dual problem. For
# large bodies its unknowns live on the contact surface alone, and are few.

# %%
Q, q = 1 / k, g0 - F / k
r = cp.Variable()
push = r >= 0
dual = cp.Problem(cp.Minimize(Q * r**2 / 2 + q * r), [push])
dual.solve(solver=cp.CLARABEL)
print(f"force r = {r.value:.4f} N, multiplier u = {push.dual_value:.4f} mm")

assert np.isclose(r.value, F - k * g0, atol=1e-4)
# up to the sign and a constant the two minima are equal
assert np.isclose(primal.value + dual.value, F * g0 - F**2 / (2 * k), atol=1e-4)

# %% [markdown]
# contactopt solves the same problem. It takes one row of $q$ for each contact, with the normal
# component first and the tangential one second. Our node is not pulled sideways, so the tangential
# entry of $q$ is zero. The last argument is the friction coefficient.

# %%
problem = InterfaceProblem(np.diag([Q, Q]), [[q, 0.0]], 0.0)
answer = solve(problem)
print(answer.status, answer.reactions)

assert answer.solved and np.allclose(answer.reactions, [[3.0, 0.0]])

# %% [markdown]
# ## Penalty: a soft floor
#
# Many codes replace the floor by a second, stiff spring of stiffness $\kappa$ that acts only when
# the node is below zero:
#
# $$ \min_u \; E(u) + \tfrac12 \kappa \min(u, 0)^2 . $$
#
# This program has no constraint any more, but the node sinks into the floor. If the load is large
# enough to close the gap, $F > k g_0$, the minimum is at $u = -(F - k g_0) / (k + \kappa)$. A
# larger $\kappa$ makes this error smaller. But when contact begins, the stiffness of the system
# jumps by the factor $1 + \kappa / k$. Written in displacements, large penalty problems are therefore
# badly conditioned. Written in forces they are not, as chapter 3 shows.
#
# ## Nitsche: exact without a multiplier
#
# Nitsche's method also has the displacement as its only unknown. It uses that the displacement
# determines the contact force: by equilibrium, $r(u) = k (u - g_0) + F$. With the notation $[x]_+ =
# \max(x, 0)$, Signorini's conditions are the same as the one equation $r = [\,r - \gamma u\,]_+$,
# for any number $\gamma > 0$. The method minimises
#
# $$ E(u) - \frac{1}{2\gamma} r(u)^2 + \frac{1}{2\gamma} [\,r(u) - \gamma u\,]_+^2 . $$
#
# The derivative of this function is $(1 - k/\gamma)\,\bigl(r - [r - \gamma u]_+\bigr)$. For every
# $\gamma$ but $\gamma = k$ it is zero exactly at the solution. Such a method is called
# *consistent*. (The penalty method is not: its minimum is another point.) There is a price. The
# function is strictly convex if $\gamma > k$. For a smaller $\gamma$ it is concave and has no minimum.
#
# ## Proximal Galerkin: never below the floor
#
# The newest of the four methods writes the gap as $u = e^{\psi}$, with a *latent variable*
# $\psi$. A gap of this form is always positive. The method goes in steps. Each step minimises the
# energy $E(u)$ together with a term that keeps $u$ near the last gap $u_{\text{last}}$:
#
# $$ \min_{u > 0} \; \alpha\, E(u) + u \ln \frac{u}{u_{\text{last}}} - u + u_{\text{last}} . $$
#
# The number $\alpha$ is the step size. The added term is a distance that is measured by the
# entropy. The derivative of the whole is zero if
#
# $$ \alpha\, E'(e^{\psi}) + \psi - \psi_{\text{last}} = 0 . $$
#
# If the node touches, every step multiplies the gap by about $e^{-\alpha r}$. The number
# $(\psi_{\text{last}} - \psi) / \alpha$ tends to the contact force. Now we compare the methods on
# our node.


# %%
def residual_force(u):
    return k * (u - g0) + F


def proximal_galerkin(steps, alpha=1.0):
    psi, gaps, forces = 0.0, [], []
    for _ in range(steps):
        last = psi
        for _ in range(50):  # Newton's method for one unknown
            slope = alpha * k * np.exp(psi) + 1
            psi -= (alpha * residual_force(np.exp(psi)) + psi - last) / slope
        gaps.append(np.exp(psi))
        forces.append((last - psi) / alpha)
    return gaps, forces


gaps, forces = proximal_galerkin(6)
stiffness = 10.0 ** np.arange(1, 7)
sunk = -(F - k * g0) / (k + stiffness)

gamma = 4.0
v = cp.Variable()
# E - r^2 / (2 gamma), written as one parabola: so cvxpy sees that it is convex
nitsche = cp.Minimize(
    (k - k**2 / gamma) / 2 * (v - g0) ** 2
    + F * (1 - k / gamma) * (v - g0)
    + cp.square(cp.pos(k * (v - g0) + F - gamma * v)) / (2 * gamma)
)
cp.Problem(nitsche).solve(solver=cp.CLARABEL)
print(f"Nitsche: gap {v.value:.1e} mm, force {residual_force(v.value):.4f} N")
print(f"proximal Galerkin: gap {gaps[-1]:.1e} mm, force {forces[-1]:.4f} N")

fig, (left, right) = plt.subplots(
    1, 2, figsize=(6.4, 3.2), layout="constrained"
)
left.loglog(stiffness / k, -sunk, "o-")
left.set(
    xlabel=r"penalty stiffness $\kappa / k$ [-]",
    ylabel="depth below the floor [mm]",
    title="penalty",
)
right.semilogy(range(1, 7), gaps, "s-", color="C1")
right.set(
    xlabel="step [-]",
    ylabel="gap above the floor [mm]",
    title="proximal Galerkin",
)

assert np.isclose(v.value, 0.0, atol=1e-4) and np.isclose(
    residual_force(v.value), 3.0, atol=1e-3
)
assert np.all(np.array(gaps) > 0) and np.isclose(forces[-1], 3.0, rtol=1e-2)
assert np.isclose(sunk[-1] * stiffness[-1], -3.0, rtol=1e-4)

# %% [markdown]
# The table sums up the four methods.
#
# | method | unknowns | error | it fails if |
# |---|---|---|---|
# | multiplier (the programs above) | $u$ and $r$ | none | the problem has no solution |
# | penalty | $u$ | the node sinks in, in proportion to $1/\kappa$ | $\kappa$ is so large that rounding errors take over |
# | Nitsche | $u$ | none | $\gamma$ is smaller than the stiffness $k$ |
# | proximal Galerkin | $\psi$ | a gap remains, which falls like $e^{-\alpha r \cdot \text{steps}}$ | the node touches with $r = 0$: then the gap falls only slowly |
#
# ## What fails: a body that nothing holds
#
# Cut the spring, so that $k = 0$, and pull the node up with $F = -1$ N. The energy $F u$ falls for
# ever as the gap grows. A solver says that the primal problem is *unbounded*. In the dual problem,
# equilibrium asks for $r = F = -1$ N. But the contact force may not be negative. A solver says that
# the dual problem is *infeasible*. Both words mean that the node flies away.

# %%
gap, force = cp.Variable(nonneg=True), cp.Variable(nonneg=True)
primal_without_spring = cp.Problem(cp.Minimize(-1.0 * gap))
dual_without_spring = cp.Problem(cp.Minimize(0.0), [force == -1.0])
for program in (primal_without_spring, dual_without_spring):
    program.solve(solver=cp.CLARABEL)
print(
    "primal:", primal_without_spring.status, "dual:", dual_without_spring.status
)

assert (
    primal_without_spring.status == "unbounded"
    and dual_without_spring.status == "infeasible"
)

# %% [markdown]
# ## Exercises
#
# Replace `...` by your answer and run the cell. It says what is wrong with your answer in terms of
# mechanics. `hint("1.1")` gives a hint, three times, and then the solution. `table(1)` shows what
# you have done since the notebook was started. The first three need pen and paper only.
#
# Give numbers with at least three digits: 0.1 percent is close enough. Counts are exact. Forces and
# displacements are graded by the certificate, which must be at most $10^{-3}$.
#
# **1.1** (Pen and paper.) A spring of stiffness 4.4 N/mm holds a node 0.6 mm above the floor. A
# load of 6.5 N pulls it down. How large are the gap and the contact force?

# %% tags=["exercise"]
answer = (..., ...)  # gap [mm], force [N]
check("1.1", answer)

# %% [markdown]
# **1.2** (Pen and paper.) For which load does the node of exercise 1.1 just touch the floor?

# %% tags=["exercise"]
answer = ...  # load [N]
check("1.2", answer)

# %% [markdown]
# **1.3** (Pen and paper.) How large is the compliance $Q$ of a spring of 2.3 N/mm in m/N?

# %% tags=["exercise"]
answer = ...  # compliance [m/N]
check("1.3", answer)

# %% [markdown]
# **1.4** (Program.) Hang a ceiling 2 mm above the floor, so that $0 \le u \le 2$. Pull the node of
# this chapter ($k = 2$ N/mm, $g_0 = 1$ mm) *up* with 5.3 N. Write the primal program in cvxpy. How
# large is the force of the ceiling?

# %% tags=["exercise"]
answer = ...  # force of the ceiling [N]
check("1.4", answer)

# %% [markdown]
# **1.5** (Program.) How stiff must the penalty spring be, so that the node of this chapter sinks
# only 0.007 mm into the floor? Give its stiffness as a multiple of the stiffness $k$ of the spring.

# %% tags=["exercise"]
answer = ...  # kappa / k [-]
check("1.5", answer)

# %% [markdown]
# **1.6** (Program.) The *method of multipliers* repairs the penalty. It starts with $r = 0$. In
# each step it minimises $E(u) + \tfrac{1}{2\kappa} [\,r - \kappa u\,]_+^2$, and then takes $[\,r -
# \kappa u\,]_+$ as its new $r$. How large is $r$ after two steps with $\kappa = 5$ N/mm, for the
# node of this chapter?

# %% tags=["exercise"]
answer = ...  # force after two steps [N]
check("1.6", answer)

# %% [markdown]
# **1.7** (Program.) Nitsche's function consists of two parabolas. Give its second derivatives for
# $\gamma = 2.7$ N/mm, first where $r \lt \gamma u$, then where $r > \gamma u$. Both are positive,
# as $\gamma > k$.

# %% tags=["exercise"]
answer = (..., ...)  # second derivative without contact, with contact [N/mm]
check("1.7", answer)

# %% [markdown]
# **1.8** (Program.) By which factor does the gap of the proximal Galerkin method change from one
# step to the next, late in the iteration, with the step size $\alpha = 0.4$?

# %% tags=["exercise"]
answer = ...  # ratio of two gaps [-]
check("1.8", answer)

# %% [markdown]
# **1.9** (Think.) A spring of 3 N/mm holds an upper node 0.5 mm above a floor of its own. From this
# node a second spring of 1.5 N/mm holds a lower node, 0.2 mm above another floor. Both gaps are
# those without load. A load of 4 N pulls the lower node down. Find the forces of both floors.

# %% tags=["exercise"]
answer = (..., ...)  # forces on the upper and on the lower node [N]
check("1.9", answer)

# %%
table(1)

# %% [markdown]
# ## References
#
# - N. Kikuchi, J. T. Oden, *Contact Problems in Elasticity*, SIAM 1988,
#   [doi:10.1137/1.9781611970845](https://doi.org/10.1137/1.9781611970845).
# - F. Chouly, P. Hild, A Nitsche-based method for unilateral contact problems, *SIAM J. Numer.
#   Anal.* 51 (2013), [doi:10.1137/12088344X](https://doi.org/10.1137/12088344X).
# - B. Keith, T. M. Surowiec, Proximal Galerkin: a structure-preserving finite element method for
#   pointwise bound constraints, *Found. Comput. Math.* (2024),
#   [doi:10.1007/s10208-024-09681-8](https://doi.org/10.1007/s10208-024-09681-8).
#
# Next: [friction](chapter_2_friction_at_one_node.py).

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

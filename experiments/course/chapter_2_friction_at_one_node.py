# %% [markdown]
# # Chapter 2. Friction at one node
#
# Now the node can also move along the floor, and friction resists. If the bound on the friction
# force is *given*, the solution is still the minimum of an energy. With Coulomb's law the bound
# depends on the answer, and the solution is not the minimum of an energy any more.
#
# You need chapter 1. The chapter takes 40 minutes with its exercises.

# %%
import sys

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

# the folder of the repository, where the exercises are
sys.path.extend([".", "../.."])
from experiments.course.grader import check, hint, table
from experiments.course.sketch import arrow, spring

# %% [markdown]
# ## The mechanical system
#
# Two springs hold the node, a vertical one and one at 45 degrees. The load pulls the node down and
# to the right. The normal $n$ points up, and the tangent $t$ points to the right. All vectors are
# written with the normal component first:
#
# - $u = (u_n, u_t)$ is the gap that remains and the slip, that is, how far the node has moved to
#   the right;
# - $r = (r_n, r_t)$ is the force of the floor on the node.
#
# The arrows of the sketch show the positive directions. As in chapter 1, $u = Q r + q$: the matrix
# $Q$ is the compliance of the springs, and $q$ is the place to which the load alone would bring the
# node. $K = Q^{-1}$ is the stiffness of the springs.

# %%
k_vertical, k_inclined = 1.0, 2.0  # N/mm
along = np.array([1.0, 1.0]) / np.sqrt(
    2
)  # direction of the inclined spring: up and to the right
K = k_vertical * np.diag([1.0, 0.0]) + k_inclined * np.outer(along, along)
Q = np.linalg.inv(K)
load = np.array([-3.0, 1.0])  # N: 3 N down, 1 N to the right
q = np.array([1.0, 0.0]) + Q @ load  # the gap without load is 1 mm
mu = 0.5  # friction coefficient
print(
    "K =",
    np.round(K, 6).tolist(),
    " Q =",
    np.round(Q, 6).tolist(),
    " q =",
    np.round(q, 6).tolist(),
)

assert np.allclose(Q, [[1, -1], [-1, 2]]) and np.allclose(q, [-3, 5])

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(4.6, 3.6), layout="constrained")
ax.axhspan(-0.5, 0, color="0.8", lw=0)
ax.axhline(0, color="k", lw=1)
for end in ((0, 2.2), (1.5, 1.9)):
    spring(ax, (0, 0.4), end)
    ax.plot(*end, "ks", ms=8)
ax.plot(0, 0.4, "o", ms=11, color="C0")
for tail, head, name, color in (
    ((0, 0.4), (0.7, 0.05), "load", "C3"),
    ((0.0, -0.45), (0.0, 0.28), "$r_n$", "C1"),
    ((-1.0, 0.4), (-0.15, 0.4), "$r_t$", "C1"),
    ((-1.4, 0), (-1.4, 0.7), "$n$", "k"),
    ((-1.4, 0), (-0.75, 0), "$t$", "k"),
):
    arrow(ax, tail, head, name, color)
ax.set(xlim=(-1.7, 2), ylim=(-0.6, 2.4), aspect="equal")
_ = ax.axis("off")

# %% [markdown]
# The entry $Q_{nt} = -1$ of the compliance couples the two directions. A force to the right moves
# the node down as well, because the inclined spring guides it.
#
# ## Primal: an energy with a given friction bound
#
# Suppose that the friction force cannot exceed a known number $g$. This is called *Tresca
# friction*. To move the node by $u_t$ against this force costs the work $g |u_t|$. So the node goes
# to the minimum of the energy of the springs, the load and friction (the prime denotes a transposed
# vector):
#
# $$ \min_{u_n \ge 0} \; \tfrac12 (u - q)' K (u - q) + g\,|u_t| . $$
#
# ## Dual: forces in a box
#
# The unknowns of the dual problem are the contact forces:
#
# $$ \min_r \; \tfrac12 r' Q r + q' r \qquad \text{subject to} \qquad r_n \ge 0, \quad |r_t| \le g . $$
#
# ## The optimality conditions
#
# Both problems have the same optimality conditions, those of Karush, Kuhn and Tucker (KKT
# conditions). They are equilibrium of the springs, Signorini's conditions, and a law of friction:
#
# $$ u = Q\, r + q, \qquad\quad u_n \ge 0, \quad r_n \ge 0, \quad u_n r_n = 0, $$
#
# $$ |r_t| \le g, \qquad u_t \ne 0 \;\Rightarrow\; r_t = -g\, \frac{u_t}{|u_t|} . $$
#
# (Friction opposes a velocity. Chapter 5 shows why the law of a step asks for $u_t$.)
#
# If the friction force is below its bound, the node does not move: it *sticks*. If the node moves,
# it *slips*. Then the friction force has reached its bound and points against the slip. The two
# programs in `cvxpy`:


# %%
def primal(g):
    u = cp.Variable(2)
    floor = u[0] >= 0
    cp.Problem(
        cp.Minimize(cp.quad_form(u - q, K) / 2 + g * cp.abs(u[1])), [floor]
    ).solve(solver=cp.CLARABEL)
    return K @ (u.value - q)  # the contact force, from equilibrium


def dual(g, Q=Q, q=q):
    r = cp.Variable(2)
    box = [r[0] >= 0, cp.abs(r[1]) <= g]
    cp.Problem(
        cp.Minimize(cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q @ r), box
    ).solve(solver=cp.CLARABEL)
    return r.value


for g in (0.0, 1.0, 2.0, 3.0):
    print(
        f"bound {g} N: primal",
        np.round(primal(g), 4),
        "dual",
        np.round(dual(g), 4),
    )
    assert np.allclose(primal(g), dual(g), atol=1e-4)
assert np.allclose(
    dual(3.0), -K @ q, atol=1e-4
)  # from 2 N on the node sticks: u = 0

# %% [markdown]
# ## Why Coulomb's law has no energy
#
# Coulomb's law says that the bound is $g = \mu r_n$. This law has no convex energy, and not even one
# that is not convex. This section shows why. It explains all the iterations of this course.
#
# **A convex energy makes forces fall.** Let the force be minus the slope of a convex function, $r =
# -\varphi'(u)$. (At a kink, such as $u_t = 0$, every slope between those of the two sides is
# allowed.) The slope of a convex function never decreases. So for any two states
#
# $$ (r - r')'(u - u') \;\le\; 0 . $$
#
# This is called *monotone*. Tresca's law is monotone. In both states $r_t u_t = -g |u_t|$, and on
# another slip a force within the bound dissipates at most $g$ times that slip: $-r_t u_t' \le g
# |u_t'|$ and $-r_t' u_t \le g |u_t|$. Multiply out, and everything cancels:
#
# $$ (r_t - r_t')(u_t - u_t') \;\le\; -g|u_t| - g|u_t'| + g|u_t'| + g|u_t| \;=\; 0 . $$
#
# The normal parts give $-r_n u_n' - r_n' u_n \le 0$.
#
# **Coulomb's law is not monotone.** Take two states that both touch the floor and slip forwards:
#
# $$ r = (10, -10 \mu), \quad u = (0, 1) \qquad \text{and} \qquad r' = (1, -\mu), \quad u' = (0, 2) . $$
#
# Each obeys Coulomb's law, but $(r - r')'(u - u') = (-9\mu)(-1) = 9 \mu > 0$. The second state slips
# further and resists less. So there is *no convex energy*.
#
# **There is no other energy either.** Let the floor be a spring, $r_n = \kappa h$ at the depth $h =
# -u_n$, and let the node slip forwards, so that $r_t = -\mu \kappa h$. Then $r_t$ depends on $u_n$, but
# $r_n$ does not depend on $u_t$. The forces of an energy have symmetric derivatives. Or go round a
# closed loop: at the depth $h$ from the slip 1 mm to 2 mm, up to the depth 0, back to the slip 1 mm,
# and down again. The normal force gives back all its work. Friction takes $\mu \kappa h$ times 1 mm
# on the way out, and nothing on the way back. A force with an energy does no work on a closed loop.


# %% tags=["hide-input"]
fig, (left, right) = plt.subplots(
    1, 2, figsize=(6.6, 3.2), layout="constrained"
)
for force, color in ((10, "C0"), (1, "C1")):
    step = np.array([0.5, 0.5, -0.5, -0.5]) * force
    left.plot([-2.6, 0, 0, 2.6], step, color, label=f"$r_n$ = {force} N")
left.plot([1, 2], [-5, -0.5], "C3o--")
left.annotate("this line rises", (1.5, -2.7), (-2.4, -3.6), color="C3")
left.set(xlabel="slip $u_t$ [mm]", ylabel="friction force $r_t$ [N]")
left.set_title("Coulomb's law, $\\mu$ = 0.5")
left.legend(frameon=False, loc="upper right")
right.fill([1, 2, 2, 1], [1, 1, 0, 0], color="C3", alpha=0.2, lw=0)
for tail, head in (
    ((1, 1), (2, 1)),
    ((2, 1), (2, 0)),
    ((2, 0), (1, 0)),
    ((1, 0), (1, 1)),
):
    arrow(right, tail, head, color="C3")
right.text(1.08, 1.06, r"friction takes $\mu \kappa h \cdot$ 1 mm", color="C3")
right.text(1.3, -0.13, "no friction", color="C3")
right.set(xlabel="slip $u_t$ [mm]", ylabel="depth / $h$ [-]")
right.set(xlim=(0.7, 2.3), ylim=(-0.25, 1.25), title="a closed loop")
_ = right.set_yticks([0, 1])

# %% [markdown]
# **What follows.** The law can still be written in three ways, and every method uses one of them.
#
# - *A fixed point.* Tresca's program with the bound $g$ has an answer $r_n(g)$. Find the bound with $g
#   = \mu r_n(g)$.
# - *A quasi-variational inequality.* Find $r$ in $C(r)$ such that $(Q r + q)'(s - r) \ge 0$ for all
#   $s$ in $C(r)$. The set $C(r) = \{s : s_n \ge 0,\ |s_t| \le \mu r_n\}$ depends on the answer. That
#   is what "quasi" means. With a fixed set this would be a convex program.
# - *Complementarity.* Let $n$ be the unit vector of the normal direction. Find $r$ in the cone $|r_t|
#   \le \mu r_n$ such that $u + \mu |u_t|\, n$ lies in the dual cone and is orthogonal to $r$. (The
#   *dual cone* holds the vectors on which no force of the cone does negative work: $v_n \ge \mu
#   |v_t|$.)
#
# The third form is Coulomb's law for this reason. The dual cone asks that $u_n + \mu |u_t| \ge \mu
# |u_t|$, which is $u_n \ge 0$. Orthogonality says that $r_n u_n + (\mu r_n |u_t| + r_t u_t) = 0$.
# Neither term is negative, so both are zero. The first is Signorini's condition. If the node slips,
# the second leaves only $r_t = -\mu r_n u_t / |u_t|$.
#
# A problem with Coulomb's law may still have exactly one solution, as we shall see. Only the law has
# no energy.
#
# ## Coulomb: the bound depends on the answer
#
# Neither program takes a bound that contains
# its own answer. If we write $\mu r_n$ into the constraint of the dual, we get another law, as we
# shall see below. But we can guess $g$, solve the program, set $g = \mu r_n$, and solve again,
# until nothing changes. This is *Tresca's iteration*.

# %%
g, history = 0.0, []
for _ in range(30):
    r = dual(g)
    g = mu * r[0]
    history.append(r)
print(
    "Tresca's iteration:",
    np.round(history[:4], 3).tolist(),
    "...",
    np.round(r, 4),
)

problem = InterfaceProblem(Q, [q], mu)
assert np.allclose(r, [2.0, -1.0], atol=1e-4)
assert natural_map_residual(problem, r[None]) < 1e-4

# %% [markdown]
# `natural_map_residual` is the *certificate*. It is computed from the problem and the forces alone,
# and it is zero exactly if the forces obey Signorini's conditions and Coulomb's law.
#
# We can also check the answer by hand. Suppose that the node slips to the right, so that $r_t =
# -\mu r_n = -\tfrac12 r_n$. It touches the floor, so that $0 = u_n = Q_{nn} r_n + Q_{nt} r_t + q_n
# = r_n + \tfrac12 r_n - 3$. Hence $r_n = 2$ N and $r_t = -1$ N. The slip is $u_t = Q_{tn} r_n +
# Q_{tt} r_t + q_t = -2 - 2 + 5 = 1$ mm, which is to the right, as we supposed.
#
# ## The cone
#
# The forces that Coulomb's law admits fill the cone $|r_t| \le \mu r_n$. The force that would make
# the node stick, so that $u = 0$, is $-Kq$. If the friction coefficient grows, the cone opens. The
# contact force moves along the edge of the cone, until the cone contains the sticking force. From
# there on the node sticks.


# %% tags=["hide-input"]
def in_the_cone(coefficient):
    force = solve(InterfaceProblem(Q, [q], coefficient)).reactions[0]
    slip = (Q @ force + q)[1]
    fig, ax = plt.subplots(figsize=(5, 3.4), layout="constrained")
    ax.fill(
        [0, -coefficient * 4, coefficient * 4],
        [0, 4, 4],
        color="C0",
        alpha=0.15,
        lw=0,
    )
    arrow(ax, (0, 0), (force[1], force[0]), color="C1")
    ax.plot(*(-K @ q)[::-1], "kx")
    ax.text(-2.0, 0.7, "sticking force", ha="center")
    ax.set(
        xlim=(-3.2, 3.2),
        ylim=(0, 3.2),
        xlabel="friction force $r_t$ [N]",
        ylabel="normal force $r_n$ [N]",
    )
    ax.set_title(
        rf"$\mu$ = {coefficient:.2f}: "
        + (f"slips {slip:.2f} mm" if slip > 1e-8 else "sticks")
    )
    return fig


Slider(
    "friction coefficient [-]", np.linspace(0, 2.5, 11), in_the_cone, start=2
)

# %% [markdown]
# ## The convex relaxation: another law
#
# Now let us write the cone into the dual problem all the same:
#
# $$ \min_r \; \tfrac12 r' Q r + q' r \qquad \text{subject to} \qquad |r_t| \le \mu\, r_n . $$
#
# This is a *second-order cone program* (SOCP), a convex program with a cone as its constraint.
# `cvxpy` writes the cone as `cp.SOC`. The KKT conditions of this program are not Coulomb's law: $u =
# Qr + q$ lies in the dual cone and is orthogonal to $r$, without the term $\mu |u_t|\, n$. On the
# edge of the cone $r_t = \mp \mu r_n$, and orthogonality gives $u_n = \mu |u_t|$. So a node that slips
# is also lifted. This law is called *associated friction*.

# %%
f = cp.Variable(2)
energy = cp.quad_form(f, cp.psd_wrap(Q)) / 2 + q @ f
cp.Problem(cp.Minimize(energy), [cp.SOC(mu * f[0], f[1:])]).solve(
    solver=cp.CLARABEL
)
lifted = Q @ f.value + q
print(
    "associated: force",
    np.round(f.value, 3),
    "gap and slip",
    np.round(lifted, 3),
)

assert np.isclose(lifted[0], mu * abs(lifted[1]), atol=1e-4) and lifted[0] > 0.1

# %% [markdown]
# Acary and Cadoux found a repair. They add the term $\mu\, \sigma\, r_n$ to the cost, where $\sigma
# = |u_t|$ is the slip of the last answer, and solve the program again and again. Its KKT conditions
# have $u + \mu \sigma n$ in place of $u$. When nothing changes any more, this is the complementarity
# above, so the answer obeys Coulomb's law (exercise 2.3).
#
# ## What fails
#
# **The iteration fails.** With $\mu = 1.5$ the node still has exactly one solution for this load,
# and slips to the right. In Tresca's iteration the new normal force is $r_n = 3 - g$, and the next bound is $\mu
# (3 - g)$, as long as the node slips. So every iteration multiplies a small error of the bound by
# $-\mu$. For $\mu > 1$ a small error grows. It does not grow for ever: as soon as the bound is
# larger than 2 N, the node sticks with $r_n = 1$ N, whatever the bound is. So the iteration ends in
# a cycle, in which the node slips and sticks in turn.

# %%
much, g, history = 1.5, 1.0, []
for _ in range(12):
    r = dual(g)
    g = much * max(r[0], 0.0)
    history.append(r[0])
exact = all_solutions(InterfaceProblem(Q, [q], much))
fig, ax = plt.subplots(figsize=(5, 3.2), layout="constrained")
ax.plot(range(1, 13), history, "o-", label="Tresca's iteration")
ax.axhline(
    exact[0].reactions[0, 0],
    color="k",
    ls="--",
    lw=1,
    label="the only solution",
)
ax.set(xlabel="iteration [-]", ylabel="normal force [N]")
ax.legend(frameon=False)

assert len(exact) == 1 and np.allclose(exact[0].reactions, [[1.2, -1.8]])
assert abs(history[-1] - 1.2) > 0.1  # it has not converged
assert np.isclose(
    min(history), 1.0, atol=1e-4
)  # it sticks in every second iteration
assert solve(InterfaceProblem(Q, [q], much)).solved  # another method has

# %% [markdown]
# **The shift can fail, too.** Let the node slip to the right. On the edge of the cone $r_t = -\mu
# r_n$, and the minimum along this edge is $r_n = (-q_n + \mu q_t - \mu \sigma) / d$ with $d = Q_{nn}
# - 2 \mu Q_{nt} + \mu^2 Q_{tt}$. So an error of $\sigma$ comes back multiplied by
#
# $$ \frac{\mu\, (\mu Q_{tt} - Q_{nt})}{Q_{nn} - 2 \mu Q_{nt} + \mu^2 Q_{tt}} . $$
#
# This factor is below $+1$ exactly if $\mu Q_{nt} < Q_{nn}$. If the node slips to the left, $Q_{nt}$
# changes its sign in both formulas. So the factor is below $+1$ in both directions exactly if
# $\mu |Q_{nt}| < Q_{nn}$. This is also the condition under which every load has a single
# solution. For our node $Q_{nt} = -1$. If it slips to the right, the factor stays between 0 and 1
# for every $\mu$: strong friction alone does no harm. But if normal and tangential motion are
# strongly coupled, $Q_{nt}^2 > \tfrac89 Q_{nn} Q_{tt}$, the factor falls below $-1$ for some
# coefficients. Then the iteration runs in a cycle, although the solution is unique.

# %%
coupled, pulled, friction = (
    np.array([[1.0, 0.99], [0.99, 1.0]]),
    np.array([-0.307, 0.71]),
    0.7,
)
f, sigma = cp.Variable(2), cp.Parameter(nonneg=True, value=0.9)
energy = (
    cp.quad_form(f, cp.psd_wrap(coupled)) / 2
    + pulled @ f
    + friction * sigma * f[0]
)
program, slips = (
    cp.Problem(cp.Minimize(energy), [cp.SOC(friction * f[0], f[1:])]),
    [],
)
for _ in range(12):
    program.solve(solver=cp.CLARABEL)
    sigma.value = abs(float((coupled @ f.value + pulled)[1]))
    slips.append(sigma.value)
(only,) = all_solutions(InterfaceProblem(coupled, [pulled], friction))
right = (coupled @ only.reactions[0] + pulled)[1]
print(
    f"slip of the only solution {right:.3f} mm; of the iteration",
    np.round(slips[-4:], 3),
)

bottom = 1.0 - 2 * friction * 0.99 + friction**2
assert friction * (friction - 0.99) / bottom < -1 and np.isclose(right, 1.0)
assert min(np.abs(np.array(slips[-4:]) - right)) > 0.1  # it has not converged

# %% [markdown]
# **Uniqueness fails.** If the node slips to the *left*, friction pushes it to the right with $r_t =
# +\mu r_n$. The coupling then draws the node down: $u_n = (Q_{nn} + \mu Q_{nt})\, r_n + q_n = (1 -
# \mu)\, r_n + q_n$. For $\mu > 1$ a larger contact force makes the gap *smaller*. The node can
# wedge itself in. As soon as $\mu$ exceeds $Q_{nn} / |Q_{nt}| = 1$, there are loads with several
# solutions.

# %%
wedged = InterfaceProblem(Q, [[0.1, -0.5]], 1.5)
for found in all_solutions(wedged):
    state = Q @ found.reactions[0] + wedged.q[0]
    force = np.round(found.reactions[0], 4)
    print(f"force {force}, gap {state[0]:.3f} mm, slip {state[1]:+.3f} mm")

assert len(all_solutions(wedged)) == 3
assert len(all_solutions(InterfaceProblem(Q, [[0.1, -0.5]], 0.9))) == 1

# %% [markdown]
# Under the same load the node may hang freely, stick, or slip. Which of these happens depends on
# what happened before, and no static law can tell.
#
# | method | what it solves | it fails if |
# |---|---|---|
# | Tresca's iteration | the box program, again and again | $\mu$ times the coupling $\lvert Q_{nt} \rvert / Q_{nn}$ exceeds 1 while the node slips |
# | cone program | associated friction | the node slips: then it is another law |
# | Acary and Cadoux | the cone program with a shift, again and again | the factor above is not between -1 and 1; for many nodes there is no proof of convergence |
#
# ## Exercises
#
# Replace `...` by your answer and run the cell. It says what is wrong with your answer in terms of
# mechanics. `hint("2.1")` gives a hint, three times, and then the solution. `table(2)` shows what
# you have done since the notebook was started.
#
# Give numbers with at least three digits: 0.1 percent is close enough. Counts are exact. Forces and
# displacements are graded by the certificate, which must be at most $10^{-3}$.
#
# **2.1** (Pen and paper.) Let $Q = \operatorname{diag}(1.2, 2.5)$ mm/N, $q = (-1.5, 1.1)$ mm and
# $\mu = 0.3$. Find the normal force and the friction force.

# %% tags=["exercise"]
answer = (..., ...)  # r_n, r_t [N]
check("2.1", answer)

# %% [markdown]
# **2.2** (Pen and paper.) What is the smallest friction coefficient with which the node of this
# chapter sticks, if $q = (-3.1, 5.3)$ mm?

# %% tags=["exercise"]
answer = ...  # friction coefficient [-]
check("2.2", answer)

# %% [markdown]
# **2.3** (Program.) Write the iteration of Acary and Cadoux. Solve the case $\mu = 1.5$ with it, in
# which Tresca's iteration failed. The certificate grades your forces.

# %% tags=["exercise"]
answer = (..., ...)  # r_n, r_t [N]
check("2.3", answer)

# %% [markdown]
# **2.4** (Pen and paper.) Find the three solutions of the wedged node with $q = (0.13, -0.55)$ mm
# and $\mu = 1.5$. Give their normal forces, the smallest first.

# %% tags=["exercise"]
answer = (..., ..., ...)  # three normal forces, the smallest first [N]
check("2.4", answer)

# %% [markdown]
# **2.5** (Program.) How large is the gap in the solution of *associated* friction, for the node of
# this chapter with $\mu = 0.7$?

# %% tags=["exercise"]
answer = ...  # gap [mm]
check("2.5", answer)

# %% [markdown]
# **2.6** (Pen and paper.) Let $Q = \begin{pmatrix} 1.3 & -0.8 \\ -0.8 & 2 \end{pmatrix}$ mm/N.
# Above which friction coefficient are there loads with several solutions?

# %% tags=["exercise"]
answer = ...  # friction coefficient [-]
check("2.6", answer)

# %% [markdown]
# **2.7** (Think.) Find another load $q$ for which the node of this chapter has three solutions with
# $\mu = 1.5$. Multiples of $(0.1, -0.5)$ mm do not count.

# %% tags=["exercise"]
answer = (..., ...)  # q_n, q_t [mm]
check("2.7", answer)

# %% [markdown]
# **2.8** (Think.) Take $Q$ of exercise 2.6 and $\mu = 0.7$. By which factor, with its sign, does a
# step of Tresca's iteration multiply an error of the bound, while the node slips to the right?

# %% tags=["exercise"]
answer = ...  # factor of the error in one step, with its sign [-]
check("2.8", answer)

# %% [markdown]
# **2.9** (Think.) In space a node has two tangential directions. Let $Q = \operatorname{diag}(1, 1,
# 3)$ mm/N, $q = (-2, 1.5, 2)$ mm and $\mu = 0.5$. Find the three forces. Friction is opposite to
# the *slip*, and the slip is not parallel to $(1.5, 2)$.

# %% tags=["exercise"]
answer = (..., ..., ...)  # r_n, r_1, r_2 [N]
check("2.9", answer)

# %% [markdown]
# **2.10** (Pen and paper.) Two states of one node with $\mu = 0.35$ touch the floor and slip
# forwards. The first has $r_n = 7.4$ N and $u_t = 0.3$ mm, the second $r_n = 2.6$ N and $u_t = 1.1$
# mm. How large is $(r - r')'(u - u')$?

# %% tags=["exercise"]
answer = ...  # product [N mm]
check("2.10", answer)

# %% [markdown]
# **2.11** (Pen and paper.) A floor is a spring of 30 N/mm, and $\mu = 0.35$. A node is pushed 0.04
# mm into it, goes from the slip 0.5 mm to 2.2 mm, is lifted to the depth 0.01 mm, goes back to 0.5
# mm, and is pushed down again. As in the text, $r_t = -\mu r_n$ wherever $u_t > 0$, on the way back
# too. How much work does the node lose to friction on this loop?

# %% tags=["exercise"]
answer = ...  # lost work [N mm]
check("2.11", answer)

# %%
table(2)

# %% [markdown]
# ## References
#
# - G. De Saxcé, Z.-Q. Feng, The bipotential method: a constructive approach to design the complete
#   contact law with friction, *Math. Comput. Modelling* 28 (1998),
#   [doi:10.1016/S0895-7177(98)00119-8](https://doi.org/10.1016/S0895-7177(98)00119-8).
# - V. Acary, F. Cadoux, C. Lemaréchal, J. Malick, A formulation of the linear discrete Coulomb
#   friction problem via convex optimization, *ZAMM* 91 (2011),
#   [doi:10.1002/zamm.201000073](https://doi.org/10.1002/zamm.201000073).
#
# Next: [duality](chapter_7_duality.py), where the second program is derived.

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

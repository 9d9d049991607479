# %% [markdown]
# # Chapter 5. Coulomb friction on an interface
#
# Now we put everything together: elastic bodies, many nodes, and Coulomb's law. The solution is not
# the minimum of an energy. Therefore all methods solve another, simpler problem again and again. In
# this chapter we write three methods, compare their speed and their accuracy, and look at a problem
# that has no solution at all.
#
# You need chapters 2 and 4. The chapter takes 50 minutes with its exercises.

# %%
import sys
import time

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import (
    InterfaceProblem,
    diagnose,
    natural_map_residual,
    reduce,
    scenes,
    solve,
)
from contactopt.teaching import Slider

# the folder of the repository, where the exercises are
sys.path.extend([".", "../.."])
from experiments.course.grader import check, hint, table
from experiments.course.sketch import arrow

# %% [markdown]
# ## The mechanical system
#
# A plate presses a rubber block, 40 mm wide and 40 mm high, on a foundation of the same rubber with
# 100 N. Under the load the lower edge of the block moves outwards. The surface of the foundation
# moves the other way: below a pressure the surface of a wide body is drawn inwards, towards the
# middle of the load. Friction resists the difference. The system is symmetric, so we model its right
# half.
#
# The normal $n$ points out of the foundation, upwards. The tangent $t$ points to the right, which
# is outwards. $r$ is the force on the block. The vectors $u$, $r$ and $q$ hold the components of
# all nodes, $(n, t)$ for the first node, then $(n, t)$ for the second, and so on. The plate may
# move down. So, as in chapter 4, there is a rigid motion $V$ with the unknown $\lambda$, and the
# contact forces must balance the load: $V' r + s = 0$.

# %%
mu = 0.2
problem = reduce(scenes.flat_punch(2, mu=mu, elements=24))
Q, q, V, s = problem.Q, problem.q.ravel(), problem.V, problem.s
k = problem.contacts
moves = (
    np.diag(Q) > 0
)  # the node on the axis of symmetry cannot move sideways: its row of Q is zero
print(f"{k} contacts, V {V.shape}: one plate, s = {s} N")

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(5, 3.4), layout="constrained")
ax.fill([0, 20, 20, 0], [0, 0, 40, 40], color="C0", alpha=0.25, lw=0)
ax.fill([0, 45, 45, 0], [0, 0, -25, -25], color="C1", alpha=0.25, lw=0)
ax.plot([0, 0], [-25, 44], "k-.", lw=0.8)
ax.plot([0, 20], [40.6, 40.6], "k", lw=4)
arrow(ax, (10, 54), (10, 42), "100 N", "C3", (11.5, 47))
arrow(ax, (28, 6), (40, 6), "$t$", at=(41, 7))
arrow(ax, (28, 6), (28, 18), "$n$", at=(29, 19))
ax.plot(problem.coordinates[0], problem.coordinates[1], "k.", ms=3)
ax.text(3, 20, "block")
ax.text(3, -14, "foundation")
_ = ax.set(
    xlabel="x [mm]",
    ylabel="y [mm]",
    aspect="equal",
    xlim=(-2, 48),
    ylim=(-26, 57),
)

# %% [markdown]
# ## Primal and dual for a given bound
#
# First let the friction bound $g_i$ of every node be given. Then the solution is the minimum of an
# energy. The *primal* problem has the displacements $u$ of the contact and the motion $\lambda$ of
# the plate as its unknowns. With the stiffness $S = Q^{-1}$ of the components that can move it is
#
# $$ \min_{u_n \ge 0,\; \lambda} \; \tfrac12 (u - q - V\lambda)' S\, (u - q - V \lambda) - s' \lambda + \sum_i g_i |u_{t,i}| . $$
#
# The *dual* problem has the contact forces as its unknowns:
#
# $$ \min_r \; \tfrac12 r' Q r + q' r \qquad \text{subject to} \qquad r_n \ge 0, \quad |r_{t,i}| \le g_i, \quad V' r + s = 0 . $$
#
# ## The optimality conditions
#
# Both have the same optimality conditions, those of Karush, Kuhn and Tucker (KKT conditions). They
# are equilibrium of the bodies and of the plate, and, at every node $i$, Signorini's conditions and
# friction with the bound $g_i$:
#
# $$ u = Q\, r + V \lambda + q, \qquad V' r + s = 0, \qquad u_{n,i} \ge 0, \quad r_{n,i} \ge 0, \quad u_{n,i}\, r_{n,i} = 0, $$
#
# $$ |r_{t,i}| \le g_i, \qquad u_{t,i} \ne 0 \;\Rightarrow\; r_{t,i} = -g_i\, \frac{u_{t,i}}{|u_{t,i}|} . $$
#
# The multiplier of the balance $V' r + s = 0$ is the motion $\lambda$ of the plate. Coulomb's law
# asks in addition that $g_i = \mu r_{n,i}$. In `cvxpy` the bounds are a parameter, which we can
# change from one solve to the next:

# %%
n, t = slice(0, None, 2), slice(1, None, 2)
r = cp.Variable(2 * k)
g = cp.Parameter(k, nonneg=True)
balance = V.T @ r + s == 0
dual = cp.Problem(
    cp.Minimize(cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q @ r),
    [r[n] >= 0, cp.abs(r[t]) <= g, balance],
)

u, plate = cp.Variable(2 * k), cp.Variable(V.shape[1])
S = np.linalg.inv(Q[np.ix_(moves, moves)])
stretch = u - q - V @ plate
energy = (
    cp.quad_form(stretch[moves], cp.psd_wrap((S + S.T) / 2)) / 2
    - s @ plate
    + g @ cp.abs(u[t])
)
primal = cp.Problem(cp.Minimize(energy), [u[n] >= 0, u[~moves] == q[~moves]])

g.value = np.full(k, 0.5)
dual.solve(solver=cp.CLARABEL)
primal.solve(solver=cp.CLARABEL)

assert np.isclose(primal.value, -dual.value, rtol=1e-5)
assert np.allclose(
    S @ (u.value - q - V @ plate.value)[moves], r.value[moves], atol=1e-2
)

# %% [markdown]
# ## Method 1: Tresca's iteration
#
# Solve the dual for a bound $g$, set $g = \mu r_n$, and repeat. Each step is one quadratic program
# (QP: a quadratic cost with linear constraints). As soon as no node changes its state any more, the
# certificate falls by about the same factor in every step. It stops falling when it has reached the accuracy of the QP solver.

# %%
g.value, road = np.zeros(k), []
for _ in range(8):
    dual.solve(solver=cp.CLARABEL)
    g.value = mu * np.maximum(r.value[n], 0)
    road.append(natural_map_residual(problem, r.value.reshape(-1, 2)))
print("Tresca's iteration:", " ".join(f"{value:.0e}" for value in road))

assert road[-1] < 1e-4 and road[3] < road[1]

# %% [markdown]
# ## Method 2: Newton on the states
#
# If we knew which nodes are open, which stick and which slip, all equations would be linear. An
# open node has $r = 0$. A sticking node has $u = 0$. A slipping node has $u_n = 0$, and $r_t = -\mu
# r_n$ or $r_t = +\mu r_n$, against its slip. Newton's method guesses the states from the last
# answer. A node is pressed if $y_n = r_n - \rho u_n$ is positive. A pressed node slips if $|r_t -
# \rho u_t|$ exceeds $\mu\, y_n$. Then the method solves the linear equations that belong to these
# states.


# %%
def newton(rho=1.0, steps=20):
    r, lam = np.zeros(2 * k), np.zeros(V.shape[1])
    for step in range(1, steps + 1):
        u = Q @ r + V @ lam + q
        pressed = np.maximum(r[n] - rho * u[n], 0) if step > 1 else np.ones(k)
        trial = r[t] - rho * u[t] if step > 1 else np.zeros(k)
        slips = (np.abs(trial) > mu * pressed) & (pressed > 0)
        # rows of A r + B u = 0: for every node a normal and a tangential one
        A, B = np.zeros((2 * k, 2 * k)), np.zeros((2 * k, 2 * k))
        for i in range(k):
            if pressed[i] == 0:
                A[2 * i, 2 * i] = A[2 * i + 1, 2 * i + 1] = 1
            elif slips[i]:
                B[2 * i, 2 * i] = A[2 * i + 1, 2 * i + 1] = 1
                A[2 * i + 1, 2 * i] = -mu * np.sign(trial[i])
            else:
                B[2 * i, 2 * i] = B[2 * i + 1, 2 * i + 1] = 1
        B[~moves], A[~moves] = (
            0,
            np.eye(2 * k)[~moves],
        )  # no friction on the axis of symmetry
        system = np.block(
            [[A + B @ Q, B @ V], [V.T, np.zeros((V.shape[1],) * 2)]]
        )
        r, lam = np.split(
            np.linalg.solve(system, -np.concatenate([B @ q, s])), [2 * k]
        )
        if natural_map_residual(problem, r.reshape(-1, 2), lam) < 1e-12:
            return r, step
    return r, steps


forces, steps = newton()
certificate = natural_map_residual(problem, forces.reshape(-1, 2))
print(f"Newton: {steps} steps, certificate {certificate:.0e}")

assert steps < 20 and np.allclose(
    forces, solve(problem, tol=1e-12).reactions.ravel(), atol=1e-8
)

# %% [markdown]
# Once the states are right, the next step is exact. Therefore Newton's method ends with an error of
# the size of rounding. Tresca's iteration comes closer step by step, as far as its QP solver allows.
#
# ## Method 3: a cone program with a shift
#
# As in chapter 2, Acary and Cadoux minimise over the cones $|r_{t,i}| \le \mu r_{n,i}$. The cost
# has the additional term $\sum_i \mu\, \sigma_i r_{n,i}$, where $\sigma_i$ is the slip of node $i$
# in the last answer. The program is solved again with the new slips, until nothing changes. In
# contactopt the method has the name `acary_cadoux`. In three dimensions the program is the same,
# with round cones.
#
# ## Penalty and multipliers
#
# A penalty can replace the constraints of friction problems too. Its error has the size of $1 /
# \kappa$, where $\kappa$ is the stiffness of the penalty springs. The *augmented Lagrangian* adds
# the contact force of the last iteration to the force of the spring. By repetition it removes the
# error, although $\kappa$ is moderate.
#
# Now we compare five methods. Each runs to the tolerances $10^{-2}$ to $10^{-8}$ of the certificate.

# %%
fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for name, label in (
    ("newton", "Newton"),
    ("tresca", "Tresca's iteration"),
    ("acary_cadoux", "cones with a shift"),
    ("augmented_lagrangian", "augmented Lagrangian"),
    ("nsgs", "node by node (Gauss-Seidel)"),
):
    points = []
    for tol in (1e-2, 1e-4, 1e-6, 1e-8):
        seconds = []
        for _ in range(3):  # the best of three
            begin = time.process_time()
            found = solve(problem, name, tol=tol, time_limit=3.0)
            seconds.append(time.process_time() - begin)
        points.append((min(seconds), max(found.residual, 1e-14)))
    ax.semilogy(*np.transpose(points), "o-", mfc="none", label=label)
ax.set(xlabel="CPU time [s]", ylabel="certificate [-]")
ax.legend(frameon=False, fontsize=8)

assert solve(problem, "augmented_lagrangian").solved
errors = [solve(problem, "penalty", factor=10.0**j).residual for j in (1, 2, 3)]
assert errors[0] > 5 * errors[1] > 25 * errors[2]

# %% [markdown]
# A chart like this one asks the right question: *how long does each method take to reach the same
# certificate?* Every point is the best of three runs on the machine that drew the figure. Small
# differences of time mean nothing. A fair comparison uses many problems, as `contactopt bench`
# does.
#
# ## What more friction does
#
# The slider changes the friction coefficient. The dashed curve is the friction bound $\mu p$, where
# $p$ is the pressure.


# %% tags=["hide-input"]
def with_friction(coefficient):
    answer = solve(InterfaceProblem(Q, problem.q, coefficient, V, s))
    pressure, shear = (answer.reactions / problem.areas[:, None]).T
    fig, ax = plt.subplots(figsize=(5.5, 3.2), layout="constrained")
    ax.plot(
        problem.coordinates[0],
        coefficient * pressure,
        "k--",
        lw=1,
        label=r"$\mu\, p$",
    )
    ax.plot(problem.coordinates[0], -shear, "C1.-", label="friction, inwards")
    ax.set(
        xlabel="x [mm]",
        ylabel="stress [MPa]",
        ylim=(-0.005, 0.06),
        title=rf"$\mu$ = {coefficient:.2f}",
    )
    ax.legend(frameon=False, loc="upper left")
    return fig


Slider(
    "friction coefficient [-]", np.linspace(0, 0.6, 9), with_friction, start=3
)

# %% [markdown]
# Where the two curves meet, the nodes slip. With more friction the slip zone shrinks towards the
# edge. In the end all nodes stick.

# %% [markdown]
# ## A load path: why $u_t$ is the slip of a step
#
# Friction opposes the *velocity* of the slip: $r_t = -\mu r_n\, v / |v|$ with $v = \dot u_t$, if $v
# \ne 0$. So far we wrote $u_t$ in its place. This needs a reason.
#
# Let the loads change so slowly that inertia does not matter. (This is called *quasistatic*.)
# Divide the load path into steps. At the end of the last step the tangential displacement was
# $u_t^{\text{old}}$. In the new step we replace the velocity by a difference:
#
# $$ v \approx \frac{u_t - u_t^{\text{old}}}{\Delta t} . $$
#
# Coulomb's law asks only whether $v$ is zero, and for its direction. The duration $\Delta t > 0$ has
# no influence on either, so it cancels. The law of the step is the law that we know, with the *slip of
# the step* $u_t - u_t^{\text{old}}$ in place of $u_t$. Since $u_t = (Q r + q)_t$, the slip of the step
# is
#
# $$ u_t - u_t^{\text{old}} \;=\; (Q\, r)_t + (q_t - u_t^{\text{old}}) . $$
#
# So *every step is the same problem with another $q$*: subtract from $q_t$ what has slipped before.
# The gap $u_n$ is not a difference, because contact has no memory. In the first step nothing has
# slipped yet, and $u_t$ is the slip. This is what all programs above assume. All forces are those at
# the end of the step. (This is the *implicit Euler method*.)
#
# One step is as good as many small ones if, at the end of the small ones, every closed contact has
# either not moved sideways at all, or is slipping in the direction in which it has moved in total.
# For these are the states that the law of the one step admits. Otherwise the path matters. It
# matters for contacts that slip back, that stick after they have slipped, and that have moved
# sideways before they touched. (An open contact has no friction, but $u_t^{\text{old}}$ contains
# its motion, too.) Here a node is pressed with 2 N, and pulled to the right, to the left and to the
# right again.


# %%
def along(path, mu=0.5):
    slipped, forces = 0.0, []
    for pull in path:
        step = InterfaceProblem(np.eye(2), [[-2.0, pull - slipped]], mu)
        forces.append(solve(step).reactions[0, 1])
        slipped = pull + forces[-1]  # u_t = Q r + q, since the beginning
    return forces


path = np.concatenate(
    [np.linspace(0, 3, 13), np.linspace(3, -3, 25), np.linspace(-3, 3, 25)]
)
frictions = along(path)
once, later = along([0.0])[0], frictions[25]  # both at the pull 0
print(f"at the pull 0: {once:.1f} N at first, {later:.1f} N on the way back")

assert np.isclose(path[25], 0) and abs(once) < 1e-9 and np.isclose(later, 1.0)
lost = np.trapezoid(-np.array(frictions[12:]), path[12:])
assert np.isclose(lost, 4 * 1.0 * (3.0 - 1.0), rtol=1e-3)

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(5.4, 3.4), layout="constrained")
ax.fill(path[12:], frictions[12:], color="C3", alpha=0.15, lw=0)
ax.plot(path, frictions, "C0.-", ms=4)
ax.plot(0, once, "ko")
ax.plot(0, later, "C3o")
ax.annotate("one step", (0, 0), (8, -12), textcoords="offset points")
ax.annotate(
    "same load, later", (0, later), (-25, 8), textcoords="offset points"
)
ax.text(-1.4, -0.55, "area: lost work", color="C3")
ax.set(xlabel="pull $q_t$ [mm]", ylabel="friction force $r_t$ [N]")
_ = ax.set(ylim=(-1.35, 1.35))

# %% [markdown]
# The load alone does not determine the friction force. The path matters, and each cycle costs
# work: this is *hysteresis*. contactopt follows such paths with bodies, too ([a load
# cycle](../tutorials/a_load_cycle.py)).
#
# ## What fails: no solution
#
# A rigid sledge stands on two runners and is pressed down with 100 N. Somebody pulls it sideways
# with 25 N. A rigid body has no compliance, so $Q = 0$. The forces on the two runners have to
# balance the load, and each of them has to lie in its friction cone. With $\mu = 0.2$ this is
# impossible: the sledge slides away, and there is no static solution. contactopt finds a proof of
# this, and says `infeasible`.
#
# | method | it fails if |
# |---|---|
# | Tresca's iteration | friction is strong: a small error grows from step to step (chapter 2) |
# | Newton on the states | the states repeat in a cycle, which happens for strong friction or a singular $Q$ |
# | cones with a shift | the coupling of normal and tangential directions is strong (chapter 2); there is no proof of convergence |
# | penalty | an exact answer is asked for: its error is proportional to $1 / \kappa$ |
# | any method | the load cannot be balanced: there is no solution |

# %%
motions = np.array(
    [[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]
)  # both runners move up, or sideways
pulled = np.array([-100.0, 25.0])  # N: the load in these two motions
for coefficient in (0.2, 0.3):
    sledge = InterfaceProblem(
        np.zeros((4, 4)), np.zeros((2, 2)), coefficient, motions, pulled
    )
    print(f"mu = {coefficient}: {solve(sledge).status}")

assert (
    str(
        solve(
            InterfaceProblem(
                np.zeros((4, 4)), np.zeros((2, 2)), 0.2, motions, pulled
            )
        ).status
    )
    == "infeasible"
)
assert solve(
    InterfaceProblem(np.zeros((4, 4)), np.zeros((2, 2)), 0.3, motions, pulled)
).solved

# %% [markdown]
# ## Exercises
#
# Replace `...` by your answer and run the cell. It says what is wrong with your answer in terms of
# mechanics. `hint("5.1")` gives a hint, three times, and then the solution. `table(5)` shows what
# you have done since the notebook was started.
#
# Give numbers with at least three digits: 0.1 percent is close enough. Counts are exact. Forces and
# displacements are graded by the certificate, which must be at most $10^{-3}$.
#
# **5.1** (Pen and paper.) A sledge is pressed down with 130 N and pulled with 23 N. What is the
# smallest friction coefficient with which it stands still?

# %% tags=["exercise"]
answer = ...  # friction coefficient [-]
check("5.1", answer)

# %% [markdown]
# **5.2** (Pen and paper.) The load of a sledge stands far in front, so that the front runner
# carries 82 N and the back runner 21 N. The front runner stands on ice, with $\mu = 0.06$. The back
# runner stands on stone, with $\mu = 0.45$. What is the largest pull that the sledge withstands?

# %% tags=["exercise"]
answer = ...  # largest pull [N]
check("5.2", answer)

# %% [markdown]
# **5.3** (Program.) How many nodes of the block slip if $\mu = 0.2$, and how many if $\mu = 0.1$?

# %% tags=["exercise"]
answer = (..., ...)  # slipping nodes with mu = 0.2, with mu = 0.1
check("5.3", answer)

# %% [markdown]
# **5.4** (Program.) Measure the factor by which the certificate of Tresca's iteration falls from
# one step to the next. (Run `solve(problem, "tresca", tol=1e-13)`. Its `history` has an entry for
# every step, with the certificate as `"residual"`.) Your factor is compared with the one that
# `diagnose` predicts, and may differ from it by 4 percent.

# %% tags=["exercise"]
answer = ...  # factor in one step [-]
check("5.4", answer)

# %% [markdown]
# **5.5** (Pen and paper.) Newton's method above looks at $y = r - \rho u$. The map of Alart and
# Curnier is $P = ([y_n]_+,$ the point of $|p_t| \le \mu [y_n]_+$ nearest to $y_t)$; at a solution
# $r = P$. Compute $P$ for $r = (2.3, -1.5)$ N, $u = (0.1, 0.3)$ mm, $\rho = 2$ N/mm and $\mu =
# 0.4$.

# %% tags=["exercise"]
answer = (..., ...)  # normal component, tangential component [N]
check("5.5", answer)

# %% [markdown]
# **5.6** (Think.) The map of De Saxcé projects $y = r - \rho\,(u + \mu |u_t|\, n)$ on the cone
# $|p_t| \le \mu p_n$. Compute it for the numbers of exercise 5.5.

# %% tags=["exercise"]
answer = (..., ...)  # normal component, tangential component [N]
check("5.6", answer)

# %% [markdown]
# **5.7** (Program.) Find the forces of the block for $\mu = 0.35$ with a method of your own choice,
# but not with `solve`. The certificate grades them.

# %% tags=["exercise"]
answer = ...  # 25 rows r_n, r_t [N]
check("5.7", answer)

# %% [markdown]
# **5.8** (Think.) A sledge on two runners is pressed down with 110 N and pulled along with 31 N.
# With $\mu = 0.26$ it slides. *Prove* it by a motion $(a, b)$, upwards and along the pull: no force
# of the friction cones does negative work on it, and the load does positive work.

# %% tags=["exercise"]
answer = (..., ...)  # up, along [-]
check("5.8", answer)

# %% [markdown]
# **5.9** (Think.) Coulomb's law in the plane is a *linear complementarity problem* (LCP). With $r_t
# = r_+ - r_-$ and $\sigma = |u_t|$, the unknowns $r_n, r_+, r_-, \sigma$ and the numbers $u_n,\;
# u_t + \sigma,\; \sigma - u_t,\; \mu r_n - r_+ - r_-$ are not negative, and the product of each
# pair is zero. Solve the LCP of the node of chapter 2, $Q = \begin{pmatrix} 1 & -1 \\ -1 & 2
# \end{pmatrix}$ mm/N and $q = (-3, 5)$ mm, for $\mu = 0.6$.

# %% tags=["exercise"]
answer = (..., ..., ..., ...)  # r_n [N], r_plus [N], r_minus [N], sigma [mm]
check("5.9", answer)

# %% [markdown]
# **5.10** (Pen and paper.) A node has $Q = \operatorname{diag}(1.4, 0.8)$ mm/N, $q_n = -2.1$ mm and
# $\mu = 0.4$. It is pulled to $q_t = 2$ mm, and then back to $q_t = 1.3$ mm. How large is the
# friction force at the end, with its sign?

# %% tags=["exercise"]
answer = ...  # friction force [N]
check("5.10", answer)

# %% [markdown]
# **5.11** (Program.) Pull the node of exercise 5.10 to and fro between $q_t = 2$ and $-2$ mm. How
# much work does friction take in a full cycle, after the first pull?

# %% tags=["exercise"]
answer = ...  # lost work [N mm]
check("5.11", answer)

# %%
table(5)

# %% [markdown]
# ## References
#
# - P. Alart, A. Curnier, A mixed formulation for frictional contact problems prone to Newton like
#   solution methods, *Comput. Methods Appl. Mech. Eng.* 92 (1991),
#   [doi:10.1016/0045-7825(91)90022-X](https://doi.org/10.1016/0045-7825(91)90022-X).
# - V. Acary, M. Brémond, O. Huber, On solving contact problems with Coulomb friction: formulations
#   and numerical comparisons, in: *Advanced Topics in Nonsmooth Dynamics*, Springer 2018,
#   [doi:10.1007/978-3-319-75972-2_10](https://doi.org/10.1007/978-3-319-75972-2_10).
#
# Next: [large problems in three dimensions](chapter_6_large_and_three_dimensional.py).

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

# %% [markdown]
# # 6. The derivative of a solution, and its kinks
#
# How does the contact force change if friction grows a little, or if the load does? Whoever fits a
# friction coefficient to measurements, or shapes a punch so that its pressure is even, needs the
# answer to this question. The solution of a contact problem is a function of its data, and this
# function has a derivative almost everywhere. In this tutorial we draw this function for one
# contact node. We compute its derivative by hand and by `contactopt.sensitivity`. We look at the
# points where it has no derivative, and see why it is a bad idea to smooth these points away.
#
# Reading time: 15 minutes. [Chapter 2](../course/chapter_2_friction_at_one_node.py) of the course
# explains the letters, and solves the problem of one node.

# %%
from dataclasses import replace
from importlib.util import find_spec

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

import contactopt
from contactopt import (
    InterfaceProblem,
    sensitivity,
    solve,
)

# %% [markdown]
# ## One node as a function of friction and load
#
# An elastic node would sink 1 mm into the floor and move 0.9 mm to the right if there were no
# contact. The floor answers with a normal force $r_n$ and a friction force $r_t$. We solve the
# problem for many friction coefficients $\mu$, and then for many horizontal loads $q_t$, and each
# time we also ask for the slope.

# %%
Q = np.array([[1.0, 0.4], [0.4, 1.2]])  # mm / N
q = np.array([-1.0, 0.9])  # mm


def solved(mu, load=q):
    problem = InterfaceProblem(Q, [load], mu)
    return problem, solve(problem, tol=1e-12)


fig, axes = plt.subplots(1, 2, figsize=(6.4, 3.2), layout="constrained")
frictions = np.linspace(0.0, 1.3, 53)
by_mu = np.array([solved(mu)[1].reactions[0] for mu in frictions])
loads = np.linspace(-2.5, 2.5, 101)
by_load = np.array(
    [solved(0.5, [-1.0, load])[1].reactions[0] for load in loads]
)
for ax, x, forces, label in (
    (axes[0], frictions, by_mu, "friction coefficient $\\mu$"),
    (axes[1], loads, by_load, "load $q_t$ [mm]"),
):
    ax.plot(x, forces[:, 0], "C1", label="$r_n$")
    ax.plot(x, forces[:, 1], "C0", label="$r_t$")
    ax.set(xlabel=label, ylabel="force [N]")
axes[0].axvline(5 / 6, color="0.7", lw=0.8)
axes[0].annotate("slips | sticks", (5 / 6, -0.35), ha="center")
for mu in (0.3, 0.6, 1.1):
    problem, solution = solved(mu)
    slope = sensitivity(problem, solution).forward(mu=1.0).reactions[0]
    step = np.array([-0.1, 0.1])
    for component in range(2):
        axes[0].plot(
            mu + step,
            solution.reactions[0, component] + step * slope[component],
            "k",
            lw=2.5,
        )
axes[0].plot([], [], "k", lw=2.5, label="slope from sensitivity")
axes[0].legend(frameon=False, loc="center left", bbox_to_anchor=(0.0, 0.62))
_ = axes[1].legend(frameon=False)

# %% [markdown]
# The curves consist of smooth pieces. In the left figure the node slips as long as $\mu$ is small.
# At $\mu = 5/6$ it begins to stick. From there on the friction coefficient has no influence any
# more. In the right figure there are three pieces: slip to the left, stick, and slip to the right.
# Inside a piece the solution is a smooth function. At the ends of a piece it has a **kink**: two
# slopes, one for each side.
#
# ## The derivative by hand
#
# While the node slips to the right, $r_t = -\mu\, r_n$ and the gap is closed:
#
# $$ Q_{nn} r_n - \mu\, Q_{nt} r_n + q_n = 0 \quad\Rightarrow\quad r_n = \frac{-q_n}{Q_{nn} - \mu\, Q_{nt}},
# \qquad \frac{dr_n}{d\mu} = \frac{Q_{nt}\, r_n}{Q_{nn} - \mu\, Q_{nt}} . $$
#
# For many contacts nobody wants to do this by hand. But the recipe is the same: **keep the state of
# every contact (open, stick or slip), and differentiate the equations that hold in this state.**
# Newton's method has these equations at hand. Its last step solved a linear system with the matrix
#
# $$ M = \begin{pmatrix} I - D + D\rho Q & D \rho V \\ V^\top & 0 \end{pmatrix} . $$
#
# Here $D$ says which contact is open ($D = 0$), sticks ($D = I$) or slips. The columns of $V$ are
# the motions of plates, which the one node does not have, and $\rho$ is a positive number. The
# *forward* derivative says how all results change with one parameter. It takes one more solve with
# $M$. The *adjoint* says how one result changes with all parameters. It takes one solve with
# $M^\top$.

# %%
mu = 0.5
problem, solution = solved(mu)
derivative = sensitivity(problem, solution)
r_n = solution.reactions[0, 0]
by_hand = Q[0, 1] * r_n / (Q[0, 0] - mu * Q[0, 1])

forward = derivative.forward(mu=1.0).reactions[0]
adjoint = derivative.adjoint(reactions=[[1.0, 0.0]])  # of the function r_n
print(
    f"dr_n/dmu: by hand {by_hand:.6f}, forward {forward[0]:.6f},"
    f" adjoint {adjoint.mu[0]:.6f}"
)
print(f"dr_n/dq = {adjoint.q[0]}, dr_n/dQ =\n{adjoint.Q}")

assert np.isclose(forward[0], by_hand) and np.isclose(adjoint.mu[0], by_hand)
assert np.isclose(
    forward[1], -r_n - mu * by_hand
)  # the product rule for r_t = -mu r_n
nudged = InterfaceProblem(np.add(Q, [[1e-6, 0.0], [0.0, 0.0]]), [q], mu)
assert np.isclose(
    (solve(nudged, tol=1e-13).reactions[0, 0] - r_n) / 1e-6,
    adjoint.Q[0, 0],
    rtol=1e-4,
)

# %% [markdown]
# ## At a kink
#
# At $\mu = 5/6$ the friction force is at its bound although the node does not move. Such a contact
# is called *weakly active*. Here the solution has no derivative, but it has one on each side.
# `sensitivity` names the contact, and `forward` gives the slope of the side to which the direction
# points. To find this slope, `forward` solves a small complementarity problem: does the contact
# stick or slip if we move this way?

# %%
problem, solution = solved(5 / 6)
kink = sensitivity(problem, solution)
print(kink.sentence)
more, less = (
    kink.forward(mu=1.0).reactions[0],
    kink.forward(mu=-1.0).reactions[0],
)
print(f"for more friction dr = {more}, for less friction dr = {less}")

assert not kink.differentiable and kink.weak[0].edge == "stick / slip"
assert np.allclose(more, 0.0)  # it sticks: the coefficient has no influence
assert less[0] < -0.5 and less[1] > 0.5
assert not np.allclose(
    more, -less
)  # a derivative would be linear in the direction

# %% [markdown]
# ## Bilevel programs, in words
#
# Suppose a sensor says that the node slips by 0.1 mm. Which $\mu$ is it? This is an optimisation
# problem (make the difference between slip and sensor small). Its constraint is again an
# optimisation problem, or at least a complementarity problem: the slip must be that of a solution.
# The outer problem is called the *leader*, which chooses $\mu$. The contact is the *follower*,
# which answers with a solution. There are three ways to write this.
#
# - If the follower minimises something, as contact without friction does, the whole problem is a
#   **bilevel program**.
# - The conditions of the follower, $u_n \ge 0$, $r_n \ge 0$, $u_n r_n = 0$ and so on, can be
#   written as constraints of the leader. Then the whole is a **mathematical program with
#   equilibrium constraints**, an MPEC. It is awkward for solvers of nonlinear programs. At *every*
#   feasible point the gradients of the active constraints are dependent: where $r_n > 0$, for
#   instance, $u_n \ge 0$ is active, and the gradient of $u_n r_n$ is $r_n$ times that of $u_n$. So
#   multipliers need not exist, and those that exist are not unique.
# - We take a third way. A contact solver answers for the follower, with a certificate, and we use
#   the derivative of its answer. This is called *implicit programming*. The leader then minimises a
#   function with kinks.
#
# Newton's method finds the $\mu$ of the sensor in a few steps, from the derivative of the solution:

# %%
sensor, mu = 0.1, 0.7
for _ in range(6):
    problem, solution = solved(mu)
    change = sensitivity(problem, solution).forward(mu=1.0)
    slip = problem.displacements(solution.reactions, solution.multipliers)[0, 1]
    mu -= (slip - sensor) / change.displacements[0, 1]
print(
    f"mu = {mu:.9f}, slip = {slip:.9f} mm, certificate {solution.residual:.1e}"
)

assert np.isclose(slip, sensor, rtol=1e-9)

# %% [markdown]
# From a first guess $\mu > 5/6$ this does not work. The node sticks, the derivative of the slip is
# zero, and no step is better than another. This is no fault of the method. *Data from a contact
# that sticks say nothing about the friction coefficient*, except that it is large enough.
# A fit notices this by the singular values of its Jacobian, the matrix of all derivatives.
#
# Two programs of the gallery use such derivatives: a calibration with confidence intervals, and
# the design of a punch with an even pressure.

# %%
problem, solution = solved(1.0)
assert sensitivity(problem, solution).forward(mu=1.0).displacements[0, 1] == 0.0

# %% [markdown]
# ## Why not smooth the kinks away?
#
# Many codes replace the kinks by round corners: $\max(y, 0)$ becomes $(y + \sqrt{y^2 +
# \varepsilon^2}) / 2$, and stick becomes creep, with a friction force $-\mu\, r_n\, u_t /
# \sqrt{u_t^2 + \varepsilon^2}$. Then everything has a derivative. But it is the derivative of
# another problem. We solve the round problem for a node that *sticks*, $\mu = 1$, and ask how much
# its slip depends on friction. The right answer is: not at all.


# %%
def rounded(mu, eps):
    """Newton's method on u_n = 0 and r_t = -mu r_n u_t / sqrt(u_t^2 + eps^2);
    eps goes down step by step.
    """
    r = np.array([1.5, -1.25])
    for size in np.geomspace(1.0, eps, 25):
        for _ in range(40):
            u = Q @ r + q
            root = np.sqrt(u[1] ** 2 + size**2)
            F = np.array([u[0], r[1] + mu * r[0] * u[1] / root])
            slope = mu * r[0] * size**2 / root**3
            r = r - np.linalg.solve(
                [
                    Q[0],
                    [mu * u[1] / root + slope * Q[1, 0], 1.0 + slope * Q[1, 1]],
                ],
                F,
            )
    return r


widths = np.array([1e-1, 3e-2, 1e-2, 3e-3, 1e-3])
slips = np.array([(Q @ rounded(1.0, eps) + q)[1] for eps in widths])
slopes = np.array(
    [
        (Q @ (rounded(1.01, eps) - rounded(0.99, eps)))[1] / 0.02
        for eps in widths
    ]
)
certificates = [
    contactopt.natural_map_residual(
        InterfaceProblem(Q, [q], 1.0), rounded(1.0, eps)[None]
    )
    for eps in widths
]

fig, ax = plt.subplots(figsize=(6, 3.8), layout="constrained")
ax.loglog(widths, slips, "o-", label="slip of a node that sticks [mm]")
ax.loglog(
    widths,
    -slopes,
    "s-",
    label="its derivative by $\\mu$, with the opposite sign [mm]",
)
ax.loglog(widths, certificates, "^-", label="certificate of the forces")
ax.set(xlabel="width of the round corner [mm]", ylabel="what should be zero")
ax.legend(frameon=False)

assert np.all(slips > 0) and np.all(slopes < 0)
assert min(certificates) > 1e-4  # no corner makes it a solution

# %% [markdown]
# Every answer of the rounded problem creeps, and its derivative says that more friction would help.
# A smaller $\varepsilon$ makes these errors smaller. But it makes Newton's method harder, because
# the round corner becomes a sharp one. The certificate tells the two laws apart: a solution of
# Coulomb's law passes it, and a solution of a smooth law does not. If we keep the kinks, we also
# know *which* contacts are at a kink, and what happens on each side of it.
#
# ## The convex case: derivatives of cone programs
#
# Contact without friction, and with associated friction, is a convex program. `diffcp`
# differentiates solutions of convex cone programs, and `cvxpy` and `cvxpylayers` build on it. The
# programs must be convex, so Coulomb's law is not among them. Where both apply they must agree.
# This cell is skipped if `diffcp` is not installed.

# %%
rng = np.random.default_rng(2)
A = rng.normal(size=(8, 8))
many = InterfaceProblem(
    A @ A.T / 8 + 0.3 * np.eye(8),
    0.5 * rng.normal(size=(4, 2)) - [0.8, 0.0],
    0.0,
)
answer = solve(many, tol=1e-12)
direction = rng.normal(size=4)
ours = (
    sensitivity(many, answer)
    .forward(q=np.stack([direction, 0 * direction], axis=1))
    .reactions[:, 0]
)
print(
    f"contacts that touch: {int((answer.reactions[:, 0] > 0).sum())} of 4;"
    f" ours: {np.round(ours, 6)}"
)

if find_spec("diffcp"):
    force, load = cp.Variable(4), cp.Parameter(4)
    load.value = many.q[:, 0]
    normal = cp.Problem(
        cp.Minimize(
            cp.sum_squares(np.linalg.cholesky(many.Q[::2, ::2]).T @ force) / 2
            + load @ force
        ),
        [force >= 0],
    )
    normal.solve(requires_grad=True, eps=1e-10)
    load.delta = direction
    normal.derivative()
    print(f"diffcp: {np.round(force.delta, 6)}")
    assert np.allclose(force.delta, ours, atol=1e-5)

t = 1e-6
there = replace(
    many, q=many.q + t * np.stack([direction, 0 * direction], axis=1)
)
assert np.allclose(
    (solve(there, tol=1e-13).reactions[:, 0] - answer.reactions[:, 0]) / t,
    ours,
    atol=1e-5,
)

# %% [markdown]
# ## Exercises
#
# **1.** At $q_n = 0$ and $q_t = 0.5$ mm the node just touches the floor. Between which two states
# does `sensitivity` see it? What are the two one-sided derivatives with respect to $q_n$?
#
# <details><summary>Solution</summary>
#
# The node is between open and closed. If it is lifted, it has no force. If it is pressed, it slips
# to the right, and the formula that we found by hand holds.
#
# ```python
# touching = InterfaceProblem(Q, [[0.0, 0.5]], 0.5)
# grazing = sensitivity(touching, solve(touching))
# assert [weak.edge for weak in grazing.weak] == ["open / closed"]
# assert np.allclose(grazing.forward(q=np.array([[1.0, 0.0]])).reactions, 0.0)
# pressed = grazing.forward(q=np.array([[-1.0, 0.0]])).reactions[0]
# assert np.allclose(pressed, np.array([1.0, -0.5]) / (Q[0, 0] - 0.5 * Q[0, 1]))
# ```
#
# </details>
#
# **2.** At the apex of the cone, $q = (0, 0)$, the node neither presses nor slips. Show that the
# one-sided derivative with respect to $q$ is not linear: the derivative along the sum of two
# directions is not the sum of the derivatives.
#
# <details><summary>Solution</summary>
#
# Close to the apex the problem looks the same in all scales, so the one-sided derivative along $d$
# is the solution of the problem with $q = d$ itself: a contact problem, not a linear map.
#
# ```python
# nothing = InterfaceProblem(Q, [[0.0, 0.0]], 0.5)
# apex = sensitivity(nothing, solve(nothing))
# one, two = np.array([[-1.0, 0.9]]), np.array([[-1.0, -2.0]])
# along = [apex.forward(q=d).reactions for d in (one, two, one + two)]
# assert not np.allclose(along[0] + along[1], along[2])
# for d, found in zip((one, two, one + two), along):
#     assert np.allclose(found, solve(InterfaceProblem(Q, d, 0.5)).reactions)
# ```
#
# </details>
#
# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

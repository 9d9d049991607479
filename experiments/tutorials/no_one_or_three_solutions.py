# %% [markdown]
# # 2. When friction has no solution, two or three
#
# A problem of elasticity has one solution if the bodies are supported, and so has contact without
# friction. With friction this
# need not be so. This tutorial shows problems with a single contact that have three solutions,
# exactly two, and none at all. It also shows a method that runs in circles although there is
# exactly one solution. And it shows the tools that find all this before you solve.
#
# Reading time: 10 minutes. [Chapter 2](../course/chapter_2_friction_at_one_node.py) of the course
# explains the letters. The pages of [the museum](../museum.md#one-node-one-solution-or-three) show
# the same with sliders.

# %%
from dataclasses import replace

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import (
    InterfaceProblem,
    Status,
    all_solutions,
    diagnose,
    models,
    solve,
)

# %% [markdown]
# ## One node, two springs
#
# An elastic node stands on a floor. The direction $n$ points up, $t$ points to the right, and the
# normal component comes first. The node hangs on springs with the stiffness matrix $K$. A load
# *pushes* it to the right and *presses* it down on the floor. The compliance is $Q = K^{-1}$, and
# without the floor the node would go to $q = Q\,(-\text{press},\ \text{push})$.

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(5, 3), layout="constrained")
ax.axhspan(-0.5, 0, color="0.8", lw=0)
ax.plot([-2.2, 2.4], [0, 0], "k", lw=1)
steps, side = (
    np.linspace(0, 1, 15),
    0.1 * np.array([0, 0, *[1, -1] * 5, 0, 0, 0]),
)
for start, end in (
    ((-1.9, 1.2), (-0.1, 0.15)),
    ((-0.6, 2.0), (-0.05, 0.2)),
):  # springs: one of them is oblique
    along = np.subtract(end, start)
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    ax.plot(
        *(np.outer(steps, along) + start + np.outer(side, across)).T,
        "C0",
        lw=1.5,
    )
    ax.plot(*start, "s", color="0.3")
ax.plot(0, 0.1, "o", ms=10, color="C0")
for tail, head, name, color, at in (
    ((0, 1.0), (0, 0.25), "press", "C1", (0.07, 0.75)),
    ((0.15, 0.1), (0.95, 0.1), "push", "C1", (0.6, 0.2)),
    ((1.5, 0), (1.5, 0.8), "$n$", "k", (1.58, 0.7)),
    ((1.5, 0), (2.3, 0), "$t$", "k", (2.2, 0.1)),
):
    ax.annotate(
        "",
        head,
        tail,
        arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.8},
    )
    ax.text(*at, name, color=color, fontsize=12)
ax.set(xlim=(-2.2, 2.4), ylim=(-0.5, 2.2), aspect="equal")
_ = ax.axis("off")

# %%
K = np.array([[4.0, -1.5], [-1.5, 1.0]])  # N / mm; normal component first


def node(push, press, mu):
    Q = np.linalg.inv(K)
    return InterfaceProblem(Q, [Q @ [-press, push]], mu)


problem = node(0.8, 1.0, mu=1.0)
print(problem.Q, problem.q)

# a push to the right also lifts the node: that is where the trouble comes from
assert problem.Q[0, 1] > 0

# %% [markdown]
# ## Three answers
#
# A contact can be open, stick, slip to the left, or slip to the right. `all_solutions` tries these
# states one after the other, until no combination is left. We push with 0.8 N, press with 1
# N, and take $\mu = 1$:

# %%
solutions = sorted(all_solutions(problem), key=lambda s: s.reactions[0, 0])
for s in solutions:
    (u_n, u_t), (r_n, r_t) = (
        problem.displacements(s.reactions, s.multipliers)[0] + 0.0,
        s.reactions[0],
    )
    print(
        f"gap {u_n:.3f}, slip {u_t:.3f}, normal force {r_n:.3f},"
        f" friction {r_t:.3f}, certificate {s.residual:.0e}"
    )

assert np.allclose(
    [s.reactions[0] for s in solutions], [[0.0, 0.0], [0.4, -0.4], [1.0, -0.8]]
)
assert all(s.residual < 1e-12 for s in solutions)

# %% [markdown]
# In the first solution the node is *open*. It moves to the right, and because of the coupling it
# lifts off. In the third solution it *sticks*. Friction holds it back. Therefore it does not lift
# off, it is pressed on the floor, and there is friction. In the second solution it *slips*, which
# lies between the two. All three obey every law exactly. Which one happens in reality depends on
# what happened before, and the data say nothing about that.
#
# Newton's method finds the solution near which it starts:

# %%
for s in solutions:
    nearby = replace(s, reactions=s.reactions + np.array([[0.001, -0.0003]]))
    again = solve(problem, "newton", start=nearby)
    assert again.solved and np.allclose(again.reactions, s.reactions)
print("from nothing:", solve(problem).reactions[0])

# %% [markdown]
# ## The threshold
#
# Vary $\mu$ and list all solutions each time.

# %%
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
points = [
    (mu, s.reactions[0])
    for mu in np.linspace(0.4, 1.6, 49)
    for s in all_solutions(node(0.8, 1.0, mu))
]
for label, color, chosen in (
    ("open", "C0", [(mu, r[0]) for mu, r in points if r[0] < 1e-6]),
    (
        "slip",
        "C1",
        [
            (mu, r[0])
            for mu, r in points
            if r[0] > 1e-6 and np.isclose(-r[1], mu * r[0], rtol=1e-6)
        ],
    ),
    (
        "stick",
        "C2",
        [
            (mu, r[0])
            for mu, r in points
            if r[0] > 1e-6 and -r[1] < mu * r[0] * (1 - 1e-6)
        ],
    ),
):
    ax.plot(*np.transpose(chosen), "o", ms=3, color=color, label=label)
ax.axvline(2 / 3, color="grey", lw=1, ls="--")
ax.text(
    2 / 3 - 0.01, 0.6, "one solution\nfor every load", color="grey", ha="right"
)
ax.set(xlabel=r"friction coefficient $\mu$ [-]", ylabel="normal force [N]")
ax.legend(frameon=False)

count = {
    mu: len(all_solutions(node(0.8, 1.0, mu))) for mu in (0.6, 0.7, 0.8, 0.9)
}
print(count)
assert count == {0.6: 1, 0.7: 1, 0.8: 2, 0.9: 3}

# %% [markdown]
# At $\mu = 0.8$ there are *exactly two* solutions: in one of them the node is open, and in the
# other it sticks with all the friction that there is. For a larger $\mu$ this solution splits into
# two, one with stick and one with slip. Such a border case is an exception. For all data but
# exceptional ones the number of solutions is *odd*, as long as $Q$ is positive definite and no body
# is free to move, because solutions appear and disappear in pairs. Loads drawn at random show this.

# %%
random = np.random.default_rng(0)
numbers = [
    len(all_solutions(node(*random.normal(size=2), mu=1.0))) for _ in range(200)
]
print(
    "solutions for 200 random loads:",
    {n: numbers.count(n) for n in sorted(set(numbers))},
)

assert set(numbers) == {1, 3}

# %% [markdown]
# For other loads the pair appears at another $\mu$. Below which $\mu$ is there one solution
# *whatever the load*? For one contact the answer is known exactly ([proof](../museum.md#one-node-one-solution-or-three)):
# $\mu^* = K_{tt} / |K_{tn}| = 2/3$. `diagnose` finds it without knowing the load.

# %%
print(diagnose(problem))

assert diagnose(problem).exact
assert np.isclose(diagnose(problem).guaranteed.unique, K[1, 1] / abs(K[0, 1]))

angles = np.linspace(40, 70, 61)
loads = np.column_stack(
    [np.cos(np.radians(angles)), np.sin(np.radians(angles))]
)
fig, ax = plt.subplots(figsize=(6.4, 3), layout="constrained")
for mu in (0.6, 0.7, 1.0):
    number = [len(all_solutions(node(*load, mu))) for load in loads]
    ax.step(angles, number, where="mid", label=rf"$\mu$ = {mu}")
    assert max(number) == (1 if mu < 2 / 3 else 3)
ax.set(
    xlabel="direction of the load [degrees from horizontal]",
    ylabel="number of solutions [-]",
    yticks=[1, 2, 3],
)
_ = ax.legend(frameon=False)

# %% [markdown]
# Just above the threshold only loads in a narrow sector have three solutions. With more friction
# the sector becomes wider.
#
# For many contacts no such formula is known; for two there is [a sharp threshold](../museum.md#two-nodes-the-sharp-threshold). `diagnose` then gives two bounds: a coefficient below
# which the solution is *guaranteed* to be unique for every load, and a coefficient at which some
# load has several. Between the two bounds `diagnose` makes no statement. If a plate can move along
# the surface, nothing is guaranteed, and the first bound is zero.
#
# ## One solution, and a method that runs in circles
#
# Now pull the node to the left with 10 N and press it down with 1 N. There is one solution for $\mu
# = 1$, but the Tresca iteration does not find it.

# %%
pulled = node(-10.0, 1.0, mu=1.0)
(only,) = all_solutions(pulled)
stuck_in_a_loop = solve(pulled, "tresca")
print(f"{stuck_in_a_loop.status}: {stuck_in_a_loop.status.sentence}")

assert np.allclose(only.reactions, [[6.4, 6.4]])
assert stuck_in_a_loop.status is Status.CYCLING

# %% [markdown]
# A drawing shows why. For a given friction bound $g$ one quadratic program yields the normal force
# $r_n(g)$, and the next bound is $\mu\, r_n(g)$. A solution is a point where this curve meets the
# diagonal. The iteration goes vertically to the curve, then horizontally to the diagonal, and so
# on. If the curve falls by more than one per unit, the path spirals outwards.

# %%
fig, axes = plt.subplots(
    1, 2, figsize=(6.4, 3.6), layout="constrained", sharey=True
)
bounds = np.linspace(0, 16, 33)
for ax, mu in zip(axes, (0.6, 1.0)):
    program = models.tresca(node(-10.0, 1.0, mu))

    def next_bound(g, program=program, mu=mu):
        program.parameters["g"].value = np.array([g])
        program.problem.solve(solver=cp.CLARABEL)
        return mu * max(float(program.variables["r"].value[0]), 0.0)

    ax.plot(
        bounds,
        [next_bound(g) for g in bounds],
        "C0",
        label=r"next bound, $\mu\, r_n(g)$",
    )
    ax.plot(bounds, bounds, "k--", lw=1, label="diagonal")
    g, path = 4.0, []
    for _ in range(12):
        following = next_bound(g)
        path += [
            (g, g if not path else path[-1][1]),
            (g, following),
            (following, following),
        ]
        g = following
    ax.plot(*np.transpose(path), "C1", lw=1, label="Tresca iteration")
    ax.set(
        xlabel="friction bound g [N]",
        title=rf"$\mu$ = {mu}",
        aspect="equal",
        xlim=(0, 16),
        ylim=(0, 16),
    )
axes[0].set_ylabel("next friction bound [N]")
axes[1].set_ylabel("next friction bound [N]")
axes[0].legend(frameon=False)

assert solve(node(-10.0, 1.0, 0.6), "tresca").solved
assert np.isclose(
    max(y for _, y in path), 14.5, atol=0.1
)  # the cycle runs between 1 and 14.5

# %% [markdown]
# At this solution the node slips to the left, and the slope of the curve is $-\mu / \mu^*$. So the
# same number 2/3 decides: below it the iteration converges, and above it the iteration runs in
# circles. But mind the sign. At a slope of $-1$ the *iteration* stops converging. At a slope of
# $+1$ the solution stops being *unique*, and this needs a node that slips to the right. Here the
# slope is negative, so the solution is unique, and only the method fails
# ([cobwebs to try](../museum.md#two-iterations-as-cobwebs)). There are two remedies:
# half steps, or another method.

# %%
half_steps = solve(pulled, "tresca", relaxation=0.5)
newton = solve(pulled, "newton")
print(
    f"half steps: {half_steps.iterations} iterations;"
    f" Newton: {newton.iterations}"
)

for remedy in (half_steps, newton):
    assert remedy.solved and np.allclose(
        remedy.reactions, only.reactions, atol=1e-5
    )

# %% [markdown]
# ## No solution
#
# If $Q$ is positive definite and no body is free to move, there is always a solution. So let $Q$ be
# singular, and consider a
# piston in a rigid guide at 45 degrees. It can move up and to the right at the same time, or down
# and to the left, and in no other way: $Q = m m'$ with $m = (1, 1)$. The floor below it rises by 1
# mm, so that $q = (-1, 0)$. The piston has to give way and moves up in its guide. So it slips over
# the floor to the right, and friction pulls it to the left, back down: $r_t = -\mu r_n$. The force
# that moves it up the guide is
#
# $$ m \cdot r = r_n + r_t = (1 - \mu)\, r_n . $$
#
# This force has to be 1 N, so $r_n = 1 / (1 - \mu)$. As $\mu$ approaches one, the normal force
# grows without bound. For $\mu \ge 1$ no force moves the piston: it *jams*.

# %%
m = np.array([1.0, 1.0])


def piston(mu, give=0.0):
    return InterfaceProblem(
        np.outer(m, m) + give * np.eye(2), [[-1.0, 0.0]], mu
    )


assert np.allclose(solve(piston(0.5)).reactions, [[2.0, -1.0]])
assert np.allclose(solve(piston(0.9)).reactions, [[10.0, -9.0]])
jammed = solve(piston(2.0), max_iterations=100)
print(f"mu = 2: {jammed.status}, certificate {jammed.residual:.2f}")
assert not jammed.solved and jammed.residual > 0.1

# %% [markdown]
# No method finds a solution that does not exist, and the certificate shows this. The model is at
# fault, because nothing is perfectly rigid. Let the guide give way a little, with the compliance
# $\varepsilon$. Now $Q$ is positive definite, nothing is free to move, and a solution exists. For $\mu = 2$ the piston
# sticks: it is wedged in the guide with a force of about $1 / (2 \varepsilon)$.

# %%
gives = np.logspace(-4, 0, 17)
fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for mu in (0.5, 0.9, 2.0):
    force = [solve(piston(mu, give)).reactions[0, 0] for give in gives]
    ax.loglog(gives, force, "o-", ms=3, label=rf"$\mu$ = {mu}")
ax.set(
    xlabel=r"compliance of the guide $\varepsilon$ [mm/N]",
    ylabel="normal force [N]",
)
ax.legend(frameon=False)

assert np.isclose(force[0], 1 / (2 * gives[0]), rtol=0.01)
assert len(all_solutions(piston(2.0, give=1e-2))) == 1

# %% [markdown]
# A positive definite $Q$ is not enough if something can move freely. Let a node with $Q = I$ hang on
# a slide that runs along the floor, and pull the slide with 0.5 N. In our letters $V = (0, 1)'$ and
# $s = 0.5$, so that the balance $V' r + s = 0$ asks for $r_t = -0.5$ N. With $\mu = 0.3$ the cone
# then asks for $r_n \ge 1.67$ N. But the node overlaps the floor by 1 mm only, $q = (-1, 0)$. The
# gap would be $u_n = r_n - 1 \ge 0.67$ mm, and an open contact carries no force. The cone contains
# forces that hold the slide; the contact cannot make them ([the same with
# sliders](../museum.md#a-plate-that-friction-cannot-hold)).

# %%
dragged = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.3, [[0.0], [1.0]], [0.5])
answer = solve(dragged)
print(f"slide: {answer.status}, certificate {answer.residual:.2f}")

assert not answer.solved and answer.residual > 0.1
held = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.6, [[0.0], [1.0]], [0.5])
assert np.allclose(
    solve(held).reactions, [[1.0, -0.5]]
)  # with more friction there is a solution

# %% [markdown]
# ## Exercises
#
# **1.** Put two copies of the first node side by side, without coupling. How many solutions are
# there? And with three copies?
#
# <details><summary>Solution</summary>
#
# Every copy has its own three solutions, so there are $3^2 = 9$ and $3^3 = 27$. The number of
# solutions can grow exponentially with the number of contacts.
#
# ```python
# for copies in (2, 3):
#     Q = np.kron(np.eye(copies), problem.Q)
#     q = np.tile(problem.q, (copies, 1))
#     many = all_solutions(InterfaceProblem(Q, q, 1.0))
#     assert len(many) == 3**copies
# ```
#
# </details>
#
# **2.** Pull with 10 N and press with 1 N. Does the alternating iteration fail at the same
# coefficient as Tresca's? Between which points does it cycle for $\mu = 1$?
#
# <details><summary>Solution</summary>
#
# For one contact it does. It cycles between two points that differ from those of Tresca's
# iteration.
#
# ```python
# def alternating(problem, steps):
#     return solve(problem, "alternating", max_iterations=steps)
#
# assert alternating(node(-10.0, 1.0, 0.66), 5000).solved
# assert not alternating(node(-10.0, 1.0, 0.67), 5000).solved
# seen = {round(alternating(pulled, n).reactions[0, 0], 4) for n in (200, 201)}
# assert np.allclose(sorted(seen), [5.1186, 8.3221], atol=1e-3)
# assert solve(pulled, "alternating", relaxation=0.5).solved
# ```
#
# </details>
#
# **3.** Make $K$ diagonal. How many solutions are there, for which $\mu$?
#
# <details><summary>Solution</summary>
#
# There is one solution for every $\mu$, because without coupling friction does not change the
# normal force. The threshold is infinite.
#
# ```python
# uncoupled = InterfaceProblem(np.diag([0.25, 1.0]), [[-1.0, 5.0]], 100.0)
# assert len(all_solutions(uncoupled)) == 1
# assert np.isinf(diagnose(uncoupled).guaranteed.unique)
# ```
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

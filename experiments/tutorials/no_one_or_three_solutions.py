# %% [markdown]
# # 5. When friction has no solution, two or three
#
# Elasticity has one solution. Contact without friction has one solution. Friction need not. This tutorial shows
# problems of a single contact that have three solutions, exactly two, and none at all; a method that runs in circles
# although there is exactly one; and the tools that tell beforehand.
#
# Reading time: 10 minutes. [Tutorial 1](one_contact_node.py) explains the letters.

# %%
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, Status, all_solutions, diagnose, models, solve

# %% [markdown]
# ## One node, two springs
#
# The elastic node has the stiffness $K$. In $K$ the order of the components is (tangential, normal), as one would write
# a finite element matrix. A load $f$ presses the node *down* on a floor by $f_n$ and pushes it *to the right* by $f_t$.
#
# The project's convention is normal first, $n$ up, $r$ the force on the upper body. We choose $t$ to the left. So we
# swap the components, and both displacements change sign. The compliance is $Q = K^{-1}$, and without contact the node
# goes to $q$.

# %%
K = np.array([[1.0, 1.5], [1.5, 4.0]])  # N / mm


def node(f_t, f_n, mu):
    right, down = np.linalg.solve(K, [f_t, f_n])
    Q = np.linalg.inv(K)[::-1, ::-1]
    return InterfaceProblem(Q, [[-down, -right]], mu)


problem = node(0.8, 1.0, mu=1.0)
print(problem.Q, problem.q)

assert problem.Q[0, 1] < 0  # what lifts the node also moves it to the right: that is where the trouble comes from

# %% [markdown]
# ## Three answers
#
# `all_solutions` sorts every contact into open, stick, slip to the left or to the right, by a mixed-integer program,
# until no combination is left. For the load $f = (0.8, 1)$ and $\mu = 1$:

# %%
solutions = sorted(all_solutions(problem), key=lambda s: s.reactions[0, 0])
for s in solutions:
    (u_n, u_t), (r_n, r_t) = problem.displacements(s.reactions, s.multipliers)[0] + 0.0, s.reactions[0]
    print(f"gap {u_n:.3f}, slip {u_t:.3f}, normal force {r_n:.3f}, friction {r_t:.3f}, certificate {s.residual:.0e}")

assert np.allclose([s.reactions[0] for s in solutions], [[0.0, 0.0], [0.4, 0.4], [1.0, 0.8]])
assert all(s.residual < 1e-12 for s in solutions)

# %% [markdown]
# *Open:* the node moves to the right, and because of the coupling it lifts off. *Stick:* friction holds it back, so it
# does not lift off, so it is pressed down, so there is friction. *Slip:* something in between. All three obey every law
# exactly. Which one happens depends on the history, and that is not in the data.
#
# Which one does a method find? The one it starts near:

# %%
for s in solutions:
    again = solve(problem, "newton", start=s)
    assert again.solved and np.allclose(again.reactions, s.reactions)
print("from nothing:", solve(problem).reactions[0])

# %% [markdown]
# ## The threshold
#
# Vary $\mu$ and list all solutions each time.

# %%
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
points = [(mu, s.reactions[0]) for mu in np.linspace(0.4, 1.6, 49) for s in all_solutions(node(0.8, 1.0, mu))]
for label, color, chosen in (
    ("open", "C0", [(mu, r[0]) for mu, r in points if r[0] < 1e-6]),
    ("slip", "C1", [(mu, r[0]) for mu, r in points if r[0] > 1e-6 and np.isclose(r[1], mu * r[0], rtol=1e-6)]),
    ("stick", "C2", [(mu, r[0]) for mu, r in points if r[0] > 1e-6 and r[1] < mu * r[0] * (1 - 1e-6)]),
):
    ax.plot(*np.transpose(chosen), "o", ms=3, color=color, label=label)
ax.axvline(2 / 3, color="grey", lw=1, ls="--")
ax.text(2 / 3 - 0.01, 0.6, "one solution\nfor every load", color="grey", ha="right")
ax.set(xlabel=r"friction coefficient $\mu$ [-]", ylabel="normal force [N]")
ax.legend(frameon=False)

count = {mu: len(all_solutions(node(0.8, 1.0, mu))) for mu in (0.6, 0.7, 0.8, 0.9)}
print(count)
assert count == {0.6: 1, 0.7: 1, 0.8: 2, 0.9: 3}

# %% [markdown]
# At $\mu = 0.8$ there are *exactly two*: sticking with all the friction there is, and open. That is the birth of the
# pair stick and slip. Two solutions are always such a border case; one, three, five are the rule.
#
# For other loads the pair is born elsewhere. Below which $\mu$ is there one solution *whatever the load*? For one
# contact the answer is exact, $\mu^* = K_{tt} / |K_{tn}| = 2/3$, and `diagnose` knows it without looking at the load.

# %%
print(diagnose(problem))

assert diagnose(problem).exact
assert np.isclose(diagnose(problem).guaranteed.unique, K[0, 0] / abs(K[0, 1]))

angles = np.linspace(40, 70, 61)
loads = np.column_stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))])
fig, ax = plt.subplots(figsize=(6.4, 3), layout="constrained")
for mu in (0.6, 0.7, 1.0):
    number = [len(all_solutions(node(*f, mu))) for f in loads]
    ax.step(angles, number, where="mid", label=rf"$\mu$ = {mu}")
    assert max(number) == (1 if mu < 2 / 3 else 3)
ax.set(xlabel="direction of the load [degrees from horizontal]", ylabel="number of solutions [-]", yticks=[1, 2, 3])
ax.legend(frameon=False)

# %% [markdown]
# Just above the threshold the trouble sits in a narrow sector of loads; with more friction it opens up.
#
# For many contacts no such formula is known. `diagnose` then gives two bounds: a coefficient below which
# uniqueness is *guaranteed* for every load, and one at which some load *spoils* it. Between them nobody knows.
#
# ## One solution, and a method that runs in circles
#
# Now pull the node hard the other way, $f = (-10, 1)$. There is one solution for $\mu = 1$, but the Tresca iteration
# never finds it.

# %%
pulled = node(-10.0, 1.0, mu=1.0)
(only,) = all_solutions(pulled)
stuck_in_a_loop = solve(pulled, "tresca")
print(f"{stuck_in_a_loop.status}: {stuck_in_a_loop.status.sentence}")

assert np.allclose(only.reactions, [[6.4, -6.4]])
assert stuck_in_a_loop.status is Status.CYCLING

# %% [markdown]
# Draw it. With the friction bound $g$ given, one QP yields the normal force $r_n(g)$, and the next bound is
# $\mu\, r_n(g)$. A solution is where this curve meets the diagonal. The iteration goes up to the curve, across to the
# diagonal, up to the curve. If the curve is steeper than one, it spirals outwards.

# %%
fig, axes = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained", sharey=True)
bounds = np.linspace(0, 16, 33)
for ax, mu in zip(axes, (0.6, 1.0)):
    program = models.tresca(node(-10.0, 1.0, mu))

    def next_bound(g, program=program, mu=mu):
        program.parameters["g"].value = np.array([g])
        program.problem.solve(solver=cp.CLARABEL)
        return mu * max(float(program.variables["r"].value[0]), 0.0)

    ax.plot(bounds, [next_bound(g) for g in bounds], "C0", label=r"next bound, $\mu\, r_n(g)$")
    ax.plot(bounds, bounds, "k--", lw=1, label="diagonal")
    g, path = 4.0, []
    for _ in range(12):
        following = next_bound(g)
        path += [(g, g if not path else path[-1][1]), (g, following), (following, following)]
        g = following
    ax.plot(*np.transpose(path), "C1", lw=1, label="Tresca iteration")
    ax.set(xlabel="friction bound g [N]", title=rf"$\mu$ = {mu}", aspect="equal", xlim=(0, 16), ylim=(0, 16))
axes[0].set_ylabel("next friction bound [N]")
axes[1].set_ylabel("next friction bound [N]")
axes[0].legend(frameon=False)

assert solve(node(-10.0, 1.0, 0.6), "tresca").solved
assert np.isclose(max(y for _, y in path), 14.5, atol=0.1)  # the cycle runs between 1 and 14.5

# %% [markdown]
# The curve's slope at the solution is $-\mu / \mu^*$, so the same number $2/3$ decides: contraction below, circles
# above. But mind the sign. A slope of $-1$ ruins the *iteration*; a slope of $+1$ ruins *uniqueness*. Here the slope is
# negative: the answer is unique and only the method is to blame. Two remedies: take half steps, or take another method.

# %%
half_steps = solve(pulled, "tresca", relaxation=0.5)
newton = solve(pulled, "newton")
print(f"half steps: {half_steps.iterations} iterations; Newton: {newton.iterations}")

for remedy in (half_steps, newton):
    assert remedy.solved and np.allclose(remedy.reactions, only.reactions, atol=1e-5)

# %% [markdown]
# ## No solution
#
# If $Q$ is positive definite there is always a solution. So let it be singular: a piston in a rigid guide at 45
# degrees. It can move up and right, or down and left, and nowhere else: $Q = m m'$ with $m = (1, 1)$. The floor below
# rises by 1 mm, $q = (-1, 0)$. The piston must give way, up the guide. So it slips over the floor to the right, and
# friction pulls it to the left, back down: $r_t = -\mu r_n$. What pushes it up the guide is
#
# $$ m \cdot r = r_n + r_t = (1 - \mu)\, r_n . $$
#
# It must be 1 N. So $r_n = 1 / (1 - \mu)$. At $\mu = 1$ the force is infinite. Beyond, there is no force at all: the
# piston *jams*.

# %%
m = np.array([1.0, 1.0])


def piston(mu, give=0.0):
    return InterfaceProblem(np.outer(m, m) + give * np.eye(2), [[-1.0, 0.0]], mu)


assert np.allclose(solve(piston(0.5)).reactions, [[2.0, -1.0]])
assert np.allclose(solve(piston(0.9)).reactions, [[10.0, -9.0]])
jammed = solve(piston(2.0), max_iterations=100)
print(f"mu = 2: {jammed.status}, certificate {jammed.residual:.2f}")
assert not jammed.solved and jammed.residual > 0.1

# %% [markdown]
# No method finds what does not exist, and the certificate says so. The model is at fault: nothing is rigid. Let the
# guide give a little, by $\varepsilon$. Now $Q$ is positive definite, a solution exists, and the piston sticks, wedged
# in with a force of about $1 / (2 \varepsilon)$.

# %%
gives = np.logspace(-4, 0, 17)
fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for mu in (0.5, 0.9, 2.0):
    force = [solve(piston(mu, give)).reactions[0, 0] for give in gives]
    ax.loglog(gives, force, "o-", ms=3, label=rf"$\mu$ = {mu}")
ax.set(xlabel=r"give of the guide $\varepsilon$ [mm/N]", ylabel="normal force [N]")
ax.legend(frameon=False)

assert np.isclose(force[0], 1 / (2 * gives[0]), rtol=0.01)
assert len(all_solutions(piston(2.0, give=1e-2))) == 1

# %% [markdown]
# ## Exercises
#
# **1.** Put two copies of the first node side by side, without coupling. How many solutions? And three copies?
#
# <details><summary>Solution</summary>
#
# Every copy chooses for itself: $3^2 = 9$, $3^3 = 27$. The number of solutions can grow exponentially.
#
# ```python
# for copies in (2, 3):
#     Q = np.kron(np.eye(copies), problem.Q)
#     many = all_solutions(InterfaceProblem(Q, np.tile(problem.q, (copies, 1)), 1.0))
#     assert len(many) == 3**copies
# ```
#
# </details>
#
# **2.** Does the alternating iteration fail at the same coefficient? Where does it cycle for $f = (-10, 1)$, $\mu = 1$?
#
# <details><summary>Solution</summary>
#
# For one contact, yes. It cycles between two other points.
#
# ```python
# assert solve(node(-10.0, 1.0, 0.66), "alternating", max_iterations=5000).solved
# assert not solve(node(-10.0, 1.0, 0.67), "alternating", max_iterations=5000).solved
# seen = {round(solve(pulled, "alternating", max_iterations=n).reactions[0, 0], 4) for n in (200, 201)}
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
# One, for every $\mu$: without coupling friction does not change the normal force. The threshold is infinite.
#
# ```python
# uncoupled = InterfaceProblem(np.diag([0.25, 1.0]), [[-1.0, 5.0]], 100.0)
# assert len(all_solutions(uncoupled)) == 1
# assert np.isinf(diagnose(uncoupled).guaranteed.unique)
# ```
#
# </details>

# %% [markdown]
# # 4. Four roads to one answer
#
# A solution of Coulomb's problem is not the minimum of an energy. So every method replaces this
# problem, again and again, by another one that can be solved. In this tutorial we give the same
# problem to four methods: the alternating iteration, Tresca's iteration, Newton's method and the
# convex relaxation. The first three arrive at the same answer on different roads. The fourth needs
# one step only, but arrives at the answer to another problem.
#
# Reading time: 10 minutes. [Tutorial 1](one_contact_node.py) has the programs for one node.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contactopt import diagnose, natural_map_residual, reduce, scenes, solve

# %% [markdown]
# ## The problem
#
# A block, 40 mm wide and 40 mm high, is pressed on a foundation of the same rubber with 100 N. It
# is symmetric, so we model its right half. The normal $n$ points up, out of the foundation. The
# tangent $t$ points to the right, which is outwards. $r$ is the force on the block. Under the load
# the lower edge of the block moves outwards, and the surface of the foundation is drawn inwards.
# Friction resists the difference. With $\mu = 0.2$
# about half of the nodes slip.

# %%
problem = reduce(scenes.flat_punch(2, mu=0.2, elements=32))
answers, tol = {}, 1e-10
for method in ("alternating", "tresca", "newton", "relaxation"):
    answers[method] = solve(problem, method, tol=tol)
    answer = answers[method]
    print(
        f"{method:12} {answer.status!s:8} {answer.iterations:2} iterations, certificate {answer.residual:.0e}"
    )

r = answers["newton"].reactions
slips = np.abs(r[:, 1]) > (1 - 1e-9) * 0.2 * r[:, 0]

assert np.isclose(r[:, 0].sum(), 100.0)
assert 0.4 * problem.contacts < slips.sum() < 0.6 * problem.contacts
for method in ("alternating", "tresca"):
    assert answers[method].solved
    assert np.allclose(answers[method].reactions, r, atol=1e-7 * r.max())

# %% [markdown]
# Three of the methods have found the same answer. Their forces differ by less than $10^{-7}$ of the
# largest one.
#
# ## The roads
#
# | method | what it holds fixed | what it solves in each iteration |
# |---|---|---|
# | alternating | the friction forces, then the normal forces | two quadratic programs (QPs), one for the normal and one for the friction forces |
# | Tresca | the friction bounds $g = \mu r_n$ | one QP in all forces |
# | Newton | which nodes are open, stick or slip | one linear system |
#
# We draw the certificate against the number of the iteration.

# %%
fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for method, style in (("alternating", "o-"), ("tresca", "s-"), ("newton", "D-")):
    exact = solve(problem, method, tol=1e-13)
    residuals = [entry["residual"] for entry in exact.history]
    ax.semilogy(range(1, len(residuals) + 1), residuals, style, mfc="none", label=method)
    answers[method] = exact
ax.set(xlabel="iteration [-]", ylabel="certificate: natural-map residual [-]")
_ = ax.legend(frameon=False)

# %% [markdown]
# The two fixed-point iterations go down a straight line, because every iteration multiplies the
# error by the same number. Newton's method looks slow at first, because it has to find out which
# nodes slip. As soon as it knows, the equations are linear, and the next step is exact.
#
# Can we know the slope of the straight lines beforehand? Near the solution the iteration is a
# linear map. Change the normal forces a little; the friction forces of the slipping nodes change,
# and in turn the normal forces change. Each of the two iterations has its own map of this kind. The
# largest modulus of its eigenvalues is the factor. `diagnose` computes both. (The maps exist where no
# node is between two states.)

# %%
local = diagnose(problem, answers["newton"]).local
print(f"predicted: alternating {local.alternating_rate:.4f}, tresca {local.tresca_rate:.4f}")
for method, rate in (("alternating", local.alternating_rate), ("tresca", local.tresca_rate)):
    residuals = np.array([entry["residual"] for entry in answers[method].history])
    measured = (residuals[9] / residuals[5]) ** (1 / 4)
    print(f"measured:  {method} {measured:.4f}")
    assert np.isclose(measured, rate, rtol=0.02)

assert answers["newton"].history[-1]["residual"] < 1e-8 * answers["newton"].history[-2]["residual"]
assert local.slip == slips.sum()

# %% [markdown]
# The factors are small, because friction couples only weakly to the normal forces here. The factor
# grows with $\mu$. If it is one or more at a solution, the iteration does not converge to that
# solution. [Tutorial 5](no_one_or_three_solutions.py) shows this case.
#
# Now we follow one slipping node on its way. `solve` with `max_iterations=j` returns the state of a
# method after $j$ iterations. As in tutorial 1, the friction force is drawn to the right and the
# normal force upwards.

# %%
node = np.flatnonzero(slips)[-8]
fig, ax = plt.subplots(figsize=(6, 4.4), layout="constrained")
for method, style in (("alternating", "o-"), ("tresca", "s-"), ("newton", "D-")):
    road = [
        solve(problem, method, tol=1e-13, max_iterations=j).reactions[node] for j in range(1, 8)
    ]
    normal, tangential = np.transpose(road)
    ax.plot(tangential, normal, style, mfc="none", label=method)
normal = np.array([0.97, 1.03]) * r[node, 0]
ax.plot(
    np.sign(r[node, 1]) * 0.2 * normal,
    normal,
    "k--",
    lw=1,
    label=r"edge of the cone, $|r_t| = \mu\, r_n$",
)
ax.plot(r[node, 1], r[node, 0], "k*", ms=12, label="solution")
ax.set(xlabel="friction force $r_t$ [N]", ylabel="normal force $r_n$ [N]")
_ = ax.legend(frameon=False)

# %% [markdown]
# ## The fourth road
#
# The *convex relaxation* minimises the energy over all cones at once, $\min \tfrac12 r'Qr + q'r$
# with $|r_t| \le \mu r_n$. It is one convex program without any iteration around it. Its
# certificate, printed above, is about $2 \cdot 10^{-2}$, while those of the other methods are below
# $10^{-10}$. This is not a rounding error. The relaxation has solved its own problem exactly, but
# that problem is another one: *associated friction*. In this law a contact that slips also opens,
# by $u_n = \mu |u_t|$.

# %%
relaxed = answers["relaxation"]
u = problem.displacements(r, answers["newton"].multipliers)
u_relaxed = problem.displacements(relaxed.reactions, relaxed.multipliers)

x = problem.coordinates[0]
fig, (left, right) = plt.subplots(1, 2, figsize=(6.4, 3.2), layout="constrained")
for label, forces, style in (("Coulomb", r, "C0-"), ("associated", relaxed.reactions, "C1--")):
    left.plot(x, -forces[:, 1] / problem.areas, style, label=label)
left.set(xlabel="x [mm]", ylabel="friction on the block, inwards [MPa]")
left.legend(frameon=False)
right.plot(x, u[:, 0], "C0-", label="Coulomb: gap")
right.plot(x, u_relaxed[:, 0], "C1--", label="associated: gap")
right.plot(x, 0.2 * np.abs(u_relaxed[:, 1]), "k:", label=r"associated: $\mu\, |u_t|$")
right.set(xlabel="x [mm]", ylabel="displacement [mm]")
right.legend(frameon=False)

assert 1.5e-2 < relaxed.residual < 2.5e-2  # not Coulomb's problem
assert np.allclose(u[:, 0], 0.0, atol=1e-9)  # everything touches
assert np.allclose(u_relaxed[:, 0], 0.2 * np.abs(u_relaxed[:, 1]), atol=1e-6)  # slips, so it floats
assert np.isclose(relaxed.reactions[:, 0].sum(), 100.0)

# %% [markdown]
# In this law the slipping edge of the block floats above the foundation and is pressed on it at the
# same time. For rock or sand, which dilate when they slide, that may be right. For metals and
# rubber it is not. The relaxation has Coulomb's answer only where no loaded contact slips.
# `diagnose` tells whether this is so, and calls the relaxation *tight* then.

# %%
print(diagnose(problem))

assert diagnose(problem).relaxation == "not tight"
assert natural_map_residual(problem, r, answers["newton"].multipliers) < 1e-12

# %% [markdown]
# Which road should you take? Newton's method needs few steps. Each step takes one factorisation of
# a dense matrix. It may run in a circle if $Q$ is singular. The fixed-point iterations need nothing
# but a good QP solver. The default, `solve(problem)`, begins with Newton's method. If that fails,
# it tries an interior-point method, then cone programs, and at last the method `proximal`.
#
# ## Exercises
#
# **1.** Set $\mu = 0$ and $\mu = 0.8$. How many iterations does each method need? Why so few?
#
# <details><summary>Solution</summary>
#
# Without friction the bounds are known to be zero, so the first QP gives the answer. With much
# friction every node sticks. Then the bounds do not matter, and Tresca's iteration confirms its
# first answer by its second.
#
# ```python
# smooth = reduce(scenes.flat_punch(2, mu=0.0, elements=16))
# assert solve(smooth, "tresca").iterations == 1 and solve(smooth, "alternating").iterations == 1
# rough = reduce(scenes.flat_punch(2, mu=0.8, elements=16))
# assert solve(rough, "tresca").iterations <= 2 and solve(rough, "newton").iterations <= 2
# assert solve(rough, "alternating").iterations > 5  # it still has to pass forces to and fro
# assert diagnose(rough).relaxation == "tight"
# ```
#
# </details>
#
# **2.** Repair the relaxation with the cure of tutorial 1: `acary_cadoux`. How many cone programs
# does it take?
#
# <details><summary>Solution</summary>
#
# ```python
# cured = solve(problem, "acary_cadoux", tol=1e-10)
# assert cured.solved and cured.iterations < 12
# assert np.allclose(cured.reactions, r, atol=1e-7 * r.max())
# ```
#
# </details>
#
# **3.** Refine the mesh from 8 to 64 elements. How do the iteration counts of Newton and Tresca
# grow?
#
# <details><summary>Solution</summary>
#
# The count of Tresca's iteration does not grow, because its factor is a property of the bodies and
# not of the mesh. That of Newton's method grows a little, because there are more nodes to sort.
#
# ```python
# counts = {}
# for elements in (8, 16, 32, 64):
#     finer = reduce(scenes.flat_punch(2, mu=0.2, elements=elements))
#     counts[elements] = [solve(finer, method).iterations for method in ("newton", "tresca")]
# assert abs(counts[64][1] - counts[8][1]) <= 1
# assert counts[8][0] <= counts[64][0] <= 12
# ```
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

# %% [markdown]
# # 8. The programs of friction on one page
#
# Friction is taught with seven mathematical programs. Each of them is here: its mathematics, its
# picture in the plane of forces, and the answers of several solvers. All are programs of
# `contactopt.models`, which writes them for any number of contacts in two and three dimensions.
#
# Reading time: 10 minutes. [Chapter 2](../course/chapter_2_friction_at_one_node.py) of the course
# derives the programs, [chapter 7](../course/chapter_7_duality.py) their duals.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contactopt import InterfaceProblem, models, natural_map_residual

Q, q, mu = np.array([[1.0, -1.0], [-1.0, 2.0]]), np.array([-3.0, 5.0]), 0.5
node = InterfaceProblem(Q, [q], mu)
coulomb = np.array([2.0, -1.0])  # N: normal force and friction of Coulomb's law
assert natural_map_residual(node, coulomb[None]) < 1e-12

# %% [markdown]
# The node is that of chapter 2. It touches the floor and slips to the right. In every picture the
# ellipses are lines of equal cost, and the coloured set holds the forces that the program admits. The
# dot is its minimum, and the cross is the force of Coulomb's law.
#
# Five lines compare the solvers. They all find the same minimum, to their own tolerances:


# %%
def compare(program, variable, solvers=("CLARABEL", "PROXQP", "SCS")):
    found = {}
    for solver in solvers:
        program.problem.solve(solver=solver)
        found[solver] = program.variables[variable].value.copy()
        print(f"{solver:<9}", np.round(found[solver], 4))
    return found


# %% tags=["hide-input"]
t, n = np.meshgrid(np.linspace(-3, 2, 251), np.linspace(-0.5, 4, 226))


def picture(admitted, force, cost=None):
    energy = (Q[0, 0] * n**2 + 2 * Q[0, 1] * n * t + Q[1, 1] * t**2) / 2
    energy = energy + q[0] * n + q[1] * t if cost is None else cost
    ax = plt.subplots(figsize=(4.4, 3.2), layout="constrained")[1]
    ax.contourf(t, n, admitted(t, n), [0.5, 1.5], colors=["C0"], alpha=0.25)
    levels = energy.min() + 0.25 * np.arange(1, 12) ** 2
    ax.contour(t, n, energy, levels, colors="0.6", linewidths=0.7)
    ax.plot(coulomb[1], coulomb[0], "kx", ms=9, mew=2)
    ax.plot(force[1], force[0], "o", color="C3", ms=7)
    ax.set(xlabel="friction $r_t$ [N]", ylabel="normal force $r_n$ [N]")


# %% [markdown]
# ## Contact without friction: a half-line
#
# The normal forces of contact with a given friction force, here zero. This is a quadratic program
# (QP), equation (21) of the paper.

# %%
normal = models.normal(node)
r_n = compare(normal, "r_n")["CLARABEL"][0]
picture(lambda t, n: 1.0 * ((n >= 0) & (np.abs(t) < 0.03)), (r_n, 0.0))
normal

# %%
assert np.isclose(r_n, 3.0, atol=1e-4)

# %% [markdown]
# ## Contact with a penalty: the same, with a softer floor
#
# A spring of stiffness $\kappa$ in every contact adds $|r_n|^2 / (2 \kappa)$ to the cost. The
# minimum has less force, and the node sinks in.

# %%
penalised = models.penalised(node, stiffness=2.0)
less = compare(penalised, "r_n")["CLARABEL"][0]
picture(lambda t, n: 1.0 * ((n >= 0) & (np.abs(t) < 0.03)), (less, 0.0))
penalised

# %%
assert np.isclose(less, 3.0 / (1 + 1 / 2.0), atol=1e-4)

# %% [markdown]
# ## Contact that holds: the whole line
#
# Without separation the normal force may pull. Nothing bounds it, and the program is a linear
# system.

# %%
bilateral = models.bilateral(node)
glued = compare(bilateral, "r_n", ("CLARABEL", "PROXQP"))["CLARABEL"][0]
picture(lambda t, n: 1.0 * (np.abs(t) < 0.03), (glued, 0.0))
bilateral

# %%
assert np.isclose(glued, -q[0] / Q[0, 0], atol=1e-4)

# %% [markdown]
# ## Friction for a given normal force: an interval
#
# With $r_n$ known, the bound is known too. In the plane the friction force lies in an interval, in
# space in a disc. This is equation (22) of the paper.

# %%
tangential = models.tangential(node)
tangential.parameters["r_n"].value = np.array([2.0])
tangential.parameters["g"].value = np.array([mu * 2.0])
r_t = compare(tangential, "r_t")["CLARABEL"][0]
picture(
    lambda t, n: 1.0 * ((np.abs(t) <= mu * 2) & (np.abs(n - 2) < 0.03)),
    (2.0, r_t),
)
tangential

# %%
assert np.isclose(r_t, -1.0, atol=1e-3)

# %% [markdown]
# ## Tresca: a strip
#
# Normal force and friction together, with a given bound $g$. With the right bound, $g = \mu r_n$, its
# minimum is Coulomb's force. Repeating the program with the new bound is Tresca's iteration.

# %%
tresca = models.tresca(node)
tresca.parameters["g"].value = np.array([mu * coulomb[0]])
strip = compare(tresca, "r")["CLARABEL"]
picture(lambda t, n: 1.0 * ((n >= 0) & (np.abs(t) <= 1.0)), strip)
tresca

# %%
assert np.allclose(strip, coulomb, atol=1e-3)

# %% [markdown]
# ## Associated friction: a cone
#
# The cone of Coulomb's law as a constraint. The dot is not at the cross: a node that slips is lifted.
# This is a second-order cone program (SOCP), the convex relaxation of Coulomb's law.

# %%
associated = models.associated(node)
lifted = compare(associated, "r")["CLARABEL"]
picture(lambda t, n: 1.0 * (np.abs(t) <= mu * n), lifted)
associated

# %%
gap, slip = Q @ lifted + q
assert np.isclose(gap, mu * slip, atol=1e-3) and gap > 0.1

# %% [markdown]
# ## Acary and Cadoux: the cone with a shift
#
# The term $\mu s\, r_n$ tilts the cost. Where $s$ is the slip of the answer itself, the minimum in the
# cone is Coulomb's force.

# %%
shifted = models.acary_cadoux(node)
shifted.parameters["s"].value = np.array([(Q @ coulomb + q)[1]])
right = compare(shifted, "r")["CLARABEL"]
tilt = mu * shifted.parameters["s"].value[0] * n
energy = (Q[0, 0] * n**2 + 2 * Q[0, 1] * n * t + Q[1, 1] * t**2) / 2
picture(
    lambda t, n: 1.0 * (np.abs(t) <= mu * n),
    right,
    energy + q[0] * n + q[1] * t + tilt,
)
shifted

# %%
assert np.allclose(right, coulomb, atol=1e-3)

# %% [markdown]
# ## What makes it Coulomb's law
#
# | program | set | what is repeated |
# |---|---|---|
# | normal, then tangential | half-line, interval | the friction force, then the normal force |
# | Tresca | strip | the bound $g = \mu r_n$ |
# | associated | cone | nothing: it is another law |
# | Acary and Cadoux | cone | the slip $s = \lvert u_t \rvert$ |
#
# Why no single convex program does it: [chapter
# 2](../course/chapter_2_friction_at_one_node.py#why-coulombs-law-has-no-energy), with
# [a room of the museum](../museum.md#why-coulombs-law-has-no-energy).
#
# ## Exercises
#
# **1.** Every program has a second form in displacements. Print that of Tresca's program, and compare
# the values.
#
# <details><summary>Solution</summary>
#
# ```python
# primal = models.tresca(node, form="primal")
# primal.parameters["g"].value = np.array([1.0])
# primal.problem.solve(solver="CLARABEL")
# print(primal)
# assert np.isclose(primal.problem.value, -tresca.problem.value, atol=1e-4)
# ```
#
# </details>
#
# **2.** Write Tresca's iteration with `models.tresca`, and start from $g = 0$.
#
# <details><summary>Solution</summary>
#
# ```python
# bound = 0.0
# for _ in range(25):
#     tresca.parameters["g"].value = np.array([bound])
#     tresca.problem.solve(solver="CLARABEL")
#     bound = mu * max(tresca.variables["r"].value[0], 0.0)
# assert np.allclose(tresca.variables["r"].value, coulomb, atol=1e-3)
# ```
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

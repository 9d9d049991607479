# %% [markdown]
# # Chapter 6. Large problems in three dimensions
#
# In three dimensions the friction force has two components, and its bound is a circle. The number of unknowns grows with the
# third power of the resolution. What was a matter of taste before, namely which method, in which form, now decides whether
# an answer comes at all. The guiding rule is: *model no more than a scene needs*.
#
# You need: chapters 3 and 5. Time: 50 minutes with the exercises.

# %%
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import HalfSpace, InterfaceProblem, Material, Rigid, Scene, models, reduce, scenes, solve
from contactopt.analytic import contact_modulus, hertz_point
from contactopt.teaching import Slider, check

# %% [markdown]
# ## Round cones
#
# The tangential force has the components $r_t = (r_1, r_2)$, and Coulomb's law bounds its length,
# $\sqrt{r_1^2 + r_2^2} \le \mu r_n$. The cone is round, so the dual with a given bound is a *second-order cone program*:
#
# $$ \min \; \tfrac12 r' Q r + q' r \qquad \text{subject to} \qquad r_n \ge 0, \quad |r_t| \le g . $$
#
# Many codes replace the circle by a polygon with $m$ edges, which makes a QP of it. The polygon inside the circle is a weaker
# law: along the middle of an edge it carries less friction. And it prefers some directions, which the material does not.


# %%
def polygon(facets):
    angle = np.linspace(0, 2 * np.pi, 721)
    half = np.pi / facets
    fig, ax = plt.subplots(figsize=(3.6, 3.6), layout="constrained")
    ax.plot(np.cos(angle), np.sin(angle), "k", lw=1, label="circle")
    corners = (2 * np.arange(facets + 1) + 1) * half
    ax.plot(np.cos(corners), np.sin(corners), "C1", label=f"{facets} facets")
    ax.set(aspect="equal", xlabel=r"$r_1 / (\mu r_n)$ [-]", ylabel=r"$r_2 / (\mu r_n)$ [-]")
    ax.set_title(f"up to {100 * (1 - np.cos(half)):.1f} % less friction")
    ax.legend(frameon=False, loc="center")
    return fig


Slider("facets [-]", [3, 4, 6, 8, 12, 16, 32], polygon, start=3)

# %% [markdown]
# One node shows it. It is pressed on the floor and pulled along the first tangent, hard enough to slip. The friction bound is
# .5 N.


# %%
def pulled(degrees):
    angle = np.deg2rad(degrees)
    return InterfaceProblem(np.eye(3), [[-1.0, 3 * np.cos(angle), 3 * np.sin(angle)]], 0.5)


one = pulled(0.0)
program = {name: models.tresca(one, facets=facets) for name, facets in (("circle", None), ("8 facets", 8))}
for name, each in program.items():
    each.parameters["g"].value = np.array([0.5])
    each.problem.solve(solver=cp.CLARABEL)
    force = each.variables["r"].value[1:]
    print(f"{name}: friction {np.linalg.norm(force):.4f} N")

round_force = np.linalg.norm(program["circle"].variables["r"].value[1:])
assert np.isclose(round_force, 0.5, atol=1e-4)
assert np.linalg.norm(program["8 facets"].variables["r"].value[1:]) < 0.47

# %% [markdown]
# ## The mechanical system
#
# A square rubber block stands on a foundation and is pressed on it. The scene has two planes of symmetry, so a quarter is
# enough: the fourth part of the unknowns, and the same answer.

# %%
scene = scenes.flat_punch(3, mu=0.3, elements=8)
problem = reduce(scene)
answer = solve(problem)
shear, pressure = np.linalg.norm(answer.reactions[:, 1:], axis=1), answer.reactions[:, 0]
slips = shear > (1 - 1e-6) * 0.3 * pressure
x, y = problem.coordinates[:2]

fig, ax = plt.subplots(figsize=(4.6, 3.8), layout="constrained")
dots = ax.scatter(x, y, c=pressure / problem.areas, s=110, marker="s", alpha=0.6)
ax.quiver(x, y, *answer.reactions[:, 1:].T, color="black", width=0.005, zorder=3)
ax.plot(x[slips], y[slips], "rx", ms=5, label="slips", zorder=4)
ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
ax.legend(loc="upper right")
fig.colorbar(dots, label="pressure [MPa]")
print(f"{problem.contacts} contacts, {int(slips.sum())} slip, certificate {answer.residual:.0e}")

assert answer.solved and 0 < slips.sum() < len(slips)

# %% [markdown]
# ## Primal or dual?
#
# In three dimensions with $N$ nodes along each edge the block has about $3 N^3$ displacements, and $3 N^2$ contact forces.
#
# | | unknowns | matrix | memory for $N = 100$ |
# |---|---|---|---|
# | primal | $3 N^3$ | sparse, 81 entries per row | 3 GB and its factors |
# | dual, $Q$ as an array | $3 N^2$ | dense | 7 GB |
# | dual, $Q$ by its products | $3 N^2$ | not formed | that of the primal |
#
# The dual with products, $Q r = \sum_b T_b K_b^{-1} T_b' r$, needs one solve of each body for every product. So the number of
# products is what counts, and a preconditioner pays. (The numbers of the table are those of exercise 6.1.)
#
# ## A preconditioner for the surface
#
# On the surface of a body, $Q$ divides a wave by its wave number. The condition number of $Q$ therefore grows like $N$, and
# the number of products of a Newton step like $\sqrt N$. Multiplying by the wave number undoes it: this is the square root of
# the surface's Laplacian, the $H^{1/2}$ seminorm of the paper. We count products with and without it.

# %%
products = {}
for elements in (4, 8, 12):
    implicit = reduce(scenes.flat_punch(3, mu=0.3, elements=elements), Q="implicit")
    products[elements] = [
        solve(implicit, "newton", linear="krylov", preconditioner=name).history[-1]["products"]
        for name in ("none", "neumann")
    ]
    print(f"{elements} elements: {products[elements][0]:.0f} products without, {products[elements][1]:.0f} with")

fig, ax = plt.subplots(figsize=(5, 3.2), layout="constrained")
ax.plot(list(products), list(products.values()), "o-", label=["without", "with the square root of the Laplacian"])
ax.set(xlabel="elements across the half-width [-]", ylabel="products with Q [-]", ylim=(0, None))
ax.legend(frameon=False)

assert products[12][1] < products[12][0]
assert products[12][1] < 1.6 * products[4][1]

# %% [markdown]
# ## Without a mesh
#
# A body that is large beside its contact is a half-space. Then $Q$ is a convolution with a known kernel, and a product costs
# two Fourier transforms. Nothing is meshed. The same program, the same certificate, and 4,096 contacts in a moment:

# %%
rubber, R, P = Material(E=5.0, nu=0.3), 400.0, 100.0
hertz = hertz_point(P, R, contact_modulus(rubber))
grid = (np.arange(64) + 0.5) * 2.5 * hertz.half_width / 64 - 1.25 * hertz.half_width
sphere = Rigid("sphere", gap=lambda p: (p[0] ** 2 + p[1] ** 2) / (2 * R), force={"z": -P})
ball = Scene("sphere", sphere, HalfSpace("block", rubber, (grid, grid)), 0.0, kind="solid", law="frictionless")
flat = reduce(ball)
round_answer = solve(flat)
p = round_answer.reactions[:, 0] / flat.areas
rho = np.linalg.norm(flat.coordinates[:2], axis=0)

fig, ax = plt.subplots(figsize=(5, 3.2), layout="constrained")
ax.plot(rho, p, ".", ms=2, label="64 x 64 points")
line = np.linspace(0, 1.3 * hertz.half_width, 200)
ax.plot(line, hertz.pressure(line), "k", lw=1, label="Hertz")
ax.set(xlabel="distance from the axis [mm]", ylabel="pressure [MPa]")
ax.legend(frameon=False)
print(f"{flat.contacts} contacts, {round_answer.products} products, peak {p.max() / hertz.peak:.4f} of Hertz")

assert round_answer.solved and abs(p.max() / hertz.peak - 1) < 5e-3

# %% [markdown]
# ## What fails
#
# - **A dense matrix.** $Q$ as an array needs $8\,(3k)^2$ bytes for $k$ contacts. contactopt says its size, and refuses one that is
#   too large.
# - **The preconditioner in place of the matrix.** $P$ is near $Q^{-1}$, but it is not $Q^{-1}$. Inside an iteration it changes the
#   cost and not the answer. Put in place of $Q$ it gives the answer to another problem.
# - **Loose inner solves.** A product that is accurate to $10^{-4}$ limits the certificate to about $10^{-4}$. The accuracy of
#   the products has to follow that of the outer iteration.

# %%
Q = problem.Q
wrong = InterfaceProblem(np.diag(np.diag(Q)), problem.q, 0.3, problem.V, problem.s)  # the diagonal in place of Q
other = solve(wrong)
difference = np.abs(other.reactions - answer.reactions).max() / answer.reactions.max()
print(f"with the diagonal in place of Q the forces are wrong by {100 * difference:.0f} % of the largest")

assert difference > 0.1

# %% [markdown]
# ## Exercises
#
# **6.1** (Pen and paper.) A contact surface has $100 \times 100$ nodes in 3D. How many gigabytes ($10^9$ bytes) does $Q$ take as
# an array of numbers of 8 bytes?

# %% tags=["exercise"]
answer = ...  # GB

# %% [markdown] tags=["solution"]
# $3 \cdot 10^4$ unknowns, $9 \cdot 10^8$ entries, $7.2 \cdot 10^9$ bytes.

# %% tags=["solution"]
answer = 8 * (3 * 100**2) ** 2 / 1e9

# %%
check("6.1", answer, 7.2)

# %% [markdown]
# **6.2** (Pen and paper.) Friction is replaced by a polygon inside the circle. How many facets are needed so that at most 1 % of
# the friction is lost in any direction?

# %% tags=["exercise"]
answer = ...  # an integer

# %% [markdown] tags=["solution"]
# In the middle of an edge the polygon reaches $\cos(\pi / m)$ of the radius. $\cos(\pi / m) \ge 0.99$ needs
# $m \ge \pi / \arccos 0.99 = 22.2$, so 23 facets.

# %% tags=["solution"]
answer = int(np.ceil(np.pi / np.arccos(0.99)))

# %%
check("6.2", answer, lambda m: m == 23)

# %% [markdown]
# **6.3** How does the peak pressure under a sphere grow when the load is doubled? Find the factor with the half-space, with
# the load of 200 N (make the grid wide enough), and compare it with Hertz's exponent.

# %% tags=["exercise"]
answer = ...  # peak at 200 N / peak at 100 N

# %% [markdown] tags=["solution"]
# Hertz: $p_0 \sim P^{1/3}$, so the factor is $2^{1/3} = 1.26$.

# %% tags=["solution"]
wide = grid * 2 ** (1 / 3)
heavy = Rigid("sphere", gap=lambda p: (p[0] ** 2 + p[1] ** 2) / (2 * R), force={"z": -2 * P})
heavier = reduce(
    Scene("sphere", heavy, HalfSpace("block", rubber, (wide, wide)), 0.0, kind="solid", law="frictionless")
)
answer = (solve(heavier).reactions[:, 0] / heavier.areas).max() / p.max()

# %%
check("6.3", answer, lambda factor: abs(factor - 2 ** (1 / 3)) < 0.01)

# %% [markdown]
# **6.4** Take the node of the beginning, `pulled(22.5)`, with *four* facets instead of the circle. Friction should pull back at
# 22.5 degrees. At which angle does it really pull back? (An angle between 0 and 90 degrees from the first tangent.)

# %% tags=["exercise"]
answer = ...  # degrees

# %% [markdown] tags=["solution"]
# Friction goes against the slip as far as the square allows, and that is into a corner of it. So it pulls back at 45 degrees,
# 22.5 degrees off the motion.

# %% tags=["solution"]
square = models.tresca(pulled(22.5), facets=4)
square.parameters["g"].value = np.array([0.5])
square.problem.solve(solver=cp.CLARABEL)
answer = float(np.degrees(np.arctan2(*-square.variables["r"].value[:0:-1])))

# %%
check("6.4", answer, lambda angle: abs(angle - 45) < 1)

# %% [markdown]
# ## References
#
# - A. Lotfi, Domain-Decomposition based $H^{1/2}$ Seminorm Preconditioners for Frictional Contact Problems: the preconditioners
#   and the reduction to the interface.
# - K. L. Johnson, *Contact Mechanics*, Cambridge University Press 1985,
#   [doi:10.1017/CBO9781139171731](https://doi.org/10.1017/CBO9781139171731).
#
# This is the end of the course. The tutorials go on from here, each with one subject.

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

# %% [markdown]
# # 2. From two bodies to Q
#
# [Tutorial 1](one_contact_node.py) took the compliance $Q$ for granted. In this tutorial we build
# it by hand from two elastic bodies. The tool is the *Schur complement*, which eliminates
# everything that is not on the interface. Then we look at the spectrum of $Q$. It explains why
# contact problems are hard for iterative methods, and what a preconditioner has to do.
#
# Reading time: 10 minutes. You need to have seen a finite element stiffness matrix.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contactopt import Material, Part, Scene, Support, reduce, reduce_bodies
from contactopt.meshes.structured import graded, rename, tensor_mesh

# %% [markdown]
# ## Two springs
#
# Two springs in series press on each other. Their stiffnesses are $s_1$ and $s_2$. Under a common
# force $r$ the first spring gives way by $r / s_1$ and the second by $r / s_2$. The displacements
# add up, and therefore the compliances do:
#
# $$ Q = s_1^{-1} + s_2^{-1} . $$
#
# The same happens with two elastic bodies, where matrices take the place of the springs: $Q =
# S_1^{-1} + S_2^{-1}$. The forces on the two sides of the interface are $r$ and $-r$. (In the paper
# by A. Lotfi, *Domain-Decomposition based H^1/2 Seminorm Preconditioners for Frictional Contact
# Problems*, this is equation 14.)
#
# ## Two blocks
#
# A punch, 4 mm wide and 4 mm high, stands on a foundation, 16 mm wide and 8 mm high. Both are 1 mm
# thick, measured perpendicular to the plane, and both are made of the same rubber. The punch is
# held at its top, and the foundation is clamped at its bottom. The meshes are fine at the interface
# and coarse away from it, because stresses that vary fast along the surface fade quickly below it.


# %%
def two_blocks(nodes, upper=5.0, lower=5.0):
    """Punch on a foundation: contact nodes, Young's moduli in MPa."""
    h, zone = 4 / (nodes - 1), np.linspace(-2, 2, nodes)
    punch = rename(
        tensor_mesh(zone, graded(4, h, 1.15)), contact="y-", top="y+"
    )
    outside = 2 + graded(6, 1.15 * h, 1.15)[1:]
    across = np.concatenate([-outside[::-1], zone, outside])
    ground = rename(tensor_mesh(across, -graded(8, h, 1.15)[::-1]), bottom="y-")
    ground = ground.with_boundaries(
        {"contact": lambda x: (x[1] > -1e-9) & (np.abs(x[0]) < 2)}
    )
    return Scene(
        "two blocks",
        upper=Part(
            "punch", punch, Material(upper, nu=0.3), supports=(Support("top"),)
        ),
        lower=Part(
            "ground",
            ground,
            Material(lower, nu=0.3),
            supports=(Support("bottom"),),
        ),
        mu=0.5,
    )


reduction = reduce_bodies(two_blocks(33))
bodies = [reduced.body for reduced in reduction.bodies]

fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for body, color in zip(bodies, ("C0", "C1")):
    mesh = body.basis.mesh
    ax.plot(*mesh.p[:, mesh.facets].transpose(0, 1, 2), color=color, lw=0.4)
    ax.plot(
        *body.points,
        "o",
        color=color,
        ms=3,
        label=f"{body.name}, {len(body.free)} unknowns",
    )
ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
ax.legend(frameon=False, loc="lower left")

assert all(len(body.nodes) == 33 for body in bodies)

# %% [markdown]
# ## Eliminate the inside
#
# Sort the unknowns of one body into inside ($i$) and contact ($c$). Its equilibrium is
#
# $$ \begin{bmatrix} A_{ii} & A_{ic} \\ A_{ci} & A_{cc} \end{bmatrix}
#    \begin{bmatrix} U_i \\ U_c \end{bmatrix} = \begin{bmatrix} 0 \\ r \end{bmatrix} . $$
#
# The first row gives $U_i = -A_{ii}^{-1} A_{ic} U_c$. We put this into the second row and get
#
# $$ S\, U_c = r, \qquad S = A_{cc} - A_{ci} A_{ii}^{-1} A_{ic} . $$
#
# $S$ is the Schur complement. It is the stiffness that you feel when you move the body by its
# contact nodes. It has few unknowns, but each of them is coupled to all others.


# %%
def schur_complement(body):
    """S of one body; unknowns node by node, (x, y) each, from left to right."""
    contact = body.contact_dofs[np.argsort(body.points[0])].ravel()
    inside = np.setdiff1d(body.free, contact)
    A = body.A.toarray()  # a real code keeps it sparse and factorises it once
    return A[np.ix_(contact, contact)] - A[
        np.ix_(contact, inside)
    ] @ np.linalg.solve(A[np.ix_(inside, inside)], A[np.ix_(inside, contact)])


S1, S2 = (schur_complement(body) for body in bodies)
print(
    "share of non-zeros:",
    [
        f"{b.A.nnz / b.A.shape[0] ** 2:.1%} of A, {np.mean(S != 0):.0%} of S"
        for b, S in zip(bodies, (S1, S2))
    ],
)

for S in (S1, S2):
    assert np.allclose(S, S.T)
    assert (
        np.linalg.eigvalsh(S).min() > 0
    )  # both bodies are held, so no motion is free

# %% [markdown]
# ## Add the compliances
#
# contactopt orders the components by contacts, and within a contact the *normal comes first*: $(n,
# t)$. The normal $n$ points out of the lower body, which is upwards here, $n = (0, 1)$. The tangent
# is $t = (1, 0)$. So the components $(x, y)$ of each node have to be taken in the order $(y, x)$.
#
# The force on the upper body is $+r$, and that on the lower body is $-r$. The relative displacement
# is that of the upper body minus that of the lower one. The two minus signs cancel, and the
# compliances add up, as those of the springs did.

# %%
nodes = len(S1) // 2
normal_first = np.arange(2 * nodes).reshape(nodes, 2)[:, ::-1].ravel()
Q = (np.linalg.inv(S1) + np.linalg.inv(S2))[np.ix_(normal_first, normal_first)]

problem = reduction.problem
assert np.allclose(Q, problem.Q, rtol=1e-8, atol=1e-12)
assert np.all(np.diff(problem.coordinates[0]) > 0)

# %% [markdown]
# To eight digits this is the matrix $Q$ that `contactopt.reduce` computes with sparse matrices.
# From here on nobody needs to know that there are finite elements. All that a solver sees is $u = Q
# r + q$, where $q$ is the displacement without contact forces.
#
# ## What Q looks like
#
# Take the normal block $Q_{nn}$. Each of its columns is the dent that a unit force at one node
# makes. The dent is deepest where the force acts. It is about twice as deep if the force acts at an
# edge. Away from the force the dent falls off slowly, so that every node feels all others.

# %%
Q_nn = Q[::2, ::2]
values, vectors = np.linalg.eigh(Q_nn)
values, vectors = values[::-1], vectors[:, ::-1]  # softest first
x = problem.coordinates[0]

fig, (left, right) = plt.subplots(
    1, 2, figsize=(6.4, 3.8), layout="constrained"
)
for column in (0, 16, 24):
    left.plot(x, Q_nn[:, column], label=f"force at x = {x[column]:g} mm")
left.set(xlabel="x [mm]", ylabel="normal displacement [mm/N]")
left.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
for j in (0, 1, 2, 5):
    right.plot(x, vectors[:, j] * np.sign(vectors[-1, j]), label=f"number {j}")
right.set(xlabel="x [mm]", ylabel="eigenvector, unit length [-]")
right.legend(
    frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0)
)

assert np.array_equal(np.argmax(Q_nn, axis=0), np.arange(nodes))
assert Q_nn[0, 0] > 1.8 * Q_nn[16, 16]

# %% [markdown]
# The eigenvectors are waves. Eigenvector number $j$ changes its sign exactly $j$ times, like
# $\cos(j \pi x / L)$ on a line of length $L$. The longest wave belongs to the largest eigenvalue:
# it is the softest.

# %%
changes = [np.sum(np.diff(np.sign(v)) != 0) for v in vectors.T]
assert changes == list(range(nodes))

# %% [markdown]
# ## The law behind it
#
# Press on an elastic half-plane with a pressure that is a wave, $\cos(\xi x)$. The surface sinks by
# the same wave, multiplied by $2 (1-\nu^2) / (E\,|\xi|)$. Short waves are stiff, because they
# strain only a thin layer. The factors of two bodies add up to
#
# $$ \frac{2}{E^*} \frac{1}{|\xi|}, \qquad \frac1{E^*} = \frac{1-\nu_1^2}{E_1} + \frac{1-\nu_2^2}{E_2} . $$
#
# So $Q$ divides the wave with wave number $\xi$ by $|\xi|$. It makes functions smoother, about as
# much as one integration does. Displacements have one derivative more than tractions; in the
# language of Sobolev spaces, $Q$ maps $H^{-1/2}$ to $H^{1/2}$.
#
# Our bodies are finite. Still, wave number $j$ has about $\xi_j = j \pi / L$, and a nodal force is
# the pressure times the spacing $h$ of the nodes. So we predict the eigenvalues $2 / (E^* h\,
# \xi_j)$.

# %%
modulus = 1 / (2 * (1 - 0.3**2) / 5.0)  # E*, MPa


def predicted(count):
    return 2 / (modulus * (4 / (count - 1)) * np.arange(1, count) * np.pi / 4)


fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for count, marker in ((17, "s"), (33, "o"), (65, "^")):
    eigenvalues = np.linalg.eigvalsh(reduce(two_blocks(count)).Q[::2, ::2])[
        ::-1
    ]
    ax.loglog(
        np.arange(1, count),
        eigenvalues[1:] * 4 / (count - 1),
        marker,
        ms=4,
        mfc="none",
        label=f"{count} nodes",
    )
    assert np.all(
        np.abs(
            eigenvalues[2 : count // 4] / predicted(count)[1 : count // 4 - 1]
            - 1
        )
        < 0.25
    )
ax.loglog(
    np.arange(1, 65),
    predicted(65) * 4 / 64,
    "k--",
    lw=1,
    label=r"half-planes, $2 / (E^* \xi_j)$",
)
ax.set(
    xlabel="number j of the wave [-]",
    ylabel=r"eigenvalue of $Q_{nn}$ times h [mm$^2$/N]",
)
_ = ax.legend(frameon=False)

# %% [markdown]
# On every mesh we see a straight line of slope $-1$. It bends only where the waves are too short
# for the mesh. Each refinement adds shorter waves at the stiff end and changes nothing at the soft
# end. So the condition number, which is the largest eigenvalue over the smallest, is proportional
# to the number of nodes:

# %%
conditions = []
for count in (17, 33, 65):
    fine = reduce(two_blocks(count)).Q
    conditions.append([np.linalg.cond(fine[::2, ::2]), np.linalg.cond(fine)])
    print(
        f"{count} nodes: condition {conditions[-1][0]:.1f} of the normal block,"
        f" {conditions[-1][1]:.0f} of all Q"
    )
growth = np.array(conditions)[1:] / np.array(conditions)[:-1]

assert np.all((growth > 1.9) & (growth < 2.1))

# %% [markdown]
# The condition number of the whole $Q$ is about ten times that of its normal block, but it grows at
# the same rate. The main reason is one more soft motion: the punch, which is held at its top, can
# sway sideways.
#
# [Tutorial 3](why_the_preconditioner_works.py) shows how an iterative method can undo the division
# by $|\xi|$.
#
# ## Exercises
#
# **1.** Make the foundation a million times stiffer. What should $Q$ become? Check it.
#
# <details><summary>Solution</summary>
#
# The second spring no longer gives way, so only the compliance of the punch remains.
#
# ```python
# stiff = reduce(two_blocks(33, lower=5e6)).Q
# alone = np.linalg.inv(S1)[np.ix_(normal_first, normal_first)]
# assert np.linalg.norm(stiff - alone) < 1e-5 * np.linalg.norm(alone)
# ```
#
# </details>
#
# **2.** Let a rigid plate press on the punch with a total force of 10 N instead of holding its top.
# Then the punch is free to move up and down, and its $S$ is singular: it has no compliance for that
# motion. Where does `contactopt` put it?
#
# <details><summary>Solution</summary>
#
# It puts this motion into $u = Q r + V \lambda + q$ with the balance $V' r + s = 0$. The only
# column of $V$ moves all nodes up by one, $\lambda$ is the unknown displacement of the plate, and
# $s$ is the load. The plate is glued to the punch, so it holds the punch sideways.
#
# ```python
# from dataclasses import replace
# from contactopt import Plate, solve
# scene = two_blocks(17)
# plate = Plate("top", {"y": -10.0})
# upper = replace(scene.upper, supports=(), loads=(plate,))
# pressed = replace(scene, upper=upper)
# with_plate = reduce(pressed)
# V = with_plate.V.reshape(-1, 2)
# assert np.allclose(V[:, 0], 1.0) and np.allclose(V[:, 1], 0.0)
# assert np.allclose(with_plate.s, -10.0)
# answer = solve(with_plate)
# assert np.isclose(answer.reactions[:, 0].sum(), 10.0)  # it carries the load
# assert answer.multipliers[0] < 0  # the plate comes down
# ```
#
# </details>
#
# **3.** The Schur complement is dense. How many numbers does $Q$ hold for a 3D interface of 100 x
# 100 nodes? How can a product $Q r$ be computed without forming $Q$?
#
# <details><summary>Solution</summary>
#
# It holds $(3 \cdot 10^4)^2 = 9 \cdot 10^8$ numbers, which take 7 GB. A product $Q r$ does not need
# $Q$ itself: one forward and one backward substitution with the factors of each body are enough,
# and `reduction.operator` does that.
#
# ```python
# assert (3 * 100 * 100) ** 2 * 8 / 1e9 > 7
# force = np.random.default_rng(0).normal(size=len(Q))
# assert np.allclose(reduction.operator @ force, Q @ force, rtol=1e-6)
# ```
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

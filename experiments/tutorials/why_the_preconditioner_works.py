# %% [markdown]
# # 1. What Q does to waves, and the preconditioner that undoes it
#
# [Chapter 4](../course/chapter_4_from_bodies_to_the_interface.py) of the course builds the
# compliance $Q$ from elastic bodies, by eliminating everything that is not on the interface. In
# this tutorial we look at its spectrum: $Q$ makes a wave of displacement out of a wave of force, and divides it by the
# wave number $|\xi|$. If we multiply a displacement by $|\xi|$, we nearly undo $Q$. The Fourier
# transform does this at almost no cost. We write such a preconditioner in a few lines. We compare
# it with those of a paper, A. Lotfi's *Domain-Decomposition based H^1/2 Seminorm Preconditioners
# for Frictional Contact Problems*, and count iterations.
#
# Reading time: 15 minutes. You need the conjugate gradient method (CG) and the discrete Fourier
# transform (FFT).

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from contactopt import Material, Part, Scene, Support, reduce
from contactopt.meshes.structured import graded, rename, tensor_mesh
from contactopt.methods.preconditioners import preconditioner

# %% [markdown]
# ## Two blocks
#
# A punch, 4 mm wide and 4 mm high, stands on a foundation, 16 mm wide and 8 mm high. Both are 1 mm
# thick, measured perpendicular to the plane, and both are made of the same rubber. The punch is
# held at its top, and the foundation is clamped at its bottom. The meshes are fine at the interface
# and coarse away from it, because stresses that vary fast along the surface fade quickly below it.


# %%
def two_blocks(nodes):
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
    upper = Part(
        "punch", punch, Material(E=5.0, nu=0.3), supports=(Support("top"),)
    )
    lower = Part(
        "ground", ground, Material(E=5.0, nu=0.3), supports=(Support("bottom"),)
    )
    return reduce(Scene("two blocks", upper, lower, mu=0.5))


problem = two_blocks(33)
Q, nodes = problem.Q, problem.contacts

# %% [markdown]
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
    eigenvalues = np.linalg.eigvalsh(two_blocks(count).Q[::2, ::2])[::-1]
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
    fine = two_blocks(count).Q
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

# %% [markdown]
# ## The problem of size
#
# We ask CG for the forces $r$ that close a given gap $b$, that is, for the solution of $Q r = b$.
# All nodes are in contact here, and there is no inequality. Every contact solver has such a linear
# system inside.


# %%
def iterations(Q, P=None):
    residuals = []
    b = np.random.default_rng(0).normal(size=len(Q))
    cg(
        Q,
        b,
        rtol=1e-8,
        maxiter=5000,
        M=P,
        callback=lambda x: residuals.append(np.linalg.norm(b - Q @ x)),
    )
    return len(residuals)


problems = {nodes: two_blocks(nodes) for nodes in (17, 33, 65, 129)}
plain = {nodes: iterations(problem.Q) for nodes, problem in problems.items()}
print("CG iterations without preconditioner:", plain)

assert plain[129] > 2 * plain[17]

# %% [markdown]
# The condition number $\kappa$ doubles when the number of nodes doubles. CG needs about
# $\sqrt\kappa$ iterations, so every refinement takes about 1.4 times as many iterations, and each
# of them has a larger product. A preconditioner $P \approx Q^{-1}$ lets CG work on $P Q$ instead.
#
# What is $P$ applied to? In every iteration CG applies it to the residual $b - Q r$. This vector is
# a gap that has not been closed yet, so it is a *displacement*, and $P$ answers with the *force*
# that would about close it.
#
# ## Five lines
#
# A *circulant* matrix is one whose rows are shifted copies of each other, where the last entry goes
# round to the front. The FFT diagonalises all circulant matrices at once. Their eigenvalues, as a
# function of the wave number, are called the *symbol*. We choose the symbol $|\xi|$. The contact
# line is not a closed curve. So we extend the displacement by zeros to a closed curve of $2m$
# nodes, multiply there, and keep only the values on the contact line.


# %%
def multiply_by_wave_number(nodes):
    m = 2 ** int(np.ceil(np.log2(nodes)))
    xi = np.minimum(np.arange(2 * m), 2 * m - np.arange(2 * m)).astype(float)
    xi[0] = 0.5  # constants: a little, so that P can be inverted

    def product(displacement):
        components = displacement.reshape(
            nodes, 2
        )  # normal and tangential, each by itself
        return (
            np.fft.ifft(
                xi[:, None] * np.fft.fft(components, n=2 * m, axis=0), axis=0
            )
            .real[:nodes]
            .ravel()
        )

    return LinearOperator((2 * nodes, 2 * nodes), matvec=product)


ours = {
    nodes: iterations(problem.Q, multiply_by_wave_number(nodes))
    for nodes, problem in problems.items()
}
print("with |xi|:", ours)

assert all(ours[nodes] < plain[nodes] for nodes in problems)
assert ours[129] <= ours[17] + 4

# %% [markdown]
# The number of iterations hardly changes with the mesh any more. One application costs two FFTs,
# which are $O(N \log N)$ operations, while a product with a dense $Q$ costs $N^2$. So the
# preconditioner is nearly free.
#
# ## Three that come with the package
#
# | name | what it is |
# |---|---|
# | `p21` | the paper's equation 25: a *sparse* circulant for the $H^{1/2}$ seminorm, extended by zero |
# | `p22` | the paper's equation 26: the inverse of a sparse circulant approximation of $Q$ |
# | `neumann` | the square root of the Laplacian of the contact line, by the cosine transform |
#
# The trick of the paper is a circulant matrix that is sparse. It has about $2 \log_2 N$ entries per
# row for $N$ nodes, so that it needs no FFT. Its symbol is not exactly $|\xi|$, but it stays near
# it. To see this, we give waves of displacement to each preconditioner, and measure by how much it
# multiplies them.

# %%
nodes = 129
problem = problems[nodes]
waves = np.cos(
    np.pi * np.outer(np.arange(nodes) + 0.5, np.arange(nodes)) / nodes
)
waves /= np.linalg.norm(waves, axis=0)
choices = {"|xi|, five lines": multiply_by_wave_number(nodes)}
choices |= {
    name: preconditioner(problem, name) for name in ("p21", "p22", "neumann")
}

fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
number = np.arange(1, nodes)
for name, P in choices.items():
    displacement = np.zeros((2 * nodes, nodes))
    displacement[::2] = waves  # waves of normal displacement only
    symbol = np.sum(waves * (P @ displacement)[::2], axis=0)[1:]
    symbol *= np.exp(
        -np.mean(np.log(symbol / number))
    )  # CG does not see a factor
    ax.loglog(number, symbol, label=name)
    assert np.all((symbol / number > 0.2) & (symbol / number < 5))
ax.loglog(number, number, "k--", lw=1, label="proportional to the wave number")
ax.set(
    xlabel="number of the wave [-]",
    ylabel="what the preconditioner multiplies it by [-]",
)
_ = ax.legend(frameon=False)

# %% [markdown]
# All of them follow the dashed line within a constant factor. On a closed curve, where waves are the
# eigenvectors of both $P$ and $Q$, no more is needed: if $c_1 |\xi| \le$ symbol $\le c_2 |\xi|$,
# then the condition number of $P Q$ is at most about $c_2 / c_1$ on every mesh. This is what
# *spectrally equivalent* means. Our contact has ends, where waves are not eigenvectors. What the
# ends do is shown below.
#
# ## Count

# %%
counts = {"none": plain, "|xi|, five lines": ours}
for name in ("p21", "p22", "neumann"):
    counts[name] = {
        k: iterations(problem.Q, preconditioner(problem, name))
        for k, problem in problems.items()
    }

fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for (name, count), style in zip(
    counts.items(), ("ko-", "C0s-", "C1^-", "C2v-", "C3D-")
):
    ax.loglog(list(count), list(count.values()), style, label=name)
ax.set_xticks(list(problems), [str(k) for k in problems])
ax.set_yticks([10, 20, 40, 80], ["10", "20", "40", "80"])
ax.minorticks_off()
ax.set(xlabel="contact nodes N [-]", ylabel="CG iterations to 1e-8 [-]")
ax.legend(frameon=False)

# (69 and 23: rounding changes such counts by one)
assert plain[129] > 2.5 * counts["p21"][129]
assert counts["neumann"][129] <= counts["neumann"][17] + 2
assert all(
    counts["neumann"][k] <= counts[name][k] for k in problems for name in counts
)

# %% [markdown]
# ## Why are they not all the same?
#
# They differ at the ends of the line. Our five lines and `p21` extend the displacement by zero.
# That does no harm to a displacement that vanishes where the contact ends; such functions form the
# space $H^{1/2}_{00}$. But the displacement does not vanish there: a uniform pressure, for
# instance, moves the nodes at the edge four fifths as far as those in the middle. So the extension by
# zero makes a jump at each end, and the $H^{1/2}$ norm of a jump is infinite. On a mesh it is
# finite, but it grows slowly with the number of nodes. The other two avoid the jump. `neumann`
# continues the displacement by its mirror image. `p22` is the inverse of a matrix that acts on
# forces, and outside the contact the force *is* zero.

# %%
pressed = np.zeros((nodes, 2))
pressed[:, 0] = problem.areas  # a uniform pressure
under_pressure = (problem.Q @ pressed.ravel()).reshape(nodes, 2)[:, 0]
ends = under_pressure[[0, -1]] / under_pressure.max()
print("normal displacement at the ends over the largest:", ends.round(2))

assert np.allclose(ends, 0.8, atol=0.05)  # no sign of a zero at the edge

# %% [markdown]
# Now look at the eigenvalues of $P Q$. They should lie close together.

# %%
fig, ax = plt.subplots(figsize=(6.0, 3.0), layout="constrained")
spectra = {}
for height, name in enumerate(("p21", "p22", "neumann")):
    PQ = preconditioner(problem, name) @ problem.Q
    spectra[name] = np.sort(np.linalg.eigvals(PQ).real)
    scaled = spectra[name] / np.median(spectra[name])
    ax.semilogx(scaled, np.full(len(scaled), height), "|", ms=18)
ax.set_yticks(range(3), list(spectra))
ax.set(
    xlabel="eigenvalues of P Q over their median [-]",
    ylabel="preconditioner",
    ylim=(-0.5, 2.5),
)

condition = {name: values[-1] / values[0] for name, values in spectra.items()}
without_largest = {
    name: values[-2] / values[0] for name, values in spectra.items()
}
print(
    "condition number:",
    {name: f"{value:.1f}" for name, value in condition.items()},
)
print(
    "without the largest eigenvalue:",
    {name: f"{value:.1f}" for name, value in without_largest.items()},
)

values, vectors = np.linalg.eig(PQ)
motion = (problem.Q @ vectors[:, np.argmax(values.real)].real).reshape(nodes, 2)


def spread(nodes, name):
    """Largest but one over smallest eigenvalue of P Q."""
    P = (
        multiply_by_wave_number(nodes)
        if name == "five lines"
        else preconditioner(problems[nodes], name)
    )
    eigenvalues = np.sort(np.linalg.eigvals(P @ problems[nodes].Q).real)
    return eigenvalues[-2] / eigenvalues[0]


growth = {
    name: spread(129, name) / spread(17, name)
    for name in ("five lines", "p21", "p22", "neumann")
}
print(
    "growth of that from 17 to 129 nodes:",
    {name: f"{value:.2f}" for name, value in growth.items()},
)

assert all(without_largest[name] < 0.5 * condition[name] for name in spectra)
assert (
    min(growth["five lines"], growth["p21"]) > 1.5
)  # the displacement extended by zero
assert max(growth["p22"], growth["neumann"]) < 1.2  # no jump
assert abs(motion[:, 1].sum()) > 0.99 * np.sqrt(nodes) * np.linalg.norm(
    motion[:, 1]
)  # sideways, the same everywhere

# %% [markdown]
# For all three, one eigenvalue stands apart on the right. It belongs to the *sway* of the punch, a
# motion of the whole body. The symbol describes waves on the surface, and does not contain this
# motion. CG needs only one or two more iterations to deal with a single eigenvalue. So the
# condition number looks worse than CG really is. It still pays to solve for such a motion exactly
# (`contactopt.methods.preconditioners.deflated`), as the last exercise shows.
#
# ## Exercises
#
# **1.** Many would first try to divide by the diagonal, $P = \mathrm{diag}(Q)^{-1}$. Try it. Why
# does it not help?
#
# <details><summary>Solution</summary>
#
# Away from the edge the diagonal has one value for all normal components, and one that is less than
# twice as large for all tangential ones. Dividing by them treats long and short waves alike, so that
# CG gains next to nothing.
#
# ```python
# diagonal = np.diag(problem.Q)
# jacobi = LinearOperator((2 * nodes,) * 2, matvec=lambda b: b / diagonal)
# assert iterations(problem.Q, jacobi) > 0.7 * plain[nodes]
# ```
#
# </details>
#
# **2.** Show that $|\xi|$ is the right symbol, rather than $|\xi|^{1/2}$ or $|\xi|^2$: try several
# powers.
#
# <details><summary>Solution</summary>
#
# With a power below one, short waves remain too small in $P Q$. With a power above one, they
# become too large.
#
# ```python
# def power(exponent):
#     m = 128 * 2
#     xi = np.minimum(np.arange(2 * m), 2 * m - np.arange(2 * m))
#     xi = np.maximum(xi, 0.5) ** exponent
#
#     def product(displacement):
#         waves = np.fft.fft(displacement.reshape(nodes, 2), n=2 * m, axis=0)
#         return np.fft.ifft(xi[:, None] * waves, axis=0).real[:nodes].ravel()
#
#     return LinearOperator((2 * nodes, 2 * nodes), matvec=product)
#
# exponents = (0.0, 0.5, 1.0, 1.5, 2.0)
# tried = {e: iterations(problem.Q, power(e)) for e in exponents}
# assert min(tried, key=tried.get) == 1.0
# ```
#
# </details>
#
# **3.** How much does the sway cost? Solve for it exactly, together with the other smooth motions,
# and count again.
#
# <details><summary>Solution</summary>
#
# ```python
# from contactopt.methods.preconditioners import deflated, smooth_motions
# P = preconditioner(problem, "p21")
# exact_on_smooth = deflated(P, problem.Q, smooth_motions(problem))
# assert iterations(problem.Q, exact_on_smooth) < counts["p21"][nodes]
# ```
#
# </details>

# **4.** $Q$ is dense. How many numbers does it hold for a 3D interface of
# 100 x 100 nodes? How can a product $Q r$ be computed without forming $Q$?
#
# <details><summary>Solution</summary>
#
# It holds $(3 \cdot 10^4)^2 = 9 \cdot 10^8$ numbers, which take 7 GB. A product $Q r$ does not need
# $Q$ itself: one forward and one backward substitution with the factors of each body are enough,
# and `reduce(scene, Q="implicit")` gives a $Q$ that is known by such products.
#
# ```python
# assert (3 * 100 * 100) ** 2 * 8 / 1e9 > 7
# ```
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

# %% [markdown]
# # Chapter 6. Large problems in three dimensions
#
# In three dimensions the friction force has two components, and its bound is a circle. The number
# of unknowns grows with the third power of the resolution. On small problems it is a matter of
# taste which method we take, and in which form. On large ones the choice decides whether we get an
# answer at all. One rule guides us: *model no more than a scene needs*.
#
# You need chapters 3 and 5. The chapter takes 50 minutes with its exercises.

# %%
import sys

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np

from contactopt import (
    HalfSpace,
    InterfaceProblem,
    Material,
    Rigid,
    Scene,
    models,
    reduce,
    scenes,
    solve,
)
from contactopt.analytic import contact_modulus, hertz_point
from contactopt.teaching import Slider

# the folder of the repository, where the exercises are
sys.path.extend([".", "../.."])
from experiments.course.grader import check, hint, table

# %% [markdown]
# ## The mechanical system
#
# A rigid plate presses a square rubber block on a foundation with 100 N. Two planes of symmetry cut
# the system into four equal quarters, and one of them is enough. It has about a fourth of the
# unknowns, and the same answer.
#
# The normal $n$ points out of the foundation, upwards. The two tangents $t_1$ and $t_2$ lie in the
# surface, along $x$ and $y$. Every contact has three components in the order $(n, t_1, t_2)$: the
# force on the block is $r = (r_n, r_1, r_2)$, and $u = (u_n, u_1, u_2)$ is the gap that remains
# with the two components of the slip. We write $r_t = (r_1, r_2)$ and $u_t = (u_1, u_2)$ for the
# tangential parts.

# %% tags=["hide-input"]
fig = plt.figure(figsize=(5.4, 4.2), layout="constrained")
ax = fig.add_subplot(projection="3d", computed_zorder=False)
ax.bar3d(
    -40, -40, -30, 80, 80, 30, color="C1", alpha=0.12, shade=False, zorder=0
)  # the foundation, cut off
ax.bar3d(-20, -20, 0, 40, 40, 40, color="C0", alpha=0.10, shade=False, zorder=1)
ax.bar3d(
    0, 0, 0, 20, 20, 40, color="C0", alpha=0.45, shade=False, zorder=2
)  # the quarter that is modelled
ax.quiver(
    10, 10, 68, 0, 0, -25, color="C3", lw=2, arrow_length_ratio=0.3, zorder=3
)
ax.text(13, 10, 58, "100 N", color="C3", zorder=3)
for way, name in (
    ((0, 0, 30), "$n$"),
    ((30, 0, 0), "$t_1$"),
    ((0, 30, 0), "$t_2$"),
):
    ax.quiver(
        -40, -44, 0, *way, color="k", lw=1.8, arrow_length_ratio=0.25, zorder=3
    )
    ax.text(
        -40 + 1.2 * way[0], -44 + 1.2 * way[1], 1.2 * way[2], name, zorder=3
    )
ax.text(8, -4, -9, "20 mm", zorder=3)
ax.text(22, 22, 18, "40 mm", zorder=3)
ax.set_box_aspect((1, 1, 0.8), zoom=1.15)
ax.set_axis_off()
ax.view_init(elev=22, azim=-58)

# %% [markdown]
# ## Primal and dual with a given friction bound
#
# As before, let the friction bound $g_i$ of every contact be given first. Only one thing is new:
# $|r_{t,i}|$ and $|u_{t,i}|$ are now the lengths of vectors with two components. $S = Q^{-1}$ is
# the stiffness at the contact. $V$ is the motion of the plate, $\lambda$ its size, and $s$ is the
# load on it, positive upwards.
#
# Primal, in displacements:
#
# $$ \min_{u_n \ge 0,\; \lambda} \; \tfrac12 (u - q - V\lambda)' S\, (u - q - V \lambda) - s' \lambda + \sum_i g_i |u_{t,i}| . $$
#
# Dual, in forces:
#
# $$ \min_r \; \tfrac12 r' Q r + q' r \qquad \text{subject to} \qquad r_n \ge 0, \quad |r_{t,i}| \le g_i, \quad V' r + s = 0 . $$
#
# ## The optimality conditions
#
# The optimality conditions of Karush, Kuhn and Tucker (KKT conditions) are those of chapter 5, but
# the tangential parts are vectors in the surface. Friction points against the slip:
#
# $$ u = Q\, r + V \lambda + q, \qquad V' r + s = 0, \qquad u_{n,i} \ge 0, \quad r_{n,i} \ge 0, \quad u_{n,i}\, r_{n,i} = 0, $$
#
# $$ |r_{t,i}| \le g_i, \qquad u_{t,i} \ne 0 \;\Rightarrow\; r_{t,i} = -g_i\, \frac{u_{t,i}}{|u_{t,i}|} . $$
#
# Coulomb's law asks in addition that $g_i = \mu r_{n,i}$. Then each force lies in a round cone,
# $\sqrt{r_1^2 + r_2^2} \le \mu r_n$.
#
# ## Both programs for one node
#
# One node without a plate shows the programs on one screen. It is pressed on the floor and pulled
# along the first tangent, hard enough to slip. The friction bound is 0.5 N. A constraint on the
# length of a vector makes the dual a *second-order cone program* (SOCP).


# %%
def pulled(degrees):
    """One node on its own: pressed down by 1 mm and pulled 3 mm, in the
    direction with that angle from the first tangent.
    """
    angle = np.deg2rad(degrees)
    return InterfaceProblem(
        np.eye(3), [[-1.0, 3 * np.cos(angle), 3 * np.sin(angle)]], 0.5
    )


one, bound = pulled(0.0), 0.5
Q, q = one.Q, one.q[0]

u = cp.Variable(3)
primal_energy = cp.quad_form(u - q, np.linalg.inv(Q)) / 2 + bound * cp.norm(
    u[1:]
)
cp.Problem(cp.Minimize(primal_energy), [u[0] >= 0]).solve(solver=cp.CLARABEL)

r = cp.Variable(3)
disc = cp.norm(r[1:]) <= bound
cp.Problem(
    cp.Minimize(cp.quad_form(r, Q) / 2 + q @ r), [r[0] >= 0, disc]
).solve(solver=cp.CLARABEL)
print(f"u = {np.round(u.value, 4)} mm, r = {np.round(r.value, 4)} N")

assert np.allclose(r.value, [1.0, -0.5, 0.0], atol=1e-4)
assert np.allclose(u.value, Q @ r.value + q, atol=1e-3)

# %% [markdown]
# ## Polygons in place of circles
#
# Many codes replace the circle by a polygon with $m$ edges, also called facets. All constraints are
# then linear, and the program is a quadratic program (QP). But a polygon inside the circle is a
# weaker law. In the direction of the middle of an edge it carries less friction. It also prefers
# the directions of its corners, which the material does not.


# %% tags=["hide-input"]
def polygon(facets):
    angle = np.linspace(0, 2 * np.pi, 721)
    half = np.pi / facets
    fig, ax = plt.subplots(figsize=(3.6, 3.6), layout="constrained")
    ax.plot(np.cos(angle), np.sin(angle), "k", lw=1, label="circle")
    corners = (2 * np.arange(facets + 1) + 1) * half
    ax.plot(np.cos(corners), np.sin(corners), "C1", label=f"{facets} facets")
    ax.set(
        aspect="equal",
        xlabel=r"$r_1 / (\mu r_n)$ [-]",
        ylabel=r"$r_2 / (\mu r_n)$ [-]",
    )
    ax.set_title(f"up to {100 * (1 - np.cos(half)):.1f} % less friction")
    ax.legend(frameon=False, loc="center")
    return fig


Slider("facets [-]", [3, 4, 6, 8, 12, 16, 32], polygon, start=3)

# %% [markdown]
# The node from above shows the difference. `contactopt.models` has both programs ready, with the
# circle and with a polygon.

# %%
program = {
    name: models.tresca(one, facets=facets)
    for name, facets in (("circle", None), ("8 facets", 8))
}
for name, each in program.items():
    each.parameters["g"].value = np.array([0.5])
    each.problem.solve(solver=cp.CLARABEL)
    force = each.variables["r"].value[1:]
    print(f"{name}: friction {np.linalg.norm(force):.4f} N")

round_force = np.linalg.norm(program["circle"].variables["r"].value[1:])
assert np.isclose(round_force, 0.5, atol=1e-4)
assert np.linalg.norm(program["8 facets"].variables["r"].value[1:]) < 0.47

# %% [markdown]
# ## The block
#
# Now we solve the block of the drawing, with Coulomb's law and $\mu = 0.3$. The colours of the
# figure show the pressure on the quarter. The arrows show the friction force on the block, and
# crosses mark the nodes that slip.

# %%
scene = scenes.flat_punch(3, mu=0.3, elements=8)
problem = reduce(scene)
answer = solve(problem)
shear, pressure = (
    np.linalg.norm(answer.reactions[:, 1:], axis=1),
    answer.reactions[:, 0],
)
slips = shear > (1 - 1e-6) * 0.3 * pressure
x, y = problem.coordinates[:2]

fig, ax = plt.subplots(figsize=(4.6, 3.8), layout="constrained")
dots = ax.scatter(
    x, y, c=pressure / problem.areas, s=110, marker="s", alpha=0.6
)
ax.quiver(
    x, y, *answer.reactions[:, 1:].T, color="black", width=0.005, zorder=3
)
ax.plot(x[slips], y[slips], "rx", ms=5, label="slips", zorder=4)
ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
fig.colorbar(dots, label="pressure [MPa]")
print(f"{int(slips.sum())} of {problem.contacts} slip, {answer.residual:.0e}")

assert answer.solved and 0 < slips.sum() < len(slips)

# %% [markdown]
# ## Primal or dual?
#
# Let the block have $N$ nodes along each edge. Then it has about $3 N^3$ displacements and $3 N^2$
# contact forces.
#
# | | unknowns | matrix | memory for $N = 100$ |
# |---|---|---|---|
# | primal | $3 N^3$ | sparse, 81 entries per row | 3 GB, and more for its factors |
# | dual, $Q$ as an array | $3 N^2$ | dense | 7 GB (as in exercise 6.1) |
# | dual, $Q$ known by its products | $3 N^2$ | never formed | as much as the primal |
#
# The third way never forms $Q$. It computes products $Q r = \sum_b T_b K_b^{-1} T_b' r$. The sum is
# over the bodies $b$, with the stiffness $K_b$ and the matrix $T_b$ that picks the contact, as in
# chapter 4. Each product takes one linear solve with each body. So the number of products decides
# the cost.
#
# ## A preconditioner for the surface
#
# With products alone, a linear system is solved by an iteration such as conjugate gradients. Its
# number of steps grows like the square root of the condition number of the matrix. On the surface
# of a body, $Q$ divides a wave of pressure by its wave number. Therefore the condition number of
# $Q$ grows like $N$, and the number of products in a step of Newton's method grows like $\sqrt N$.
#
# A *preconditioner* is a cheap approximation of $Q^{-1}$ that makes the iteration short. Here it
# multiplies a wave by its wave number. This operation is the square root of the Laplacian of the
# surface. (The paper by A. Lotfi works with it as the $H^{1/2}$ seminorm.) We count the products of
# all steps of Newton's method and divide by the number of steps, in the plane, where fine meshes are
# quick.

# %%
names = ("none", "p21", "neumann")
products, sizes = {name: [] for name in names}, (12, 24, 48, 96, 192)
for elements in sizes:
    implicit = reduce(
        scenes.flat_punch(2, mu=0.3, elements=elements), Q="implicit"
    )
    for name in names:
        history = solve(
            implicit, "newton", linear="krylov", preconditioner=name
        ).history
        products[name].append(history[-1]["products"] / len(history))

fig, ax = plt.subplots(figsize=(5.4, 3.2), layout="constrained")
labels = "none", "$P_{21}$ of the paper", "square root of the Laplacian"
for counts, style, label in zip(
    products.values(), ("ko-", "C1^-", "C2s-"), labels
):
    ax.semilogx(sizes, counts, style)
    ax.text(14, counts[0] + 0.3, label, color=style[:-2])
ax.set(xlabel="elements across the half-width [-]", ylim=(0, 17))
ax.set_xticks(sizes, sizes)
ax.minorticks_off()
_ = ax.set_ylabel("products with Q in a step [-]")

assert products["none"][-1] > 1.4 * products["none"][0]  # grows
assert products["neumann"][-1] < 1.1 * products["neumann"][0]  # does not

# %% [markdown]

# %% [markdown]
# ## The $H^{1/2}$ seminorm on a circle
#
# Where does the square root of the Laplacian come from, and why does a *sparse* matrix replace it?
# You need only Fourier series. Let the edge of a disc be the closed curve $0 \le t < 2\pi$, and $u(t)
# = \sum_k u_k e^{i k t}$ a displacement on it. Its $H^{1/2}$ seminorm compares all pairs of points:
#
# $$ |u|^2 = \frac{1}{4 \pi^2} \int_0^{2\pi}\!\! \int_0^{2\pi} \frac{|u(s) - u(t)|^2}{4 \sin^2 \frac{s - t}{2}}\, ds\, dt . $$
#
# The denominator is the squared length of the chord between two points of the unit circle.
#
# **Step 1: it multiplies a wave by its wave number.** Put $s = t + \tau$. The wave $u_k e^{ikt}$
# changes by the factor $e^{ik\tau} - 1$, and $|e^{ik\tau} - 1|^2 = 4 \sin^2 \frac{k \tau}{2}$. Waves are
# orthogonal (Parseval), so the integral over $t$ is $2\pi \sum_k |u_k|^2\, 4 \sin^2 \frac{k\tau}{2}$.
# What remains is
#
# $$ \int_0^{2\pi} \frac{\sin^2 (k \tau / 2)}{\sin^2 (\tau / 2)}\, d\tau = \int_0^{2\pi} \bigl| 1 + e^{i\tau} + \dots + e^{i (k - 1) \tau} \bigr|^2 d\tau = 2 \pi k \qquad (k \ge 1), $$
#
# a geometric series, and Parseval again. Together:
#
# $$ |u|^2 = \sum_k |k|\, |u_k|^2 . $$
#
# The surface of a body has a stiffness of this kind, since $Q$ divides a wave by its wave number. So
# the matrix of the seminorm is a preconditioner.
#
# **Step 2: on nodes it is a circulant.** Take $2m$ nodes at equal distances, and replace the integrals
# by sums over all pairs of different nodes. The weight of a pair depends only on its distance $l$.
# A matrix whose rows are shifted copies of each other is a *circulant*. Its eigenvectors are the waves,
# and its eigenvalues are called its *symbol*. For small $l$ the weight is proportional to $1 / l^2$, so
# we write it as $(\pi / 2m)^2 / \sin^2 (\pi l / 2m)$. The sum over all
# $l$ from 0 is $2 m j$, by Parseval as in step 1, and its first term is $j^2$. So the symbol is
#
# $$ 2 \Bigl(\frac{\pi}{2m}\Bigr)^2 \sum_{l = 1}^{2m - 1} \frac{\sin^2 (\pi j l / 2m)}{\sin^2 (\pi l / 2m)} = \frac{\pi^2}{2 m^2}\, j\, (2m - j), \qquad 0 \le j \le m . $$
#
# It lies between $\pi^2 j / 2m$ and $\pi^2 j / m$: it is *equivalent* to the wave number.

# %% tags=["hide-input"]
m = 16
distance = np.arange(1, 2 * m)
sine = np.sin(np.pi * distance / 2 / m)
row = np.pad((np.pi / 2 / m / sine) ** 2, (1, 0))
shift = np.subtract.outer(np.arange(2 * m), np.arange(2 * m)) % (2 * m)
fig, (left, right) = plt.subplots(
    1, 2, figsize=(7.2, 3.2), layout="constrained"
)
image = left.imshow(np.ma.masked_equal(row[shift], 0), norm="log", cmap="Blues")
left.set(xlabel="node", ylabel="node", title="weights of the pairs")
fig.colorbar(image, ax=left)
nodes = np.arange(2 * m)
for wave, color in ((1, "C0"), (3, "C1")):
    right.plot(nodes, np.cos(np.pi * wave * nodes / m), color + "o-", ms=3)
_ = right.set(xlabel="node", yticks=(-1, 0, 1), title="two of its eigenvectors")

# %% [markdown]
# **Step 3: the paper makes it sparse.** Its equation (27) puts the distances into groups: 1; then 2
# and 3; then 4 to 7; then 8 to 15. The group $2^{i-1} \le l \lt 2^i$ gets one distance, $2^i - 1$, with
# the sum of its weights, $w_i = \sum_l 1 / l^2$. (For $l < m$ this differs from the weight of step 2
# by at most the factor $\pi^2 / 4$.) So a row has about $2 \log_2 m$ entries, and a product
# takes $O(m \log m)$ operations without any Fourier transform. The symbol is $\sum_i 2 w_i\, (1 - \cos
# ((2^i - 1) \pi j / m))$.
#
# Is this still $|k|$? No, but it is equivalent: the symbol divided by $j / m$ stays between two bounds
# for all $m$. The reason is that $w_i$ lies between $2^{-i-1}$ and $2^{1-i}$. A wave with the angle
# $\theta = \pi j / m$ per node hardly feels distances much shorter than its length: these terms sum up
# to at most $\theta^2 \sum 2^i$, a multiple of $\theta$. Longer distances give at most $\sum 2^{-i}$, a
# multiple of $\theta$ as well. One distance fits the wave, and gives at least a multiple of $\theta$.
# (If $m$ is not a power of two, the last group does not fit. Then rows do not sum up to zero, and
# the matrix is no seminorm.)


# %%
def sparse_seminorm(m):
    """First column of equation (27), for m a power of two."""
    column, distance = np.zeros(2 * m), np.arange(1, m)
    for i in range(1, int(np.log2(m)) + 1):
        group = (distance >= 2 ** (i - 1)) & (distance < 2**i)
        column[[2**i - 1, 1 - 2**i]] = -np.sum(1.0 / distance[group] ** 2)
    column[0] = -column.sum()
    return column


# %% tags=["hide-input"]
angle = np.pi / m * nodes
x = np.stack([np.sin(angle), np.cos(angle)])
fig, axes = plt.subplots(1, 2, figsize=(7.2, 3.6), layout="constrained")
for ax, weights, title in zip(
    axes,
    (row, -sparse_seminorm(m)),
    ("all pairs", "one distance for each group"),
):
    for node in nodes[1:][weights[1:] > 0]:
        ax.plot(*x[:, [0, node]], "C0", lw=6 * np.sqrt(weights[node]))
    ax.plot(*x, "ko", ms=4)
    ax.set(aspect="equal", title=title)
    ax.axis("off")

# %% [markdown]
# **Step 4: a contact is only a part of the curve.** Let $E$ extend a displacement of the $N$ contact
# nodes by zero to all $2m$ nodes, and let $Q_b$ be the circulant for the body $b$. The paper's
# equation (25) is
#
# $$ P_{21} = \sum_b E_b' Q_b E_b . $$
#
# The body itself continues $u$ in the way that costs it the *least* energy. So the zero extension
# costs at least as much. How much more? A displacement that vanishes at the ends of the contact is
# continued smoothly enough. Any other displacement gets a jump. In the double integral, the pairs
# with one point inside and one outside add a multiple of $\int |u|^2 / \text{(distance to the end)}$.
# On a mesh this is at most $\max |u|^2$ times $\log N$. Continue $u$ by its mirror image instead. This
# makes no jump, and costs at most a fixed multiple of the least energy. The maximum is bounded by the
# seminorm of this function, up to another logarithm:
#
# $$ \max |u| \le |u_0| + \sum_{k \ne 0} |u_k| \le |u_0| + \Bigl( \sum_{0 < |k| \le N} \frac{1}{|k|} \Bigr)^{1/2} |u| \;\lesssim\; |u_0| + (2 \log N)^{1/2}\, |u| . $$
#
# So the extension makes the energy larger by at most a multiple of $\log^2 N$. (The mean $u_0$ has its
# own place in the energy, because the body is held.) This is the bound
# $O(\log^2 N)$ of the paper. *It comes from displacements that do not vanish at the ends.*

# %% tags=["hide-input"]
t = np.linspace(0, 2, 400)
u = np.where(t < 1, 0.8 + 0.2 * np.sin(np.pi * t) ** 2, np.nan)
fig, axes = plt.subplots(
    1, 2, figsize=(7.2, 2.6), layout="constrained", sharey=True
)
for ax, rest, title in zip(
    axes, (0 * t, u[::-1]), ("extended by zero", "by its mirror image")
):
    ax.plot(t, np.where(t > 1, rest, np.nan), "C1", lw=2)
    ax.plot(t, u, "C0", lw=2)
    ax.axvspan(0, 1, color="0.93")
    ax.text(0.5, 0.1, "contact", ha="center")
    ax.set(title=title, xticks=[], xlabel="along the curve", ylim=(-0.05, 1.1))
for place in (0, 1, 2):
    axes[0].plot([place, place], [0, 0.8], "C3:", lw=2)
axes[0].text(1.04, 0.4, "jump", color="C3")
_ = axes[0].set(ylabel="displacement $u$", yticks=[])

# %% [markdown]
# **Step 5: forces have no such jump.** Outside the contact the force *is* zero. Equation (26) extends
# forces. With $L$ for the $H^1$ norm, whose symbol grows like $1 + k^2$, the circulant $L^{-1} Q$ has a
# symbol like $1 / |k|$. It resembles the compliance, and
#
# $$ P_{22} = \Bigl( \sum_b E_b' L_b^{-1} Q_b E_b \Bigr)^{-1} $$
#
# has no logarithm. But each application solves a system. Both belong *inside* conjugate gradients
# (PCG), as approximations of $Q^{-1}$. PCG needs about $\sqrt{\kappa}$ steps, where $\kappa$ is the
# condition number of $P Q$. We measure it on a contact that is half of the curve, with a compliance that
# divides each wave by its wave number.


# %%
def circulant(symbol):
    """The matrix with this symbol for the waves 0, 1, ... of 2 m nodes."""
    waves = np.fft.fft(np.eye(len(symbol)), axis=0)
    return np.fft.ifft(symbol[:, None] * waves, axis=0).real


kappa = {"none": [], "P21": [], "P22": []}
sizes = 2 ** np.arange(3, 9)
for N in sizes:
    k = np.minimum(np.arange(2 * N), 2 * N - np.arange(2 * N))  # m = N
    part = np.s_[:N, :N]  # half of the curve
    C = circulant(1 / np.maximum(k, 0.5))[part]
    seminorm = np.fft.fft(sparse_seminorm(N)).real
    h1 = 2 * N / np.pi * (1 - np.cos(np.pi * k / N)) + np.pi / N
    for name, P in (
        ("none", np.eye(N)),
        ("P21", circulant(seminorm)[part]),
        ("P22", np.linalg.inv(circulant(seminorm / h1)[part])),
    ):
        values = np.sort(np.linalg.eigvals(P @ C).real)
        kappa[name].append(values[-1] / values[0])
print({name: np.round(values, 1).tolist() for name, values in kappa.items()})

m = 128
j = np.arange(1, m + 1)
symbol = np.fft.fft(sparse_seminorm(m)).real[1 : m + 1]
pairs = np.pi**2 / (2 * m**2) * j * (2 * m - j)
assert abs(sparse_seminorm(m).sum()) < 1e-12
assert 1.2 < (symbol * m / (np.pi * j)).min() < 5
assert kappa["none"][-1] > 30 * kappa["none"][0]  # grows like N
assert kappa["P21"][-1] < 5 * kappa["P21"][0]  # like a power of log N
assert kappa["P22"][-1] < 1.2 * kappa["P22"][0]  # does not grow

# %% tags=["hide-input"]
fig, (left, right) = plt.subplots(
    1, 2, figsize=(7.2, 3.5), layout="constrained"
)
left.plot(j / m, np.pi**2 * j / m, "k--", lw=1, label="$|k|$")
left.plot(j / m, pairs, "C0", label="all pairs (step 2)")
left.plot(j / m, symbol, "C1", label="sparse (27)")
left.set(xlabel="wave $j / m$ [-]", ylabel="symbol [-]", title="128 waves")
left.legend(frameon=False)
for (name, values), style in zip(kappa.items(), ("ko-", "C1^-", "C2s-")):
    right.loglog(sizes, values, style)
    right.text(sizes[-1] * 1.15, values[-1] * 0.9, name, color=style[:-2])
right.set(xlabel="contact nodes N [-]", ylabel="condition number of $P Q$ [-]")
_ = right.set(xlim=(7, 700))

# %% [markdown]
# Without a preconditioner the condition number doubles with the number of nodes. With $P_{21}$ it
# grows like a power of $\log N$. With $P_{22}$ it does not grow, but it is larger at these sizes.
# [A room of the museum](../museum.md#the-sparse-seminorm-and-its-symbol) has both symbols with sliders,
# and [the first tutorial](../tutorials/why_the_preconditioner_works.py) does the same with elastic
# bodies.
#
# ## Without a mesh
#
# A body that is large compared with its contact may be modelled as a half-space, elastic
# everywhere below a plane. Then nothing is meshed. $Q$ is a convolution with a function that is
# known exactly, so that a product takes a few fast Fourier transforms. The dual program and the
# certificate stay the same. Here a rigid sphere is pressed on a half-space, with 4,096 contacts,
# and compared with Hertz's exact solution:

# %%
rubber, R, P = Material(E=5.0, nu=0.3), 400.0, 100.0
hertz = hertz_point(P, R, contact_modulus(rubber))
grid = (
    np.arange(64) + 0.5
) * 2.5 * hertz.half_width / 64 - 1.25 * hertz.half_width
sphere = Rigid(
    "sphere", gap=lambda p: (p[0] ** 2 + p[1] ** 2) / (2 * R), force={"z": -P}
)
ball = Scene(
    "sphere",
    sphere,
    HalfSpace("block", rubber, (grid, grid)),
    0.0,
    kind="solid",
    law="frictionless",
)
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
peak = p.max() / hertz.peak
print(
    flat.contacts,
    "contacts,",
    round_answer.products,
    f"products, {peak:.4f} of Hertz",
)

assert round_answer.solved and abs(p.max() / hertz.peak - 1) < 5e-3

# %% [markdown]
# ## What fails
#
# - **The matrix is too large.** $Q$ as an array needs $8\,(3k)^2$ bytes for $k$ contacts.
#   contactopt refuses an array that is too large, and says its size.
# - **The preconditioner takes the place of the matrix.** A preconditioner $P$ is near $Q^{-1}$, but
#   it is not $Q^{-1}$. Inside an iteration it changes the cost and not the answer. If $P^{-1}$ is
#   put in place of $Q$, the answer is that of another problem. The cell below shows how wrong it
#   can be.
# - **The products are not accurate enough.** If the products are accurate to $10^{-4}$ only, the
#   certificate cannot fall below about $10^{-4}$. The products must become more accurate while the
#   outer iteration converges.

# %%
Q = problem.Q
wrong = InterfaceProblem(
    np.diag(np.diag(Q)), problem.q, 0.3, problem.V, problem.s
)  # the diagonal in place of Q
other = solve(wrong)
difference = (
    np.abs(other.reactions - answer.reactions).max() / answer.reactions.max()
)
print(f"the diagonal in place of Q: {difference:.0%} of the largest force")

assert difference > 0.1

# %% [markdown]
# ## Exercises
#
# Replace `...` by your answer and run the cell. It says what is wrong with your answer in terms of
# mechanics. `hint("6.1")` gives a hint, three times, and then the solution. `table(6)` shows what
# you have done since the notebook was started.
#
# Give numbers with at least three digits: 0.1 percent is close enough. Counts are exact. Forces and
# displacements are graded by the certificate, which must be at most $10^{-3}$.
#
# **6.1** (Pen and paper.) A contact surface has $120 \times 80$ nodes in 3D. How many gigabytes
# ($10^9$ bytes) does $Q$ take as an array of numbers of 8 bytes?

# %% tags=["exercise"]
answer = ...  # memory [GB]
check("6.1", answer)

# %% [markdown]
# **6.2** (Pen and paper.) The circle of the friction bound is replaced by a polygon inside it. How
# many facets are needed so that at most 0.7 % of the friction is lost in any direction?

# %% tags=["exercise"]
answer = ...  # number of facets
check("6.2", answer)

# %% [markdown]
# **6.3** (Program.) By which factor does the peak pressure under the sphere grow when the load
# grows from 100 N to 260 N? Solve the half-space with 260 N to find the factor. (Make the grid wide
# enough.) Hertz's exact solution grades your answer,
# and 1 percent is close enough.

# %% tags=["exercise"]
answer = ...  # peak at 260 N / peak at 100 N
check("6.3", answer)

# %% [markdown]
# **6.4** (Program.) Pull the node of the beginning in another direction, `pulled(50.0)`, and take
# *eight* facets instead of the circle. In the material, friction pulls back along the same line, at
# 50 degrees from the first tangent. At which angle does it pull back with eight facets? (Give an
# angle between 0 and 90 degrees.)

# %% tags=["exercise"]
answer = ...  # angle [degrees]
check("6.4", answer)

# %% [markdown]
# **6.5** (Pen and paper.) A rigid sphere is pressed on rubber with $E = 5.5$ MPa and $\nu = 0.42$.
# How large is the contact modulus $E^*$ in Hertz's formulas?

# %% tags=["exercise"]
answer = ...  # contact modulus [MPa]
check("6.5", answer)

# %% [markdown]
# **6.6** (Think.) A pressure wave $p = 0.2 \cos(k x)$ MPa with a wavelength of 3 mm acts on a
# half-space with $E^* = 6$ MPa. How large is the amplitude of the displacement of its surface? A
# point load $P$ moves the surface by $P / (\pi E^* r)$ at the distance $r$.

# %% tags=["exercise"]
answer = ...  # amplitude of the displacement [mm]
check("6.6", answer)

# %% [markdown]
# **6.7** (Pen and paper.) The error of conjugate gradients after $j$ steps is at most $2 e^{-2 j /
# \sqrt{\kappa}}$ times the first one, where $\kappa$ is the condition number. After how many steps
# is this bound $10^{-6}$ or less for $\kappa = 900$?

# %% tags=["exercise"]
answer = ...  # number of iterations
check("6.7", answer)

# %% [markdown]
# **6.8** (Program.) One node has $Q = \begin{pmatrix} 1 & 0.2 & -0.1 \\ 0.2 & 1.5 & 0.3 \\ -0.1 &
# 0.3 & 2 \end{pmatrix}$ mm/N, $q = (-1.4, 1.2, -1.9)$ mm and $\mu = 0.45$. Give its
# *displacements*. The certificate grades the forces that belong to them.

# %% tags=["exercise"]
answer = (..., ..., ...)  # u_n, u_1, u_2 [mm]
check("6.8", answer)

# %% [markdown]
# **6.9** (Pen and paper.) How large is the squared seminorm $|u|^2$ of $u(t) = 1.5 + 0.8 \cos 3t -
# 0.6 \sin 7t$ mm on the circle?

# %% tags=["exercise"]
answer = ...  # squared seminorm [mm^2]
check("6.9", answer)

# %% [markdown]
# **6.10** (Program.) By which factor is the sparse circulant (27) stiffer for $j = 21$ waves than for
# one wave, on a circle with $2m = 128$ nodes?

# %% tags=["exercise"]
answer = ...  # ratio of the symbols [-]
check("6.10", answer)

# %%
table(6)

# %% [markdown]
# ## References
#
# - A. Lotfi, Domain-Decomposition based $H^{1/2}$ Seminorm Preconditioners for Frictional Contact
#   Problems: the preconditioners and the reduction to the interface.
# - K. L. Johnson, *Contact Mechanics*, Cambridge University Press 1985,
#   [doi:10.1017/CBO9781139171731](https://doi.org/10.1017/CBO9781139171731).
#
# This is the end of the course. The tutorials go on from here. Each of them has one subject.

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

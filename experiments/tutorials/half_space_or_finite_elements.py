# %% [markdown]
# # 7. Half-space or finite elements?
#
# Seen from its contact, a large body looks like a half-space: everything below (or above) a plane
# is elastic. A half-space needs no mesh, because it is known since Boussinesq (1885) how its
# surface moves under a force. In this tutorial we solve the same contact, a rigid sphere on a
# block, with finite elements and with a half-space. We compare what each costs for a given
# accuracy. Then we make the block small, and see when the half-space is the wrong model.
#
# Reading time: 10 minutes. [Chapter 4](../course/chapter_4_from_bodies_to_the_interface.py) of
# the course explains $Q$ for finite elements.

# %%
import time

import matplotlib.pyplot as plt
import numpy as np

from contactopt import HalfSpace, Material, Rigid, Scene, reduce, scenes, solve
from contactopt.analytic import contact_modulus, hertz_point

rubber = Material(E=5.0, nu=0.3)
P, R = 100.0, 400.0  # N, mm
exact = hertz_point(P, R, contact_modulus(rubber))
print(
    f"Hertz: contact radius {exact.half_width:.3f} mm,"
    f" peak pressure {exact.peak:.4f} MPa, approach {exact.approach:.4f} mm"
)

# %% [markdown]
# ## What a half-space is here
#
# We put points on a square of the surface, evenly spaced by $h$. Each point represents a cell of
# $h \times h$ that carries a uniform traction. A unit of force on one cell moves the middle of
# another cell by the integral of $1/\rho$ over the loaded cell, up to a constant factor. ($\rho$
# is the distance.) Love wrote this integral down in closed form in 1929. It depends on the
# distance of the two cells alone. So $Q$ is a convolution, and a product $Qr$ costs a few fast
# Fourier transforms, whatever the shape of the contact.

# %%
a = exact.half_width


def on_half_space(n: int) -> Scene:
    """The sphere on n x n points of a square that is 2.5 contact radii wide."""
    x = (np.arange(n) + 0.5) * 2.5 * a / n - 1.25 * a
    sphere = Rigid(
        "sphere",
        gap=lambda p: (p[0] ** 2 + p[1] ** 2) / (2 * R),
        force={"z": -P},
    )
    return Scene(
        "sphere",
        sphere,
        HalfSpace("block", rubber, (x, x)),
        0.0,
        kind="solid",
        law="frictionless",
    )


small = reduce(on_half_space(12))
Q = small.Q.to_dense()
assert np.allclose(Q, Q.T)
assert np.linalg.eigvalsh(Q).min() > 0
r = np.random.default_rng(0).normal(size=len(Q))
assert np.allclose(small.Q @ r, Q @ r)

# %% [markdown]
# The array above has $432^2$ entries. With $512 \times 512$ points it would have $6 \cdot 10^{11}$,
# but the transforms need about a hundred megabytes only. Nothing else changes: the problem $u = Qr + V\lambda
# + q$, its solvers and its certificate are the same as for finite elements.

# %%
begin = time.perf_counter()
problem = reduce(on_half_space(256))
solution = solve(problem)
seconds = time.perf_counter() - begin
pressure = solution.reactions[:, 0] / problem.areas
assert solution.solved and problem.contacts == 65536
assert abs(pressure.max() / exact.peak - 1) < 1e-3
assert abs(-solution.multipliers[0] / exact.approach - 1) < 1e-4
print(
    f"{problem.contacts} contacts, {seconds:.1f} s,"
    f" {solution.products} products, residual {solution.residual:.0e}"
)

# %% [markdown]
# ## The same with finite elements
#
# Finite elements can use the symmetry about the axis, which saves most of the work. The scene
# `sphere` with a rigid sphere is a block with a radius and a height of 800 mm, which is 45 times
# the contact radius. We draw the error of the pressure, in the mean square over the contact,
# against the time that each model needs.


# %%
def error_and_seconds(scene: Scene) -> tuple[float, float]:
    begin = time.perf_counter()
    problem = reduce(scene)
    solution = solve(problem)
    seconds = time.perf_counter() - begin
    distance = np.linalg.norm(problem.coordinates[: scene.dim - 1], axis=0)
    hertz, w = exact.pressure(distance), problem.areas
    computed = solution.reactions[:, 0] / np.maximum(w, 1e-300)
    return float(
        np.sqrt(np.sum(w * (computed - hertz) ** 2) / np.sum(w * hertz**2))
    ), seconds


meshed = np.array(
    [
        error_and_seconds(scenes.sphere(rigid="sphere", mu=0.0, elements=n))
        for n in (8, 16, 32)
    ]
)
spaced = np.array(
    [error_and_seconds(on_half_space(n)) for n in (20, 40, 80, 160)]
)

fig, ax = plt.subplots(figsize=(5.5, 3.8), layout="constrained")
ax.loglog(
    meshed[:, 1],
    meshed[:, 0],
    "o-",
    color="C1",
    label="finite elements, axisymmetric",
)
ax.loglog(spaced[:, 1], spaced[:, 0], "o-", color="C0", label="half-space, 3D")
ax.set(xlabel="seconds", ylabel="error of the pressure [-]")
ax.legend(frameon=False)
assert spaced[-1, 0] < 0.01
assert spaced[-1, 0] < spaced[0, 0] / 3

# %% [markdown]
# The half-space is three-dimensional and does not use the symmetry, yet it costs no more. Finite
# elements in three dimensions would need about a hundred times the unknowns of the section. The
# rule is: *model no more than a scene needs*. If the bodies are large compared with the contact,
# we need no mesh of their volume.
#
# ## When the half-space is wrong
#
# The half-space rests on two assumptions. The slopes of the surfaces are small, so the contact
# radius $a$ is much smaller than the radius $R$ of the sphere. And the body is large compared
# with the contact, so its thickness $H$ is many times $a$. Let us break the second assumption. We
# make the block thinner, from 40 to 2 contact radii, and glue it to a rigid floor. The half-space
# stays what it is.

# %%
thickness = np.array([2.0, 4.0, 8.0, 16.0, 40.0])
stiffer = []
for H in thickness * a:
    block = scenes.sphere(
        rigid="sphere",
        mu=0.0,
        elements=16,
        foundation_height=H,
        foundation_radius=800.0,
    )
    thin = reduce(block)
    answer = solve(thin)
    stiffer.append(
        (
            -answer.multipliers[0] / exact.approach,
            (answer.reactions[:, 0] / np.maximum(thin.areas, 1e-9)).max(),
        )
    )
approach, peak = np.array(stiffer).T
peak = peak / exact.peak

fig, ax = plt.subplots(figsize=(5.5, 3.8), layout="constrained")
ax.semilogx(thickness, approach, "o-", color="C1", label="approach")
ax.semilogx(thickness, peak, "s-", color="C2", label="peak pressure")
ax.axhline(1.0, color="C0", label="half-space")
ax.set_xticks(thickness, [f"{value:g}" for value in thickness])
ax.minorticks_off()
ax.set(
    xlabel="thickness of the block over contact radius, H / a",
    ylabel="finite elements over half-space",
)
ax.legend(frameon=False)
assert approach[0] < 0.8  # a thin block gives way less
assert np.all(np.diff(approach) > 0)
assert 0.9 < approach[2] < 0.95  # eight radii
assert np.all(np.abs(peak[1:] - 1) < 0.01)
assert abs(approach[-1] - 1) < 0.05

# %% [markdown]
# The pressure depends on the material near the contact. So it is nearly right as soon as the block
# is a few contact radii thick. The approach needs a much larger block, because far away from the
# contact the displacement falls only like $1/\rho$. A block of eight contact radii still approaches
# over 5 % less than the half-space. If you want pressures, a half-space is good for bodies of a few
# contact radii and more. If you want the stiffness, the body must be tens of radii large.
#
# ## Exercises
#
# **1.** How does the cost of a product grow? Measure the products and the time of the solution for
# 64, 128 and 256 points a side. Why does the number of products hardly grow?
#
# <details><summary>Solution</summary>
#
# ```python
# counts = [solve(reduce(on_half_space(n))).products for n in (64, 128, 256)]
# assert max(counts) < 1.6 * min(counts)
# ```
#
# Coarse grids find out which points are in contact, and only a few steps remain on the finest grid.
# The preconditioner is the inverse of the same convolution, so that each step takes few products.
# One product costs $O(n^2 \log n)$ operations for $n^2$ points.
#
# </details>
#
# **2.** Where does the block begin to yield? On the axis Hertz's pressure makes the stresses
# $\sigma_z = -p_0 / (1 + \zeta^2)$ and $\sigma_r = -\sigma_z / 2 - p_0\,(1 + \nu)\,(1 - \zeta
# \arctan(1/\zeta))$, where $\zeta = z / a$ (Johnson 1985, eq. 3.45). Find the largest von Mises
# stress $|\sigma_z - \sigma_r|$, and its depth.
#
# <details><summary>Solution</summary>
#
# ```python
# depth = np.linspace(0.3, 0.7, 401)  # over a
# down = -1 / (1 + depth**2)  # over the peak pressure
# aside = -down / 2 - (1 + rubber.nu) * (1 - depth * np.arctan(1 / depth))
# mises = np.abs(down - aside)
# assert abs(mises.max() - 0.62) < 0.005
# assert abs(depth[mises.argmax()] - 0.48) < 0.01
# ```
#
# It begins to yield below the surface, at a depth of about half a contact radius, where nobody sees
# it.
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

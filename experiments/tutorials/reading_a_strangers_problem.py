# %% [markdown]
# # 5. Reading a stranger's problem: FCLib
#
# FCLib is a collection of friction problems from real simulations: boxes in a stack, grains in a
# silo, a wall of bricks. It is also a file format (HDF5), by which people with different codes can
# work on the same problem. In this tutorial a stranger writes such a file without any help from
# this package. We read the file, look at the problem, solve it, and write a file back.
#
# Reading time: 10 minutes. You need the extra `fclib`.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import matplotlib.pyplot as plt
import numpy as np

from contactopt import (
    InputError,
    InterfaceProblem,
    diagnose,
    fclib,
    natural_map_residual,
    reduce,
    scenes,
    siconos_residual,
    solve,
)

folder = TemporaryDirectory()

# %% [markdown]
# ## The stranger
#
# A rigid cube has edges of 1 m and a mass of 1 kg. It slides over a floor at 0.5 m/s to the right
# and 0.2 m/s away from us, and touches the floor with its four lower corners. The stranger takes a
# time step of 0.05 s.
#
# The stranger's unknowns are *velocities* $v$ (three of the centre and three of rotation) and
# *impulses* $r$. The letters here are those of FCLib, whose global form reads
#
# $$ M v = H r + f, \qquad u = H' v + w . $$
#
# $M$ is the mass matrix. $f$ is the momentum that the cube has, together with what gravity adds to
# it in the step. $H'$ takes the motion of the cube to the velocities $u$ of its corners. The signs
# are those of this package: $n$ points out of the floor, $r_n \ge 0$ pushes the cube up, and the
# block of each corner has its normal component first.

# %%
M = np.diag([1.0, 1.0, 1.0, 1 / 6, 1 / 6, 1 / 6])  # kg and kg m^2
velocity, step = np.array([0.5, 0.2, 0.0, 0.0, 0.0, 0.0]), 0.05
f = M @ velocity - step * 9.81 * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])

corners = np.array(
    [[x, y, -0.5] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
)  # m, seen from the centre
directions = np.array(
    [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
)  # n, t1, t2
H = np.column_stack(
    [np.concatenate([d, np.cross(p, d)]) for p in corners for d in directions]
)


def write_matrix(group, matrix):
    """Stored by columns (nz = -1), by rows (-2), or as triplets."""
    rows, columns = np.nonzero(matrix)
    for key, value in (
        ("m", matrix.shape[0]),
        ("n", matrix.shape[1]),
        ("nz", len(rows)),
        ("nzmax", len(rows)),
    ):
        group[key] = np.array([value], dtype=np.int32)
    group["i"], group["p"], group["x"] = (
        rows.astype(np.int32),
        columns.astype(np.int32),
        matrix[rows, columns],
    )


path = Path(folder.name, "cube.hdf5")
with h5py.File(path, "w") as file:
    cube = file.create_group("fclib_global")
    cube["spacedim"] = np.array([3], dtype=np.int32)
    write_matrix(cube.create_group("M"), M)
    write_matrix(cube.create_group("H"), H)
    cube["vectors/f"], cube["vectors/w"], cube["vectors/mu"] = (
        f,
        np.zeros(12),
        np.full(4, 0.3),
    )

# %% [markdown]
# ## Reading the file
#
# One line reads the file. The result has the same type as the problems that come from finite
# elements, because the mathematics are the same. The motion is eliminated, so that $u = W r + q$
# with $W = H' M^{-1} H$ and $q = H' M^{-1} f + w$. What FCLib calls $W$ is called $Q$ here.

# %%
problem = fclib.read(path)
print(f"{problem.contacts} contacts in {problem.dim}D, mu = {problem.mu[0]}")

W = H.T @ np.linalg.solve(M, H)
assert np.allclose(problem.Q, W)
assert np.allclose(problem.q, (H.T @ np.linalg.solve(M, f)).reshape(4, 3))
assert np.all(
    problem.q[:, 0] < 0
)  # without contact all corners would sink in: gravity

# %% [markdown]
# ## Ask before you solve
#
# It is wise to look at an unknown problem first.

# %%
print(diagnose(problem))

assert np.linalg.matrix_rank(problem.Q) == 6

# %% [markdown]
# The matrix has 12 rows, but its rank is only 6. A rigid cube can move in six ways, but its four
# corners have twelve components. It is like a table on four legs, where nobody can say how much
# each leg carries. So the impulses are *not unique*, whatever the friction is. Solvers that need a
# positive definite matrix may fail here.
#
# ## Solve

# %%
answers = {
    method: solve(problem, method, tol=1e-10, max_iterations=5000)
    for method in ("auto", "nsgs", "acary_cadoux", "admm")
}
for method, answer in answers.items():
    v = np.linalg.solve(M, H @ answer.reactions.ravel() + f)
    print(
        f"{method:13} {answer.status!s:7} {answer.iterations:3} iterations, "
        f"impulses up {answer.reactions[:, 0].round(4)}, v = {v[:2].round(4)}"
    )
    assert answer.solved
    assert np.isclose(
        answer.reactions[:, 0].sum(), step * 9.81
    )  # together they carry the weight
    assert np.allclose(
        v[:2],
        velocity[:2] * (1 - 0.3 * step * 9.81 / np.linalg.norm(velocity[:2])),
    )
    assert np.allclose(v[2:], 0.0, atol=1e-9)

fig, ax = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
for i, (method, answer) in enumerate(answers.items()):
    ax.bar(
        np.arange(4) + 0.2 * i - 0.3,
        answer.reactions[:, 0],
        width=0.2,
        label=method,
    )
ax.set_xticks(
    range(4), ["rear right", "rear left", "front right", "front left"]
)
most = max(answer.reactions[:, 0].max() for answer in answers.values())
ax.set(xlabel="corner", ylabel="normal impulse [N s]", ylim=(0, 1.4 * most))
ax.legend(frameon=False, ncols=2, loc="upper left")

spread = np.ptp([answer.reactions[:, 0] for answer in answers.values()], axis=0)
assert spread.max() > 0.005

# %% [markdown]
# The methods find different impulses, but the *same motion*: friction takes $\mu g$ times the
# time step off the speed, against the direction of the motion. The front corners carry more,
# because friction at the floor tips the cube forwards. All four answers are certified, because the
# certificate asks whether the laws hold, and not whether one answer looks like another.
#
# ## Two ways to measure
#
# The FCLib community quotes the natural-map residual with step $\rho = 1$. That number changes if
# you measure mass in grams, because it adds velocities to impulses. Our certificate balances the
# two first and does not change.

# %%
r = answers["nsgs"].reactions
for label, unit in (("kg", 1.0), ("g", 1e3)):
    same = InterfaceProblem(problem.Q / unit, problem.q, problem.mu)
    ours, published = (
        natural_map_residual(same, unit * r),
        siconos_residual(same, unit * r),
    )
    print(f"in {label:2}: certificate {ours:.2e}, with rho = 1 {published:.2e}")
    if unit == 1.0:
        first = ours, published

assert np.isclose(ours, first[0], rtol=0.01, atol=0.0)
assert published < 0.1 * first[1]

# %% [markdown]
# ## Write one back
#
# Elastic problems fit into the local form of FCLib, $u = W r + V \lambda + q$. If a plate presses a
# block down, the contact forces must balance the load of the plate. FCLib calls this the equality
# part of its mixed form. All numbers are kept to the last bit. Coordinates and nodal areas are not
# part of the format, so they are lost.

# %%
block = reduce(scenes.flat_punch(3, elements=2, mu=0.2))
fclib.write(
    block,
    Path(folder.name, "block.hdf5"),
    title="block",
    description="a block pressed on a foundation, 100 N",
)
back = fclib.read(Path(folder.name, "block.hdf5"))

with h5py.File(Path(folder.name, "block.hdf5")) as file:
    print(
        "groups:",
        sorted(file["fclib_local"]),
        "vectors:",
        sorted(file["fclib_local/vectors"]),
    )

assert back.fingerprint == block.fingerprint
assert np.array_equal(back.V, block.V) and np.array_equal(back.s, block.s)
assert np.isclose(solve(back).reactions[:, 0].sum(), 100.0)

# %% [markdown]
# A broken file is refused with a sentence that names it.

# %%
Path(folder.name, "broken.hdf5").write_bytes(b"not an HDF5 file")
try:
    fclib.read(Path(folder.name, "broken.hdf5"))
except InputError as error:
    message = str(error)

assert "broken.hdf5' is not a usable FCLib file" in message
folder.cleanup()

# %% [markdown]
# ## Exercises
#
# **1.** Make the floor rough, $\mu = 2$. The cube should tip over. Which corners carry the weight,
# and what moves?
#
# <details><summary>Solution</summary>
#
# The friction impulse that would stop the motion to the right is 0.5 N s, and it acts half a metre
# below the centre. The normal impulse is 0.4905 N s, and it acts at most half a metre in front of
# the centre, which is not quite enough. Both rear corners lift off slowly.
#
# ```python
# rough = InterfaceProblem(problem.Q, problem.q, 2.0)
# answer = solve(rough)
# u = rough.displacements(answer.reactions, answer.multipliers)
# assert answer.solved
# assert np.all(u[:2, 0] > 1e-3)  # the rear is off the floor
# assert np.allclose(answer.reactions[:2], 0.0, atol=1e-9)
# assert np.allclose(u[2:], 0.0, atol=1e-9)  # the front sticks
# spin = np.linalg.solve(M, H @ answer.reactions.ravel() + f)[3:]
# assert spin[1] > 1e-3 and np.allclose(spin[[0, 2]], 0.0, atol=1e-9)
# ```
#
# </details>
#
# **2.** Which part of the impulses is not unique? Find a change of the four normal impulses that
# moves nothing.
#
# <details><summary>Solution</summary>
#
# Press one diagonal of the table down and lift the other one. The change $(1, -1, -1, 1)$ of the
# normal components has no resultant and no moment. It is in the kernel of $Q$.
#
# ```python
# twist = np.zeros((4, 3))
# twist[:, 0] = [1.0, -1.0, -1.0, 1.0]
# assert np.allclose(problem.Q @ twist.ravel(), 0.0)
# difference = answers["admm"].reactions - answers["nsgs"].reactions
# assert np.linalg.norm(difference[:, 0]) > 0.005
# # two answers differ by such a change
# assert np.allclose(problem.Q @ difference.ravel(), 0.0, atol=1e-8)
# size = np.linalg.norm(difference[:, 0]) * np.linalg.norm(twist)
# assert abs(difference[:, 0] @ twist[:, 0]) > 0.99 * size
# ```
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

# %% [markdown]
# # Chapter 4. From bodies to the interface
#
# A real body has thousands of unknowns, and only those on its surface can touch anything. In this chapter finite elements
# make the stiffness of a block. We eliminate everything that cannot touch. What remains is a small problem of the form that
# you know: $u = Q r + q$.
#
# You need: chapters 1 to 3, and what a finite element is. Time: 50 minutes with the exercises.

# %%
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, FacetBasis, LinearForm, MeshTri, condense
from skfem import solve as solve_linear
from skfem.helpers import div
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import InterfaceProblem, Material, Part, Rigid, Scene, Traction, natural_map_residual, reduce, solve
from contactopt.problem.laws.tresca import Tresca
from contactopt.teaching import check

# %% [markdown]
# ## The mechanical system
#
# A block of rubber, 4 mm wide and 2 mm high, hangs on a rigid plate. The plate comes down by .1 mm, onto a rigid floor that
# is slightly round: the gap is $x^2 / 20$ mm. The block is long in the third direction, so it is in plane strain, and all
# forces are those of a slice of 1 mm.

# %%
E, nu, lowered = 5.0, 0.3, 0.1  # MPa, -, mm
mesh = MeshTri.init_tensor(np.linspace(-2, 2, 33), np.linspace(0, 2, 17)).with_boundaries(
    {"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 2}
)
basis = Basis(mesh, ElementVector(ElementTriP1()))
K = linear_elasticity(*lame_parameters(E, nu)).assemble(basis)

top, bottom = basis.get_dofs("top"), basis.get_dofs("bottom")
held, c_n, c_t = top.all(), bottom.all(["u^2"]), bottom.all(["u^1"])
U_top = np.zeros(basis.N)
U_top[top.all(["u^2"])] = -lowered
x = mesh.p[0, bottom.nodal_ix]
gap = x**2 / 20

fig, ax = plt.subplots(figsize=(6, 3.6), layout="constrained")
ax.triplot(*mesh.p, mesh.t.T, color="C0", lw=0.4)
line = np.linspace(-2.4, 2.4, 101)
ax.fill_between(line, -0.5, -(line**2) / 20, color="0.8", lw=0)
ax.plot([-2.2, 2.2], [2.03, 2.03], "k", lw=4)
ax.annotate("", (0, 2.1), (0, 2.6), arrowprops={"arrowstyle": "-|>", "color": "C3", "lw": 2})
ax.text(0.1, 2.35, ".1 mm", color="C3")
ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", ylim=(-0.5, 2.7))

print(f"{basis.N} unknowns, {len(held)} held, {len(x)} nodes on the contact surface")

assert np.abs(K - K.T).max() < 1e-12

# %% [markdown]
# ## Primal: all displacements
#
# The block takes the shape $U$ of least elastic energy that does not pass through the floor:
#
# $$ \min_U \; \tfrac12 U' K U \qquad \text{subject to} \qquad U_y + g \ge 0 \text{ on the bottom}, \quad U = U_{\text{top}} \text{ on the top.} $$
#
# Without friction this is the primal program of chapter 3, with more unknowns that have no constraint.

# %%
U = cp.Variable(basis.N)
floor = U[c_n] + gap >= 0
primal = cp.Problem(cp.Minimize(cp.quad_form(U, cp.psd_wrap(K)) / 2), [floor, U[held] == U_top[held]])
primal.solve(solver=cp.CLARABEL)
pressed = floor.dual_value
print(f"the floor carries {pressed.sum():.4f} N; {int(np.sum(pressed > 1e-4))} of {len(x)} nodes touch")

assert 3 < np.sum(pressed > 1e-4) < len(x)

# %% [markdown]
# ## Elimination
#
# Let $I$ be the unknowns that are free to move, and $T$ the matrix that picks the contact's unknowns out of them, normal first
# in each node. Equilibrium is $K_{II} U_I = T' r - K_{I,\text{top}} U_{\text{top}}$. Solve it for the displacement of the
# contact:
#
# $$ u = Q\, r + q, \qquad Q = T K_{II}^{-1} T', \qquad q = T U^0 + g\, n, $$
#
# where $U^0$ is the displacement without contact forces. $Q$ is the inverse of the Schur complement of the stiffness. It says
# how the surface moves under forces on the surface. Nothing has been approximated.

# %%
free = np.setdiff1d(np.arange(basis.N), held)
contact = np.column_stack([c_n, c_t]).ravel()  # normal first
K_free = K[free][:, free].toarray()
T = (contact[:, None] == free[None, :]).astype(float)
Q = T @ np.linalg.solve(K_free, T.T)
U_0 = np.linalg.solve(K_free, -(K @ U_top)[free])
q = (T @ U_0).reshape(-1, 2) + np.column_stack([gap, 0 * gap])

S = np.linalg.inv(Q)
others = np.setdiff1d(np.arange(len(free)), np.nonzero(T)[1])
places = np.nonzero(T)[1]
schur = K_free[np.ix_(places, places)] - K_free[np.ix_(places, others)] @ np.linalg.solve(
    K_free[np.ix_(others, others)], K_free[np.ix_(others, places)]
)
print(f"{len(free)} free unknowns became {len(Q)}")

assert np.allclose(S, schur)

# %% [markdown]
# ## Dual: forces on the contact alone

# %%
r_n = cp.Variable(len(x))
push = r_n >= 0
dual = cp.Problem(cp.Minimize(cp.quad_form(r_n, cp.psd_wrap(Q[::2, ::2])) / 2 + q[:, 0] @ r_n), [push])
dual.solve(solver=cp.CLARABEL)

frictionless = InterfaceProblem(Q, q, 0.0)
answer = solve(frictionless)

assert np.allclose(r_n.value, pressed, atol=1e-4)
assert answer.solved and np.allclose(answer.reactions[:, 0], pressed, atol=1e-4)

# %% [markdown]
# ## Nitsche's method with finite elements
#
# Nitsche's method needs no multiplier: it takes the pressure $p(U) = -\sigma_{yy}$ from the elements themselves. With the gap
# $u_n = U_y + g$ and $\gamma = \gamma_0 E / h$ the equation of virtual work is
#
# $$ a(U, v) - \int \tfrac1\gamma\, p(U)\, p(v) + \int \tfrac1\gamma\, [\,p(U) - \gamma u_n\,]_+ \,\bigl(p(v) - \gamma v_y\bigr) = 0 . $$
#
# It is chapter 1's function with the integrals over the bottom. The only nonlinear part is the bracket, so Newton's method
# asks in every step where the bracket is positive.

# %%
lam, shear = lame_parameters(E, nu)
edge = FacetBasis(mesh, ElementVector(ElementTriP1()), facets="bottom")
gamma = 10 * E / (4 / 32)


def pressure(v):
    return -(lam * div(v) + 2 * shear * v.grad[1, 1])


@BilinearForm
def consistency(U, v, w):
    return -pressure(U) * pressure(v) / gamma


@BilinearForm
def bracket(U, v, w):
    return w.touches * (pressure(U) - gamma * U[1]) * (pressure(v) - gamma * v[1]) / gamma


@LinearForm
def distance(v, w):
    return w.touches * (w.x[0] ** 2 / 20) * (pressure(v) - gamma * v[1])


touches, fixed = np.ones(edge.dx.shape), consistency.assemble(edge)
step = 0
while step < 30:
    step += 1
    system = K + fixed + bracket.assemble(edge, touches=touches)
    nitsche = solve_linear(*condense(system, distance.assemble(edge, touches=touches), x=U_top, D=held))
    field = edge.interpolate(nitsche)
    value = pressure(field) - gamma * (field[1] + np.asarray(edge.global_coordinates())[0] ** 2 / 20)
    if np.array_equal(value > 0, touches > 0):
        break
    touches = (value > 0).astype(float)
carried = np.sum(np.maximum(value, 0) * edge.dx)
print(f"Nitsche: {step} steps, the floor carries {carried:.4f} N")

fig, ax = plt.subplots(figsize=(6, 3.4), layout="constrained")
ax.plot(x[np.argsort(x)], pressed[np.argsort(x)] / (4 / 32), "C0o-", mfc="none", label="multiplier / area of the node")
middle = np.asarray(edge.global_coordinates())[0].mean(axis=1)
order = np.argsort(middle)
ax.plot(middle[order], np.maximum(value, 0).mean(axis=1)[order], "C1.", label="Nitsche's bracket")
ax.set(xlabel="x [mm]", ylabel="pressure [MPa]")
ax.legend(frameon=False)

assert step < 30 and np.isclose(carried, pressed.sum(), rtol=0.02)

# %% [markdown]
# Both methods find the same pressure up to the error of the mesh. Take $\gamma_0$ too small, and the energy loses its minimum,
# as in chapter 1 (exercise 4.4).
#
# ## Friction with a given bound
#
# With Tresca's friction the primal energy gets the term $\sum g_i |u_{t,i}|$. The dual gets a box for every tangential force.
# It is one convex program again, in 66 unknowns.

# %%
bound = np.full(len(x), 0.02)  # N
r = cp.Variable(2 * len(x))
law = [r[::2] >= 0, cp.abs(r[1::2]) <= bound]
cp.Problem(cp.Minimize(cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q.ravel() @ r), law).solve(solver=cp.CLARABEL)
with_bound = InterfaceProblem(Q, q, Tresca(bound))

assert natural_map_residual(with_bound, r.value.reshape(-1, 2)) < 1e-4

# %% [markdown]
# ## What fails: a body that only contact holds
#
# Take the plate away and load the top by a pressure. Now nothing but the floor holds the block: its stiffness is singular, and
# $K_{II}^{-1}$ does not exist. The block can move rigidly. The three rigid motions become unknowns $\lambda$ of the interface
# problem, and the forces have to balance the load:
#
# $$ u = Q\, r + V \lambda + q, \qquad V' r + s = 0 . $$
#
# contactopt finds the motions by itself.

# %%
flat = MeshTri.init_tensor(np.linspace(-2, 2, 17), np.linspace(0, 2, 9)).with_boundaries(
    {"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 2}
)
loads = (Traction("top", (0.0, -1.0)),)
block = Part("block", flat, Material(E=E, nu=nu), loads=loads, contact="bottom")
floating = reduce(Scene("block on a floor", block, Rigid("floor"), mu=0.5))
resting = solve(floating)
print(
    f"{floating.V.shape[1]} rigid motions, status {resting.status}, normal force {resting.reactions[:, 0].sum():.6f} N"
)

assert floating.V.shape[1] == 3 and resting.solved
assert np.isclose(resting.reactions[:, 0].sum(), 4.0)  # 1 MPa on 4 mm

# %% [markdown]
# ## Exercises
#
# **4.1** (Pen and paper.) The block of this chapter has $33 \times 17$ nodes, and the top row is held. How many free unknowns
# has the primal problem, and how many has the dual one?

# %% tags=["exercise"]
answer = ...  # (primal, dual)

# %% [markdown] tags=["solution"]
# $2 \cdot 33 \cdot 16 = 1056$ displacements are free. The dual has two forces at each of the 33 nodes of the bottom, 66.

# %% tags=["solution"]
answer = (1056, 66)

# %%
check("4.1", answer, (1056, 66))

# %% [markdown]
# **4.2** (Pen and paper.) The load on the floating block, 4 mm wide, acts as one force at the distance $e$ from its middle. For
# which $e$ does the block tip over?

# %% tags=["exercise"]
answer = ...  # mm

# %% [markdown] tags=["solution"]
# The floor can only push. So the resultant of its forces lies between the ends of the block, and $e$ can be at most 2 mm.
# Beyond that, no forces balance the load, and the interface problem is *infeasible*.

# %% tags=["solution"]
answer = 2.0

# %%
check("4.2", answer, 2.0)

# %% [markdown]
# **4.3** Solve the lowered block with Coulomb's law and $\mu = 0.4$, by Tresca's iteration from chapter 2 with the program
# above. Give the forces, one row per node. The certificate grades them.

# %% tags=["exercise"]
answer = ...  # (33, 2) forces [N]

# %% tags=["solution"]
limit = cp.Parameter(len(x), nonneg=True, value=np.zeros(len(x)))
y = cp.Variable(2 * len(x))
cost = cp.quad_form(y, cp.psd_wrap(Q)) / 2 + q.ravel() @ y
program = cp.Problem(cp.Minimize(cost), [y[::2] >= 0, cp.abs(y[1::2]) <= limit])
for _ in range(12):
    program.solve(solver=cp.CLARABEL)
    limit.value = 0.4 * np.maximum(y.value[::2], 0)
answer = y.value.reshape(-1, 2)

# %%
check("4.3", answer, InterfaceProblem(Q, q, 0.4))

# %% [markdown]
# **4.4** Nitsche's energy is convex only if $K$ minus the integral of $p\,p / \gamma$ is positive definite on the free unknowns.
# Compute the smallest eigenvalue of this matrix for $\gamma_0 = 0.1$ and for $\gamma_0 = 10$. Is it positive?

# %% tags=["exercise"]
answer = ...  # (True or False for 0.1, True or False for 10)

# %% tags=["solution"]
at_ten = fixed[free][:, free].toarray()  # it was assembled with gamma_0 = 10, and scales with 1 / gamma_0
answer = tuple(bool(np.linalg.eigvalsh(K_free + at_ten * 10 / g)[0] > 0) for g in (0.1, 10.0))

# %%
check("4.4", answer, lambda given: tuple(given) == (False, True))

# %% [markdown]
# ## References
#
# - F. Chouly, P. Hild, Y. Renard, *Finite Element Approximation of Contact and Friction in Elasticity*, Birkhäuser 2023,
#   [doi:10.1007/978-3-031-31423-0](https://doi.org/10.1007/978-3-031-31423-0).
# - T. Gustafsson, G. D. McBain, scikit-fem: A Python package for finite element assembly, *J. Open Source Softw.* 5 (2020),
#   [doi:10.21105/joss.02369](https://doi.org/10.21105/joss.02369).
#
# Next: [friction on an interface](chapter_5_friction_on_an_interface.py).

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

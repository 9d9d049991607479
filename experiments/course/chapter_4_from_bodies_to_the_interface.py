# %% [markdown]
# # Chapter 4. From bodies to the interface
#
# A real body has thousands of unknowns, and only those on its surface can touch anything. In this
# chapter we compute the stiffness of a block by finite elements. Then we eliminate all unknowns
# that cannot touch the floor. What remains is a small problem of the form that you know: $u = Q r +
# q$.
#
# You need chapters 1 to 3, and you should know what a finite element is. The chapter takes 50
# minutes with its exercises.

# %%
import sys

import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshTri,
    condense,
)
from skfem import solve as solve_linear
from skfem.helpers import div
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import (
    InterfaceProblem,
    Material,
    Part,
    Rigid,
    Scene,
    Traction,
    natural_map_residual,
    reduce,
    solve,
)
from contactopt.problem.laws.tresca import Tresca
from contactopt.teaching import Slider

# the folder of the repository, where the exercises are
sys.path.extend([".", "../.."])
from experiments.course.grader import check, hint, table
from experiments.course.sketch import arrow

# %% [markdown]
# ## The mechanical system
#
# A block of rubber, 4 mm wide and 2 mm high, hangs on a rigid plate. The plate comes down by 0.1
# mm, onto a rigid floor that is slightly round: before the plate moves, the gap at the place $x$ is
# $g(x) = x^2 / 20$ mm. The block is long in the third direction. So it is in plane strain, and all
# forces are those of a slice of 1 mm.
#
# The normal $n$ points out of the floor, upwards, and the tangent $t$ points to the right. (The
# floor is so flat that we take the same $n$ everywhere.) As before, $r$ is the force on the upper
# body, here the block, and every contact has its normal component first.

# %%
E, nu, lowered = 5.0, 0.3, 0.1  # MPa, -, mm
mesh = MeshTri.init_tensor(
    np.linspace(-2, 2, 33), np.linspace(0, 2, 17)
).with_boundaries({"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 2})
basis = Basis(mesh, ElementVector(ElementTriP1()))
K = linear_elasticity(*lame_parameters(E, nu)).assemble(basis)

top, bottom = basis.get_dofs("top"), basis.get_dofs("bottom")
held, c_n, c_t = top.all(), bottom.all(["u^2"]), bottom.all(["u^1"])
U_top = np.zeros(basis.N)
U_top[top.all(["u^2"])] = -lowered
x = mesh.p[0, bottom.nodal_ix]
gap = x**2 / 20

print(f"{basis.N} unknowns, {len(held)} held, {len(x)} nodes may touch")

assert np.abs(K - K.T).max() < 1e-12

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(6, 3.6), layout="constrained")
ax.triplot(*mesh.p, mesh.t.T, color="C0", lw=0.4)
line = np.linspace(-2.4, 2.4, 101)
ax.fill_between(line, -0.5, -(line**2) / 20, color="0.8", lw=0)
ax.plot([-2.2, 2.2], [2.03, 2.03], "k", lw=4)
arrow(ax, (0, 2.6), (0, 2.1), "0.1 mm", "C3")
arrow(ax, (2.7, 0.0), (2.7, 0.6), "$n$")
arrow(ax, (2.7, 0.0), (3.3, 0.0), "$t$")
arrow(ax, (0, -0.46), (0, -0.02), "$r_n$", "C1", (0.08, -0.42))
_ = ax.set(
    xlabel="x [mm]",
    ylabel="y [mm]",
    aspect="equal",
    xlim=(-2.5, 3.6),
    ylim=(-0.5, 2.7),
)

# %% [markdown]
# ## Primal: all displacements
#
# Let $U$ be the displacements of all nodes, $U_y$ their vertical parts, and $K$ the stiffness
# matrix. The block takes the shape of least elastic energy that does not pass through the floor:
#
# $$ \min_U \; \tfrac12 U' K U \qquad \text{subject to} \qquad U_y + g \ge 0 \text{ on the bottom}, \quad U = U_{\text{top}} \text{ on the top.} $$
#
# Without friction this is the primal program of chapter 3. It only has many more unknowns that have
# no constraint. The multipliers of the constraint are the normal forces of the floor on the nodes.

# %%
U = cp.Variable(basis.N)
floor = U[c_n] + gap >= 0
primal = cp.Problem(
    cp.Minimize(cp.quad_form(U, cp.psd_wrap(K)) / 2),
    [floor, U[held] == U_top[held]],
)
primal.solve(solver=cp.CLARABEL)
pressed = floor.dual_value
touching = int(np.sum(pressed > 1e-4))
print(f"the floor carries {pressed.sum():.4f} N; {touching} nodes of {len(x)}")

assert 3 < np.sum(pressed > 1e-4) < len(x)

# %% [markdown]
# ## Elimination
#
# Let the index $I$ stand for the unknowns that are free to move. Let $T$ be the matrix that picks
# the unknowns of the contact out of these, the normal one first at each node. The free unknowns are
# in equilibrium under the contact forces $r$ and the motion of the plate:
#
# $$ K_{II}\, U_I = T' r - K_{I,\text{top}}\, U_{\text{top}} . $$
#
# We solve this for $U_I$. The displacements of the contact are $T U_I$, and the gaps are these plus
# $g$ in the direction $n$:
#
# $$ u = Q\, r + q, \qquad Q = T K_{II}^{-1} T', \qquad q = T U_I^0 + g\, n, $$
#
# where $U_I^0$ is the solution without contact forces. $Q$ is the compliance of the surface: it
# says how the surface moves under forces on the surface. A column of $Q$ is the motion under a force
# of 1 N at one node. $Q$ is also the inverse of the *Schur complement*, which is the stiffness that
# remains when the inner unknowns are eliminated. Nothing has been approximated.

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
schur = K_free[np.ix_(places, places)] - K_free[
    np.ix_(places, others)
] @ np.linalg.solve(
    K_free[np.ix_(others, others)], K_free[np.ix_(others, places)]
)
print(f"{len(free)} free unknowns became {len(Q)}")

assert np.allclose(S, schur)

# %% tags=["hide-input"]
order = np.argsort(x)
fig, ax = plt.subplots(figsize=(6, 3.2), layout="constrained")
for node, color in ((order[4], "C0"), (order[18], "C2")):
    column = Q[::2, 2 * node]
    ax.plot(x[order], column[order], color + ".-")
    arrow(ax, (x[node], -0.2), (x[node], -0.03), "1 N", color)
ax.set(xlabel="x [mm]", ylabel="normal displacement [mm]")
_ = ax.set(ylim=(-0.22, 0.58))

# %% [markdown]
# ## Dual: forces on the contact alone
#
# Without friction the unknowns of the dual problem are the normal forces alone. $Q_{nn}$ and $q_n$
# are the normal parts of $Q$ and $q$:
#
# $$ \min_{r_n \ge 0} \; \tfrac12 r_n' Q_{nn} r_n + q_n' r_n . $$
#
# ## The optimality conditions
#
# Primal and dual have the same optimality conditions, those of Karush, Kuhn and Tucker (KKT
# conditions). They are equilibrium of the block, and Signorini's conditions at every node $i$ of
# the contact:
#
# $$ u_n = Q_{nn} r_n + q_n, \qquad u_{n,i} \ge 0, \qquad r_{n,i} \ge 0, \qquad u_{n,i}\, r_{n,i} = 0 . $$
#
# The program in `cvxpy` is as short as in chapter 1, and its forces are the multipliers of the
# primal program:

# %%
r_n = cp.Variable(len(x))
push = r_n >= 0
dual = cp.Problem(
    cp.Minimize(
        cp.quad_form(r_n, cp.psd_wrap(Q[::2, ::2])) / 2 + q[:, 0] @ r_n
    ),
    [push],
)
dual.solve(solver=cp.CLARABEL)

frictionless = InterfaceProblem(Q, q, 0.0)
answer = solve(frictionless)

assert np.allclose(r_n.value, pressed, atol=1e-4)
assert answer.solved and np.allclose(answer.reactions[:, 0], pressed, atol=1e-4)

# %% [markdown]
# Without contact forces the displacements of the block are proportional to the motion of the plate.
# So if the plate comes down further, only $q$ changes, and $Q$ stays the same. The slider shows how
# the contact grows.


# %% tags=["hide-input"]
def further_down(depth):
    without_contact = depth / lowered * (T @ U_0).reshape(
        -1, 2
    ) + np.column_stack([gap, 0 * gap])
    forces = solve(InterfaceProblem(Q, without_contact, 0.0)).reactions[:, 0]
    order = np.argsort(x)
    fig, ax = plt.subplots(figsize=(5.5, 3.2), layout="constrained")
    ax.plot(x[order], forces[order] / (4 / 32), "C0.-")
    ax.set(xlabel="x [mm]", ylabel="pressure [MPa]", ylim=(-0.05, 0.8))
    ax.set_title(f"the floor carries {forces.sum():.2f} N")
    return fig


Slider(
    "the plate comes down by [mm]",
    np.linspace(0.02, 0.2, 10),
    further_down,
    start=4,
)

# %% [markdown]
# ## Nitsche's method with finite elements
#
# Nitsche's method has no multiplier. It takes the pressure from the stresses in the elements, $p(U)
# = -\sigma_{yy}$. The gap is $u_n = U_y + g$. The parameter is $\gamma = \gamma_0 E / h$ with the
# size $h$ of the elements and a number $\gamma_0$. In chapter 1 we minimised a function. Here this
# function holds integrals over the bottom of the block, and its derivative must vanish for every
# virtual displacement $v$:
#
# $$ a(U, v) - \int \tfrac1\gamma\, p(U)\, p(v) + \int \tfrac1\gamma\, [\,p(U) - \gamma u_n\,]_+ \,\bigl(p(v) - \gamma v_y\bigr) = 0 . $$
#
# The first term, $a(U, v)$, is the virtual work of the stresses. The only nonlinear part is the
# bracket $[x]_+ = \max(x, 0)$. So in every step Newton's method asks where the bracket is positive,
# and solves a linear system.

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
    return (
        w.touches
        * (pressure(U) - gamma * U[1])
        * (pressure(v) - gamma * v[1])
        / gamma
    )


@LinearForm
def distance(v, w):
    return w.touches * (w.x[0] ** 2 / 20) * (pressure(v) - gamma * v[1])


touches, fixed = np.ones(edge.dx.shape), consistency.assemble(edge)
step = 0
while step < 30:
    step += 1
    system = K + fixed + bracket.assemble(edge, touches=touches)
    nitsche = solve_linear(
        *condense(
            system, distance.assemble(edge, touches=touches), x=U_top, D=held
        )
    )
    field = edge.interpolate(nitsche)
    value = pressure(field) - gamma * (
        field[1] + np.asarray(edge.global_coordinates())[0] ** 2 / 20
    )
    if np.array_equal(value > 0, touches > 0):
        break
    touches = (value > 0).astype(float)
carried = np.sum(np.maximum(value, 0) * edge.dx)
print(f"Nitsche: {step} steps, the floor carries {carried:.4f} N")

fig, ax = plt.subplots(figsize=(6, 3.4), layout="constrained")
ax.plot(
    x[np.argsort(x)],
    pressed[np.argsort(x)] / (4 / 32),
    "C0o-",
    mfc="none",
    label="multiplier / area of the node",
)
middle = np.asarray(edge.global_coordinates())[0].mean(axis=1)
order = np.argsort(middle)
ax.plot(
    middle[order],
    np.maximum(value, 0).mean(axis=1)[order],
    "C1.",
    label="Nitsche's bracket",
)
ax.set(xlabel="x [mm]", ylabel="pressure [MPa]")
ax.legend(frameon=False)

assert step < 30 and np.isclose(carried, pressed.sum(), rtol=0.02)

# %% [markdown]
# Both methods find the same pressure, up to the error of the mesh. If $\gamma_0$ is too small, the
# energy is not convex, as in chapter 1 (exercise 4.4).
#
# ## Friction with a given bound
#
# With Tresca friction the primal energy gets the term $\sum_i b_i |u_{t,i}|$, where $b_i$ is the
# friction bound of node $i$. (Chapter 2 called it $g$. In this chapter $g$ is the gap.) In the dual
# problem every tangential force gets the constraint $|r_{t,i}| \le b_i$. It is one convex program
# again, with 66 unknowns.

# %%
bound = np.full(len(x), 0.02)  # N
r = cp.Variable(2 * len(x))
law = [r[::2] >= 0, cp.abs(r[1::2]) <= bound]
cp.Problem(
    cp.Minimize(cp.quad_form(r, cp.psd_wrap(Q)) / 2 + q.ravel() @ r), law
).solve(solver=cp.CLARABEL)
with_bound = InterfaceProblem(Q, q, Tresca(bound))

assert natural_map_residual(with_bound, r.value.reshape(-1, 2)) < 1e-4

# %% [markdown]
# ## What fails: a body that only contact holds
#
# Take the plate away, and load the top by a pressure of 1 MPa. Now nothing but a flat floor holds
# the block. The block can move as a rigid body, so its stiffness matrix is singular and
# $K_{II}^{-1}$ does not exist.
#
# The remedy is to treat the rigid motions as unknowns of the interface problem. In the plane there
# are three: two translations and a rotation. The columns of a matrix $V$ hold what these motions do
# to the contact. The unknowns $\lambda$ say how far the block moves in each of them. In return, the
# contact forces have to balance the load, and $s$ is the load in each motion:
#
# $$ u = Q\, r + V \lambda + q, \qquad V' r + s = 0 . $$
#
# contactopt finds the rigid motions by itself.

# %%
flat = MeshTri.init_tensor(
    np.linspace(-2, 2, 17), np.linspace(0, 2, 9)
).with_boundaries({"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 2})
loads = (Traction("top", (0.0, -1.0)),)
block = Part("block", flat, Material(E=E, nu=nu), loads=loads, contact="bottom")
floating = reduce(Scene("block on a floor", block, Rigid("floor"), mu=0.5))
resting = solve(floating)
supported = resting.reactions[:, 0].sum()
print(
    floating.V.shape[1], "rigid motions,", resting.status, f"{supported:.6f} N"
)

assert floating.V.shape[1] == 3 and resting.solved
assert np.isclose(resting.reactions[:, 0].sum(), 4.0)  # 1 MPa on 4 mm
assert np.isclose(floating.s.min(), -4.0)  # the load, downwards

# %% [markdown]
# ## Exercises
#
# Replace `...` by your answer and run the cell. It says what is wrong with your answer in terms of
# mechanics. `hint("4.1")` gives a hint, three times, and then the solution. `table(4)` shows what
# you have done since the notebook was started.
#
# Give numbers with at least three digits: 0.1 percent is close enough. Counts are exact. Forces and
# displacements are graded by the certificate, which must be at most $10^{-3}$.
#
# **4.1** (Pen and paper.) A mesh of the block has $41 \times 21$ nodes, and its top row is held.
# How many free unknowns does the primal problem have? How many unknowns does the dual problem with
# friction have?

# %% tags=["exercise"]
answer = (..., ...)  # unknowns of the primal problem, of the dual problem
check("4.1", answer)

# %% [markdown]
# **4.2** (Pen and paper.) A block without a plate is 4.6 mm wide. The load on it is one vertical
# force at the distance $e$ from the middle. What is the largest $e$ for which the block does not
# tip over?

# %% tags=["exercise"]
answer = ...  # distance from the middle [mm]
check("4.2", answer)

# %% [markdown]
# **4.3** (Program.) Solve the block under the lowered plate with Coulomb's law and $\mu = 0.1$. Use
# Tresca's iteration of chapter 2, with the program above. Give the forces, one row $(r_n, r_t)$ for
# each node. The certificate grades them.

# %% tags=["exercise"]
answer = ...  # 33 rows r_n, r_t [N]
check("4.3", answer)

# %% [markdown]
# **4.4** (Think.) Nitsche's energy is convex only if one matrix is positive definite on the free
# unknowns: $K$ minus the matrix of the integral of $p(U)\,p(v) / \gamma$. What is the smallest
# $\gamma_0$ for which it is? (The matrix `fixed` above has the integral with its minus sign, for
# $\gamma_0 = 10$.)

# %% tags=["exercise"]
answer = ...  # gamma_0 [-]
check("4.4", answer)

# %% [markdown]
# **4.5** (Pen and paper.) An inner node stands on a spring of 3 N/mm. A second spring of 1.7 N/mm
# joins it to the node that may touch the floor. Eliminate the inner node: how stiff is the other
# one?

# %% tags=["exercise"]
answer = ...  # stiffness of the contact [N/mm]
check("4.5", answer)

# %% [markdown]
# **4.6** (Pen and paper.) A body in three dimensions becomes 2.5 times as large, and its Young's
# modulus 1.7 times as large. By which factor does $Q$ change?

# %% tags=["exercise"]
answer = ...  # factor of Q [-]
check("4.6", answer)

# %% [markdown]
# **4.7** (Program.) A rigid beam stands on two points at $x = -1.2$ mm and $x = 2.1$ mm. A load of
# 7 N presses it down at $x = 0.4$ mm. Write $V$ for the motion upwards and the rotation about $x =
# 0$, and $s$. Find the two forces.

# %% tags=["exercise"]
answer = (..., ...)  # forces of the left and of the right point [N]
check("4.7", answer)

# %% [markdown]
# **4.8** (Think.) The block of exercise 4.2 carries 10 N at $e = 2.45$ mm, to the right of the
# middle. No forces of the floor balance it. *Prove* it by a motion: each point rises by $a + \theta
# x$, no corner ($x = \pm 2.3$ mm) goes into the floor, and the load does positive work. Why is this
# a proof?

# %% tags=["exercise"]
answer = (..., ...)  # motion upwards [mm], rotation [-]
check("4.8", answer)

# %%
table(4)

# %% [markdown]
# ## References
#
# - F. Chouly, P. Hild, Y. Renard, *Finite Element Approximation of Contact and Friction in
#   Elasticity*, Birkhäuser 2023,
#   [doi:10.1007/978-3-031-31423-0](https://doi.org/10.1007/978-3-031-31423-0).
# - T. Gustafsson, G. D. McBain, scikit-fem: A Python package for finite element assembly, *J. Open
#   Source Softw.* 5 (2020), [doi:10.21105/joss.02369](https://doi.org/10.21105/joss.02369).
#
# Next: [friction on an interface](chapter_5_friction_on_an_interface.py).

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

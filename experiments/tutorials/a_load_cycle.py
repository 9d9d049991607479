# %% [markdown]
# # 3. A load cycle and its hysteresis
#
# Press a cylinder on a flat body. Push it sideways, but not so hard that it slides off. Then take
# the push away. Does the cylinder come back to where it was? It does not, because friction has done
# work. The answer depends on the loads that came before. Cattaneo (1938) and Mindlin (1949) solved
# this problem exactly. In this tutorial we solve it numerically, step by step. We compare the slip
# zones, the tractions and the energy that a cycle costs with the exact ones.
#
# Reading time: 10 minutes. [Chapter 2](../course/chapter_2_friction_at_one_node.py) of the course
# has Coulomb's law for one step.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contactopt import scenes
from contactopt.analytic import cycle_loss_line
from contactopt.solving.follow import follow

# %% [markdown]
# ## From one step to a path
#
# Coulomb's law is about the slip *velocity*: friction opposes the motion of this moment. In a
# static step, $u_t$ stands for the whole way from the start. Along a path we take many steps, and
# in each of them $u_t$ is replaced by the slip of that step,
#
# $$ u_t \;\to\; u_t - u_t^{\text{before}} . $$
#
# Nothing else changes, because this replacement only shifts $q_t$. So each step is one static
# problem, which is solved and certified like any other. The normal part has no memory: the gap of
# this moment is all that counts.
#
# ## The scene
#
# Two bodies of the same rubber are pressed together with $P = 100$ N. The lower one is flat, and
# the upper one is round with a radius of 4 m. Perpendicular to the plane of the drawing both have a
# thickness of $D = 400$ mm. The shear force $T$ on the upper body goes from zero to 40 N, to $-40$
# N, and back to 40 N. The bodies would slide off at $\mu P = 50$ N. The normal $n$ points up, and
# the tangent $t$ points to the right. Every contact has its normal component first.

# %% tags=["hide-input"]
fig, ax = plt.subplots(figsize=(5, 3), layout="constrained")
across = np.linspace(-2, 2, 101)
ax.fill_between(across, 0.14 * across**2, 1.6, color="C0", alpha=0.25, lw=0)
ax.fill_between(across, -1.0, 0, color="0.8", lw=0)
ax.plot([-2, 2], [1.6, 1.6], "C0", lw=4)
for tail, head, name, color, at in (
    ((0, 2.4), (0, 1.65), "$P$", "C1", (0.08, 2.1)),
    ((0.2, 1.8), (1.0, 1.8), "$T$", "C1", (0.75, 1.9)),
    ((2.4, 0), (2.4, 0.8), "$n$", "k", (2.48, 0.7)),
    ((2.4, 0), (3.2, 0), "$t$", "k", (3.1, 0.1)),
):
    ax.annotate(
        "",
        head,
        tail,
        arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.8},
    )
    ax.text(*at, name, color=color, fontsize=12)
ax.plot([-0.7, 0.7], [0, 0], "C3", lw=4)
ax.text(0, -0.35, "contact, $-a < x < a$", color="C3", ha="center")
ax.text(-1.9, 1.3, "rubber, below a rigid plate", color="C0", va="center")
ax.set(xlim=(-2.1, 3.4), ylim=(-1.0, 2.5), aspect="equal")
_ = ax.axis("off")

# %%
mu, P, T_most, D = 0.5, 100.0, 40.0, 400.0
states = scenes.shear_cycle(
    2, steps=8, mu=mu, force=P, shear=T_most, depth=D, elements=32
)
path = follow(states)
history, problem = path.history, path.reduction.problem
T, shift = history["shear_force"], history["shift"]
print(
    f"{len(path.states)} states, {problem.contacts} contacts,"
    f" largest certificate {history['residual'].max():.0e}"
)

assert path.solved
assert np.allclose(history["normal_force"], P)
assert np.isclose(T.max(), T_most) and np.isclose(T.min(), -T_most)

# %% [markdown]
# ## First loading: the edge slips
#
# Both bodies are of the same material, so the shear does not disturb the pressure. It stays that of
# Hertz, $p = p_0 \sqrt{1 - x^2 / a^2}$. If the whole contact stuck, the shear traction would be
# infinite at its edge, and friction cannot carry that. So the edge slips, however small $T$ is, and
# the contact sticks only where
#
# $$ |x| < c, \qquad \frac{c}{a} = \sqrt{1 - \frac{|T|}{\mu P}} . $$
#
# The shear traction $\tau$ on the lower body is the difference of two ellipses,
# $\tau = \mu p_0 \bigl[\sqrt{1 - x^2/a^2} - \tfrac{c}{a} \sqrt{1 - x^2/c^2}\bigr]$.

# %%
reference = states[0].reference
a, p0 = reference.half_width, reference.peak


def first_loading(x, T):
    """Cattaneo and Mindlin: traction on the lower body for 0 <= T <= mu P."""
    c = a * np.sqrt(1 - T / (mu * P))
    outer, inner = (
        np.sqrt(np.maximum(1 - (x / a) ** 2, 0)),
        np.sqrt(np.maximum(1 - (x / c) ** 2, 0)),
    )
    return mu * p0 * (outer - c / a * inner)


# the path starts with T = 0; its first eight steps load
loading = slice(1, 9)
exact = a * np.sqrt(1 - T[loading] / (mu * P))
print("stick half-width, mm:", history["stick_half_width"][loading].round(2))
print("exact:               ", exact.round(2))

assert np.allclose(history["contact_half_width"], a, rtol=0.005)
assert np.allclose(history["stick_half_width"][loading], exact, rtol=0.03)

# %% [markdown]
# ## Unloading: slip turns round
#
# Now reduce $T$ from its largest value $T^*$. The edge slips back at once, while the middle keeps
# the slip that it had. To slip *against* the old direction the traction has to change by $2 \mu
# p$, from one bound to the other. So unloading is a first loading in the other direction and of
# twice the size. This is Masing's rule:
#
# $$ \tau(T) = \tau_{\text{first}}(T^*) - 2\, \tau_{\text{first}}\Bigl(\frac{T^* - T}{2}\Bigr) . $$
#
# At $T = 0$ the traction does not vanish. It points one way in the middle and the other way at the
# edge.

# %%
x = problem.coordinates[0]
fine = np.linspace(-a, a, 401)
turned, home, lowest = 8, 16, 24  # states with T = 40 N, 0, -40 N

fig, ax = plt.subplots(figsize=(6.2, 4.2), layout="constrained")
for index, color in ((4, "C0"), (turned, "C1"), (home, "C2"), (lowest, "C3")):
    tau = (
        -path.states[index].solution.reactions[:, 1] / problem.areas
    )  # on the lower body
    expected = (
        first_loading(fine, T[index])
        if index <= turned
        else (
            first_loading(fine, T_most)
            - 2 * first_loading(fine, (T_most - T[index]) / 2)
        )
    )
    ax.plot(fine, expected / p0, color=color, lw=1)
    ax.plot(
        x, tau / p0, "o", ms=3, color=color, label=f"T = {round(T[index])} N"
    )
    near = np.interp(x, fine, expected)
    assert (
        np.abs(tau - near).max() < 0.06 * mu * p0
    )  # largest next to the kinks, where elements see it blurred
ax.plot(
    fine,
    mu * np.sqrt(1 - (fine / a) ** 2),
    "k--",
    lw=1,
    label=r"bound $\pm \mu p$",
)
ax.plot(fine, -mu * np.sqrt(1 - (fine / a) ** 2), "k--", lw=1)
ax.set(
    xlabel="x [mm]",
    ylabel="shear traction over peak pressure [-]",
    xlim=(-1.15 * a, 1.9 * a),
)
ax.legend(frameon=False, title="dots: computed\nlines: exact", loc="right")

resultant = path.states[home].solution.reactions[:, 1]
assert abs(resultant.sum()) < 1e-8 and np.abs(resultant).max() > 0.2

# %% [markdown]
# ## The loop
#
# We draw the force against the shift of the upper body. The loop is thin, because most of the shift
# is the elastic deformation of the large bodies. If we subtract the straight line through the two
# tips, the loop becomes visible.

# %%
stiffness_line = shift.max() / T_most * T

fig, (left, right) = plt.subplots(
    1, 2, figsize=(6.4, 3.2), layout="constrained"
)
left.plot(shift, T, "o-", ms=3)
left.set(xlabel="shift of the plate [mm]", ylabel="shear force T [N]")
right.plot(1e3 * (shift - stiffness_line), T, "o-", ms=3)
right.set(xlabel="shift beyond the line [µm]", ylabel="shear force T [N]")

assert np.allclose(shift[turned], shift[-1], rtol=1e-6)  # the loop closes
assert abs(shift[home]) > 0.002  # but it does not go through zero

# %% [markdown]
# ## What a cycle costs
#
# The area of the loop is the energy that friction turns into heat. It does not depend on the size
# of the bodies, because the elastic deformation is a straight line in this diagram, and encloses no
# area. Let $P' = P / D$ and $T' = T / D$ be the forces per unit of thickness. The shift under first
# loading is
#
# $$ \delta(T) = \text{const} \cdot T + \frac{\mu}{\pi E^*}
#    \Bigl[\bigl(P' - \tfrac{T'}{\mu}\bigr) \ln\bigl(P' - \tfrac{T'}{\mu}\bigr) - P' \ln P'\Bigr] . $$
#
# (The tangential shift is $\mu$ times the difference of two normal approaches, under $P'$ and under
# $P' - T'/\mu$, and an approach under $P'$ contains the term $-P' \ln P' / (\pi E^*)$.) Masing's
# rule makes both branches of the loop from $\delta$, and the area between them is $4\, T^*
# \delta(T^*) - 8 \int_0^{T^*} \delta\, dT$. The term that is linear in $T$ drops out of this area.

# %%
modulus = 1 / (2 * (1 - 0.3**2) / 5.0)  # E*, MPa


def shift_by_slip(T):
    """delta(T) without its linear term [mm]."""
    rest = P / D - T / D / mu
    return (
        mu / (np.pi * modulus) * (rest * np.log(rest) - P / D * np.log(P / D))
    )


forces = np.linspace(0, T_most, 2001)
expected = 4 * T_most * shift_by_slip(T_most) - 8 * np.trapezoid(
    shift_by_slip(forces), forces
)

cycle = slice(turned, len(T))  # from the tip to the tip
area = abs(np.trapezoid(T[cycle], shift[cycle]))
friction = history["friction_work"][-1] - history["friction_work"][turned]
print(
    f"one cycle costs: exact {expected:.4f} N mm,"
    f" area of the loop {area:.4f}, friction work {friction:.4f}"
)

assert np.isclose(
    expected, D * cycle_loss_line(P / D, modulus, mu, T_most / D), rtol=1e-5
)  # the same in closed form
assert np.isclose(area, expected, rtol=0.03)
assert np.isclose(friction, expected, rtol=0.05)
assert np.all(
    np.diff(history["friction_work"]) >= -1e-12
)  # friction never gives back

# %% [markdown]
# The two computed numbers have different meanings. The area comes from the force and the shift of
# the plate, and the friction work comes from the slip at the contacts. They differ, because the
# steps are finite, and the difference falls with the size of the steps. The balance of energy along
# the whole path holds to rounding:

# %%
fig, ax = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
step = np.arange(len(T))
ax.plot(
    step,
    history["external_work"] - history["external_work"][0],
    label="work of the loads",
)
ax.plot(
    step,
    history["elastic_energy"] - history["elastic_energy"][0],
    label="elastic energy",
)
ax.plot(step, history["friction_work"], label="friction work")
ax.set(xlabel="state [-]", ylabel="energy since T = 0 [N mm]", ylim=(None, 4.8))
ax.legend(frameon=False)

assert history["energy_error"].max() < 1e-9

# %% [markdown]
# ## Exercises
#
# **1.** Solve the state $T = 0$ at the end of the path in a *single* static step. Where is the
# memory?
#
# <details><summary>Solution</summary>
#
# The memory is lost. A static step knows only the loads of this moment, and without a shear force
# it finds no shear traction.
#
# ```python
# from contactopt import reduce, solve
# single = solve(reduce(states[home], elements=32))
# assert single.solved
# assert np.abs(single.reactions[:, 1]).max() < 0.05 * np.abs(resultant).max()
# ```
#
# </details>
#
# **2.** How does the energy of a cycle depend on $T^*$, if $T^*$ is small?
#
# <details><summary>Solution</summary>
#
# It grows like $T^{*3}$: half the force makes an eighth of the heat. (The width of the slipping rim
# and the slip in it both grow with $T^*$, and so does the force.)
#
# ```python
# def loop(T_star):
#     T = np.linspace(0, T_star, 4001)
#     under = np.trapezoid(shift_by_slip(T), T)
#     return 4 * T_star * shift_by_slip(T_star) - 8 * under
#
# exponent = np.log2(loop(2.0) / loop(1.0))
# assert abs(exponent - 3) < 0.05
# ```
#
# </details>
#
# **3.** Take two steps instead of eight from zero to the largest force. What becomes worse: the
# tips of the loop, the stick zones, or the energy?
#
# <details><summary>Solution</summary>
#
# On each branch the slip never turns back, so the tips and the stick zones are right with any
# number of steps. The area of a loop with few corners is too small. The friction work is too large,
# because each step takes the force at its end.
#
# ```python
# loads = {"mu": mu, "force": P, "shear": T_most, "depth": D}
# coarse = follow(scenes.shear_cycle(2, steps=2, elements=32, **loads)).history
# assert np.isclose(coarse["shift"].max(), shift.max(), rtol=1e-3)
# least = history["stick_half_width"].min()
# assert np.isclose(coarse["stick_half_width"].min(), least, rtol=1e-3)
# tip = 2  # the state with T = 40 N
# corners = coarse["shear_force"][tip:], coarse["shift"][tip:]
# assert abs(np.trapezoid(*corners)) < area
# assert coarse["friction_work"][-1] - coarse["friction_work"][tip] > friction
# ```
#
# </details>

# %% tags=["remove-cell"]
plt.show()  # opens the figures where this runs as a script

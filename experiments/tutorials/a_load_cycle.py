# %% [markdown]
# # 6. A load cycle and its hysteresis
#
# Press two cylinders together. Push the upper one sideways, but not enough to slide. Pull it back. Does it come home?
# No: friction has done work, and the answer depends on the way. Cattaneo (1938) and Mindlin (1949) solved this problem
# exactly. Here we solve it numerically, step by step, and compare slip zones, tractions and the energy that a cycle
# costs.
#
# Reading time: 10 minutes. [Tutorial 1](one_contact_node.py) has Coulomb's law for one step.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contactopt import scenes
from contactopt.analysis.paths import follow
from contactopt.analytic import cycle_loss_line

# %% [markdown]
# ## From one step to a path
#
# Coulomb's law speaks of slip *velocity*: friction opposes the motion of this moment. In a static step we wrote $u_t$
# and meant the whole way from the start. Along a path we take steps, and in each of them $u_t$ is replaced by the slip
# of that step,
#
# $$ u_t \;\to\; u_t - u_t^{\text{before}} . $$
#
# Nothing else changes: it only shifts $q_t$. So each step is one static problem, solved and certified like any other.
# The normal part keeps no memory: a gap is a gap.
#
# ## The scene
#
# Two bodies of the same rubber, 400 mm deep, one with a radius of 4 m, pressed with $P = 100$ N. The shear force $T$
# goes from zero to 40 N, to $-40$ N and back to 40 N. Full sliding would need $\mu P = 50$ N. The normal $n$ points up,
# the tangent to the right; $r$ is the force on the upper body.

# %%
mu, P, T_most, depth = 0.5, 100.0, 40.0, 400.0
states = scenes.shear_cycle(2, steps=8, mu=mu, force=P, shear=T_most, depth=depth, elements=32)
path = follow(states)
history, problem = path.history, path.reduction.problem
T, shift = history["shear_force"], history["shift"]
print(f"{len(path.states)} states, {problem.contacts} contacts, largest certificate {history['residual'].max():.0e}")

assert path.solved
assert np.allclose(history["normal_force"], P)
assert np.isclose(T.max(), T_most) and np.isclose(T.min(), -T_most)

# %% [markdown]
# ## First loading: the edge slips
#
# Two bodies of the same material: the shear does not disturb the pressure, which stays Hertz's,
# $p = p_0 \sqrt{1 - x^2 / a^2}$. If all stuck, the shear traction would be infinite at the edge. Friction cannot hold
# that. So the edge slips, however small $T$ is, and sticks only within
#
# $$ |x| < c, \qquad \frac{c}{a} = \sqrt{1 - \frac{|T|}{\mu P}} . $$
#
# The traction is the difference of two ellipses,
# $q = \mu p_0 \bigl[\sqrt{1 - x^2/a^2} - \tfrac{c}{a} \sqrt{1 - x^2/c^2}\bigr]$.

# %%
reference = states[0].reference
a, p0 = reference.half_width, reference.peak


def first_loading(x, T):
    """Cattaneo and Mindlin's traction for 0 <= T <= mu P, against the push."""
    c = a * np.sqrt(1 - T / (mu * P))
    outer, inner = np.sqrt(np.maximum(1 - (x / a) ** 2, 0)), np.sqrt(np.maximum(1 - (x / c) ** 2, 0))
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
# Now reduce $T$. The edge must slip back at once; the middle still remembers. Slip *against* the old direction needs a
# change of traction of $2 \mu p$. So unloading is a first loading in the other direction, of twice the size (Masing's
# rule):
#
# $$ q(T) = q_{\text{first}}(T^*) - 2\, q_{\text{first}}\Bigl(\frac{T^* - T}{2}\Bigr) . $$
#
# At $T = 0$ the traction does not vanish: it points one way in the middle and the other way at the edge.

# %%
x = problem.coordinates[0]
fine = np.linspace(-a, a, 401)
turned, home, lowest = 8, 16, 24  # states with T = 40 N, 0, -40 N

fig, ax = plt.subplots(figsize=(6.8, 4.2), layout="constrained")
for index, color in ((4, "C0"), (turned, "C1"), (home, "C2"), (lowest, "C3")):
    q = -path.states[index].solution.reactions[:, 1] / problem.areas  # from the lower body's point of view
    expected = (
        first_loading(fine, T[index])
        if index <= turned
        else (first_loading(fine, T_most) - 2 * first_loading(fine, (T_most - T[index]) / 2))
    )
    ax.plot(fine, expected / p0, color=color, lw=1)
    ax.plot(x, q / p0, "o", ms=3, color=color, label=f"T = {round(T[index])} N")
    near = np.interp(x, fine, expected)
    assert np.abs(q - near).max() < 0.06 * mu * p0  # largest next to the kinks, where elements see it blurred
ax.plot(fine, mu * np.sqrt(1 - (fine / a) ** 2), "k--", lw=1, label=r"bound $\pm \mu p$")
ax.plot(fine, -mu * np.sqrt(1 - (fine / a) ** 2), "k--", lw=1)
ax.set(xlabel="x [mm]", ylabel="shear traction over peak pressure [-]", xlim=(-1.15 * a, 1.9 * a))
ax.legend(frameon=False, title="dots: computed\nlines: exact", loc="right")

resultant = path.states[home].solution.reactions[:, 1]
assert abs(resultant.sum()) < 1e-8 and np.abs(resultant).max() > 0.2

# %% [markdown]
# ## The loop
#
# Plot force against shift. The loop is thin, because most of the shift is plain elasticity of the large bodies. Take
# off the straight line through the tips, and it opens.

# %%
stiffness_line = shift.max() / T_most * T

fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
left.plot(shift, T, "o-", ms=3)
left.set(xlabel="shift of the plate [mm]", ylabel="shear force T [N]")
right.plot(1e3 * (shift - stiffness_line), T, "o-", ms=3)
right.set(xlabel="shift beyond the line through the tips [µm]", ylabel="shear force T [N]")

assert np.allclose(shift[turned], shift[-1], rtol=1e-6)  # the loop closes
assert abs(shift[home]) > 0.002  # but it does not go through zero

# %% [markdown]
# ## What a cycle costs
#
# The area of the loop is the energy that friction turns into heat. It does not depend on the size of the bodies,
# because linear elasticity encloses no area. For two cylinders the shift under first loading is
#
# $$ f(T) = \text{const} \cdot T
#    + \frac{\mu}{\pi E^*} \Bigl[\bigl(p - \tfrac{t}{\mu}\bigr) \ln\bigl(p - \tfrac{t}{\mu}\bigr) - p \ln p\Bigr], $$
#
# with forces per depth $p = P / D$ and $t = T / D$. (The tangential shift is $\mu$ times the difference of two normal
# approaches, under $P$ and under $P - T/\mu$; an approach under $p$ contains $-p \ln p\, / (\pi E^*)$.) Masing's rule
# makes both branches of the loop from $f$, and the area between them is $4\, T^* f(T^*) - 8 \int_0^{T^*} f\, dT$.

# %%
modulus = 1 / (2 * (1 - 0.3**2) / 5.0)  # E*, MPa
forces = np.linspace(0, T_most, 2001)
p, t = P / depth, forces / depth
f = mu / (np.pi * modulus) * ((p - t / mu) * np.log(p - t / mu) - p * np.log(p))
expected = 4 * T_most * f[-1] - 8 * np.trapezoid(f, forces)

cycle = slice(turned, len(T))  # from the tip to the tip
area = abs(np.trapezoid(T[cycle], shift[cycle]))
friction = history["friction_work"][-1] - history["friction_work"][turned]
print(f"one cycle costs: exact {expected:.4f} N mm, area of the loop {area:.4f}, friction work {friction:.4f}")

assert np.isclose(
    expected, depth * cycle_loss_line(p, modulus, mu, T_most / depth), rtol=1e-5
)  # the same in closed form
assert np.isclose(area, expected, rtol=0.03)
assert np.isclose(friction, expected, rtol=0.05)
assert np.all(np.diff(history["friction_work"]) >= -1e-12)  # friction never gives back

# %% [markdown]
# Two numbers, two meanings. The area comes from forces and displacements at the plate, the friction work from slip at
# the contacts. They differ by what the finite steps cost, which falls with the step. The energy balance of the whole
# path is kept to rounding:

# %%
fig, ax = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
step = np.arange(len(T))
ax.plot(step, history["external_work"] - history["external_work"][0], label="work of the loads")
ax.plot(step, history["elastic_energy"] - history["elastic_energy"][0], label="elastic energy")
ax.plot(step, history["friction_work"], label="friction work")
ax.set(xlabel="state [-]", ylabel="energy since T = 0 [N mm]", ylim=(None, 4.8))
ax.legend(frameon=False)

assert history["energy_error"].max() < 1e-9

# %% [markdown]
# ## Exercises
#
# **1.** Solve the state $T = 0$ at the end of the path in a *single* static step. Where is the memory?
#
# <details><summary>Solution</summary>
#
# Gone. A static step knows only the loads, and without shear it finds no shear traction.
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
# Like $T^{*3}$: half the force, an eighth of the heat. (The width of the slipping rim and the slip in it both grow with
# $T^*$.)
#
# ```python
# def loop(T_star):
#     s = np.linspace(0, T_star, 4001)
#     t = s / depth
#     f = mu / (np.pi * modulus) * ((p - t / mu) * np.log(p - t / mu) - p * np.log(p))
#     return 4 * T_star * f[-1] - 8 * np.trapezoid(f, s)
#
# exponent = np.log2(loop(2.0) / loop(1.0))
# assert abs(exponent - 3) < 0.05
# ```
#
# </details>
#
# **3.** Take two steps instead of eight from zero to the largest force. What suffers: tips, stick zones, or energy?
#
# <details><summary>Solution</summary>
#
# On each branch slip never turns back, so the tips and the stick zones are right with any number of steps. The area of
# a loop with few corners is too small, and friction work, taken with the force at the end of each step, is too large.
#
# ```python
# coarse = follow(scenes.shear_cycle(2, steps=2, mu=mu, force=P, shear=T_most, depth=depth, elements=32)).history
# assert np.isclose(coarse["shift"].max(), shift.max(), rtol=1e-3)
# assert np.isclose(coarse["stick_half_width"].min(), history["stick_half_width"].min(), rtol=1e-3)
# tip = 2  # the state with T = 40 N
# assert abs(np.trapezoid(coarse["shear_force"][tip:], coarse["shift"][tip:])) < area
# assert coarse["friction_work"][-1] - coarse["friction_work"][tip] > friction
# ```
#
# </details>

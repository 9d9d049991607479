"""Do the sheared contacts reproduce Cattaneo and Mindlin: stick zone, tractions, energy lost in a
cycle?
"""

from __future__ import annotations

import time

import numpy as np
from matplotlib.figure import Figure

from contactopt import scenes
from contactopt.analytic import (
    contact_modulus,
    cycle_loss_line,
    cycle_loss_point,
    tangential_modulus,
)
from contactopt.figures.plots import BLUE, GREY, ORANGE
from contactopt.scenes.scene import Part, Scene
from contactopt.solving.follow import follow
from contactopt.solving.paths import PathResult
from experiments.report import write

FORCE, MU, DEPTH, RADIUS = 100.0, 0.5, 400.0, 10000.0  # the scenes' defaults; RADIUS in 3D
SHEARS = {2: (10.0, 20.0, 30.0, 40.0, 45.0), 3: (20.0, 30.0, 40.0)}  # of mu force = 50
ELEMENTS = {2: (16, 32, 64), 3: (10, 14, 20)}


def measure(
    dim: int, shear: float, elements: int | None = None
) -> tuple[dict[str, object], PathResult]:
    """One cycle with four states from zero to the largest shear."""
    start = time.perf_counter()
    states = scenes.shear_cycle(dim, steps=4, shear=shear, elements=elements)
    path = follow(states)
    seconds = time.perf_counter() - start
    scene, history, problem = states[-1], path.history, path.reduction.problem
    exact, r = scene.reference, path.solution.reactions
    distance = np.linalg.norm(problem.coordinates[: dim - 1], axis=0)
    pressure, traction = r[:, 0] / problem.areas, -r[:, 1] / problem.areas
    lost, area = float(np.diff(history["friction_work"][[4, -1]])[0]), loop_area(history, 4)
    ratio = history["stick_half_width"][-1] / history["contact_half_width"][-1]
    loss = exact_loss(dim, scene, shear)
    return {
        "scene": scene.name,
        "T / (mu P)": shear / (MU * FORCE),
        "elements": scene.elements,
        "contact nodes": problem.contacts,
        "unknowns": path.reduction.dofs,
        "c / a": float(ratio),
        "c / a, rel. error": float(ratio / (exact.stick_half_width / exact.half_width) - 1),
        "p in L2": error(pressure, exact.pressure(distance), problem.areas),
        "q in L2": error(traction, exact.shear(distance), problem.areas),
        "loss, rel. error": lost / loss - 1,
        "loop's area, rel. error": area / loss - 1,
        "energy balance": float(history["energy_error"].max()),
        "seconds": seconds,
        "solved": path.solved,
    }, path


def error(value: np.ndarray, exact: np.ndarray, areas: np.ndarray) -> float:
    """Relative L2 error at the nodes, with their areas."""
    exact = np.nan_to_num(exact)
    return float(np.sqrt(np.sum(areas * (value - exact) ** 2) / np.sum(areas * exact**2)))


def loop_area(history: dict[str, np.ndarray], first: int) -> float:
    """Integral of the shear force over the shift from state `first` on, by the trapezoidal rule."""
    force, shift = history["shear_force"][first:], history["shift"][first:]
    return float(np.sum((force[1:] + force[:-1]) / 2 * np.diff(shift)))


def exact_loss(dim: int, scene: Scene, shear: float) -> float:
    assert isinstance(scene.upper, Part)
    material = scene.upper.material
    modulus = contact_modulus(material, material)
    if dim == 2:
        return DEPTH * cycle_loss_line(FORCE / DEPTH, modulus, MU, shear / DEPTH)
    return cycle_loss_point(
        FORCE, RADIUS, modulus, tangential_modulus(material, material), MU, shear
    )


def draw(paths: dict[str, PathResult]) -> Figure:
    figure = Figure(figsize=(10.8, 4.2), layout="constrained")
    for ax, (name, path) in zip(figure.subplots(1, len(paths)), paths.items()):
        problem, scene = path.reduction.problem, path.states[-1].scene
        distance = np.linalg.norm(problem.coordinates[: problem.dim - 1], axis=0)
        a, peak = scene.reference.half_width, MU * scene.reference.peak
        r = path.solution.reactions / problem.areas[:, None]
        fine = np.linspace(0, 1.25 * a, 1001)
        ax.plot(
            fine / a,
            MU * scene.reference.pressure(fine) / peak,
            "--",
            color=GREY,
            lw=1,
            label="mu p, exact",
        )
        ax.plot(
            fine / a, scene.reference.shear(fine) / peak, color=ORANGE, lw=1.5, label="q, exact"
        )
        ax.plot(distance / a, -r[:, 1] / peak, ".", color=BLUE, ms=4, label="q, all contact nodes")
        ax.set(
            title=name, xlabel="distance from the centre / a [-]", ylabel="traction / (mu p0) [-]"
        )
        ax.legend(frameon=False)
    return figure


TEXT = """How accurate are sheared contacts? Two bodies of one material are pressed by 100 N and sheared to and fro by T, with mu = .5. Cattaneo and
Mindlin's exact solution is compared with two things: the state at +T after a whole cycle, and the
energy that the cycle costs. The cycle starts at the first +T.

There are two scenes. In plane strain (nu = .3) a cylinder has a radius of 4,000 mm, and the bodies
are 50 contact half-widths large. In 3D (nu = 0) a sphere has a radius of 10,000 mm, half of it is
modelled, and the bodies are 8 contact radii large.

Tractions are compared node by node, without smoothing, although the exact ones have vertical
tangents at both edges. `loss` is the friction work. `loop's area` is the integral of the shear
force over the shift by the trapezoidal rule. It has eight chords each way, and is therefore
coarser. The balance of energy says: external work = elastic energy + friction work + error of the
steps. `energy balance` is its largest error, relative to the energy.

{loads}

The next table shows the influence of the mesh, at T = .6 mu P:

{meshes}
"""

if __name__ == "__main__":
    loads, kept = [], {}
    for dim, shears in SHEARS.items():
        for shear in shears:
            row, path = measure(dim, shear)
            loads.append(row)
            if shear == 30.0:
                kept[path.states[-1].scene.name] = path
    meshes = [measure(dim, 30.0, elements)[0] for dim in ELEMENTS for elements in ELEMENTS[dim]]
    title = "Sheared contacts against Cattaneo and Mindlin"
    write("cattaneo", title, TEXT, {"loads": loads, "meshes": meshes}, {"tractions": draw(kept)})

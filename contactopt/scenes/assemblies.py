"""Bodies that others hold: a pin in a bush with clearance, a press fit, a stack of blocks, an arch
of stones.
"""

from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from contactopt.analytic import contact_modulus, pin_in_hole
from contactopt.analytic import press_fit as lame
from contactopt.checks import check_count, check_number, check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.meshes.polar import even, right_half_disc, ring
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.scenes.common import RUBBER, check_choice, circle, explained, model
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Part, Rigid, Scene, Support

STEEL = Material(E=210e3, nu=0.3)  # MPa
STONE = Material(E=30e3, nu=0.2)
LARGE = 30.0  # infinite plate: its outer radius over that of the hole
FLAT = 0.75  # height of the elements of a press fit over their length: it varies along the radius
# thickness over mean radius below which a half circle of stones cannot bear its own weight
THINNEST = 0.1075


@explained
def pin_in_bush(
    *,
    radius: float = 20.0,
    clearance: float = 0.5,
    outside: float | None = None,
    depth: float = 40.0,
    material: Material = RUBBER,
    mu: float = 0.0,
    force: float = 100.0,
    elements: int = 24,
) -> Scene:
    """A pin in the hole of a bush of its material, pressed down; half a section in plane strain.

    Only contact holds the pin. The force acts on it as a force per volume. On the circle this has
    the radial displacements of a force at the centre, but for a rigid motion.

    Parameters
    ----------
    radius : of the hole [mm]
    clearance : by how much the radius of the pin is smaller [mm]
    outside : radius at which the bush is clamped. By default 30 radii of the hole, which stand for
        an infinite plate
    force : total force on the pin [N]

    Returns
    -------
    Scene : 'pin-in-bush', with Persson's solution where it is exact: mu = 0, infinite plate
    """
    check_positive(radius=radius, clearance=clearance, depth=depth, force=force)
    check_count("elements", elements)
    exact = pin_in_hole(force / depth, radius, clearance, contact_modulus(material, material))
    edge = LARGE * radius if outside is None else outside
    if not clearance < radius < edge:
        raise InputError(
            f"the hole's radius {radius:g} must lie between the clearance and the bush's outside."
        )

    def parts(elements: int) -> int:
        return 4 * max(1, round(elements * np.pi * radius / (4 * exact.half_width)))

    def pin(elements: int, zone: float | None) -> Any:
        return rename(right_half_disc(radius - clearance, parts(elements) // 4), contact="rim")

    def bush(elements: int, zone: float | None) -> Any:
        return rename(_sector(radius, edge, np.pi, parts(elements)), contact="inner")

    # the pin of linear elements is a polygon, and bears the force on its area
    area = parts(elements) * np.sin(np.pi / parts(elements)) * (radius - clearance) ** 2
    weight = BodyForce((0.0, -force / float(area * depth)))
    axis, start, end = (Support(name, {"x": 0.0}) for name in ("axis", "start", "end"))
    held = (start, end, Support("outer"))
    return Scene(
        "pin-in-bush",
        Part("pin", pin, material, (axis,), (weight,), curve=circle(radius - clearance)),
        Part("bush", bush, material, held, curve=circle(radius)),
        mu,
        elements=elements,
        **model("plane-strain", depth, 2),
        reference=exact if mu == 0 and outside is None else None,
    )


@explained
def press_fit(
    kind: str = "plane-strain",
    *,
    radius: float = 20.0,
    bore: float = 10.0,
    outside: float = 40.0,
    interference: float = 0.01,
    depth: float = 40.0,
    shaft: Material = STEEL,
    hub: Material = STEEL,
    mu: float = 0.15,
    elements: int = 14,
) -> Scene:
    """A hollow shaft pressed into a hub whose hole is too narrow.

    The shaft is larger than `radius` by half of the interference, and the hole is smaller by the
    other half. Lame's pressure is exact as the interference goes to zero.

    Parameters
    ----------
    kind : 'plane-strain' for a quarter of the section; 'axisymmetric' for a slice between two
        frictionless planes
    bore, radius, outside : of the shaft's hole, of where shaft and hub meet, of the hub [mm]
    interference : of the radii [mm]
    depth : length of the fit along its axis [mm]
    shaft, hub : materials
    elements : number of elements along the quarter of the circle, or along the height

    Returns
    -------
    Scene : 'press-fit', with Lame's pressure
    """
    exact = lame(interference, bore, radius, outside, shaft, hub)
    check_positive(bore=bore, depth=depth)
    check_choice("kind", kind, "plane-strain", "axisymmetric")
    plane = kind == "plane-strain"
    across = ("y", "x") if plane else ("z", "z")
    ends = tuple(Support(end, {c: 0.0}) for end, c in zip(("start", "end"), across))

    def part(name: str, material: Material, inner: float, outer: float, touching: str) -> Part:
        mesh = partial(_layer, None if plane else depth, (inner, outer), touching)
        curve = circle(outer if touching == "outer" else inner) if plane else None
        return Part(name, mesh, material, ends, curve=curve)

    half = interference / 2
    return Scene(
        "press-fit",
        part("shaft", shaft, bore, radius + half, "outer"),
        part("hub", hub, radius - half, outside, "inner"),
        mu,
        elements=elements,
        **model(kind, depth, 4 if plane else 1),
        reference=exact,
    )


def _layer(
    height: float | None,
    radii: tuple[float, float],
    touching: str,
    elements: int,
    zone: float | None,
) -> Any:
    """A quarter of a ring, or with a height the section of a hollow cylinder."""
    inner, outer = radii
    if height is None:
        return rename(_sector(inner, outer, np.pi / 2, elements, FLAT), contact=touching)
    count = max(1, round((outer - inner) * elements / height))
    grids = np.linspace(inner, outer, count + 1), np.linspace(0, height, elements + 1)
    side = "x+" if touching == "outer" else "x-"
    return rename(tensor_mesh(*grids), start="y-", end="y+", contact=side)


def _sector(inner: float, outer: float, sweep: float, parts: int, height: float = 1.0) -> Any:
    """A sector of a ring that ends upright, `parts` elements around, about `height` high."""
    angles = np.linspace(np.pi / 2 - sweep, np.pi / 2, parts + 1)
    return ring(even(inner, outer, round(parts * np.pi / sweep / height)), angles)


@explained
def stack(
    *,
    blocks: int = 4,
    width: float = 200.0,
    height: float = 100.0,
    depth: float = 100.0,
    material: Material = STONE,
    mu: float = 0.6,
    weight: float = 100.0,
    tilt: float = 10.0,
    elements: int = 8,
) -> Scene:
    """Blocks that only rest on each other, the lowest one on a rigid floor, tilted; plane strain.

    Statics give the resultant of every joint. With W the weight above a joint it is W cos(tilt)
    across and W sin(tilt) along, through the centre of gravity of what is above. The stack stands
    as long as tan(tilt) is below mu and below the width over the height of the stack.

    Parameters
    ----------
    blocks : number of blocks
    width, height : of each block [mm]
    mu : friction coefficient of all joints
    weight : of each block [N]
    tilt : angle of the floor [degrees]
    elements : number of elements across half the width

    Returns
    -------
    Scene : 'stack'
    """
    check_count("blocks", blocks)
    check_positive(width=width, height=height, depth=depth, weight=weight)
    check_number("tilt", tilt, low=-90.0, high=90.0)
    angle, steepest = np.radians(tilt), min(mu, width / (blocks * height))
    if steepest <= 0:
        raise InputError("the stack slides without friction; take mu above 0.")
    if abs(np.tan(angle)) >= steepest:
        raise InputError(
            f"tilted by {tilt:g} degrees the stack slides or falls over; take a tilt below"
            f" {np.degrees(np.arctan(steepest)):.3g} degrees, or more friction, or fewer blocks."
        )
    density = weight / (width * height * depth)
    load = BodyForce((density * float(np.sin(angle)), -density * float(np.cos(angle))))

    def block(name: str, level: int) -> Part:
        def mesh(elements: int, zone: float | None) -> Any:
            x = np.linspace(-width / 2, width / 2, 2 * elements + 1)
            y = np.linspace(0, height, max(1, round(2 * elements * height / width)) + 1)
            return rename(tensor_mesh(x, y + level * height), contact="y-", top="y+")

        return Part(name, mesh, material, loads=(load,))

    names = [f"block-{i + 1}" for i in range(blocks)]
    below = ["floor", *(f"{name}:top" for name in names)]
    return Scene(
        "stack",
        bodies=(Rigid("floor"), *(block(name, i) for i, name in enumerate(names))),
        contacts=tuple(Contact(upper, lower, mu) for upper, lower in zip(names, below)),
        elements=elements,
        **model("plane-strain", depth),
    )


@explained
def arch(
    *,
    stones: int = 7,
    radius: float = 1000.0,
    thickness: float = 250.0,
    depth: float = 500.0,
    material: Material = STONE,
    mu: float = 0.6,
    weight: float = 1000.0,
    elements: int = 8,
) -> Scene:
    """A half circle of stones that rest on each other and on rigid ground; plane strain.

    Every springing bears half of the weight, and the thrusts at both springings balance. Stones
    that are thinner than .1075 of the mean radius cannot stand at all (Milankovitch 1907, Theorie
    der Druckkurven, Z. Math. Phys. 55, 1-27).

    Parameters
    ----------
    stones : number of stones
    radius : mean radius of the half circle [mm]
    thickness : of the stones, along the radius [mm]
    mu : friction coefficient of all joints
    weight : of all stones together [N]
    elements : number of elements across half the thickness

    Returns
    -------
    Scene : 'arch'
    """
    check_count("stones", stones)
    check_positive(radius=radius, thickness=thickness, depth=depth, weight=weight)
    if not THINNEST < thickness / radius < 2:
        raise InputError(
            f"the thickness over the mean radius is {thickness / radius:.4g}; such an arch cannot"
            f" stand: take more than {THINNEST:g}, and less than 2."
        )
    load = BodyForce((0.0, -weight / (np.pi * radius * thickness * depth)))

    def stone(name: str, number: int) -> Part:
        def mesh(elements: int, zone: float | None) -> Any:
            # An even number: the keystone has edges in the arch's plane of symmetry.
            rows = 2 * max(1, round(elements * np.pi * radius / stones / thickness))
            angles = np.linspace(number * np.pi / stones, (number + 1) * np.pi / stones, rows + 1)
            half = thickness / 2
            return ring(np.linspace(radius - half, radius + half, 2 * elements + 1), angles)

        return Part(name, mesh, material, loads=(load,), contact="start")

    names = [f"stone-{i + 1}" for i in range(stones)]
    joints = [Contact(names[0], "right", mu)]
    joints += [Contact(upper, f"{lower}:end", mu) for lower, upper in pairwise(names)]
    joints += [Contact(f"{names[-1]}:end", "left", mu)]
    return Scene(
        "arch",
        bodies=(Rigid("right"), Rigid("left"), *(stone(name, i) for i, name in enumerate(names))),
        contacts=tuple(joints),
        elements=elements,
        **model("plane-strain", depth),
    )

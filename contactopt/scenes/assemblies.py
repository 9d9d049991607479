"""Bodies that others hold: a pin in a bush with clearance, a press fit, a stack of blocks, an arch
of stones.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from contactopt.analytic import contact_modulus, pin_in_hole
from contactopt.analytic import press_fit as lame
from contactopt.checks import check_count, check_number, check_positive
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.common import RUBBER, UNITS
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Part, Rigid, Scene, Support

STEEL = Material(E=210e3, nu=0.3)  # MPa
STONE = Material(E=30e3, nu=0.2)
LARGE = 30.0  # infinite plate: its outer radius over that of the hole
# thickness over mean radius below which a half circle of stones cannot bear its own weight
THINNEST = 0.1075


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
    """A pin in the hole of a bush of the same material, pressed down; plane strain, of which half
    is modelled.

    Only contact holds the pin. The force acts on it as a force per volume. On the circle this has
    the same radial displacements as a force at the centre, but for a rigid motion. The nodes divide
    the circles evenly. Lengths are in mm, forces in N and Young's moduli in MPa.

    Parameters
    ----------
    radius : Of the hole.
    clearance : By how much the radius of the pin is smaller.
    outside : Radius at which the bush is clamped. By default 30 radii of the hole, which stand for
        an infinite plate.
    depth : Length of both bodies along the axis.
    material : Of both bodies.
    mu : Friction coefficient. Without friction Persson's solution is exact for an infinite plate.
    force : Total force on the pin.
    elements : Number of elements across the contact half-width.

    Returns
    -------
    Named 'pin-in-bush', with Persson's solution where it is exact.

    Raises
    ------
    InputError : If a size is not positive, or the pin does not fit into the hole.
    """
    check_positive(radius=radius, clearance=clearance, depth=depth, force=force)
    check_count("elements", elements)
    exact = pin_in_hole(force / depth, radius, clearance, contact_modulus(material, material))
    edge = LARGE * radius if outside is None else outside
    if not clearance < radius < edge:
        raise InputError(
            f"the clearance must be less than the hole's radius {radius:g}, and the bush end"
            " beyond it."
        )

    def sectors(elements: int) -> int:
        return max(1, round(elements * np.pi * radius / (4 * exact.half_width)))

    def pin(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.meshes.polar import right_half_disc
        from contactopt.meshes.structured import rename

        return rename(right_half_disc(radius - clearance, sectors(elements)), contact="rim")

    def bush(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
        from contactopt.meshes.polar import even, ring
        from contactopt.meshes.structured import rename

        parts = 4 * sectors(elements)
        angles = np.linspace(-np.pi / 2, np.pi / 2, parts + 1)
        return rename(ring(even(radius, edge, parts), angles), contact="inner")

    # the pin of linear elements is a polygon, and bears the force on its area
    parts = 8 * sectors(elements)
    area = parts / 2 * np.sin(2 * np.pi / parts) * (radius - clearance) ** 2
    weight = (0.0, -force / float(area * depth))
    symmetry = Support("start", {"x": 0.0}), Support("end", {"x": 0.0})
    return Scene(
        "pin-in-bush",
        Part(
            "pin",
            pin,
            material,
            (Support("axis", {"x": 0.0}),),
            (BodyForce(weight),),
            curve=_circle(radius - clearance),
        ),
        Part("bush", bush, material, (*symmetry, Support("outer")), curve=_circle(radius)),
        mu,
        thickness=depth,
        copies=2,
        elements=elements,
        units=UNITS,
        reference=exact if mu == 0 and outside is None else None,
    )


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
    elements: int = 16,
) -> Scene:
    """A hollow shaft pressed into a hub whose hole is too narrow.

    The shaft is larger than `radius` by half of the interference, and the hole is smaller by the
    other half. Lame's pressure is exact as the interference goes to zero. Lengths are in mm and
    Young's moduli in MPa.

    Parameters
    ----------
    kind : 'plane-strain' for a quarter of the section; 'axisymmetric' for a slice between two
        frictionless planes.
    radius : At which shaft and hub meet.
    bore : Inner radius of the shaft.
    outside : Outer radius of the hub.
    interference : Of the radii.
    depth : Length of the fit along its axis.
    shaft, hub : Materials.
    mu : Friction coefficient.
    elements : Number of elements along the quarter of the circle, or along the height.

    Returns
    -------
    Named 'press-fit', with Lame's pressure.

    Raises
    ------
    InputError : If the radii are not in order, a size is not positive, or the kind is unknown.
    """
    exact = lame(interference, bore, radius, outside, shaft, hub)
    check_positive(bore=bore, depth=depth)
    check_count("elements", elements)
    if kind not in ("plane-strain", "axisymmetric"):
        raise InputError(f"kind must be 'plane-strain' or 'axisymmetric'; got {kind!r}.")
    limits = {
        "shaft": (bore, radius + interference / 2),
        "hub": (radius - interference / 2, outside),
    }
    side = {"shaft": "outer", "hub": "inner"}

    def mesh(body: str, elements: int):  # type: ignore[no-untyped-def]
        from contactopt.meshes.polar import even, ring
        from contactopt.meshes.structured import rename, tensor_mesh

        if kind == "plane-strain":
            made = ring(even(*limits[body], 2 * elements), np.linspace(0, np.pi / 2, elements + 1))
            return rename(made, contact=side[body])
        across = max(1, round((limits[body][1] - limits[body][0]) * elements / depth))
        made = tensor_mesh(
            np.linspace(*limits[body], across + 1), np.linspace(0, depth, elements + 1)
        )
        return rename(
            made, start="y-", end="y+", contact={"outer": "x+", "inner": "x-"}[side[body]]
        )

    normal = {"plane-strain": ("y", "x"), "axisymmetric": ("z", "z")}[kind]
    ends = tuple(
        Support(name, {component: 0.0}) for name, component in zip(("start", "end"), normal)
    )
    curves = {
        name: _circle(limits[name][name == "shaft"]) if kind == "plane-strain" else None
        for name in limits
    }

    def part(name: str, material: Material) -> Part:
        return Part(
            name, lambda elements, zone: mesh(name, elements), material, ends, curve=curves[name]
        )

    return Scene(
        "press-fit",
        part("shaft", shaft),
        part("hub", hub),
        mu,
        kind=kind,
        thickness=depth if kind == "plane-strain" else 1.0,
        copies=4 if kind == "plane-strain" else 1,
        elements=elements,
        units=UNITS,
        reference=exact,
    )


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
    """Blocks that only rest on each other, the lowest one on a rigid floor, all tilted by an angle;
    plane strain.

    Statics give the resultant of every joint. With W the weight above a joint it is W cos(tilt)
    across and W sin(tilt) along, through the centre of gravity of what is above. The stack stands
    as long as tan(tilt) is below mu and below the width over the height of the stack. Lengths are
    in mm, forces in N and Young's moduli in MPa.

    Parameters
    ----------
    blocks : Number of blocks.
    width, height : Of each block.
    depth : Length of the blocks along the direction without strain.
    material : Of the blocks.
    mu : Friction coefficient of all joints.
    weight : Of each block.
    tilt : Angle of the floor [degrees].
    elements : Number of elements across half the width.

    Returns
    -------
    Named 'stack'.

    Raises
    ------
    InputError : If a size is not positive, or the stack would slide or fall over.
    """
    check_count("blocks", blocks)
    check_count("elements", elements)
    check_positive(width=width, height=height, depth=depth, weight=weight)
    check_number("tilt", tilt, low=-90.0, high=90.0)
    slope = np.tan(np.radians(tilt))
    if abs(slope) >= min(mu, width / (blocks * height)):
        raise InputError(
            f"tilted by {tilt:g} degrees the stack slides or falls over; take a tilt below"
            f" {np.degrees(np.arctan(min(mu, width / (blocks * height)))):.3g} degrees, or more"
            " friction, or fewer blocks."
        )
    density = weight / (width * height * depth)
    load = BodyForce(
        (density * float(np.sin(np.radians(tilt))), -density * float(np.cos(np.radians(tilt))))
    )

    def mesh(level: int):  # type: ignore[no-untyped-def]
        def build(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
            from contactopt.meshes.structured import rename, tensor_mesh

            rows = max(1, round(2 * elements * height / width))
            x, y = (
                np.linspace(-width / 2, width / 2, 2 * elements + 1),
                np.linspace(0, height, rows + 1),
            )
            return rename(tensor_mesh(x, y + level * height), contact="y-", top="y+")

        return build

    names = [f"block-{i + 1}" for i in range(blocks)]
    below = ["floor", *(f"{name}:top" for name in names)]
    return Scene(
        "stack",
        bodies=(
            Rigid("floor"),
            *(Part(name, mesh(i), material, loads=(load,)) for i, name in enumerate(names)),
        ),
        contacts=tuple(Contact(upper, lower, mu) for upper, lower in zip(names, below)),
        thickness=depth,
        elements=elements,
        units=UNITS,
    )


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
    """A half circle of stones that only rest on each other, the outermost ones on rigid ground;
    plane strain.

    Every springing bears half of the weight, and the thrusts at both springings balance. Stones
    that are thinner than .1075 of the mean radius cannot stand at all (Milankovitch 1907, Theorie
    der Druckkurven, Z. Math. Phys. 55, 1-27). Lengths are in mm, forces in N and Young's moduli in
    MPa.

    Parameters
    ----------
    stones : Number of stones.
    radius : Mean radius of the half circle.
    thickness : Of the stones, along the radius.
    depth : Length of the arch along its axis.
    material : Of the stones.
    mu : Friction coefficient of all joints.
    weight : Of all stones together.
    elements : Number of elements across half the thickness.

    Returns
    -------
    Named 'arch'.

    Raises
    ------
    InputError : If a size is not positive, or the stones are too thin to stand.
    """
    check_count("stones", stones)
    check_count("elements", elements)
    check_positive(radius=radius, thickness=thickness, depth=depth, weight=weight)
    if not THINNEST < thickness / radius < 2:
        raise InputError(
            f"the thickness over the mean radius is {thickness / radius:.4g}; such an arch cannot"
            f" stand: take more than {THINNEST:g}, and less than 2."
        )
    load = BodyForce((0.0, -weight / (np.pi * radius * thickness * depth)))

    def mesh(number: int):  # type: ignore[no-untyped-def]
        def build(elements: int, zone: float | None):  # type: ignore[no-untyped-def]
            from contactopt.meshes.polar import ring

            # An even number: the keystone has edges in the arch's plane of symmetry.
            rows = 2 * max(1, round(elements * np.pi * radius / stones / thickness))
            angles = np.linspace(number * np.pi / stones, (number + 1) * np.pi / stones, rows + 1)
            return ring(
                np.linspace(radius - thickness / 2, radius + thickness / 2, 2 * elements + 1),
                angles,
            )

        return build

    names = [f"stone-{i + 1}" for i in range(stones)]
    bodies = [
        Part(name, mesh(i), material, loads=(load,), contact="start")
        for i, name in enumerate(names)
    ]
    joints = [Contact(names[0], "right", mu)]
    joints += [Contact(upper, f"{lower}:end", mu) for lower, upper in pairwise(names)]
    joints += [Contact(f"{names[-1]}:end", "left", mu)]
    return Scene(
        "arch",
        bodies=(Rigid("right"), Rigid("left"), *bodies),
        contacts=tuple(joints),
        thickness=depth,
        elements=elements,
        units=UNITS,
    )


def _circle(radius: float):  # type: ignore[no-untyped-def]
    """The curve of a contact boundary on a circle around the origin."""
    return lambda x: radius * x / np.linalg.norm(x, axis=0)

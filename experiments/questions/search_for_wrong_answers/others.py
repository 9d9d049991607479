"""Random scenes of round bodies and of half-spaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import gamma

from contactopt import Contact, HalfSpace, Part, Plate, Rigid, Scene, Support
from contactopt.analytic import contact_modulus, hertz_line, hertz_point, press_fit
from contactopt.meshes.discs import extrude, half_disc
from contactopt.meshes.structured import graded, tensor_mesh
from contactopt.scenes.round import cylinder
from experiments.questions.search_for_wrong_answers.blocks import (
    Random,
    friction,
    material,
    oblique,
)
from experiments.questions.search_for_wrong_answers.compare import Case, Values, Way
from experiments.questions.search_for_wrong_answers.meshes import (
    named,
    outlined,
    random_move,
    ring,
    ticks,
)


def scene_of(bodies: list[Any], pair: tuple[str, str], mu: float, **settings: Any) -> Scene:
    """A scene of one pair; settings of the contact among those of the scene."""
    own = {key: settings.pop(key) for key in ("coupling", "carrier") if key in settings}
    return Scene("search", bodies=tuple(bodies), contacts=(Contact(*pair, mu, **own),), **settings)


def moved(rng: Random, build: Callable[[int], Scene], axes: tuple[int, ...] = (0, 1)) -> Way:
    """The way, exchanged or not and moved."""
    swap = bool(rng.random() < 0.5)
    return Way(build, axes, swap, random_move(rng, build(0), swap))


def mortar(rng: Random, order: int = 1) -> dict[str, Any]:
    """Settings of a second way."""
    degree = max(order, int(rng.integers(1, 3)))
    return {"coupling": "mortar", "carrier": str(rng.choice(["upper", "lower"])), "degree": degree}


def circle(radius: float, y: float = 0.0) -> Callable[[np.ndarray], np.ndarray]:
    """Points moved to a circle about (0, y)."""
    middle = np.array([[0.0], [y]])
    return lambda x: middle + radius * (x - middle) / np.hypot(*(x - middle))


def pin(rng: Random) -> Case:
    """A pin with a hole in a bush that is held outside; with or without clearance."""
    hole, outer, mu = float(rng.uniform(0.3, 0.6)), float(rng.uniform(1.6, 2.5)), friction(rng)
    turn = rng.uniform(0, 6)
    play = 0.0 if rng.random() < 0.3 else float(10 ** rng.uniform(-4, -1))
    one, two, angle = material(rng), material(rng), rng.uniform(0, 2 * np.pi)
    force = min(one.E, two.E) * min(play or 1e-3, 1e-3) * float(rng.uniform(0.3, 3))
    load = Plate("inside", {"x": force * np.cos(angle), "y": force * np.sin(angle)})
    radii, order = {"pin": (hole, 1 - play), "bush": (1.0, outer)}, int(rng.integers(1, 3))
    shares, given = rng.uniform(0.7, 1.5, 2), mortar(rng, order)

    def scene(mesh: Callable[[str], Any], **settings: Any) -> Scene:
        pin = Part("pin", mesh("pin"), one, (), (load,), curve={"outside": circle(1 - play)})
        bush = Part("bush", mesh("bush"), two, (Support("outside"),), curve={"inside": circle(1.0)})
        return scene_of([pin, bush], ("pin:outside", "bush:inside"), mu, **settings)

    def structured(level: int) -> Scene:
        count = 28 * 2**level
        around = turn + 2 * np.pi * np.arange(count) / count
        return scene(
            lambda name: ring(np.geomspace(*radii[name], 4 * 2**level + 1), around), degree=1
        )

    def free(level: int) -> Scene:
        def loop(r: float, h: float, name: str) -> Any:
            return [
                (r * np.cos(t), r * np.sin(t), h, name) for t in turn + np.pi / 2 * np.arange(4)
            ]

        def mesh(name: str) -> Any:
            (low, high), h = radii[name], 2 * np.pi / (28 * 2**level)
            inner, outward = shares * h if name == "bush" else shares[::-1] * h
            return outlined(
                loop(high, outward, "outside"), loop(low, inner, "inside"), order=order, arcs=True
            )

        return scene(mesh, **given)

    points = {
        "pin": [(0.0, (hole + 1) / 2), ((hole + 1) / 2, 0.0)],
        "bush": [(0.0, -(1 + outer) / 2)],
    }
    return Case(
        "pin in bush",
        (Way(structured), moved(rng, free)),
        points,
        smooth=True,
        loose=play,
        strain=1e-3,
    )


def fit(rng: Random) -> Case:
    """A press fit: a quarter of two rings against Lame's solution."""
    bore, outer = float(rng.uniform(0.3, 0.7)), float(rng.uniform(1.4, 2.5))
    d = float(10 ** rng.uniform(-4, -2.5))
    shaft, hub, share, mu = material(rng), material(rng), float(rng.uniform(0, 1)), friction(rng)
    rims, order = (1 + share * d, 1 - (1 - share) * d), int(rng.integers(1, 3))
    sizes = rng.uniform(0.1, 0.2, 2)
    given, exact = mortar(rng, order), press_fit(d, bore, 1.0, outer, shaft, hub).peak or 0.0
    sides = (Support("straight x", {"y": 0.0}), Support("straight y", {"x": 0.0}))

    def build(level: int) -> Scene:
        def quarter(low: float, high: float, h: float) -> Any:
            loop = [
                (low, 0.0, h, "straight x"),
                (high, 0.0, h, "outside"),
                (0.0, high, h, "straight y"),
                (0.0, low, h, "inside"),
            ]
            return outlined(loop, order=order, arcs=True)

        h = sizes / 2**level
        bodies = [
            Part(
                "shaft",
                quarter(bore, rims[0], h[0]),
                shaft,
                sides,
                curve={"outside": circle(rims[0])},
            ),
            Part(
                "hub", quarter(rims[1], outer, h[1]), hub, sides, curve={"inside": circle(rims[1])}
            ),
        ]
        return scene_of(bodies, ("shaft:outside", "hub:inside"), mu, copies=4, **given)

    return Case(
        "press fit",
        ({"pressure 0": exact, "peak 0": exact}, moved(rng, build)),
        smooth=True,
        strain=d,
    )


def roller(rng: Random) -> Case:
    """A cylinder on a flat body: half of it, graded, or all of it, coarse far from contact."""
    one, two, mu = material(rng), material(rng), friction(rng)
    a, wide = float(rng.uniform(0.03, 0.1)), float(rng.uniform(1.5, 4))
    high = float(rng.uniform(1, 3))
    force, fine = np.pi * contact_modulus(one, two) * a**2 / 4, float(rng.uniform(0.8, 1.3))
    far = float(rng.uniform(0.1, 0.5))
    given = mortar(rng)
    sizes = {"foundation_width": wide, "foundation_height": high, "force": force}

    def half(level: int) -> Scene:
        return cylinder(
            radius=1.0, depth=1.0, upper=one, lower=two, mu=mu, elements=6 * 2**level, **sizes
        )

    def build(level: int) -> Scene:
        h, c = a / (5 * 2**level) * fine, wide / 2
        ends = [
            (-np.pi, far, "arc"),
            *((t * a - np.pi / 2, h, "arc") for t in (-1.3, 0, 1.3)),
            (0.0, far, "straight top"),
        ]
        made = outlined([(np.cos(t), np.sin(t), s, name) for t, s, name in ends], arcs=True)
        disc = type(made)(made.doflocs + np.array([[0.0], [1.0]]), made.t).with_boundaries(
            made.boundaries
        )
        flat = [
            (-c, -high, far, "bottom"),
            (c, -high, far, "right"),
            (c, 0.0, far, "over"),
            (1.3 * a, 0.0, h, "over"),
            (-1.3 * a, 0.0, h, "over"),
            (-c, 0.0, far, "left"),
        ]
        load = Plate("straight top", {"y": -force})
        bodies = [
            Part("cylinder", disc, one, (), (load,), curve={"arc": circle(1.0, 1.0)}),
            Part("foundation", outlined(flat), two, (Support("bottom"),)),
        ]
        return scene_of(bodies, ("cylinder:arc", "foundation:over"), mu, **given)

    return Case(
        "roller", (Way(half), moved(rng, build)), whole=False, smooth=True, loose=a**2, strain=a
    )


def ball(rng: Random) -> Case:
    """A round body with a crowned face on a plate: its section, and the half of it in space."""
    one, two, mu, a = material(rng), material(rng), friction(rng), float(rng.uniform(0.3, 0.5))
    radius, heights = float(rng.uniform(50, 500)), rng.uniform(0.6, 1.2, 2)
    share = (1.0, float(rng.uniform(0.8, 1.3)))
    force = 4 / 3 * contact_modulus(one, two) * a**3 / radius

    def build(level: int, section: bool) -> Scene:
        bodies = []
        for i, (own, high) in enumerate(zip((one, two), heights)):
            h = a / (6 * 2**level if section else 3 * 1.4**level) * (1.0 if section else share[i])
            across, rise = ticks([0.0, 0.9, 1.0], h), graded(high, h, 1.3 ** (0.5**level))
            rise = -rise[::-1] if i else rise
            flat = (
                tensor_mesh(across, rise)
                if section
                else extrude(*half_disc(across, max(2, len(across) // 4)), rise)
            )
            r = np.hypot(*flat.p[:-1]) if len(flat.p) == 3 else flat.p[0]
            middle = flat.p[:, flat.facets].mean(axis=1)
            touch = (np.abs(middle[-1]) < 1e-9) & (np.linalg.norm(middle[:-1], axis=0) < 0.9)
            p = flat.p.copy()
            p[-1] += 0 if i else r**2 / (2 * radius) * (1 - p[-1] / high)
            far = -high if i else high
            sides = {
                "far": lambda x, far=far: np.abs(x[-1] - far) < 1e-9,
                "axis": lambda x, axis=int(not section): x[axis] < 1e-9,
            }
            mesh = named(type(flat)(p, flat.t), sides)
            mesh = mesh.with_boundaries({**mesh.boundaries, "contact": np.flatnonzero(touch)})
            held = Support("axis", {"r": 0.0} if section else {"y": 0.0})
            supports, loads = (
                ((held, Support("far")), ()) if i else ((held,), (Plate("far", {"z": -force}),))
            )
            bodies.append(Part(["upper", "lower"][i], mesh, own, supports, loads))
        kind = {"kind": "axisymmetric"} if section else {"kind": "solid", "copies": 2}
        return scene_of(bodies, ("upper", "lower"), mu, **kind)

    points = {"upper": [(0.3, 0.5 * heights[0])], "lower": [(0.3, -0.5 * heights[1])]}
    second = moved(rng, lambda level: build(level, False), (0, 2))
    ways = Way(lambda level: build(level, True)), second
    case = Case("section or space", ways, points, whole=False, smooth=True, strain=a / radius)
    return replace(case, without=("reach",))  # of which a section shows one component


def westergaard(modulus: float, tall: float, length: float, a: float) -> Values:
    """What is known of a wave on a periodic half-plane that touches on 2 a of every `length`."""
    t = (np.arange(4000) + 0.5) / 4000 * np.pi - np.pi / 2
    x, dx, closed = a * np.sin(t), a * np.cos(t) * np.pi / 4000, np.sin(np.pi * a / length) ** 2
    p = 2 * np.pi * modulus * tall / length * np.cos(np.pi * x / length)
    p *= np.sqrt(np.maximum(closed - np.sin(np.pi * x / length) ** 2, 0))
    force = float(p @ dx)
    mean, reach = float(p**2 @ dx / force), float(np.sqrt(p * x**2 @ dx / force))
    bearing = float((np.sqrt(p) @ dx) ** 2 / force)
    return of_contact(mean, reach, float(p.max()), bearing, force)


def hertzian(solid: bool, modulus: float, radius: float, a: float) -> Values:
    """What is known of Hertz's contact of half-width a."""
    if solid:
        force = 4 / 3 * modulus * a**3 / radius
        peak = hertz_point(force, radius, modulus).peak or 0.0
        return of_contact(0.75 * peak, a * 0.4**0.5, peak, 0.96 * np.pi * a**2, force)
    force = np.pi * modulus * a**2 / (4 * radius)
    peak = hertz_line(force, radius, modulus).peak or 0.0
    bearing = 2 * (gamma(1.25) / gamma(1.75)) ** 2 * a
    return of_contact(8 / (3 * np.pi) * peak, a / 2, peak, bearing, force)


def of_contact(mean: float, reach: float, peak: float, bearing: float, force: float) -> Values:
    known = {"pressure": mean, "reach": reach, "peak": peak, "bearing": bearing, "normal": force}
    return {f"{name} 0": value for name, value in known.items()}


def exact(rng: Random) -> Case:
    """Round bodies against Hertz, and a wave on a periodic half-plane against Westergaard."""
    solid, wave, one, two = rng.random() < 0.4, rng.random() < 0.3, material(rng), material(rng)
    rigid, radius, a = wave or rng.random() < 0.4, float(rng.uniform(5, 50)), 1.0
    shift = rng.uniform(-0.1, 0.1, 2)
    modulus, share = contact_modulus(None if rigid else one, two), float(rng.uniform(0.1, 0.8))
    wide = float(rng.uniform(1.3, 3))
    solid = solid and not wave
    length, tall = 2 * a / share, a**2 / radius  # period and amplitude of the wave
    known = westergaard(modulus, tall, length, a) if wave else hertzian(solid, modulus, radius, a)

    def gap(x: np.ndarray) -> np.ndarray:
        if wave:
            return np.asarray(tall * (1 - np.cos(2 * np.pi * x[0] / length)))
        return np.asarray(np.sum(x[: 2 if solid else 1] ** 2, axis=0) / (2 * radius))

    def build(level: int) -> Scene:
        count = (10 if solid else 48) * 2**level
        row = (
            (np.arange(count) + 0.5) * 2 * a / share / count
            if wave
            else np.linspace(-wide, wide, count) + shift[0]
        )
        points = (
            (row, np.linspace(-wide, wide, count + 1) + shift[1])
            if solid
            else (row - a / share * wave,)
        )
        load = {"z" if solid else "y": -known["normal 0"]}
        upper: Any = Rigid("upper", gap=gap, force=load)
        if not rigid:
            upper = HalfSpace("upper", one, points, height=lambda x: -gap(x), force=load)
        ground = HalfSpace("lower", two, points, periodic=bool(wave))
        return scene_of(
            [upper, ground], ("upper", "lower"), 0.0, kind="solid" if solid else "plane-strain"
        )

    second = moved(rng, build, (0, 1, 2) if solid else (0, 1))
    return Case("half-space, exact", (known, second), smooth=True)


def heights(rng: Random) -> Case:
    """A rigid uneven body on a half-space: as a gap, or as the height of the half-space."""
    solid, periodic, mu = rng.random() < 0.4, bool(rng.random() < 0.4), friction(rng)
    own = material(rng)
    tall, k = float(10 ** rng.uniform(-4, -3)), rng.integers(1, 4, (4, 2))
    phase = rng.uniform(0, 2 * np.pi, 4)
    force = contact_modulus(None, own) * tall * float(10 ** rng.uniform(-1, 0.3))
    load, axes, first = oblique(rng, mu, force), (0, 1, 2) if solid else (0, 1), 10 if solid else 40
    load = {"z" if solid and name == "y" else name: value for name, value in load.items()}

    def gap(x: np.ndarray) -> np.ndarray:
        x = x[: 2 if solid else 1]
        waved = np.cos(2 * np.pi * k[:, : len(x)] @ x + phase[:, None]).sum(axis=0)
        return np.asarray(tall * (waved + 4 + (0 if periodic else 8) * np.sum(x**2, axis=0)))

    def build(level: int, high: bool) -> Scene:
        count = (first + 3 * high) * 2**level
        row = (np.arange(count) + 0.5) / count - 0.5
        body = Rigid("body", gap=None if high else gap, force=load)
        height = (lambda x: -gap(x)) if high else None
        points, depth = ((row, row), None) if solid else ((row,), 3.0)
        ground = HalfSpace("ground", own, points, height=height, periodic=periodic, depth=depth)
        return scene_of(
            [body, ground], ("body", "ground"), mu, kind="solid" if solid else "plane-strain"
        )

    ways = (
        Way(lambda level: build(level, False), axes),
        moved(rng, lambda level: build(level, True), axes),
    )
    return Case("gap or height of a half-space", ways, smooth=True, loose=20 * tall)


def large(rng: Random) -> Case:
    """A rigid profile on a half-plane, and on larger and larger bodies of finite elements."""
    own, mu, radius = material(rng), friction(rng), float(rng.uniform(10, 50))
    bumps = float(rng.uniform(0, 0.5))
    phase, period, share, degree = (
        *map(float, rng.uniform([0, 0.5, 0.8], [6, 1.5, 1.2])),
        int(rng.integers(1, 3)),
    )
    load = oblique(rng, mu, np.pi * contact_modulus(None, own) / (4 * radius))

    def gap(x: np.ndarray) -> np.ndarray:
        waved = bumps * (period / np.pi) ** 2 * (1 - np.cos(2 * np.pi * x[0] / period + phase)) / 4
        return np.asarray((x[0] ** 2 / 2 + waved) / radius)

    def plane(level: int) -> Scene:
        ground = HalfSpace("ground", own, (np.linspace(-2, 2, 60 * 2**level),))
        return scene_of([Rigid("body", gap=gap, force=load), ground], ("body", "ground"), mu)

    def finite(level: int) -> Scene:
        c, h = 15.0 * 2**level, share / (8 * 2**level)
        ends = [
            (-c, -c, "bottom"),
            (c, -c, "right"),
            (c, 0, "top"),
            (2, 0, "over"),
            (1.3, 0, "over"),
            (-1.3, 0, "over"),
            (-2, 0, "top"),
            (-c, 0, "left"),
        ]
        mesh = outlined(
            [(x, y, 3.0 if abs(x) > 5 else h * (1 + (abs(x) > 1.5)), name) for x, y, name in ends]
        )
        part = Part("ground", mesh, own, (Support("bottom"),))
        body = Rigid("body", (0.0, 1.0), gap, load)
        return scene_of([body, part], ("body", "ground:over"), mu, degree=degree)

    second = Way(finite)
    second = replace(second, move=random_move(rng, finite(0)))
    case = Case("half-plane or large body", (Way(plane), second), smooth=True, loose=0.1)
    return replace(case, without=("energy",))  # of a half-plane it has no end

"""Whether the two ends of each bolt are equal and opposite forces on one line."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from contactopt.bodies.assembled import AssembledBody
from contactopt.bodies.body import face_of
from contactopt.checks import place_words
from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.scenes.scene import Scene

BESIDE = 0.02  # of the extent of a face: how far another one may lie off its axis


def check_bolts(scene: Scene, bodies: Sequence[AssembledBody]) -> None:
    """Raise InputError unless the ends of each bolt pull against each other on one line."""
    assembled: dict[str, Any] = {body.name: body for body in bodies}
    for name, ends in scene.bolt_ends.items():
        ways, centres, extent = [], [], 0.0
        for part, end in ends:
            body = assembled[part.name].body
            mesh = body.basis.mesh
            face = face_of(scene, part, body.basis, body.weight, end.boundary)
            way = face.normal if end.direction is None else np.asarray(end.direction, dtype=float)
            ways.append(np.sign(way @ face.normal) * way / np.linalg.norm(way))
            centres.append(face.centre)
            places = mesh.p[:, mesh.facets[:, mesh.boundaries[end.boundary]]]
            extent = max(extent, float(np.ptp(places, axis=(1, 2)).max()))
        one, two = ways
        between = f"the faces '{ends[0][1].boundary}' and '{ends[1][1].boundary}' of bolt '{name}'"
        if np.linalg.norm(one + two) > CLOSE:
            words = " and ".join(f"({place_words(way)})" for way in ways)
            remedy = (
                "name two faces that look away from each other, or give the bolt a direction"
                if ends[0][1].direction is None
                else "name two faces on opposite sides"
            )
            raise InputError(f"{between} look along {words}, which are not opposite; {remedy}.")
        apart = centres[1] - centres[0]
        off = float(np.linalg.norm(apart - (apart @ one) * one))
        if apart @ one > -CLOSE * extent:
            raise InputError(
                f"{between} look at each other, and pulling them into their bodies would push the"
                " bodies apart; name the faces under the head and under the nut."
            )
        if off > BESIDE * extent:
            raise InputError(
                f"{between} lie {off:.4g} {scene.units[0]} beside each other, and forces on them"
                " would turn the bodies; name faces on one axis."
            )

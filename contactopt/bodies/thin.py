"""Bodies so thin or so weakly held that rounding moves them: how soft they are, and the ground that
holds them meanwhile.

Between a layer's stiffness against bending and that of its elements lie more digits than numbers
have once its thickness is a thousandth of its width. What bends is held by the contact, but the
compliance, which knows the body alone, is made of rounding.

A ground resists the displacement by p M, where M is the volume of the nodes. The grounded body has
the compliance (A + p M)^-1, of moderate size, and is pulled by the forces p M U' towards a
displacement U'. Where the contact problem of the grounded bodies gives U = U' the ground bears
nothing, so that U is the answer for the bodies without a ground: repeated with the last U as the
next U', the problem converges where contacts, supports or the body itself resist more than the
ground does.

Source: Rockafellar (1976), Monotone operators and the proximal point algorithm, SIAM J. Control
Optim. 14, 877-898.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contactopt.bodies.assembly import Assembly
from contactopt.bodies.elements import weight_at

# stiffness of the ground over that of a block of the softest material on the contact surface
SHARE = 1e-5


def volumes(body: Assembly) -> np.ndarray:
    """The volume (n,) of the elements shared out to their unknowns [length^3]."""
    basis = body.basis
    measure = weight_at(body.weight, np.asarray(basis.global_coordinates()))
    volume = np.sum(basis.dx * measure, axis=1)
    share = np.broadcast_to(volume * len(body.unknowns) / basis.Nbfun, basis.element_dofs.shape)
    return np.bincount(basis.element_dofs.ravel(), share.ravel(), len(body.load))


def is_thin(body: Assembly, relieved: Callable[[np.ndarray], np.ndarray]) -> bool:
    """Whether a body resists some displacement little more than a ground of its own material would:
    the least eigenvalue of A U = lambda M U, by one step of inverse iteration with `relieved`,
    forces -> displacements (n,), is below 20 p, as for layers up to a thirtieth of their width.
    """
    M = volumes(body)
    forces = M * np.random.default_rng(0).standard_normal(len(body.load))
    U = relieved(forces)
    U = U / (np.abs(U).max() or 1.0)  # whose square is finite in all units
    ground = _per_volume(body, M, body.material.E) * float(U @ (M * U))
    return float(U @ (body.A @ U)) < 20.0 * ground  # grounds: softer ones are thin


def _per_volume(body: Assembly, M: np.ndarray, modulus: float) -> float:
    """p: a small share of the stiffness of a block on the surface, as high as wide."""
    surface = max(float(trace.areas.sum()) for trace in body.traces.values())
    size = float(np.ptp(body.locations, axis=1).max())
    return SHARE * modulus * surface * len(body.unknowns) / (size * float(M.sum()))


def on_ground(body: Assembly, modulus: float) -> tuple[Assembly, np.ndarray]:
    """Put a body on a ground that is soft beside the other bodies, the softest of them of Young's
    modulus `modulus`.

    Returns the body, whose inertia forces are those of M, so that the ground does not resist its
    free motions, and the stiffness p M of the ground (n,) [force / length].
    """
    M, motions = volumes(body), body.rigid_motions
    forces = M[:, None] * motions.fields
    forces = forces @ np.linalg.inv(motions.fields.T @ forces)
    body = replace(body, rigid_motions=replace(motions, forces=forces))
    return body, M * _per_volume(body, M, modulus)

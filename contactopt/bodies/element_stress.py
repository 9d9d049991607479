"""Displacement and stress inside a body of finite elements, computed element by element."""

from collections.abc import Callable

import numpy as np
import skfem

from contactopt.bodies.assembly import Assembly
from contactopt.bodies.elements import interpolated, weight_at, with_jacobians
from contactopt.bodies.fields import PLACES, Fields, Validity, von_mises
from contactopt.defaults import ROUNDED
from contactopt.meshes.cells import SHAPES, second_order, straight
from contactopt.scenes.kinds import Constants

# elements whose shape functions are evaluated at a time, which bounds the memory that they take
BLOCK = 2000
Force = Callable[[np.ndarray], np.ndarray]  # per volume (dim, m), at places (dim, m)


def limits_of(body: Assembly, U: np.ndarray, force: np.ndarray, least: float = 0.0) -> Validity:
    """How far a body is from equilibrium under the contact forces (n,), on free unknowns and on the
    sum over each plate's, strained and turned. Forces whose sum is at most `least` are none.
    """
    internal = body.A @ U
    missing = internal - body.load - force
    plates = body.motion.T @ missing - body.plate_forces
    applied = max(np.abs(part).sum() for part in (force, body.load, body.plate_forces))
    size = max(applied, np.abs(np.delete(internal, body.free)).sum())
    unbalanced = float(np.abs(missing[body.free]).sum() + np.abs(plates).sum())
    rounding = ROUNDED * float((abs(body.A) @ np.abs(U)).sum())
    if applied <= least and size <= max(least, rounding):
        unbalanced = 0.0  # supports move the body as a whole: all forces are rounding
    middle = body.basis.mesh.init_refdom().p.mean(axis=1, keepdims=True)
    gradient = _gradient(body.basis, U, middle)[..., 0].transpose(2, 0, 1)
    turned = gradient.swapaxes(1, 2)
    strains = np.abs(np.linalg.eigvalsh((gradient + turned) / 2)).max(axis=1)
    mean = np.sqrt(np.average(strains**2, weights=np.sum(body.basis.dx, axis=1)))
    rotation = np.linalg.norm(gradient - turned, axis=(1, 2)).max(initial=0.0) / np.sqrt(8)
    moved = float(np.abs(U).max(initial=0.0))
    return Validity(
        unbalanced / size if size > 0 else unbalanced,
        float(strains.max()),
        float(rotation),
        moved,
        float(mean),
    )


def _gradient(
    basis: skfem.CellBasis, U: np.ndarray, places: np.ndarray, elements: np.ndarray | None = None
) -> np.ndarray:
    """The gradient (dim, dim, elements, points) of a displacement, as for stress_in()."""
    shape, some = basis.elem.elem, slice(None) if elements is None else elements
    slopes = np.stack([shape.lbasis(places, i)[1] for i in range(basis.Nbfun // len(places))])
    own = U[basis.element_dofs[:, some]].reshape(len(slopes), len(places), -1)
    local = np.einsum("iae,ibq->abeq", own, slopes, optimize=True)
    inverse = with_jacobians(basis.mapping, places, some).invDF(places, tind=elements)
    return np.einsum("abeq,bceq->aceq", local, np.asarray(inverse))


def fields_of(body: Assembly, U: np.ndarray) -> Fields:
    basis = body.basis
    stress = nodal_stress(body, U)
    full = np.stack([stress[i, j] for i, j in PLACES[len(body.unknowns)]], axis=1)
    mesh = straight(basis.mesh) if body.degree == 1 else second_order(basis.mesh, body.locations)
    return Fields(body.name, mesh, body.kind.stresses, U[body.unknowns], full, von_mises(full))


def nodal_stress(
    body: Assembly, U: np.ndarray, everywhere: bool = True, stress: np.ndarray | None = None
) -> np.ndarray:
    """Stress tensor (3, 3, n) at the nodes of a body, averaged over the elements with their
    volumes.

    An element counts with its mean stress where the displacement is linear, with its stress at the
    node where it is quadratic; at planes of symmetry its mirror image counts as well, so that no
    shear is left across them. Axes are x, y, z or, in an axisymmetric scene, r, z, theta. Not
    `everywhere` asks for the vertices of the mesh alone. `stress` is what stress_in() gives at the
    body's own basis, if it is known.
    """
    basis, mesh = body.basis, body.basis.mesh
    volume = basis.dx.sum(axis=1)
    shape = SHAPES[mesh.refdom.__name__][1][body.degree if everywhere else 1]()
    if body.degree == 1:
        stress = stress_in(body, U, basis.X) if stress is None else stress
        element = np.sum(stress * basis.dx, axis=3) / volume
        values = np.repeat(element[..., None], len(mesh.t), axis=3)
    else:
        blocks = np.array_split(np.arange(mesh.nelements), -(-mesh.nelements // BLOCK))
        stresses = [stress_in(body, U, shape.doflocs.T, block) for block in blocks]
        values = np.concatenate(stresses, axis=2)
    nodes = skfem.Dofs(mesh, shape).element_dofs  # numbered as the nodes are
    where, count = nodes.T.ravel(), int(nodes.max()) + 1
    weight = np.bincount(where, np.repeat(volume, len(nodes)), count)
    total = np.zeros((3, 3, count))
    for i in range(3):
        for j in range(3):
            total[i, j] = np.bincount(where, (values[i, j] * volume[:, None]).ravel(), count)
    for axis, there in enumerate(body.mirrored[:, :count]):
        total[axis, :axis, there] = total[axis, axis + 1 :, there] = 0.0
        total[:axis, axis, there] = total[axis + 1 :, axis, there] = 0.0
    return total / weight


def recovery_errors(body: Assembly, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
    """For every element (elements,) how much it adds to the error of the energy, or of other
    functionals.

    This is the integral of (s*(U) - s(U)) : C^-1 : (s*(W) - s(W)) [force length] for each W of the
    others. s is the stress of a displacement and s* the continuous stress with its averages at the
    vertices, which is more accurate where the solution is smooth. With W = U it is twice the energy
    of the estimated error in each element; with W the displacement of an adjoint problem it is what
    the element adds to the error of that problem's functional.

    Source: Zienkiewicz, Zhu (1987), A simple error estimator and adaptive procedure for practical
    engineering analysis.
    """
    basis, corners = body.basis, body.basis.mesh.t
    vertex = SHAPES[basis.mesh.refdom.__name__][1][1]()
    hats = [vertex.lbasis(basis.X, i)[0] for i in range(len(corners))]

    def missing(field: np.ndarray) -> np.ndarray:
        stress = stress_in(body, field, basis.X)
        nodal = nodal_stress(body, field, False, stress)
        smooth = sum(nodal[:, :, own][..., None] * hat for own, hat in zip(corners, hats))
        return np.asarray(smooth - stress)

    measure = basis.dx * weight_at(body.weight, np.asarray(basis.global_coordinates()))
    first, found = missing(U), []
    for W in others:
        second = first if W is U else missing(W)
        found.append(np.asarray(np.sum(_product(body, first, second) * measure, axis=1)))
    return tuple(found)


def _product(body: Assembly, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """first : C^-1 : second of two stresses (3, 3, ...)."""
    E, nu = body.material.E, body.material.nu
    traces = np.trace(first) * np.trace(second)
    return np.asarray(((1 + nu) * np.sum(first * second, axis=(0, 1)) - nu * traces) / E)


def added_work(
    body: Assembly, volumes: np.ndarray, force: Force, U: np.ndarray, *others: np.ndarray
) -> tuple[np.ndarray, ...]:
    """For each W of the others what volumes (elements,) [length^dim] with the force per volume
    force(x) (dim, elements), added to the elements of a body, would work (elements,) [force
    length]: force . W - s(U) : C^-1 : s(W), by the means of the elements.
    """
    basis = body.basis
    centre = np.asarray(basis.global_coordinates()).mean(axis=2)
    measure, found = volumes * weight_at(body.weight, centre), []
    own = stress_in(body, U, basis.X).mean(axis=3)
    for W in others:
        stress = own if W is U else stress_in(body, W, basis.X).mean(axis=3)
        moved = np.sum(force(centre) * interpolated(basis, W).mean(axis=2), axis=0)
        found.append(np.asarray((moved - _product(body, own, stress)) * measure))
    return tuple(found)


def stress_in(
    body: Assembly, U: np.ndarray, places: np.ndarray, elements: np.ndarray | None = None
) -> np.ndarray:
    """Stress tensor (3, 3, elements, points) at reference places (dim, points) in elements (by
    number; None: all of them).
    """
    gradient, hoop = _gradient(body.basis, U, places, elements), None
    some = slice(None) if elements is None else elements
    if body.weight[1]:  # u_r / r, on the axis its limit
        own = U[body.basis.element_dofs[:: len(places), some]]
        values = [body.basis.elem.elem.lbasis(places, i)[0] for i in range(len(own))]
        r = np.asarray(body.basis.mapping.F(places, tind=elements))[0]
        away, limit = r > 1e-12 * r.max(), gradient[0, 0].copy()
        hoop = np.divide(own.T @ np.stack(values), r, where=away, out=limit)
    return stress_of(body.kind.constants(body.material), gradient, hoop)


def stress_of(constants: Constants, gradient: np.ndarray, hoop: np.ndarray | None) -> np.ndarray:
    """Stress (3, 3, e, q) of a gradient (dim, dim, e, q) and of a hoop strain, if there is one."""
    lam, shear, across = constants
    dim = len(gradient)
    strain = np.zeros((3, 3, *gradient.shape[2:]))
    strain[:dim, :dim] = (gradient + gradient.swapaxes(0, 1)) / 2
    if hoop is not None:
        strain[2, 2] = hoop
    pressed = np.diag([lam, lam, across])[:, :, None, None]
    return np.asarray(2 * shear * strain + np.trace(strain) * pressed)

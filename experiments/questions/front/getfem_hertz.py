"""Hertz's line contact in GetFEM: bilinear displacements, multipliers on the boundary, contact with
a rigid obstacle by its augmented Lagrangian. Run by the Python that has GetFEM, with no package of
this project: given.npz answer.npz.

Source: GetFEM's manual, "Small sliding contact with friction bricks".
"""

from __future__ import annotations

import sys
import time

import numpy as np

STEPS = 100  # of Newton's method


def main() -> None:
    import getfem as gf

    given = np.load(sys.argv[1])
    start = time.process_time()
    E, nu = float(given["E"]), float(given["nu"])
    mesh = gf.Mesh("empty", 2)
    mesh.add_convex(gf.GeoTrans("GT_QK(2,1)"), given["p"][:, given["t"]][:, [0, 1, 3, 2]])
    x, y = mesh.pts()
    top = given["p"][0, given["contact"]].max()
    AXIS, BOTTOM, CONTACT = 1, 2, 3
    for region, nodes in ((AXIS, x == 0), (BOTTOM, y == y.min()), (CONTACT, (y == 0) & (x <= top))):
        mesh.set_region(region, mesh.faces_from_pid(np.flatnonzero(nodes)))
    u, multiplier, obstacle = (gf.MeshFem(mesh, components) for components in (2, 1, 1))
    for field, degree in ((u, 1), (multiplier, 1), (obstacle, 2)):
        field.set_fem(gf.Fem(f"FEM_QK(2,{degree})"))
    points = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(2,4)"))
    model = gf.Model("real")
    model.add_fem_variable("u", u)
    model.add_filtered_fem_variable("lambda_n", multiplier, CONTACT)
    model.add_initialized_data("lame", E * nu / (1 + nu) / (1 - 2 * nu))
    model.add_initialized_data("shear", E / (2 * (1 + nu)))
    model.add_isotropic_linearized_elasticity_brick(points, "u", "lame", "shear")
    model.add_Dirichlet_condition_with_simplification("u", BOTTOM)
    model.add_initialized_data("across", [1, 0, 0, 0])
    model.add_initialized_data("zero", [0, 0])
    model.add_generalized_Dirichlet_condition_with_penalization(
        points, "u", 1e9, AXIS, "zero", "across"
    )
    places = obstacle.basic_dof_nodes()
    gap = places[0] ** 2 / (2 * float(given["radius"])) - float(given["depth"]) - places[1]
    model.add_initialized_fem_data("gap", obstacle, gap)
    model.add_initialized_data("augmentation", E / top)
    model.add_integral_contact_with_rigid_obstacle_brick(
        points, "u", "lambda_n", "gap", "augmentation", CONTACT, 1
    )
    _, converged = model.solve("max_res", 1e-10, "max_iter", STEPS)
    seconds = time.process_time() - start
    if not converged:
        sys.exit(f"Newton's method did not converge in {STEPS} steps and {seconds:.0f} s")
    places = multiplier.basic_dof_nodes()[0][multiplier.basic_dof_on_region(CONTACT)]
    order = np.argsort(places)
    np.savez(sys.argv[2], pressure=-model.variable("lambda_n")[order], seconds=seconds)


if __name__ == "__main__":
    main()

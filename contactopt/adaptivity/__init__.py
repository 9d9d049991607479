"""Fewest unknowns for an accuracy: meshes refined where the quantity asked for needs it.

    solve -> estimate -> mark -> refine, until the estimated error of one quantity J is below a target.

The error of J is estimated element by element by the dual-weighted residual method. W is the displacement of the adjoint
problem: what J feels of a unit load at each place, with the contact states of the solution kept (contactopt.derivatives). Then

    J - J_h = sum_K  int_K (s - s_h)(U) : C^-1 : (s - s_h)(W),

exactly so for a linear problem and a linear J. The unknown stresses s are replaced by recovered ones, averages at the vertices.
The signed sum estimates the error of J; the absolute values say where to refine. Two terms are added.

The force at a contact is a mean of the pressure nearby. For a J that reads pressure, the error of the pressure at contact i is
half of p_i less the mean of the piecewise linear p around i (estimate.pressure_errors), times dJ/dp_i. Without it a contact that
is smaller than an element would seem exact, since then equilibrium alone says what the one closed contact carries.

A stress at a place is recovered by a fit to the stresses of the elements near it (contactopt.bodies.recovery). For a stress
s* = R D U the adjoint load is D' R' dJ/ds*. The stresses scatter about the fit, and the estimated error is at least two standard
errors of the fit. For a largest stress this covers the places where it could be larger by as much; these are refined too.

The estimated error is also at least what the last refinement changed. What is not estimated: the linearisation of a J
that is not linear, what recovery does not see where the solution is not smooth, and that straight edges are chords of a curved
boundary. So the estimate is not a bound.

Sources: Becker, Rannacher (2001), An optimal control approach to a posteriori error estimation in finite element methods, Acta
Numerica 10; Doerfler (1996), A convergent adaptive algorithm for Poisson's equation, for the marking; Zienkiewicz, Zhu
(1987) and (1992) for the recovery.

| module | what it does |
|---|---|
| `estimate.py` | the error of a quantity, element by element |
| `corners.py` | places where a pressure or a stress is infinite are recognised |
| `loop.py` | `refine_locally(scene, quantity, accuracy)`: the loop |
"""

from contactopt.adaptivity.loop import refine_locally as refine_locally

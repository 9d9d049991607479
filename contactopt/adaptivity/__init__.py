"""Fewest unknowns for an accuracy: meshes refined where the quantity asked for needs it.

    solve -> estimate -> mark -> refine, until the estimated error of one quantity J is below a target.

The error of J is estimated element by element by the dual-weighted residual method. W is the displacement of the adjoint
problem: what J feels of a unit load at each place, with the contact states of the solution kept (contactopt.derivatives). Then

    J - J_h = sum_K  int_K (s - s_h)(U) : C^-1 : (s - s_h)(W),

exactly so for a linear problem and a linear J. The unknown stresses s are replaced by recovered ones, averages at the vertices.
The signed sum estimates the error of J; the absolute values say where to refine. What is not estimated: the error of the
contact forces between the nodes, the linearisation of a J that is not linear, and what recovery does not see where the
solution is not smooth. So the estimate is not a bound; the estimated error is also at least what the last refinement
changed.

Sources: Becker, Rannacher (2001), An optimal control approach to a posteriori error estimation in finite element methods, Acta
Numerica 10; Doerfler (1996), A convergent adaptive algorithm for Poisson's equation, for the marking; Zienkiewicz, Zhu
(1987) for the recovery.

| module | what it does |
|---|---|
| `estimate.py` | the error of a quantity, element by element |
| `loop.py` | `refine_locally(scene, quantity, accuracy)`: the loop |
"""

from contactopt.adaptivity.loop import refine_locally as refine_locally

"""An accuracy is asked for, and meshes are refined until the estimated error of one quantity J is
below it.

    solve -> estimate -> refine, everywhere or where the quantity needs it, and so on

until the target is met or a sentence says why not.

Every mesh is a Level, the end is an Estimate. The estimated error of the value is the largest of

    what the search says of it: differences of nested solutions, or a sum over the elements (below);
    how uncertain its reading is (contactopt.readings.quantities). It is added to the differences of
    meshes that are given: where nodes do not match, readings scatter, which differences may hide;
    by how much another local maximum may exceed it, whose elements are refined, too.

The error of a geometry that the file gives by straight edges alone is added at the end
(contactopt.accuracy.polygon). A target is not reached on fewer than three meshes, nor where
few contacts touch, nor where the gap of a rigid body undercuts what the contacts see of it. A value
that grows at one place with every refinement is infinite (contactopt.accuracy.corners).

Refined where the quantity needs it, the error of J is estimated element by element by the
dual-weighted residual method. W is the displacement of the adjoint problem: what J feels of a unit
load at each place, with the contact states of the solution kept (contactopt.derivatives). Then

    J - J_h = sum_K  int_K (s - s_h)(U) : C^-1 : (s - s_h)(W),

exactly so for a linear problem and a linear J. The unknown stresses s are replaced by recovered
ones, averages at the vertices. The signed sum estimates the error of J; the absolute values say
where to refine. More terms are added.

The force at a contact is a mean of the pressure nearby. For a J that reads pressure the error of
that mean (indicators.pressure_errors) is added. Without it a contact that is smaller than an
element would seem exact, since then equilibrium alone says what the one closed contact carries.

The energy is quadratic, so that what its slope at the solution gives is corrected by the energy of
the error itself (indicators.element_errors). Its sign then agrees with the load: a mesh under given
forces holds too little energy, one under given displacements or an interference too much.

Linear elements have straight edges, and those far from the place that matters stay long. What lies
between them and the curve for which they stand is estimated as well, by the derivative of J by the
shape of the body: without it a disc under its own weight is too light for its contact. A J that is
read at a place is left out, because its adjoint is infinite there.

A stress at a place is recovered by a fit to the stresses of the elements near it
(contactopt.bodies.stress_recovery). The stresses scatter about the fit, and the estimated error is
at least two standard errors of the fit. For a largest stress this covers the places where it could
be larger by as much; these are refined too.

What is not estimated: the linearisation of a J that is neither linear nor the energy, and what
recovery does not see where the solution is not smooth. Much of it shows in the corrected value, J_h
and its estimated error together, which would be the same on every mesh if the estimates were exact.
What the last two refinements changed of it is therefore added to the sum, which has a factor of
safety of 1.25, unless the reading is more uncertain than that (indicators.misfit). So the estimate
is not a bound. A guaranteed bound is made at the end where it is asked for (contactopt.bounds).

The adjoint of one state says nothing about the states before it. So the error of a load path is
read from the changes of its value, which fall like the square of the error in the energy norm.

Sources: Becker, Rannacher (2001), An optimal control approach to a posteriori error estimation in
finite element methods, Acta Numerica 10; Doerfler (1996), A convergent adaptive algorithm for
Poisson's equation, for the marking; Zienkiewicz, Zhu (1987) and (1992) for the recovery.
"""

from contactopt.accuracy.estimate import Estimate as Estimate
from contactopt.accuracy.estimate import Level as Level
from contactopt.accuracy.loop import refine as refine

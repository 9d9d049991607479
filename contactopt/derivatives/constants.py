"""Numbers of this room that were chosen by trial, with the commands that show what they are worth.

`python -m experiments.questions.design` counts the steps and measures the gain of designs.
`python -m experiments.questions.sensitivity` measures accuracy and time of derivatives.
Tolerances that follow from rounding stand beside the code that uses them.
"""

from __future__ import annotations

# The trust region of a design (contactopt.derivatives.design).
# share of the promised gain from which on a step is taken, and the trust region grows
TAKEN, GOOD = 0.05, 0.7
SHRINK, GROW = 0.3, 2.0  # factors by which its radius changes
# of the first one, in changes that move the pressure somewhere by the largest one
FIRST_RADIUS = 0.1

# Linear systems solved by iteration (contactopt.derivatives.linear).
# reduction of the residual by one round of GMRES, and by GMRES for the model of Q
ROUND, INNER = 1e-4, 1e-6

# unknowns up to which LU of all costs less than Cholesky's factors of those that stick, and what is
# beside them
WHOLE = 300

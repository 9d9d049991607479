"""Numbers of this room that were chosen by trial, with the commands that show what they are worth.

`python -m experiments.questions.sensitivity` measures accuracy and time of derivatives.
Tolerances that follow from rounding stand beside the code that uses them.
"""

# Linear systems solved by iteration (contactopt.derivatives.linear).
# reduction of the residual by one round of GMRES, and by GMRES for the model of Q
ROUND, INNER = 1e-4, 1e-6

# unknowns up to which LU of all costs less than Cholesky's factors of those that stick, and what is
# beside them
WHOLE = 300

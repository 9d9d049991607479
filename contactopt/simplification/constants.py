"""The chosen numbers of these simplifications, whose effect `tests/test_simplest.py` checks."""

BETWEEN = 8  # intervals of each edge of a facet at whose ends gaps and friction are compared

# Proofs (contactopt.simplification.proof).
PROVED = 1e-6  # certificate of the whole with the forces and displacements of the part, at most
MOST = 2_000_000  # displacement unknowns of the largest whole that is assembled for a proof

# Bonded and frictionless pairs (contactopt.simplification.joints).
SHARE = 0.8  # of its friction bound that no contact of a pair may use for the pair to be tied
SMOOTH = 1e-2  # largest tangential traction over the largest pressure, where friction is left out

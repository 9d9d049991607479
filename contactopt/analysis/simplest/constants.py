"""The chosen numbers of these simplifications; `python -m experiments.questions.simplest` shows what they are worth."""

# Half-spaces instead of bodies (contactopt.analysis.simplest.large_bodies).
FINITE = (
    0.45  # error of the peak pressure times (size of the body over the contact half-width)^2, at most, in the plane
)
STEEP = 0.15  # error of the peak pressure over the square of the largest slope of the gap inside the contact
WORST = 0.05  # estimated error up to which half-spaces are offered
ACROSS = {2: 128, 3: 32}  # points across the contact half-width of the half-spaces that are offered, by dimension
REACH = 1.5  # half side of their points over the contact half-width

# Bonded and frictionless pairs (contactopt.analysis.simplest.joints).
SHARE = 0.8  # of its friction bound that no contact of a pair may use for the pair to be tied
SMOOTH = 1e-2  # largest tangential traction over the largest pressure below which friction is left out

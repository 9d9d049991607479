"""What holds where nothing else is asked for, and what counts as equal; read by words and numbers
alike.
"""

TOL = 1e-8  # largest natural-map residual that counts as solved

# Double precision keeps a number to 1e-16 of itself. ROUNDED is what sums of up to some thousand
# terms lose, as a share of their largest term. EQUAL leaves three digits more for what comes of
# several such sums, or of the solution of a well-conditioned system; nothing that a mesh, a load or
# a matrix means is nearer to something else. CLOSE is for places and directions that two parts of
# a scene have to share, and that files give with six or seven digits.
ROUNDED = 1e-12
EQUAL = 1e-9
CLOSE = 1e-6


def install(extra: str) -> str:
    """How the packages of an extra are installed, for messages: the one place that says it."""
    return f"run pip install -e '.[{extra}]' in the folder of the clone"

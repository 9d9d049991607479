"""The fitted numbers of the preconditioners, all of them, and what they were fitted on.

ALONG was chosen for small condition numbers of `laplacian` on a disc; PIECE, THINNEST and DISTORTED
were chosen by trial. On a disc, an annulus, an L, a graded square and a ring tests bound the
condition numbers (tests/test_surface_laplacian.py).

EIGENVECTORS was chosen by the times of both ways; a solve takes up to thousands of products.

DISPERSION, CELL and EDGE were chosen for small condition numbers of the deflated `neumann` on the
bodies of `python -m experiments.questions.preconditioners` (reports/preconditioners/report.md).

WAVES and MOST_WAVES were chosen for few iterations on a body that is cut into thin layers, tied to
each other (tests/test_krylov.py).
"""

SPLIT = 0.3  # Poisson's ratio of the half-space that is modelled on a surface, whatever the bodies'
# resistance of `laplacian` to tangential waves along their own direction; 1 / (1 - SPLIT)^2 - 1 for
# a half-space
ALONG = 2.0
# share by which bilinear elements lower the compliance of the shortest tangential waves along their
# own direction
DISPERSION = 0.28
CELL = 0.45  # power of a node's cell that weights it: 1/2 where the spacing varies slowly
EDGE = 0.2  # power of the share of it that an edge leaves: 0 for half-, 1/4 for quarter-spaces
EIGENVECTORS = 800  # unknowns of a surface up to which the inverse root is by eigenvectors
PIECE = 0.25  # shift over the least eigenvalue of a piece of the surface that is as long
THINNEST = 1e-2  # nodal area over mass, relative to the mean, of a contact on an axis
# area of a cell in the chart over that in space, or one over it, beyond which the chart has no
# directions there
DISTORTED = 2.0
WAVES = 3.0  # length of a pair over its distance to the next that is worth one more degree
MOST_WAVES = 12  # the highest degree of smooth motions

"""The chosen numbers of this room, all of them, and the commands that show what they are worth.

`python -m experiments.questions.accuracy` measures readings and error estimates against exact
solutions. `python -m experiments.questions.large_punch` measures whole solves that start from a
coarse mesh.
"""

# Reading edges and peaks (contactopt.readings.edges, contactopt.readings.quantities).
# rings of nodes left out and fitted where contact ends by itself: the outermost carry most of the
# error
SMOOTH = 3, 6
NEAR = 1, 2  # the same where the values are straight only next to the edge
# shares of the half-width from which on the pressure on a line is fitted by a root times a
# polynomial, and the highest degree of this
SHARES, HIGHEST = (0.3, 0.5, 0.7, 0.85), 3
OUTER = 2  # nodes next to the edge of contact that this fit leaves out
SPARE = 3  # nodes that it has beyond its degree, at least one more
FAR = 3.0  # elements beyond the last node within which it finds the edge
STEPS, SETTLED, SINGULAR = 20, 1e-12, 1e-12  # of its iteration
# nodes to which the square of the pressure is fitted around a peak, by dimension
FITTED = {2: 5, 3: 13}
NEIGHBOURS = {2: 5, 3: 9}  # nodes among which a local maximum is the largest, itself among them
MOST_PEAKS = 8  # local maxima that are looked at
# least uncertainty of an edge that is read between nodes, over the distance of the nodes: by a
# straight line, and by a root times a polynomial
WITHIN, FITTED_WITHIN = 0.05, 0.025

# The zone loop (contactopt.solving.zone).
AGREE = 0.05  # two zones agree when they differ by less than this fraction of an element
LOOPS = 10  # rounds after which the last zone is taken

# Starts from coarser meshes (contactopt.solving.solve_scene).
COARSEST = 4  # elements across the contact half-width of the first of nested meshes
# coarser than the next of them, where bodies are factorised: a 64th of the unknowns
FACTOR = {2: 8, 3: 4}
ROUGH = 1e-6  # certificate asked of a coarse mesh: its own error is larger

# Thin bodies on a ground (contactopt.bodies.thin).
# share of the forces on a body that its ground may still bear, and misfit of its surfaces
BALANCED = 1e-8
# what it may bear where it gets no less; beyond, the body bends by itself and needs no ground
BEARABLE = 1e-4
BORNE = 1e-12  # what it may bear in the end, where rounds still take load off it
ROUNDS = 24  # of problems with the ground
SLOW = 0.7  # share of the last round's imbalance from which on a round is of no use

# Refinement (contactopt.accuracy).
FIRST = {2: 8, 3: 4}  # elements across the half-width of the first mesh, at least, by dimension
BELOW = 8  # by how much fewer than the scene's default they are
MOST_UNKNOWNS = {2: 400_000, 3: 150_000}  # displacement unknowns, by dimension: half a minute
# bytes that the search may take, by those that its meshes have taken for each unknown so far
MOST_MEMORY = 2e9
# least order that is believed: slower ones were noise wherever the exact value was known
SLOWEST = 0.75
STUCK = 0.1  # order below which a sequence does not converge

# Patches of a zone (contactopt.readings.patches).
RING = 0.75  # share of an element by which the next ring of nodes is further away at least
ROUNDNESS = 1.5  # elements by which the edge of a disc may vary around it

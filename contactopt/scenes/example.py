"""The scene file that `contactopt new` writes: an example that runs, with every entry explained."""

from pathlib import Path

from contactopt.errors import InputError

EXAMPLE = """\
# A scene for contactopt. Run it:   contactopt run {name}
# A block is pressed on a foundation and pushed to the side. Lines that begin with # are comments.

name = "block-on-foundation"    # of figures; the name of this file without it
kind = "plane-strain"           # or "axisymmetric" (components r, z), "solid" (x, y, z)
thickness = 40.0                # depth of a plane-strain body
copies = 1                      # mirror images that make the whole body: 2 for a half model, 4 for a quarter
degree = 2                      # of the displacement: 1, linear, or 2, quadratic
units = {{ length = "mm", stress = "MPa" }}    # any consistent units; forces are then in N

# Each body has a table of its own. Its mesh is one of
#   mesh = "file.msh"   any format of Gmsh and meshio; group = "NAME" chooses one of several bodies in the file, unit = "m" says
#                       its unit of length. Physical groups of lines or faces are its boundaries.
#   block = {{ x = [0, 40], y = [0, 20], elements = [16, 8] }}          boundaries "x-", "x+", "y-", "y+"
#   ring = {{ radii = [20, 40], angles = [0, 90], elements = [8, 16] }} boundaries "inner", "outer", "start", "end"
#   disc = {{ radius = 20, elements = 32 }}                            boundary "rim"
#   rigid = {{ normal = {{ y = 1 }}, gap = "x**2 / 100", force = {{ y = -10 }} }}   a rigid body; all of it is optional
[bodies.block]
block = {{ x = [-20, 20], y = [0, 40], elements = [16, 16] }}
# move = {{ x = 10 }}           # puts the mesh somewhere else
material = {{ E = 5.0, nu = 0.3 }}
contact = "y-"                  # the boundary that may touch
plates = [                      # rigid plates, loaded by total forces; glued = false lets them slide
    # an array of forces is a load path: first pressed, then pushed
    {{ boundary = "y+", force = {{ y = [-100, -100, -100], x = [0, 20, 40] }} }},
]
# tractions = [{{ boundary = "x+", x = 0.1 }}]      # force per area
# body_force = {{ y = -1e-5 }}                      # force per volume
# curve = {{ radius = 20, centre = {{ x = 0, y = 20 }} }}   # the circle (sphere) that the contact boundary stands for

[bodies.foundation]
block = {{ x = [-80, 80], y = [-80, 0], elements = [64, 32] }}
boundaries = {{ top = {{ x = [-40, 40], y = 0 }} }}   # named by where they are: a coordinate, or [least, largest]
material = {{ E = 5.0, nu = 0.3 }}
contact = "top"
supports = [{{ boundary = "y-" }}]      # clamped; {{ boundary = "x-", x = 0 }} prescribes one component

# Pairs of surfaces: a body, or "body:boundary" for another surface than its contact.
[[contacts]]
upper = "block"
lower = "foundation"
mu = 0.6                        # or an expression of the place: "0.6 + 0.001 * x"
law = "coulomb"                 # all of them: contactopt list
# law = "orthotropic"           # machined surfaces: mu = [0.1, 0.3] along and across a direction,
# direction = {{ x = 1 }}         # such as that of the grooves

[solve]
method = "auto"
tol = 1e-8
# accuracy = 0.01               # refine plane meshes until the quantity is known to this relative error
# quantity = "pressure"
# adaptive = true               # only where the quantity needs it
# max_unknowns = 50000          # bounds on the search: time_limit = 60 seconds, max_memory = 4 GB
"""


def write_example(path: Path) -> None:
    """Write an example of a scene file, with a comment on every entry.

    Parameters
    ----------
    path : The file, whose name ends in .toml.

    Raises
    ------
    InputError : If the name has another ending, if the file is there already, or if it cannot be
        written.
    """
    if path.suffix != ".toml":
        raise InputError(f"a scene file's name ends in .toml; got '{path}'.")
    try:
        with path.open("x") as file:
            file.write(EXAMPLE.format(name=path))
    except FileExistsError as error:
        raise InputError(f"'{path}' is there already; choose another name.") from error
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror}.") from error

"""The bodies of a scene, elastic, rigid or half-spaces, and what holds and loads them.

Everything here is frozen and checked when it is made; what depends on the kind of the scene is
checked by the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from skfem import Mesh

from contactopt.checks import check_name, check_number, real_array, short
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.meshes.given_curves import Curve
from contactopt.scenes.kinds import KINDS
from contactopt.scenes.loads import LOADS, Load
from contactopt.scenes.loads.load import check_components

Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Support:
    """Prescribed displacement on a named boundary, eq (3) of the paper.

    `displacement` maps components to values [length]; None clamps every component. A symmetry plane
    is a Support that holds the normal component only. 'a/b' is the edge where the boundaries a and
    b meet, in the plane a point, and 'a/b/c' the point where three meet.
    """

    what = "support"
    form = "displacement:BODY:BOUNDARY:COMPONENT, or displacement:BODY:COMPONENT of a rigid body,"
    boundary: str
    displacement: Mapping[str, float] | None = None

    def faces(self, known: Container[str]) -> tuple[str, ...]:
        """The boundaries whose common nodes are held: one known by this name, or several."""
        return (self.boundary,) if self.boundary in known else tuple(self.boundary.split("/"))

    def values(self, components: tuple[str, ...]) -> dict[str, float]:
        """The displacement by component, as Load.values."""
        return (
            dict.fromkeys(components, 0.0) if self.displacement is None else {**self.displacement}
        )

    def address(self, body: str) -> tuple[str, ...]:
        """As Load.address."""
        return body, self.boundary

    def with_values(self, values: Mapping[str, float]) -> Support:
        """As Load.with_values."""
        return replace(self, displacement=dict(values))


@dataclass(frozen=True)
class Part:
    """An elastic body.

    mesh     a scikit-fem mesh with named boundaries, or a function (elements, zone) -> mesh, where
             `elements` counts elements across the contact half-width and `zone` is the half-width
             the mesh must resolve.
    contact  the name of the candidate contact boundary; a Contact of the scene can name others.
    curve    function (dim, k) -> (dim, k) that puts points of the contact boundary on the surface
             that the mesh stands for: the gap of a curved body at nodes within its edges (degree
             2). None: the edges are the surface. For a body with several contact boundaries, a
             mapping from the name of a boundary to its function.
    """

    name: str
    mesh: Mesh
    material: Material
    supports: tuple[Support, ...] = ()
    loads: tuple[Load, ...] = ()
    contact: str = "contact"
    curve: Function | Mapping[str, Function] | None = None
    elastic: ClassVar[Literal[True]] = True
    meshed: ClassVar[Literal[True]] = True

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)  # of its VTU file
        if not isinstance(self.material, Material):
            raise self._wrong("its material must be a Material(E, nu)", repr(self.material))
        if not isinstance(self.contact, str):
            raise self._wrong("its contact boundary must be a name", short(self.contact))
        if not (self.curve is None or callable(self.curve) or isinstance(self.curve, Mapping)):
            must = "its curve must be a function, or a mapping from boundaries to functions"
            raise self._wrong(must, short(self.curve))
        known = " or ".join(name for _, name in LOADS.values())
        rows: tuple[Any, ...] = (
            ("supports", self.supports, Support, "Support"),
            ("loads", self.loads, Load, known),
        )
        for what, items, kind, names in rows:
            alike = isinstance(items, (tuple, list))
            if not alike or not all(isinstance(item, kind) for item in items):
                raise self._wrong(f"its {what} must be a tuple of {names} objects", short(items))
            for item in items:
                if not isinstance(item.boundary, str):
                    raise self._wrong("a boundary is given by its name", short(item.boundary))

    def _wrong(self, must: str, got: str) -> InputError:
        return InputError(f"body '{self.name}': {must}; got {got}.")

    def check_in(self, kind: str) -> None:
        """Check what depends on the kind of the scene; InputError on values that do not fit it."""
        for support in self.supports:
            held = support.displacement
            check_components(self.name, {} if held is None else held, kind)
        for load in self.loads:
            load.check(self.name, kind)

    @property
    def given(self) -> bool:
        """Whether the mesh is given, and not made for a number of elements."""
        return not callable(self.mesh)

    def curve_of(self, boundary: str) -> Curve | None:
        """The function, if any, that puts points (dim, m) [length] of a boundary on its surface."""
        if callable(self.curve):
            found = self.curve if boundary == self.contact else None
        else:
            found = (self.curve or {}).get(boundary)
        if found is None or isinstance(found, Curve):
            return found
        label = f"the curve of boundary {boundary!r} of body '{self.name}'"
        return Curve(found, True, label, given=True)

    def build_mesh(self, elements: int, zone: float | None) -> Any:
        """The mesh of the body, with `elements` across the half-width `zone` [length] of the
        contact; None: the scene's first guess. It is the given one if the part has a mesh and no
        function.
        """
        return self.mesh(elements, zone) if callable(self.mesh) else self.mesh


@dataclass(frozen=True)
class Rigid:
    """A rigid body: its compliance is zero.

    normal        the contact normal, one value per component; None: the normals of the other
                  body's contact boundary. Where that is curved, a gap that is measured along one
                  direction needs this direction here
    gap           function of the other body's contact nodes, coordinates (dim, k) -> initial gap
                  (k,) along the normal [length]; an array of these values, for half-spaces also of
                  the shape of their grid; None means touching everywhere
    force         None for an obstacle that does not move; otherwise, as in Plate, the total force
                  on it by component
    displacement  of the body by component [length]; components that have neither a force nor a
                  displacement are held
    """

    name: str
    normal: tuple[float, ...] | None = None
    gap: Function | np.ndarray | None = None
    force: Mapping[str, float] | None = None
    displacement: Mapping[str, float] | None = None

    elastic: ClassVar[Literal[False]] = False
    meshed: ClassVar[Literal[False]] = False
    given = False

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)

    def check_in(self, kind: str) -> None:
        """Check what depends on the kind of the scene, as Part.check_in() does."""
        _check_motion(self, kind)
        if self.normal is None:
            return
        dim = len(KINDS[kind].components)
        if len(self.normal) != dim or not np.any(self.normal):
            raise InputError(
                f"rigid body '{self.name}': its normal needs {dim} values, not all zero."
            )
        for value in self.normal:
            check_number(f"every value of the normal of rigid body '{self.name}'", value)


@dataclass(frozen=True)
class HalfSpace:
    """An elastic half-space (half-plane in 2D) without a mesh: a model of a body that is large
    compared with its contact.

    The upper body fills the half z >= 0, the lower the half z <= 0 (in 2D: y). It has no support:
    it deforms under the contact forces alone, and as a whole it is held, displaced or pressed by a
    total force. Making and solving a problem in 3D takes about 1.2 kB of memory per point without
    friction and 2.8 kB with it (reports/half_spaces).

    points        places of the contact points along each direction of the surface, evenly spaced:
                  (x,) in 2D, (x, y) in 3D [length]; or a function (elements, zone) -> such places.
                  Each point stands for a cell about it
    height        of the surface above its plane, outwards: function of the points (dim - 1, k) ->
                  (k,), or an array of the shape of the grid, indexed [x, y] [length]; None: flat
    force         the total force on the body by component, as in Rigid
    displacement  of the body as a whole by component [length]; components that have neither a force
                  nor a displacement are held
    periodic      whether surface and forces repeat themselves beyond the points. Displacements are
                  then measured from their mean
    depth         in 2D, where displacements grow without end: the displacements that a force makes
                  are measured from the point at this depth beneath it [length]; by default ten
                  times the length of the points
    """

    name: str
    material: Material
    points: Any
    height: Function | np.ndarray | None = None
    force: Mapping[str, float] | None = None
    displacement: Mapping[str, float] | None = None
    periodic: bool = False
    depth: float | None = None
    elastic: ClassVar[Literal[True]] = True
    meshed: ClassVar[Literal[False]] = False

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)
        if not isinstance(self.material, Material):
            raise self._wrong(f"its material must be a Material(E, nu); got {self.material!r}.")
        if self.depth is not None:
            check_number(f"the depth of half-space '{self.name}'", self.depth, low=0.0)
        if not isinstance(self.periodic, (bool, np.bool_)):
            raise self._wrong(f"periodic must be True or False; got {short(self.periodic)}.")

    def _wrong(self, why: str) -> InputError:
        return InputError(f"half-space '{self.name}': {why}")

    def check_in(self, kind: str) -> None:
        """Check what depends on the kind of the scene, as Part.check_in() does."""
        _check_motion(self, kind)

    @property
    def given(self) -> bool:
        """Whether the points are given, and not made for a number of elements."""
        return not callable(self.points)

    def ticks(self, elements: int, zone: float | None, axes: int) -> tuple[np.ndarray, ...]:
        """The places (n_i,) [length] of the points along each of the axes. InputError unless they
        are evenly spaced and growing, at least four along each axis.

        Points that are given by a function depend on `elements` across the contact half-width, and
        on the half-width `zone` [length] that they resolve.
        """
        given = self.points(elements, zone) if callable(self.points) else self.points
        if not isinstance(given, (tuple, list, np.ndarray)) or len(given) == 0:
            raise self._wrong(
                f"its points must be given by one row of places per axis; got {short(given)}."
            )
        rows = (given,) if np.ndim(given[0]) == 0 else tuple(given)
        if len(rows) != axes:
            raise self._wrong(
                f"its points need {axes} rows of places, one per axis; got {len(rows)}."
            )
        name = f"a row of points of half-space '{self.name}'"
        made = tuple(real_array(name, row) for row in rows)
        for row in made:
            steps = np.diff(row)
            short_row = row.ndim != 1 or len(row) < 4
            if short_row or steps.min() <= 0 or np.ptp(steps) > 1e-6 * steps.mean():
                raise self._wrong(
                    "its points must be at least 4 growing numbers per axis, evenly spaced."
                )
        return made


Body = Part | Rigid | HalfSpace


def _check_motion(body: Rigid | HalfSpace, kind: str) -> None:
    """Force and displacement of a body that moves as a whole."""
    force, displacement = body.force or {}, body.displacement or {}
    check_components(body.name, force, kind)
    check_components(body.name, displacement, kind)
    if set(force) & set(displacement):
        raise InputError(
            f"body '{body.name}': a component can have a force or a displacement, not both."
        )

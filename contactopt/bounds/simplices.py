"""Straight-edged triangles and tetrahedra: what the stresses on them need of their shape."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from skfem import Mesh


@dataclass(frozen=True, eq=False)
class Simplices:
    """Straight-edged triangles or tetrahedra, with displacements and stresses on them."""

    mesh: Mesh

    @cached_property
    def dim(self) -> int:
        return len(self.mesh.p)

    @cached_property
    def map(self) -> np.ndarray:
        """(e, dim, dim) the matrices B from the reference element."""
        x = self.mesh.p[:, self.mesh.t]
        return np.moveaxis(x[:, 1:] - x[:, :1], 2, 0)

    @cached_property
    def ratio(self) -> np.ndarray:
        """(e,) |det B|."""
        return np.abs(np.linalg.det(self.map))

    @cached_property
    def volume(self) -> np.ndarray:
        """(e,) [length^dim]."""
        return self.ratio / (2 if self.dim == 2 else 6)

    @cached_property
    def back(self) -> np.ndarray:
        """(e, dim, dim) the inverses of these matrices."""
        return np.linalg.inv(self.map)

    @cached_property
    def slopes(self) -> np.ndarray:
        """(e, dim + 1, dim) gradients of the hat functions."""
        return np.concatenate([-self.back.sum(axis=1, keepdims=True), self.back], axis=1)

    @cached_property
    def others(self) -> np.ndarray:
        """(dim + 1, dim) for each local vertex the others, which span the facet opposite it."""
        every = np.arange(self.dim + 1)
        return np.array([every[every != o] for o in every])

    @cached_property
    def opposite(self) -> np.ndarray:
        """(dim + 1, e) the facet of the mesh opposite each vertex."""
        local = [tuple(facet) for facet in self.mesh.refdom.facets]
        return np.asarray(self.mesh.t2f[[local.index(tuple(own)) for own in self.others]])

    @cached_property
    def slots(self) -> np.ndarray:
        """(dim + 1, dim, e) the place that each of `others` has among the vertices of its facet."""
        corners = self.mesh.facets[:, self.opposite]
        return np.stack(
            [
                [np.argmax(corners[:, o] == self.mesh.t[a], axis=0) for a in own]
                for o, own in enumerate(self.others)
            ]
        )

    @cached_property
    def sign(self) -> np.ndarray:
        """(dim + 1, e) 1 where the normal of the facet points out of the element, else -1."""
        return np.where(self.mesh.f2t[0, self.opposite] == np.arange(len(self.volume)), 1.0, -1.0)

    @cached_property
    def outward(self) -> np.ndarray:
        """(dim + 1, e, dim) outward normals times the measure of the facets."""
        return -self.dim * np.moveaxis(self.volume[:, None, None] * self.slopes, 1, 0)

    @cached_property
    def between(self) -> tuple[np.ndarray, np.ndarray]:
        """Local vertices (2, j) at the ends of the edges of an element, and the edges (j, e)."""
        flat = self.dim == 2
        ends = self.mesh.refdom.facets if flat else self.mesh.refdom.edges
        return np.array(ends).T, np.asarray(self.mesh.t2f if flat else self.mesh.t2e)

    def quadratic(self, nodal: np.ndarray) -> np.ndarray:
        """Displacements (dim, vertices and edges) of nodal ones, which may be those of vertices."""
        count = self.mesh.nvertices
        if nodal.shape[1] > count:
            return nodal
        edges = self.mesh.facets if self.dim == 2 else self.mesh.edges
        return np.concatenate([nodal, nodal[:, edges].mean(axis=1)], axis=1)

    def _once(self, key: Any, make: Callable[[], Any]) -> Any:
        """What was made for a key: a bound and its adjoints have the same tractions to find."""
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    @cached_property
    def _kept(self) -> dict[Any, Any]:
        return {}

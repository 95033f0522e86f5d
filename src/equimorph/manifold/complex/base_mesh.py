"""Triangulation of the parameter box on which the equilibrium set is lifted."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from equimorph.arrays import Cells, EdgeFlags, Float, Int, ItemFlags, Place, Places
from equimorph.manifold.geometry.simplices import barycentric
from equimorph.manifold.geometry.topology import keys_of, rows_of
from equimorph.tolerances import IN_BOX


def _none(corners: int) -> Int[np.ndarray, "0 corners"]:
    return np.zeros((0, corners), int)


@dataclass(frozen=True)
class BaseMesh:
    """A conforming triangulation of a box in the space of one, two or three free parameters.

    edges (E, 2): vertex numbers; triangles (T, 3): corners a, b, c; sides (T, 3): edges ab, bc,
    ca; tetrahedra (N, 4): corners a, b, c, d; faces (N, 4): triangles bcd, acd, abd, abc. Edges
    keep their numbers when other edges are bisected; bisected ones stay, unused. Triangles and
    tetrahedra pass their numbers to one of their halves.
    """

    vertices: Float[np.ndarray, "V d"]
    edges: Int[np.ndarray, "E 2"]
    triangles: Int[np.ndarray, "T 3"] = field(default_factory=lambda: _none(3))
    sides: Int[np.ndarray, "T 3"] = field(default_factory=lambda: _none(3))
    tetrahedra: Int[np.ndarray, "N 4"] = field(default_factory=lambda: _none(4))
    faces: Int[np.ndarray, "N 4"] = field(default_factory=lambda: _none(4))

    @property
    def dimension(self) -> int:
        """Number of free parameters."""
        return int(self.vertices.shape[1])

    @property
    def cells(self) -> Cells:
        """Simplices that fill the box: edges, triangles or tetrahedra."""
        return (self._segments, self.triangles, self.tetrahedra)[self.dimension - 1]

    @cached_property
    def _segments(self) -> Cells:
        return np.asarray(self.edges[self.edges_in_use])

    @cached_property
    def edges_in_use(self) -> EdgeFlags:
        """Which edges have not been bisected."""
        if self.dimension == 1:  # nothing lies between their ends
            rank = self.vertices[:, 0].argsort().argsort()[self.edges]
            return np.asarray(np.abs(rank[:, 1] - rank[:, 0]) == 1)
        used = np.zeros(len(self.edges), bool)
        used[self.sides] = True
        return used

    @cached_property
    def _largest_spans(self) -> Place:
        """Largest change of each free parameter along an edge."""
        largest = np.abs(self.vertices[self.edges[:, 1]] - self.vertices[self.edges[:, 0]])
        return np.asarray(largest.max(axis=0))

    def spans(self, edges: Int[np.ndarray, "*some"]) -> Float[np.ndarray, "*some d"]:
        """Changes of the free parameters along edges, relative to the largest ones."""
        ends = self.vertices[self.edges[edges]]
        return np.asarray((ends[..., 1, :] - ends[..., 0, :]) / self._largest_spans)

    def covers(self, points: Places) -> ItemFlags:
        """Which points lie in the box, up to round-off."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        slack = IN_BOX * (high - low)
        return np.asarray(((points >= low - slack) & (points <= high + slack)).all(axis=1))

    def locate(self, point: Place) -> int:
        """Cell that contains a point; the nearest one by barycentric coordinates."""
        low, high = self._bounds
        near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
        if len(near) == 0:  # a little outside the box
            near = np.arange(len(self.cells))
        corners = self.vertices[self.cells[near]]
        return int(near[np.argmax(barycentric(corners, point).min(axis=1))])

    @cached_property
    def _bounds(self) -> tuple[Float[np.ndarray, "C d"], Float[np.ndarray, "C d"]]:
        """Smallest boxes around the cells."""
        corners = self.vertices[self.cells]
        return corners.min(axis=1), corners.max(axis=1)


def mesh_of(vertices: Float[np.ndarray, "V d"], cells: Cells) -> BaseMesh:
    """Mesh with its edges and triangles numbered."""
    if cells.shape[1] == 2:
        return BaseMesh(vertices, np.sort(cells, axis=1))
    triangles, faces = cells, _none(4)
    if cells.shape[1] == 4:
        triangles, faces = _number_faces(
            [np.delete(cells, k, axis=1) for k in range(4)], len(vertices)
        )
    pairs = [triangles[:, list(pair)] for pair in ((0, 1), (1, 2), (2, 0))]
    edges, sides = _number_faces(pairs, len(vertices))
    tetrahedra = cells if cells.shape[1] == 4 else _none(4)
    return BaseMesh(vertices, edges, triangles, sides, tetrahedra, faces)


def _number_faces(
    columns: list[Int[np.ndarray, "C k"]], vertices: int
) -> tuple[Int[np.ndarray, "F k"], Int[np.ndarray, "C columns"]]:
    """Distinct faces with sorted corners, and the number of each cell's."""
    keys = np.stack([keys_of(column, vertices) for column in columns], axis=1)
    distinct, inverse = np.unique(keys.ravel(), return_inverse=True)
    return rows_of(distinct, vertices, columns[0].shape[1]), inverse.reshape(keys.shape)

"""Triangulation of the parameter box on which the equilibrium set is lifted."""

from dataclasses import dataclass, field
from itertools import permutations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.geometry.simplices import barycentric
from equimorph.manifold.geometry.topology import keys_of, rows_of
from equimorph.model import Box

SHIFT = 0.02
"""Largest shift of a grid line off its regular place, in intervals."""

MARGIN = 0.2
"""How far the coarse grid reaches beyond the box, in ranges of the parameters."""

SLACK = 1e-12
"""How far outside the box a point counts as inside, in ranges of the parameters."""

Lines = tuple[Float[np.ndarray, " _"], ...]
"""Places of grid lines along each free parameter."""


def _none(corners: int) -> Int[np.ndarray, "0 corners"]:
    return np.zeros((0, corners), int)


@dataclass(frozen=True)
class BaseMesh:
    """A conforming triangulation of a box in the space of one, two or three free parameters.

    edges (E, 2): vertex numbers; triangles (T, 3): corners a, b, c; sides (T, 3): edges ab, bc,
    ca; tetrahedra (N, 4): corners a, b, c, d; faces (N, 4): triangles bcd, acd, abd, abc. Edges
    keep their numbers when others are bisected; bisected ones stay, unused. Triangles and
    tetrahedra leave their numbers to one of their halves.
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
    def cells(self) -> Int[np.ndarray, "C corners"]:
        """Simplices that fill the box: edges, triangles or tetrahedra."""
        return (self.edges, self.triangles, self.tetrahedra)[self.dimension - 1]

    @property
    def edges_in_use(self) -> Bool[np.ndarray, " E"]:
        """Which edges have not been bisected."""
        used = np.full(len(self.edges), self.dimension == 1)
        used[self.sides] = True
        return used

    def covers(self, points: Float[np.ndarray, "n d"]) -> Bool[np.ndarray, " n"]:
        """Which points lie in the box, up to round-off."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        slack = SLACK * (high - low)
        return np.asarray(((points >= low - slack) & (points <= high + slack)).all(axis=1))

    def locate(self, point: Float[np.ndarray, " d"]) -> int:
        """Cell that contains a point; the nearest one by barycentric coordinates."""
        corners = self.vertices[self.cells]
        low, high = corners[:, 0], corners[:, 0]
        for k in range(1, corners.shape[1]):
            low, high = np.minimum(low, corners[:, k]), np.maximum(high, corners[:, k])
        near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
        if len(near) == 0:  # a little outside the box
            near = np.arange(len(corners))
        return int(near[np.argmax(barycentric(corners[near], point).min(axis=1))])


def _lines(low: float, high: float, count: int, mirrored: bool) -> Float[np.ndarray, " lines"]:
    """Grid lines, equidistant but for a slight shift; one on a line of symmetry is moved off it.

    Round numbers put vertices exactly on folds more often than chance would: the shift, an odd
    function of the place so that mirror images stay mirror images, takes them off. Edges along a
    line of symmetry run through pitchforks, which no generic set has.
    """
    lines = np.linspace(low, high, count + 1)
    spacing = (high - low) / count
    lines[1:-1] += SHIFT * spacing * np.sin(lines[1:-1] / spacing)
    if mirrored:
        on = np.flatnonzero(np.abs(lines) < 1e-9 * (high - low))
        inside = on[(on > 0) & (on < count)]
        lines[inside] += 0.15 * spacing
    return lines


def grid_lines(box: Box, intervals: tuple[int, ...], mirrored: tuple[bool, ...]) -> Lines:
    """Places of the grid lines along each free parameter."""
    return tuple(
        _lines(box.lower[k], box.upper[k], count, mirrored[k]) for k, count in enumerate(intervals)
    )


def grid_mesh(lines: Lines) -> BaseMesh:
    """Kuhn triangulation of a grid: every box cut along its rising diagonal.

    Its simplices climb from the lowest to the highest corner along the axes in any order.
    """
    d = len(lines)
    vertices = np.stack([line.ravel() for line in np.meshgrid(*lines, indexing="ij")], axis=1)
    strides = [int(np.prod([len(line) for line in lines[k + 1 :]])) for k in range(d)]
    places = np.meshgrid(*(np.arange(len(line) - 1) for line in lines), indexing="ij")
    corner = sum(strides[k] * places[k].ravel() for k in range(d))
    climbs = []
    for order in permutations(range(d)):
        steps = np.cumsum([0, *(strides[axis] for axis in order)])
        if sum(order[i] > order[j] for i in range(d) for j in range(i + 1, d)) % 2:
            steps[-2:] = steps[:-3:-1]  # an odd order would turn the simplex over
        climbs.append(np.asarray(corner)[:, None] + steps)
    return mesh_of(vertices, np.concatenate(climbs))


def coarse_grid(
    lines: Lines, intervals: int, limits: Float[np.ndarray, "2 d"]
) -> tuple[BaseMesh, Int[np.ndarray, " vertices"]]:
    """Mesh on some of the lines of a grid, and on a few beyond it, within limits.

    It has at most so many intervals along each parameter of the grid. Returned with it are the
    grid's numbers of its vertices, −1 for those beyond the grid.
    """
    counts = [len(line) - 1 for line in lines]
    chosen, wide = [], []
    for count, line, (low, high) in zip(counts, lines, limits.T, strict=True):
        own = np.linspace(0, count, min(count, intervals) + 1).round().astype(int)
        margin = MARGIN * (line[-1] - line[0])
        first = max(line[0] - margin, 0.5 * (line[0] + low))
        last = min(line[-1] + margin, 0.5 * (line[-1] + high))
        before, after = np.linspace(first, line[0], 3)[:-1], np.linspace(line[-1], last, 3)[1:]
        wide.append(np.concatenate([before, line[own], after]))
        chosen.append(np.concatenate([[-1, -1], own, [-1, -1]]))
    places = np.stack([place.ravel() for place in np.meshgrid(*chosen, indexing="ij")])
    number = np.ravel_multi_index(list(np.maximum(places, 0)), tuple(n + 1 for n in counts))
    return grid_mesh(tuple(wide)), np.where((places >= 0).all(axis=0), number, -1)


def mesh_of(vertices: Float[np.ndarray, "V d"], cells: Int[np.ndarray, "C corners"]) -> BaseMesh:
    """Mesh with its edges and triangles numbered."""
    if cells.shape[1] == 2:
        return BaseMesh(vertices, np.sort(cells, axis=1))
    triangles, faces = cells, _none(4)
    if cells.shape[1] == 4:
        triangles, faces = _numbered([np.delete(cells, k, axis=1) for k in range(4)], len(vertices))
    pairs = [triangles[:, list(pair)] for pair in ((0, 1), (1, 2), (2, 0))]
    edges, sides = _numbered(pairs, len(vertices))
    tetrahedra = cells if cells.shape[1] == 4 else _none(4)
    return BaseMesh(vertices, edges, triangles, sides, tetrahedra, faces)


def _numbered(
    columns: list[Int[np.ndarray, "C k"]], vertices: int
) -> tuple[Int[np.ndarray, "F k"], Int[np.ndarray, "C columns"]]:
    """Distinct faces with sorted corners, and the number of each cell's."""
    keys = np.stack([keys_of(column, vertices) for column in columns], axis=1)
    distinct, inverse = np.unique(keys.ravel(), return_inverse=True)
    return rows_of(distinct, vertices, columns[0].shape[1]), inverse.reshape(keys.shape)

"""Grids over the box of the free parameters, and the bisection of their edges."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import permutations

import numpy as np

from equimorph.arrays import Float, Int, Items, Place, Some
from equimorph.manifold.complex.base_mesh import BaseMesh, mesh_of
from equimorph.manifold.geometry.simplices import barycentric
from equimorph.model import Box
from equimorph.tolerances import IN_BOX

SHIFT = 0.02
"""Largest shift of a grid line off its regular place, in intervals."""

APART = 0.15
"""Shift, in intervals, of a line on which a parameter is zero, and of the inner lines of a
parameter with the same lines as another one."""

ASIDE = 0.1
"""Part of an edge by which the point that splits it is moved off a line of symmetry."""

NEAR_AN_END = 0.02
"""Part of an edge within which nothing is split off: slivers serve nobody."""

MARGIN = 0.2
"""How far the coarse grid reaches beyond the box, in ranges of the parameters."""

Lines = tuple[Float[np.ndarray, " _"], ...]
"""Places of grid lines along each free parameter."""


def _lines(low: float, high: float, count: int) -> Float[np.ndarray, " lines"]:
    """Grid lines, equidistant but for a slight shift; one on a line of symmetry is moved off it.

    Round numbers put vertices exactly on folds more often than chance would: the shift, an odd
    function of the place so that mirror images stay mirror images, takes them off. Edges along a
    line of symmetry run through pitchforks, which no generic set has.
    """
    lines = np.linspace(low, high, count + 1)
    spacing = (high - low) / count
    lines[1:-1] += SHIFT * spacing * np.sin(lines[1:-1] / spacing)
    on = np.flatnonzero(np.abs(lines) < 1e-9 * (high - low))
    lines[on[(on > 0) & (on < count)]] += APART * spacing
    return lines


def grid_lines(box: Box, intervals: tuple[int, ...]) -> Lines:
    """Places of the grid lines along each free parameter."""
    lines: list[Float[np.ndarray, " _"]] = []
    for k, count in enumerate(intervals):
        line = _lines(box.lower[k], box.upper[k], count)
        if any(np.array_equal(line, other) for other in lines):
            # else diagonals lie on the line where both parameters are equal, often a singular one
            line[1:-1] += APART * (line[-1] - line[0]) / count * np.sign(line[1:-1])
        lines.append(line)
    return tuple(lines)


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
    """Mesh on selected lines of a grid, and on a few beyond it, within limits.

    The number of its intervals along each parameter is limited. Returned with it are the grid's
    numbers of its vertices, −1 for those beyond the grid.
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


def bisect(
    mesh: BaseMesh,
    chosen: Some,
    shares: Mapping[int, float] | None = None,
) -> BaseMesh:
    """Split edges at their midpoints, and the triangles and tetrahedra around them.

    Where the midpoint lies on a line of symmetry the edge is split off it. For some edges `shares`
    has the part of the way from their first to their second end at which they are split instead.

    Edges are split one after the other; one that shares a cell with an earlier one of the same
    call waits for another call, so that every cell is split at most once.
    """
    growth = _Growth.of(mesh)
    touched = np.zeros(len(mesh.cells), bool)
    by_triangle, by_tetrahedron = _around(mesh, chosen)
    for edge in chosen.tolist():
        cells = (by_triangle if mesh.dimension == 2 else by_tetrahedron)[edge]
        if touched[cells].any():
            continue
        touched[cells] = True
        a, b = mesh.vertices[mesh.edges[edge]]
        middle = _between(a, b, (shares or {}).get(edge, 0.5))
        _split(growth, mesh, edge, middle, (by_triangle[edge], by_tetrahedron[edge]))
    return growth.mesh(mesh)


@dataclass
class _Growth:
    """Rows of a mesh that is being bisected: old arrays, changed in place, and rows to append."""

    triangles: Int[np.ndarray, "T 3"]
    sides: Int[np.ndarray, "T 3"]
    tetrahedra: Int[np.ndarray, "N 4"]
    faces: Int[np.ndarray, "N 4"]
    vertices: list[Place] = field(default_factory=list)
    edges: list[tuple[int, int]] = field(default_factory=list)
    more_triangles: list[tuple[list[int], list[int]]] = field(default_factory=list)
    more_tetrahedra: list[tuple[list[int], list[int]]] = field(default_factory=list)

    @classmethod
    def of(cls, mesh: BaseMesh) -> "_Growth":
        """Nothing split yet."""
        triangles, tetrahedra = mesh.triangles.copy(), mesh.tetrahedra.copy()
        return cls(triangles, mesh.sides.copy(), tetrahedra, mesh.faces.copy())

    def mesh(self, old: BaseMesh) -> BaseMesh:
        """Put the rows together."""

        def append_rows(rows: np.ndarray, more: list[list[int]]) -> np.ndarray:
            return np.concatenate([rows, np.array(more, int).reshape(-1, rows.shape[1])])

        return replace(
            old,
            vertices=np.concatenate([old.vertices, *(each[None] for each in self.vertices)]),
            edges=np.concatenate([old.edges, np.array(self.edges, int).reshape(-1, 2)]),
            triangles=append_rows(self.triangles, [row[0] for row in self.more_triangles]),
            sides=append_rows(self.sides, [row[1] for row in self.more_triangles]),
            tetrahedra=append_rows(self.tetrahedra, [row[0] for row in self.more_tetrahedra]),
            faces=append_rows(self.faces, [row[1] for row in self.more_tetrahedra]),
        )


def _around(mesh: BaseMesh, chosen: Some) -> tuple[dict[int, list[int]], dict[int, list[int]]]:
    """Triangles and tetrahedra that contain each of some edges."""
    wanted = np.zeros(len(mesh.edges), bool)
    wanted[chosen] = True
    triangles: dict[int, list[int]] = {int(edge): [] for edge in chosen}
    tetrahedra: dict[int, list[int]] = {int(edge): [] for edge in chosen}
    has = wanted[mesh.sides]
    for triangle, side in zip(*np.nonzero(has), strict=True):
        triangles[int(mesh.sides[triangle, side])].append(int(triangle))
    for cell in np.flatnonzero(has.any(axis=1)[mesh.faces].any(axis=1)):
        sides = np.unique(mesh.sides[mesh.faces[cell]])
        for edge in sides[wanted[sides]]:
            tetrahedra[int(edge)].append(int(cell))
    return triangles, tetrahedra


def _split(
    growth: _Growth, mesh: BaseMesh, edge: int, place: Place, around: tuple[list[int], list[int]]
) -> None:
    """Split an edge and the triangles and tetrahedra around it, all of them unsplit so far."""
    a, b = mesh.edges[edge].tolist()
    middle = len(mesh.vertices) + len(growth.vertices)
    growth.vertices.append(place)
    first_edge, half_edges = len(mesh.edges), {}
    for end in (a, b):
        half_edges[end] = first_edge + len(growth.edges)
        growth.edges.append((end, middle))
    cuts: dict[int, int] = {}
    halves: dict[tuple[int, int], int] = {}
    for t in around[0]:
        k = mesh.sides[t].tolist().index(edge)
        first, second, apex = (int(mesh.triangles[t, (k + m) % 3]) for m in range(3))
        to_apex, from_apex = int(mesh.sides[t, (k + 1) % 3]), int(mesh.sides[t, (k + 2) % 3])
        cuts[apex] = cut = first_edge + len(growth.edges)
        growth.edges.append((apex, middle))
        growth.triangles[t] = [first, middle, apex]
        growth.sides[t] = [half_edges[first], cut, from_apex]
        halves[apex, first] = t
        halves[apex, second] = len(mesh.triangles) + len(growth.more_triangles)
        growth.more_triangles.append(([middle, second, apex], [half_edges[second], to_apex, cut]))
    for cell in around[1]:
        _split_tetrahedron(growth, mesh, cell, (a, b, middle), cuts, halves)


def _split_tetrahedron(
    growth: _Growth,
    mesh: BaseMesh,
    cell: int,
    ends: tuple[int, int, int],
    cuts: dict[int, int],
    halves: dict[tuple[int, int], int],
) -> None:
    """Part a tetrahedron by the triangle through the middle of the edge and the other corners."""
    a, b, middle = ends
    corners, faces = mesh.tetrahedra[cell].tolist(), mesh.faces[cell].tolist()
    at = {corner: k for k, corner in enumerate(corners)}
    c, d = (corner for corner in corners if corner not in {a, b})
    far = _side_between(mesh, faces[at[a]], (c, d))
    wall = len(mesh.triangles) + len(growth.more_triangles)
    growth.more_triangles.append(([middle, c, d], [cuts[c], far, cuts[d]]))
    parts = []
    for kept, lost in ((a, b), (b, a)):
        part, sides = corners.copy(), faces.copy()
        part[at[lost]] = middle
        # opposite to the middle lies what lay opposite to the lost corner
        sides[at[kept]] = wall
        sides[at[c]], sides[at[d]] = halves[d, kept], halves[c, kept]
        parts.append((part, sides))
    growth.tetrahedra[cell], growth.faces[cell] = parts[0]
    growth.more_tetrahedra.append(parts[1])


def _side_between(mesh: BaseMesh, triangle: int, pair: tuple[int, int]) -> int:
    """Side of a triangle between two of its corners."""
    sides: list[int] = mesh.sides[triangle].tolist()
    return next(side for side in sides if set(mesh.edges[side].tolist()) == set(pair))


def _between(a: Place, b: Place, share: float) -> Place:
    """Point of an edge, or one next to it if it lies on a line of symmetry."""
    place = a + share * (b - a)
    on_line = np.abs(place) < 1e-9 * np.abs(b - a).max()
    return np.asarray(a + (share - ASIDE) * (b - a) if on_line.any() else place)


def longest_edges(mesh: BaseMesh, sides: Int[np.ndarray, "rows sides"]) -> Items:
    """Return the longest edge, relative to the box, of each row, each once."""
    ends = mesh.vertices[mesh.edges[sides]] / np.ptp(mesh.vertices, axis=0)
    length = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
    return np.unique(sides[np.arange(len(sides)), length.argmax(axis=1)])


def split_at(mesh: BaseMesh, place: Place) -> tuple[int, float]:
    """Edge around a place to split, and the part of the way along it at which.

    Then the place lies on a face of its cell of one dimension less, in the end on a vertex. Where
    that would part a sliver off, the longest edge is split in the middle.
    """
    cell, d = mesh.locate(place), mesh.dimension
    shares = barycentric(mesh.vertices[mesh.cells[[cell]]], place)[0]
    if d == 1:
        sides = mesh.edges_in_use.nonzero()[0][[cell]]
    else:
        sides = mesh.sides[cell] if d == 2 else np.unique(mesh.sides[mesh.faces[cell]])
    corners = mesh.cells[cell].tolist()
    ends = np.array([[corners.index(end) for end in mesh.edges[side]] for side in sides.tolist()])
    weights = shares[ends]
    beside = weights.sum(axis=1) > IN_BOX  # else it lies on the other corners, up to round-off
    part = np.where(beside, weights[:, 1], 0.0) / np.where(beside, weights.sum(axis=1), 1.0)
    fair = sides[(part > NEAR_AN_END) & (part < 1.0 - NEAR_AN_END)]
    edge = int(longest_edges(mesh, (fair if len(fair) else sides)[None])[0])
    return edge, float(part[sides == edge][0]) if len(fair) else 0.5

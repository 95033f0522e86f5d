"""Triangulation of the parameter box on which the equilibrium set is lifted."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.model import Box

SHIFT = 0.02
"""Largest shift of a grid line off its regular place, in intervals."""


@dataclass(frozen=True)
class BaseMesh:
    """A conforming triangulation of a box in the plane of two free parameters.

    edges (E, 2): vertex numbers; triangles (T, 3): corners a, b, c; sides (T, 3): edges ab, bc,
    ca. Edges keep their numbers when others are bisected; bisected ones stay, unused.
    """

    vertices: Float[np.ndarray, "V 2"]
    edges: Int[np.ndarray, "E 2"]
    triangles: Int[np.ndarray, "T 3"]
    sides: Int[np.ndarray, "T 3"]

    def locate(self, point: Float[np.ndarray, " 2"]) -> int:
        """Triangle that contains a point; the nearest one by barycentric coordinates."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        inverse = 1.0 / _cross(b - a, c - a)
        u, v = _cross(point - a, c - a) * inverse, _cross(b - a, point - a) * inverse
        return int(np.argmax(np.minimum(np.minimum(u, v), 1.0 - u - v)))


def _cross(
    a: Float[np.ndarray, "... 2"], b: Float[np.ndarray, "... 2"]
) -> Float[np.ndarray, "..."]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


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


def grid_mesh(box: Box, intervals: tuple[int, int], mirrored: tuple[bool, bool]) -> BaseMesh:
    """Kuhn triangulation of a regular grid: every rectangle cut by its rising diagonal."""
    axes = [_lines(box.lower[k], box.upper[k], intervals[k], mirrored[k]) for k in range(2)]
    first, second = np.meshgrid(*axes, indexing="ij")
    vertices = np.stack([first.ravel(), second.ravel()], axis=1)
    i, j = (x.ravel() for x in np.meshgrid(*map(np.arange, intervals), indexing="ij"))
    row = intervals[1] + 1
    corner = i * row + j
    right, up, across = corner + row, corner + 1, corner + row + 1
    triangles = np.concatenate(
        [np.stack([corner, right, across], 1), np.stack([corner, across, up], 1)]
    )
    return mesh_of(vertices, triangles)


def mesh_of(vertices: Float[np.ndarray, "V 2"], triangles: Int[np.ndarray, "T 3"]) -> BaseMesh:
    """Mesh with its edges numbered."""
    pairs = np.stack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]], 1)
    ordered = np.sort(pairs.reshape(-1, 2), axis=1)
    edges, inverse = np.unique(ordered, axis=0, return_inverse=True)
    return BaseMesh(vertices, edges, triangles, inverse.reshape(-1, 3))


def _between(
    a: Float[np.ndarray, " 2"], b: Float[np.ndarray, " 2"], mirrored: tuple[bool, bool]
) -> Float[np.ndarray, " 2"]:
    """Middle of an edge, or a point beside it if the middle lies on a line of symmetry."""
    middle = 0.5 * (a + b)
    on_line = np.array(mirrored) & (np.abs(middle) < 1e-9 * np.abs(b - a).max())
    return np.asarray(0.6 * a + 0.4 * b if on_line.any() else middle)


def bisect(
    mesh: BaseMesh, chosen: Int[np.ndarray, " some"], mirrored: tuple[bool, bool]
) -> BaseMesh:
    """Split edges at their midpoints, and the triangles on both sides of them.

    Where the midpoint lies on a line of symmetry the edge is split off it.

    Edges are split one after the other; one that shares a triangle with an earlier one of the same
    call waits for another call, so that every triangle is split at most once.
    """
    vertices, edges = [mesh.vertices], [mesh.edges]
    triangles, sides = mesh.triangles.copy(), mesh.sides.copy()
    more: list[tuple[list[int], list[int]]] = []
    touched = np.zeros(len(triangles), bool)
    new_vertex, new_edge = len(mesh.vertices), len(mesh.edges)
    for edge in chosen:
        around = np.flatnonzero((mesh.sides == edge).any(axis=1))
        if touched[around].any():
            continue
        touched[around] = True
        a, b = mesh.edges[edge]
        vertices.append(_between(mesh.vertices[a], mesh.vertices[b], mirrored)[None])
        edges.append(np.array([[a, new_vertex], [b, new_vertex]]))
        half = {int(a): new_edge, int(b): new_edge + 1}
        middle, new_vertex, new_edge = new_vertex, new_vertex + 1, new_edge + 2
        for t in around:
            k = int(np.flatnonzero(mesh.sides[t] == edge)[0])
            first, second, apex = (int(mesh.triangles[t, (k + m) % 3]) for m in range(3))
            to_apex, from_apex = int(mesh.sides[t, (k + 1) % 3]), int(mesh.sides[t, (k + 2) % 3])
            edges.append(np.array([[apex, middle]]))
            cut, new_edge = new_edge, new_edge + 1
            triangles[t], sides[t] = [first, middle, apex], [half[first], cut, from_apex]
            more.append(([middle, second, apex], [half[second], to_apex, cut]))
    return BaseMesh(
        np.concatenate(vertices),
        np.concatenate(edges),
        np.concatenate([triangles, *(np.array([row[0]]) for row in more)]),
        np.concatenate([sides, *(np.array([row[1]]) for row in more)]),
    )

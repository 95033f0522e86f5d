"""Known points of the equilibrium set: over grid vertices, on edges, inside triangles."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from equimorph.arrays import Bool, Float, Int, Some
from equimorph.manifold.geometry.kernels import match_or_add
from equimorph.structures import Structure
from equimorph.tolerances import SAME_STATE


class VertexKind(IntEnum):
    """What a vertex of a set lies on."""

    GRID = 0
    """A vertex of the grid."""
    FOLD = 1
    CAP = 2
    """A constraint that bounds the set."""
    BETWEEN = 3
    """A grid edge, between two of its folds."""
    CORNER = 4
    """A fold and a constraint at once."""
    AMID = 5
    """The inside of a grid tetrahedron, between given vertices."""
    REFINED = 6
    """An edge of the set that was bisected."""
    CROSSING = 7
    """A crossing of two sheets."""


GRID, FOLD, CAP, BETWEEN, CORNER, AMID, REFINED, CROSSING = VertexKind


def on_fold(kinds: Int[np.ndarray, "..."]) -> Bool[np.ndarray, "..."]:
    """Which vertices lie on folds."""
    return np.isin(kinds, (FOLD, CORNER))


def are_singular(kinds: Int[np.ndarray, "..."]) -> Bool[np.ndarray, "..."]:
    """Which vertices lie on folds or crossings, where F_z is singular."""
    return np.isin(kinds, (FOLD, CORNER, CROSSING))


@dataclass
class Points:
    """Growing store of points; those over a grid vertex are found again by their configuration.

    `vertex` is the grid vertex or −1; `edge` the grid edge on which an extra point lies, or −1.
    """

    structure: Structure
    z: Float[np.ndarray, "capacity size"]
    p: Float[np.ndarray, "capacity parameters"]
    index: Int[np.ndarray, " capacity"]
    kind: Int[np.ndarray, " capacity"]
    vertex: Int[np.ndarray, " capacity"]
    edge: Int[np.ndarray, " capacity"]
    following: Int[np.ndarray, " capacity"]
    head: Int[np.ndarray, " vertices"]
    count: int = 0

    @classmethod
    def empty(cls, structure: Structure, vertices: int) -> "Points":
        """Return an empty store for a number of grid vertices."""
        none = np.zeros(0, int)
        return cls(
            structure,
            np.zeros((0, structure.size)),
            np.zeros((0, len(structure.parameters))),
            none, none, none, none, none,
            np.full(vertices, -1),
        )  # fmt: skip

    def _reserve(self, extra: int) -> None:
        capacity = len(self.z)
        if self.count + extra <= capacity:
            return
        grown = max(2 * capacity, self.count + extra, 2 * len(self.head), 64)
        for name in ("z", "p", "index", "kind", "vertex", "edge", "following"):
            old = getattr(self, name)
            new = np.empty((grown, *old.shape[1:]), old.dtype)  # takes no memory until it is used
            new[:capacity] = old
            setattr(self, name, new)

    def over_vertices(
        self,
        vertices: Some,
        z: Float[np.ndarray, "some size"],
        p: Float[np.ndarray, "some parameters"],
        index: Some,
    ) -> tuple[Some, Bool[np.ndarray, " some"]]:
        """Numbers of polished equilibria over vertices, known or added, and which are new."""
        self._reserve(len(vertices))
        ids, new = np.empty(len(vertices), int), np.empty(len(vertices), bool)
        self.count = match_or_add(
            vertices, np.ascontiguousarray(z), self.structure.mass, SAME_STATE, self.head,
            self.following, self.z, self.count, ids, new,
        )  # fmt: skip
        own = np.flatnonzero(new)
        at = ids[own]
        self.p[at], self.index[at], self.kind[at] = p.take(own, axis=0), index[own], GRID
        self.vertex[at], self.edge[at] = vertices[own], -1
        return ids, new

    def add(
        self,
        z: Float[np.ndarray, " size"],
        p: Float[np.ndarray, " parameters"],
        index: int,
        kind: int,
        edge: int = -1,
    ) -> int:
        """Add an extra point; return its number."""
        self._reserve(1)
        at = self.count
        self.z[at], self.p[at], self.index[at], self.kind[at] = z, p, index, kind
        self.vertex[at], self.edge[at], self.following[at] = -1, edge, -1
        self.count += 1
        return at

    def add_many(
        self,
        z: Float[np.ndarray, "some size"],
        p: Float[np.ndarray, "some parameters"],
        index: Some,
        kinds: Some,
        edges: Some | int = -1,
    ) -> Some:
        """Add extra points inside cells, or on grid edges; return their numbers."""
        self._reserve(len(z))
        at = np.arange(self.count, self.count + len(z))
        self.z[at], self.p[at], self.index[at], self.kind[at] = z, p, index, kinds
        self.vertex[at], self.edge[at], self.following[at] = -1, edges, -1
        self.count += len(z)
        return at

    def grow_vertices(self, vertices: int) -> None:
        """Make room for new grid vertices."""
        self.head = np.concatenate([self.head, np.full(vertices - len(self.head), -1)])

    def over_first(self, vertices: int) -> int:
        """Return how many points lie over the first so many grid vertices."""
        own = self.vertex[: self.count]
        return int(np.count_nonzero((own >= 0) & (own < vertices)))

    def over(self, vertex: int) -> list[int]:
        """Points over one grid vertex."""
        found, node = [], int(self.head[vertex])
        while node >= 0:
            found.append(node)
            node = int(self.following[node])
        return found

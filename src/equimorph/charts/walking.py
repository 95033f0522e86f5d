"""Straight ways over the triangles of a sheet, from vertex to vertex."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.geometry.topology import Adjacency, adjacency

AT_VERTEX = 1e-6
"""Share of an edge within which a way that crosses it runs through its end."""
LONGEST = 100_000

Crossing = tuple[int, int, float]
"""Ends of an edge, and the share of the way from the first to the second where it is crossed."""
Way = list[int | Crossing]


@dataclass(frozen=True, eq=False)
class Walker:
    """Triangles over the plane on which one can go straight on.

    Parameters
    ----------
    corners
        Vertices of the triangles.
    places
        Places of all vertices in the plane.
    allowed
        Triangles that may be entered.
    """

    corners: Int[np.ndarray, "C 3"]
    places: Float[np.ndarray, "V 2"]
    allowed: Bool[np.ndarray, " C"]

    @cached_property
    def _whole(self) -> Adjacency:
        return adjacency(self.corners)

    @cached_property
    def _beyond(self) -> list[list[int]]:
        """Triangle beyond the side opposite to each corner; −1 where there is none."""
        whole = self._whole
        beyond = np.full(self.corners.shape, -1)
        facet = whole.across[whole.manifold]
        for cell, other in (whole.links[whole.manifold].T, whole.links[whole.manifold].T[::-1]):
            corner = (whole.cell_facets[cell] == facet[:, None]).argmax(axis=1)
            beyond[cell, corner] = other
        beyond[(beyond >= 0) & ~self.allowed[beyond]] = -1
        found: list[list[int]] = beyond.tolist()
        return found

    @cached_property
    def _rows(self) -> list[int]:
        """Vertices of the triangles one after the other: long lists of lists are slow to make."""
        rows: list[int] = self.corners.ravel().tolist()
        return rows

    def _corners(self, cell: int) -> list[int]:
        return self._rows[3 * cell : 3 * cell + 3]

    @cached_property
    def _columns(self) -> tuple[list[float], list[float]]:
        x, y = self.places.T
        return x.tolist(), y.tolist()

    @cached_property
    def _around(self) -> dict[int, list[int]]:
        """Allowed triangles around each vertex."""
        around: dict[int, list[int]] = {}
        for cell in np.flatnonzero(self.allowed).tolist():
            for vertex in self._corners(cell):
                around.setdefault(vertex, []).append(cell)
        return around

    def way(self, start: int, goal: int) -> Way | None:
        """Vertices and crossed edges of the straight way between two vertices, if there is one.

        Both ends are part of it.
        """
        way: Way = [start]
        target = self.places[goal]
        for _ in range(LONGEST):
            here = way[-1]
            assert isinstance(here, int)
            if here == goal:
                return way
            leg = self._leg(here, target)
            if leg is None:
                return None
            way += leg
        return None

    def _leg(self, start: int, target: Float[np.ndarray, " 2"]) -> Way | None:
        """From a vertex straight on to the next vertex that is met."""
        origin = self.places[start]
        ahead = target - origin
        far = float(ahead @ ahead)
        if far == 0.0:
            return None
        for cell in self._around.get(start, ()):
            a, b = (v for v in self._corners(cell) if v != start)
            entry = self._crossed(origin, ahead, a, b)
            if entry is None:
                continue
            crossing, along = entry
            if isinstance(crossing, int):
                return [crossing] if along <= 1.0 + AT_VERTEX else None
            if along > 1.0 + AT_VERTEX:
                continue
            return self._onward((origin, ahead), cell, start, crossing)
        return None

    def _onward(
        self,
        ray: tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]],
        cell: int,
        corner: int,
        crossing: Crossing,
    ) -> Way | None:
        """Through one triangle after the other until a vertex is met."""
        way: Way = [crossing]
        while len(way) < LONGEST:
            a, b, _ = crossing
            cell = self._beyond[cell][self._corners(cell).index(corner)]
            if cell < 0:
                return None
            third = next(v for v in self._corners(cell) if v not in {a, b})
            for side, rest in ((a, b), (b, a)):
                entry = self._crossed(*ray, side, third)
                if entry is None or entry[1] > 1.0 + AT_VERTEX:
                    continue
                if isinstance(entry[0], int):
                    return [*way, entry[0]] if entry[0] == third else None
                crossing, corner = entry[0], rest
                way.append(crossing)
                break
            else:
                return None
        return None

    def _crossed(
        self, origin: Float[np.ndarray, " 2"], ahead: Float[np.ndarray, " 2"], a: int, b: int
    ) -> tuple[int | Crossing, float] | None:
        """Where a ray crosses an edge, or which of its ends it meets; and after which share."""
        (px, py), (dx, dy) = origin.tolist(), ahead.tolist()
        x, y = self._columns
        ax, ay, bx, by = x[a], y[a], x[b], y[b]
        side_a = dx * (ay - py) - dy * (ax - px)
        side_b = dx * (by - py) - dy * (bx - px)
        if side_a == side_b:
            return None
        share = side_a / (side_a - side_b)
        if not -AT_VERTEX <= share <= 1.0 + AT_VERTEX:
            return None
        ahead_x, ahead_y = ax + share * (bx - ax) - px, ay + share * (by - ay) - py
        along = (ahead_x * dx + ahead_y * dy) / (dx * dx + dy * dy)
        if along <= 0.0:
            return None
        if share < AT_VERTEX:
            return a, along
        if share > 1.0 - AT_VERTEX:
            return b, along
        return (a, b, share), along


def straightened(clear: Walker, free: Walker, path: list[int]) -> Way:
    """The shortest chain of straight ways between vertices of a path.

    Parameters
    ----------
    clear
        Where ways between any two of the vertices may run.
    free
        Where ways between neighbours on the path may run, if they may not otherwise.
    path
        Vertices.
    """
    count = len(path)
    length = np.full(count, np.inf)
    length[0] = 0.0
    before = np.zeros(count, int)
    ways: dict[tuple[int, int], Way] = {}
    places = clear.places[path]
    for i in range(count):
        for j in range(i + 1, count):
            far = length[i] + float(np.linalg.norm(places[j] - places[i]))
            if far >= length[j]:
                continue
            way = clear.way(path[i], path[j])
            if way is None and j == i + 1:
                way = free.way(path[i], path[j]) or [path[i], path[j]]
            if way is not None:
                length[j], before[j], ways[i, j] = far, i, way
    at, out = count - 1, [path[-1]]
    whole: Way = list(out)
    while at > 0:
        whole = ways[int(before[at]), at][:-1] + whole
        at = int(before[at])
    return whole

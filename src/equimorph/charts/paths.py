"""Short paths over the cells of a set from chart to chart, straight where they can be."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from equimorph.arrays import CellFlags, CellNumbers, Float, Int, VertexFlags
from equimorph.charts.preparation import first_copies
from equimorph.linalg.graphs import shortest_path
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import places_of
from equimorph.manifold.geometry.points import are_singular, on_fold
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import Adjacency, faces_of
from equimorph.manifold.lookup.exact_states import exact_states, root_weights
from equimorph.structures import State, States, join_states

AT_VERTEX = 1e-6
"""Share of an edge within which a way that crosses it runs through its end."""
LONGEST = 100_000
"""Most triangles that a straight way may cross."""

Crossing = tuple[int, int, float]
"""Ends of an edge, and the share of the way from the first to the second where it is crossed."""
Way = list[int | Crossing]


@dataclass(frozen=True, eq=False)
class AtlasPath:
    """A continuous path on a set, from chart to chart.

    Parameters
    ----------
    states
        Exact states along it: at its ends, and where it enters another cell.
    coords
        Their coordinates.
    chart
        Number of the chart of each step between them.
    """

    states: States
    coords: Float[np.ndarray, "points d"]
    chart: Int[np.ndarray, " steps"]

    def __repr__(self) -> str:
        """Charts in turn and number of states."""
        charts = " → ".join(str(chart) for chart, _, _ in self.legs)
        return f"AtlasPath({charts}: {len(self.states)} states)"

    @property
    def legs(self) -> tuple[tuple[int, Float[np.ndarray, "_ d"], States], ...]:
        """Chart, coordinates and states of each leg; neighbours share the state between them."""
        change = np.flatnonzero(np.diff(self.chart)) + 1
        bounds = [0, *change.tolist(), len(self.chart)]
        return tuple(
            (int(self.chart[a]), self.coords[a : b + 1], self.states[a : b + 1])
            for a, b in pairwise(bounds)
        )


@dataclass(frozen=True)
class Place:
    """A state of a set, and the number of its cell."""

    state: State
    cell: int


def path_over_cells(
    eset: EquilibriumSet, chart: CellNumbers, start: Place, goal: Place
) -> AtlasPath | None:
    """Short path between two places; None if the set does not connect them.

    Shortest over edges, in the metric; over two parameters then pulled straight between folds.
    """
    # ways may lead from sheet to sheet where these cross
    eset = replace(eset, cells=first_copies(eset)[eset.cells])
    if start.cell == goal.cell:
        states = _chain(eset, start.state, None, goal.state)
        return AtlasPath(states, _coords(eset, states), chart[[start.cell]])
    path = _over_edges(eset, start, goal)
    if path is None:
        return None
    way = _straighten(eset, path)
    states = _chain(eset, start.state, _states_on(eset, way), goal.state)
    charts = _charts_of(eset, chart, way)
    whole = np.concatenate([chart[[start.cell]], charts, chart[[goal.cell]]])
    return AtlasPath(states, _coords(eset, states), whole)


def _coords(eset: EquilibriumSet, states: States) -> Float[np.ndarray, "points d"]:
    return np.stack([states[name] for name in eset.names], axis=1)


def _chain(eset: EquilibriumSet, start: State, middle: States | None, goal: State) -> States:
    return join_states(eset.structure, [start, *([] if middle is None else [middle]), goal])


def _over_edges(eset: EquilibriumSet, start: Place, goal: Place) -> list[int] | None:
    """Vertices of the shortest way over edges from one cell to another."""
    setting, count = eset.setting, len(eset.points)
    place = places_of(eset)
    pairs = faces_of(eset.cells, 2) if eset.cells.shape[1] > 2 else eset.cells
    pairs = pairs[~_at_end(eset)[pairs].any(axis=1)]
    links, lengths = [pairs], [np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)]
    for number, end in enumerate((start, goal)):
        corners = eset.cells[end.cell]
        own = embed(setting, end.state.z[None], end.state.p[None])
        links.append(np.stack([np.full(len(corners), count + number), corners], axis=1))
        lengths.append(np.linalg.norm(place[corners] - own, axis=1))
    ends = (count, count + 1)
    path = shortest_path(count + 2, np.concatenate(links), np.concatenate(lengths), ends)
    return None if path is None else path[1:-1].tolist()


def _at_end(eset: EquilibriumSet) -> VertexFlags:
    """Vertices on folds at which the set ends: no way should touch them."""
    whole, at = eset.adjacency, np.zeros(len(eset.points), bool)
    at[whole.facets[whole.counts == 1]] = True
    return np.asarray(at & on_fold(eset.kinds))


def _straighten(eset: EquilibriumSet, path: list[int]) -> Way:
    """The way, straight in the parameters between its vertices on folds."""
    if eset.cells.shape[1] != 3:
        return list(path)
    folded = are_singular(eset.kinds)
    stops = [0, *(k for k in range(1, len(path) - 1) if folded[path[k]]), len(path) - 1]
    way: Way = [path[0]]
    ground = Ground(eset.cells, eset.coordinates, eset.adjacency)
    for a, b in pairwise(stops):
        run = path[a : b + 1]
        if len(run) < 2:
            continue
        around = eset.stratum[np.isin(eset.cells, run[:2]).sum(axis=1) == 2]
        walker = Walker(ground, np.isin(eset.stratum, around))
        way += straightest_path(walker, walker, run)[1:]
    return way


def _states_on(eset: EquilibriumSet, way: Way) -> States:
    """Exact states at the vertices and crossed edges of a way."""
    ends = np.array([(s, s) if isinstance(s, int) else s[:2] for s in way])
    share = np.array([0.0 if isinstance(s, int) else s[2] for s in way])
    weights = np.stack([1.0 - share, share], axis=1)
    p = np.einsum("nk,nkp->np", weights, eset.points.p[ends])
    folded = are_singular(eset.kinds)[ends]
    some = np.flatnonzero(folded.any(axis=1) & ~folded.all(axis=1))
    weights[some] = root_weights(weights[some], folded[some])
    z = np.einsum("nk,nki->ni", weights, eset.points.z[ends])
    amid = np.flatnonzero(share > 0.0)
    z[amid], good, _ = exact_states(eset.structure, z[amid], p[amid])
    kept = np.ones(len(way), bool)
    kept[amid] = good
    return States(eset.structure, z[kept], p[kept])


def _charts_of(eset: EquilibriumSet, chart: CellNumbers, way: Way) -> Int[np.ndarray, " steps"]:
    """Chart of each step of a way: that of a cell which holds both of its ends."""
    out: list[int] = []
    for one, other in pairwise(way):
        held = {*(one[:2] if not isinstance(one, int) else (one,))}
        held |= {*(other[:2] if not isinstance(other, int) else (other,))}
        around = np.flatnonzero(np.isin(eset.cells, list(held)).sum(axis=1) == len(held))
        known = chart[around].tolist()
        out.append(out[-1] if out and out[-1] in known else int(known[0]))
    return np.array(out, int)


@dataclass(frozen=True, eq=False)
class Ground:
    """Triangles over the plane, with tables for whoever walks over them."""

    corners: Int[np.ndarray, "C 3"]
    """Vertices of the triangles."""
    places: Float[np.ndarray, "V 2"]
    """Places of all vertices in the plane."""
    whole: Adjacency
    """How the triangles hang together."""

    @cached_property
    def beyond(self) -> list[int]:
        """Triangle beyond the side opposite to each corner, −1 where there is none, by `rows`."""
        whole = self.whole
        beyond = np.full(self.corners.shape, -1)
        facet = whole.across[whole.manifold]
        for cell, other in (whole.links[whole.manifold].T, whole.links[whole.manifold].T[::-1]):
            corner = (whole.cell_facets[cell] == facet[:, None]).argmax(axis=1)
            beyond[cell, corner] = other
        found: list[int] = beyond.ravel().tolist()
        return found

    @cached_property
    def rows(self) -> list[int]:
        """Vertices of the triangles one after the other: long lists of lists are slow to make."""
        rows: list[int] = self.corners.ravel().tolist()
        return rows

    @cached_property
    def columns(self) -> tuple[list[float], list[float]]:
        """Coordinates of the vertices."""
        x, y = self.places.T
        return x.tolist(), y.tolist()


Ray = tuple[float, float, float, float]
"""Place where it begins, and the way ahead."""


@dataclass(frozen=True, eq=False)
class Walker:
    """Goes straight on over triangles."""

    ground: Ground
    """The triangles."""
    allowed: CellFlags
    """Those that may be entered."""

    @cached_property
    def _open(self) -> list[bool]:
        found: list[bool] = self.allowed.tolist()
        return found

    def _corners(self, cell: int) -> list[int]:
        return self.ground.rows[3 * cell : 3 * cell + 3]

    @cached_property
    def _stars(self) -> tuple[list[int], list[int]]:
        """Allowed triangles around vertex after vertex, and where those of each vertex begin."""
        allowed = np.flatnonzero(self.allowed)
        vertex, count = self.ground.corners[allowed].ravel(), len(self.ground.places)
        begin = np.concatenate([[0], np.cumsum(np.bincount(vertex, minlength=count))])
        return np.repeat(allowed, 3)[np.argsort(vertex, kind="stable")].tolist(), begin.tolist()

    def _around(self, vertex: int) -> list[int]:
        cells, begin = self._stars
        return cells[begin[vertex] : begin[vertex + 1]]

    def way(self, start: int, goal: int) -> Way | None:
        """Vertices and crossed edges of the straight way between two vertices, if there is one.

        Both ends are part of it.
        """
        way: Way = [start]
        for _ in range(LONGEST):
            here = way[-1]
            assert isinstance(here, int)
            if here == goal:
                return way
            leg = self._leg(here, goal)
            if leg is None:
                return None
            way += leg
        return None

    def _leg(self, start: int, goal: int) -> Way | None:
        """From a vertex straight on to the next vertex that is met."""
        x, y = self.ground.columns
        ray = x[start], y[start], x[goal] - x[start], y[goal] - y[start]
        if ray[2:] == (0.0, 0.0):
            return None
        for cell in self._around(start):
            a, b = (v for v in self._corners(cell) if v != start)
            entry = self._crossing(ray, a, b)
            if entry is None:
                continue
            crossing, along = entry
            if isinstance(crossing, int):
                return [crossing] if along <= 1.0 + AT_VERTEX else None
            if along > 1.0 + AT_VERTEX:
                continue
            return self._onward(ray, cell, start, crossing)
        return None

    def _onward(self, ray: Ray, cell: int, corner: int, crossing: Crossing) -> Way | None:
        """Through one triangle after the other until a vertex is met."""
        way: Way = [crossing]
        beyond, allowed = self.ground.beyond, self._open
        while len(way) < LONGEST:
            a, b, _ = crossing
            cell = beyond[3 * cell + self._corners(cell).index(corner)]
            if cell < 0 or not allowed[cell]:
                return None
            third = next(v for v in self._corners(cell) if v not in {a, b})
            for side, rest in ((a, b), (b, a)):
                entry = self._crossing(ray, side, third)
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

    def _crossing(self, ray: Ray, a: int, b: int) -> tuple[int | Crossing, float] | None:
        """Where a ray crosses an edge, or which of its ends it meets; and after which share."""
        px, py, dx, dy = ray
        x, y = self.ground.columns
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


def straightest_path(clear: Walker, free: Walker, path: list[int]) -> Way:
    """The shortest chain of straight ways between vertices of a path.

    Ways between any two of the vertices run where `clear` allows, those between neighbours on the
    path also where only `free` does.
    """
    count = len(path)
    length = np.full(count, np.inf)
    length[0] = 0.0
    before = np.zeros(count, int)
    ways: dict[tuple[int, int], Way] = {}
    places = clear.ground.places[path]
    for i in range(count):
        apart = np.linalg.norm(places - places[i], axis=1)
        for j in range(i + 1, count):
            far = length[i] + apart[j]
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

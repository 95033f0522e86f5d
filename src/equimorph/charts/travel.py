"""Ways over the cells of a set from chart to chart."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from equimorph.charts.uncrossed import first_copies
from equimorph.charts.walking import Walker, Way, straightened
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.embedding import embed
from equimorph.manifold.geometry.points import CORNER, CROSSING, FOLD
from equimorph.manifold.geometry.topology import adjacency, faces_of
from equimorph.manifold.lookup.exact_states import exact_states
from equimorph.manifold.lookup.over import rooted
from equimorph.manifold.queries.nearest import setting_of
from equimorph.structures import State, States


@dataclass(frozen=True, eq=False)
class AtlasPath:
    """A continuous way on a set, from chart to chart.

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


def travel(
    eset: EquilibriumSet,
    chart: Int[np.ndarray, " C"],
    start: tuple[State, int],
    goal: tuple[State, int],
) -> AtlasPath | None:
    """Short way between states, each with its cell; None if the set does not join them.

    Shortest over edges, in the metric; over two parameters then pulled straight between folds.
    """
    # ways may lead from sheet to sheet where these cross
    eset = replace(eset, cells=first_copies(eset)[eset.cells])
    if start[1] == goal[1]:
        states = _stacked(eset, start[0], None, goal[0])
        return AtlasPath(states, _coords(eset, states), chart[[start[1]]])
    path = _over_edges(eset, start, goal)
    if path is None:
        return None
    way = _pulled(eset, path)
    states = _stacked(eset, start[0], _states_on(eset, way), goal[0])
    charts = _charts_of(eset, chart, way)
    whole = np.concatenate([chart[[start[1]]], charts, chart[[goal[1]]]])
    return AtlasPath(states, _coords(eset, states), whole)


def _coords(eset: EquilibriumSet, states: States) -> Float[np.ndarray, "points d"]:
    return np.stack([states[name] for name in eset.names], axis=1)


def _stacked(eset: EquilibriumSet, start: State, middle: States | None, goal: State) -> States:
    parts = [start.batch, *([] if middle is None else [middle]), goal.batch]
    z, p = (np.concatenate([getattr(part, name) for part in parts]) for name in ("z", "p"))
    return States(eset.structure, z, p)


def _over_edges(
    eset: EquilibriumSet, start: tuple[State, int], goal: tuple[State, int]
) -> list[int] | None:
    """Vertices of the shortest way over edges from one cell to another."""
    setting, count = setting_of(eset), len(eset.points)
    place = embed(setting, eset.points.z, eset.points.p)
    pairs = faces_of(eset.cells, 2) if eset.cells.shape[1] > 2 else eset.cells
    pairs = pairs[~_at_end(eset)[pairs].any(axis=1)]
    links, lengths = [pairs], [np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)]
    for number, (state, cell) in enumerate((start, goal)):
        corners = eset.cells[cell]
        own = embed(setting, state.z[None], state.p[None])
        links.append(np.stack([np.full(len(corners), count + number), corners], axis=1))
        lengths.append(np.linalg.norm(place[corners] - own, axis=1))
    joined = np.concatenate(links)
    graph = coo_array(
        (np.maximum(np.concatenate(lengths), 1e-12), joined.T), shape=(count + 2,) * 2
    ).tocsr()
    far, before = dijkstra(graph, directed=False, indices=count, return_predecessors=True)
    if not np.isfinite(far[count + 1]):
        return None
    path = [int(before[count + 1])]
    while before[path[-1]] != count:
        path.append(int(before[path[-1]]))
    return path[::-1]


def _at_end(eset: EquilibriumSet) -> Bool[np.ndarray, " V"]:
    """Vertices on folds at which the set ends: no way should touch them."""
    whole, at = adjacency(eset.cells), np.zeros(len(eset.points), bool)
    at[whole.facets[whole.counts == 1]] = True
    return at & np.isin(eset.kinds, (FOLD, CORNER))


def _pulled(eset: EquilibriumSet, path: list[int]) -> Way:
    """The way, straight in the parameters between its vertices on folds."""
    if eset.cells.shape[1] != 3:
        return list(path)
    folded = np.isin(eset.kinds, (FOLD, CORNER, CROSSING))
    stops = [0, *(k for k in range(1, len(path) - 1) if folded[path[k]]), len(path) - 1]
    way: Way = [path[0]]
    for a, b in pairwise(stops):
        run = path[a : b + 1]
        if len(run) < 2:
            continue
        around = eset.stratum[np.isin(eset.cells, run[:2]).sum(axis=1) == 2]
        walker = Walker(eset.cells, eset.coordinates, np.isin(eset.stratum, around))
        way += straightened(walker, walker, run)[1:]
    return way


def _states_on(eset: EquilibriumSet, way: Way) -> States:
    """Exact states at the vertices and crossed edges of a way."""
    ends = np.array([(s, s) if isinstance(s, int) else s[:2] for s in way])
    share = np.array([0.0 if isinstance(s, int) else s[2] for s in way])
    weights = np.stack([1.0 - share, share], axis=1)
    p = np.einsum("nk,nkp->np", weights, eset.points.p[ends])
    folded = np.isin(eset.kinds, (FOLD, CORNER, CROSSING))[ends]
    some = np.flatnonzero(folded.any(axis=1) & ~folded.all(axis=1))
    weights[some] = rooted(weights[some], folded[some])
    z = np.einsum("nk,nki->ni", weights, eset.points.z[ends])
    amid = np.flatnonzero(share > 0.0)
    z[amid], good, _ = exact_states(eset.structure, z[amid], p[amid])
    kept = np.ones(len(way), bool)
    kept[amid] = good
    return States(eset.structure, z[kept], p[kept])


def _charts_of(
    eset: EquilibriumSet, chart: Int[np.ndarray, " C"], way: Way
) -> Int[np.ndarray, " steps"]:
    """Chart of each step of a way: that of a cell which holds both of its ends."""
    out: list[int] = []
    for one, other in pairwise(way):
        held = {*(one[:2] if not isinstance(one, int) else (one,))}
        held |= {*(other[:2] if not isinstance(other, int) else (other,))}
        around = np.flatnonzero(np.isin(eset.cells, list(held)).sum(axis=1) == len(held))
        known = chart[around].tolist()
        out.append(out[-1] if out and out[-1] in known else int(known[0]))
    return np.array(out, int)

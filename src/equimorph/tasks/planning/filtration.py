"""Stable cells joined through their facets, the lowest first: where a level parts two states.

The objective is the largest of its branches and linear between vertices. Then all places of a cell
below a level, within the constraints, are one convex piece, and two cells are joined at the least
value on the facet between them: the lowest way between two states is that in a minimum spanning
tree of the cells.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from equimorph.arrays import Facets, Float, Int, Items, ItemValues, Pairs, Some
from equimorph.linalg.graphs import walk_back
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.topology import adjacency
from equimorph.model import Constraint
from equimorph.tasks.optimising.programme import Branches, Objective, match_branches
from equimorph.tasks.stable_part import SLACK, stable_values

Shares = Float[np.ndarray, "n d"]


@dataclass(frozen=True)
class Passages:
    """Stable cells of a set, pairs of them that share a facet (as rows), and these facets."""

    cells: Some
    links: Pairs
    facets: Facets

    def between(self, path: Items) -> Int[np.ndarray, " steps"]:
        """Numbers of the links between one cell of a path and the next."""
        steps = np.sort(np.stack([path[1:], path[:-1]], axis=1), axis=1)
        codes, order = self._codes
        return np.asarray(order[np.searchsorted(codes, self._code(steps))])

    @cached_property
    def _codes(self) -> tuple[Items, Items]:
        """One number for each link, increasing, and the links in this order."""
        codes = self._code(np.sort(self.links, axis=1))
        order = np.argsort(codes)
        return codes[order], order

    def _code(self, pairs: Pairs) -> Items:
        return np.asarray(pairs @ np.array([len(self.cells), 1]))


def passages_of(eset: EquilibriumSet) -> Passages:
    """Stable cells and the facets between them; kept with the set."""
    found: Passages = from_cache(eset, "passages", lambda: _passages(eset))
    return found


def _passages(eset: EquilibriumSet) -> Passages:
    cells = np.flatnonzero(eset.cell_index == 0)
    whole = adjacency(eset.cells[cells])
    facets = whole.facets[whole.across]
    inside = whole.manifold & (eset.kinds[facets] != VertexKind.CROSSING).any(axis=1)
    return Passages(cells, whole.links[inside], facets[inside])


@dataclass(frozen=True)
class Filtration:
    """Facets between stable cells, and the level at which each of them opens."""

    eset: EquilibriumSet
    objective: Objective
    constraints: tuple[Constraint, ...]
    """The set, what is kept low, and the bounds in addition to those of the set."""
    passages: Passages
    """Stable cells and the facets between them."""
    level: ItemValues
    """Least value on each facet within the constraints; ∞ where nothing obeys them."""
    shares: Shares
    """Where on the facet it is, in barycentric coordinates."""

    @classmethod
    def of(
        cls, eset: EquilibriumSet, objective: Objective, constraints: tuple[Constraint, ...]
    ) -> "Filtration":
        """Levels by the values at the vertices, without kinks between these."""
        passages = passages_of(eset)
        none = np.full(len(passages.facets), np.inf)
        shut = cls(eset, objective, constraints, passages, none, np.zeros(passages.facets.shape))
        values = objective.sign * stable_values(eset, objective.descriptor)
        return shut._open(np.arange(len(none)), values[passages.facets])

    def with_kinks(self, some: Items) -> "Filtration":
        """The same with some facets opened where branches of the objective cross on them."""
        facets = self.passages.facets[some]
        vertices, place = np.unique(facets, return_inverse=True)
        states = self.eset.points[vertices]
        known = self.objective.branches(states.z, states.p)
        place = place.reshape(facets.shape)
        return self._open(some, known[0].max(axis=1)[place], known, place)

    def _open(
        self,
        some: Items,
        values: Shares,
        known: Branches | None = None,
        place: Facets | None = None,
    ) -> "Filtration":
        """Facets opened at the least values on their edges, if these are lower than before.

        known, place: branches that cross on edges, and their rows for each vertex of the facets.
        """
        level, shares = self.level.copy(), self.shares.copy()
        corners = values.shape[1]
        excess = self._excess(some)
        for i, j in combinations(range(corners), 2) if corners > 1 else ((0, 0),):
            lines = values[:, [i, j, i, j]].reshape(-1, 2, 2)
            if known is not None and place is not None:
                lines = _crossing_lines(known, place[:, i], place[:, j])
            t, least = _least_between(lines, *_window(excess[:, :, i], excess[:, :, j]))
            lower = np.flatnonzero(least < level[some])
            at = some[lower]
            level[at], shares[at] = least[lower], 0.0
            shares[at, i] = 1.0 - t[lower] if i != j else 1.0
            if i != j:
                shares[at, j] = t[lower]
        return replace(self, level=level, shares=shares)

    def _excess(self, some: Items) -> Float[np.ndarray, "k n d"]:
        """Excess over the constraints at the vertices of facets."""
        facets = self.passages.facets[some]
        rows = [
            (1.0 if each.sense == "<=" else -1.0)
            * (stable_values(self.eset, each.descriptor) - each.bound)[facets]
            - SLACK * each.size
            for each in self.constraints
        ]
        return np.array(rows).reshape(len(rows), *facets.shape)

    def way(self, first: int, last: int) -> Items | None:
        """Links of the lowest way between two cells of the set, in turn; None if there is none."""
        links, count = self.passages.links, len(self.passages.cells)
        passable = np.flatnonzero(self.level < np.inf)
        rank = np.empty(len(passable), int)
        rank[np.argsort(self.level[passable], kind="stable")] = np.arange(1, len(passable) + 1)
        graph = coo_array((rank, links[passable].T), shape=(count, count))
        tree = minimum_spanning_tree(graph.tocsr())
        start, goal = np.searchsorted(self.passages.cells, [first, last]).tolist()
        _, before = breadth_first_order(tree, start, directed=False)
        path = walk_back(before, start, goal)
        return None if path is None else self.passages.between(path)


def _crossing_lines(known: Branches, first: Items, second: Items) -> Float[np.ndarray, "n 2 2"]:
    """Values at both ends of edges of the branch that is largest at each end."""
    values, places = known
    one, other = ((values[each], places[each]) for each in (first, second))
    ahead, back = match_branches(one, other), match_branches(other, one)
    lane = np.arange(len(first))
    top, last = one[0].argmax(axis=1), other[0].argmax(axis=1)
    columns = (one[0][lane, top], ahead[lane, top], back[lane, last], other[0][lane, last])
    return np.stack(columns, axis=1).reshape(-1, 2, 2)


def _window(
    first: Float[np.ndarray, "k n"], second: Float[np.ndarray, "k n"]
) -> tuple[ItemValues, ItemValues]:
    """Part of edges on which linear excesses are not positive; empty where it ends before 0."""
    low, high = np.zeros(first.shape[1]), np.ones(first.shape[1])
    for one, other in zip(first, second, strict=True):
        with np.errstate(all="ignore"):
            root = np.nan_to_num(one / (one - other), nan=0.5)
        low = np.where(one > 0.0, np.maximum(low, root), low)
        high = np.where(other > 0.0, np.minimum(high, root), high)
        high = np.where((one > 0.0) & (other > 0.0), -1.0, high)
    return low, high


def _least_between(
    lines: Float[np.ndarray, "n 2 2"], low: ItemValues, high: ItemValues
) -> tuple[ItemValues, ItemValues]:
    """Place and value of the least larger one of two lines on parts of edges; ∞ on empty parts."""
    with np.errstate(all="ignore"):
        gap = lines[:, 0] - lines[:, 1]
        kink = np.nan_to_num(gap[:, 0] / (gap[:, 0] - gap[:, 1]), nan=0.0)
        tried = np.stack([low, high, np.clip(kink, low, high)])
        between = (1.0 - tried)[:, :, None] * lines[:, :, 0] + tried[:, :, None] * lines[:, :, 1]
    between = np.where(tried[:, :, None] == 0.0, lines[:, :, 0], between)
    between = np.where(tried[:, :, None] == 1.0, lines[:, :, 1], between)
    value = np.nan_to_num(between.max(axis=2), nan=np.inf)
    value = np.where(low <= high, value, np.inf)
    best, lane = value.argmin(axis=0), np.arange(len(low))
    return tried[best, lane], value[best, lane]

"""`dissect`: a set cut into few charts over the free parameters."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, CellNumbers, Int, ItemValues, Pairs, VertexNumbers
from equimorph.charts.atlas import Atlas
from equimorph.charts.conflicts import conflicts_of, least_cut
from equimorph.charts.coordinates import Coordinates, coordinates_of
from equimorph.charts.location import Cells
from equimorph.charts.paths import Ground, Walker, Way, straightest_path
from equimorph.charts.preparation import cut_along_crossings, with_cusp_vertices
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.equilibrium_set import check_cells
from equimorph.manifold.complex.excerpts import Excerpt, excerpt_of
from equimorph.manifold.complex.marked_complex import Fabric
from equimorph.manifold.complex.vertices import Vertices, free_vertices
from equimorph.manifold.geometry.exact_points import Corrected
from equimorph.manifold.geometry.topology import (
    chains,
    count_corners,
    flags_of,
    keys_of,
    labels,
)
from equimorph.manifold.lookup.exact_states import exact_states
from equimorph.manifold.queries.levels import whole_set
from equimorph.structures import States
from equimorph.tolerances import SAME_NUMBER

MOST = 40
"""Largest number of cuts; overlaps that remain are listed by `Atlas`."""


@check_arguments
def dissect(eset: EquilibriumSet) -> Atlas:
    """Cut a set, or a part of one, into few charts over the free parameters.

    Folds separate strata. A stratum that overlaps itself is cut between the overlapping cells,
    along the minimum cut of its dual graph with lengths in scaled parameters. Over two parameters a
    cut is then pulled straight, from cusp to cusp where it ends at them, and the cells are cut
    exactly along it.

    Parameters
    ----------
    eset
        The set; for its stable part pass ``part(eset, eset.cell_index == 0)``.

    Returns
    -------
    Charts, each single-valued, with the transitions between them.

    Raises
    ------
    InputError
        If the set is empty.
    """
    check_cells(eset)
    eset, cusps = with_cusp_vertices(cut_along_crossings(eset))
    work = _Work.of(eset, cusps)
    if len(eset.names) > 1:
        open_ = list(range(len(eset.strata)))
        for _ in range(MOST):
            if not open_:
                break
            work, more = work.cut_chart(open_.pop(0))
            open_ += more
    index = np.array([stratum.index for stratum in eset.strata])
    fabric = replace(work.fabric, cell_index=index[work.origin[work.fabric.cell_index]])
    whole = eset
    if len(fabric.vertices) > len(eset.points):
        whole = whole_set(work.excerpt.put_back(fabric))
    _, label = np.unique(work.fabric.cell_index, return_inverse=True)
    order = np.argsort(-np.bincount(label), kind="stable")
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order))
    family = work.origin[work.fabric.cell_index]
    return Atlas(whole, rank[label], family)


@dataclass(frozen=True, eq=False)
class _Work:
    """A set that is being cut: a fabric whose cells are numbered by chart instead of index."""

    excerpt: Excerpt
    """The set that was given, all of it."""
    fabric: Fabric
    """Its cells, cut; ``fabric.cell_index`` is the number of their chart."""
    origin: Int[np.ndarray, " charts"]
    """Stratum of each chart."""
    cusps: VertexNumbers
    """Vertices at cusps."""

    @classmethod
    def of(cls, eset: EquilibriumSet, cusps: VertexNumbers) -> "_Work":
        """Nothing is cut: charts are strata."""
        every = np.ones(len(eset.cells), bool)
        excerpt = excerpt_of(eset, every, np.zeros(len(eset.points), bool))
        number = np.arange(len(eset.strata))
        fabric = replace(excerpt.fabric, cell_index=eset.stratum.copy())
        return cls(excerpt, fabric, number, np.searchsorted(excerpt.used, cusps))

    @property
    def eset(self) -> EquilibriumSet:
        """The set that was given."""
        return self.excerpt.eset

    def cells(self, chart: int) -> tuple[Cells, Int[np.ndarray, " own"]]:
        """Cells of a chart in the plane of parameters, and their numbers."""
        own = np.flatnonzero(self.fabric.cell_index == chart)
        store = self.fabric.vertices
        index = np.array([stratum.index for stratum in self.eset.strata])
        drawn = replace(
            self.eset,
            points=States(self.eset.structure, store.z, store.p),
            kinds=store.kinds,
            index=store.index,
            grid_vertex=store.grid_vertex,
            cells=self.fabric.cells,
            component=np.zeros_like(self.fabric.cell_index),
            stratum=self.fabric.cell_index,
            cell_index=index[self.origin[self.fabric.cell_index]],
        )
        return Cells(drawn, self._coordinates, own), own

    @property
    def _coordinates(self) -> Coordinates:
        return coordinates_of(self.eset, self.eset.names)

    def cut_chart(self, chart: int) -> tuple["_Work", list[int]]:
        """The same with a chart cut once, and the charts to look at again."""
        cells, own = self.cells(chart)
        colour = conflicts_of(cells, self.cusps).colour
        if not (colour >= 0).any():
            return self, []
        side = least_cut(cells, colour == 0, colour > 0)
        straight = self._straight(chart, cells, side, colour < 0)
        if straight is not None:
            return straight
        number = len(self.origin)
        label = self.fabric.cell_index.copy()
        label[own[side]] = number
        return self._relabel(label, chart), [chart, number]

    def _relabel(self, label: CellNumbers, chart: int) -> "_Work":
        more = int(label.max()) + 1 - len(self.origin)
        origin = np.concatenate([self.origin, np.full(max(more, 0), self.origin[chart])])
        return replace(self, fabric=replace(self.fabric, cell_index=label), origin=origin)

    def _straight(
        self,
        chart: int,
        cells: Cells,
        side: Bool[np.ndarray, " own"],
        alone: Bool[np.ndarray, " own"],
    ) -> tuple["_Work", list[int]] | None:
        """The chart cut along straight lines, if these part what the cut parted."""
        if self.fabric.dimension != 2:
            return None
        places = cells.values / cells.coordinates.setting.scales
        ground = Ground(cells.corners, places, cells.whole)
        clear, free = Walker(ground, alone), Walker(ground, np.ones_like(alone))
        ways = [straightest_path(clear, free, path) for path in _paths(cells, side)]
        cut = _insert_crossings(self.fabric, ways)
        if cut is None:
            return None
        fabric, facets = cut
        work = replace(self, fabric=fabric)
        drawn_cells, own = work.cells(chart)
        whole = drawn_cells.whole
        wall = flags_of(whole.facets, facets)
        piece = labels(len(own), whole.links[~wall[whole.across]])
        if piece.max() == 0:
            return None
        label = fabric.cell_index.copy()
        numbers = np.concatenate([[chart], len(self.origin) + np.arange(piece.max())])
        label[own] = numbers[piece]
        return work._relabel(label, chart), numbers.tolist()


def _paths(cells: Cells, side: Bool[np.ndarray, " own"]) -> list[list[int]]:
    """Chains of edges between both sides of a cut."""
    whole = cells.whole
    a, b = whole.links.T
    return [chain.tolist() for chain in chains(whole.facets[whole.across[side[a] != side[b]]])]


def _insert_crossings(fabric: Fabric, ways: list[Way]) -> tuple[Fabric, Pairs] | None:
    """The fabric with exact vertices where straight ways cross edges, and the edges along them."""
    crossings: dict[tuple[int, int], float] = {}
    for a, b, share in (step for way in ways for step in way if not isinstance(step, int)):
        key, own = ((a, b), share) if a < b else ((b, a), 1.0 - share)
        # two ways over one edge would need two vertices on it
        if abs(crossings.setdefault(key, own) - own) > SAME_NUMBER:
            return None
    number = {key: len(fabric.vertices) + k for k, key in enumerate(crossings)}
    if crossings:
        ends = np.array(list(crossings))
        new = _amid(fabric, ends, np.array(list(crossings.values())))
        if new is None:
            return None
        fabric = fabric.bisect(ends, new)
    wall = np.array([pair for way in ways for pair in pairwise(_numbers(way, number))], int)
    base, wall = len(fabric.vertices), wall.reshape(-1, 2)
    on = np.zeros(base, bool)
    on[wall] = True
    beside = fabric.cells[count_corners(on, fabric.cells) > 1]
    pairs = [beside[:, list(two)] for two in ((0, 1), (1, 2), (0, 2))]
    known = np.concatenate([keys_of(pair, base) for pair in pairs])
    return (fabric, wall) if np.isin(keys_of(wall, base), known).all() else None


def _numbers(way: Way, number: dict[tuple[int, int], int]) -> list[int]:
    """Vertices of a way whose crossed edges have been given vertices."""
    return [step if isinstance(step, int) else number[min(step[:2]), max(step[:2])] for step in way]


def _amid(fabric: Fabric, ends: Pairs, share: ItemValues) -> Vertices | None:
    """Exact vertices over points between the ends of edges, if there are any."""
    store, setting = fabric.vertices, fabric.setting
    weights = np.stack([1.0 - share, share], axis=1)
    z, p = (np.einsum("nk,nki->ni", weights, column[ends]) for column in (store.z, store.p))
    z, good, index = exact_states(setting.structure, z, p)
    lowest = store.index[ends].min(axis=1)
    if not (good & (index == lowest)).all():
        return None
    frames = np.zeros((len(z), *store.frame.shape[1:]))  # which nobody asks for
    return free_vertices(setting, Corrected(z, p, frames, index, good))

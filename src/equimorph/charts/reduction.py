"""`reduce`: at most one preferred state over each point, with barriers and gaps.

The preferred part is cut exactly where the preference changes.

See docs/decisions.md, "Preferences are asked, not modelled".
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import (
    Bool,
    Float,
    Int,
    ItemFlags,
    Items,
    Points,
    VertexFlags,
)
from equimorph.charts.barriers import Barrier, barriers_of, gaps_of
from equimorph.charts.chart import Chart, Charted, PointStatus
from equimorph.charts.coordinates import Coordinates, coordinates_of
from equimorph.charts.domain import Domain
from equimorph.charts.location import Cells
from equimorph.charts.preference import Preference
from equimorph.charts.preference_changes import Straight, locate_changes
from equimorph.charts.preparation import cut_along_crossings, with_cusp_vertices
from equimorph.charts.rules import Rule, Scores, rule_of
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.cuts import Ends, cut_between
from equimorph.manifold.complex.equilibrium_set import check_cells
from equimorph.manifold.complex.excerpts import changing_cells, excerpt_of
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.manifold.complex.marked_complex import Fabric, edges_of
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.points import VertexKind, are_singular, on_fold
from equimorph.manifold.geometry.topology import keys_of
from equimorph.manifold.queries.levels import part_of
from equimorph.model import Constraint, Descriptor
from equimorph.structures import States
from equimorph.structures.metric import metric_length
from equimorph.tables import html_table
from equimorph.tolerances import IN_BOX

ON_BARRIER = 1e-9
"""Distance from a barrier, in ranges of the parameters, within which points lie on it."""
BESIDE, MOVED = 0.02, 0.3
"""Distance from a fold, in lengths of edges, at which the preference is examined, and the largest
distance of its state there: at a cusp it is the cube root of the first."""


@dataclass(frozen=True, eq=False, repr=False)
class Reduction(Chart):
    """The free parameters as coordinates of preferred states.

    The preferred state is determined separately and exactly for every requested point.

    Parameters
    ----------
    eset
        The preferred part of the set, cut exactly along barriers and gaps, as a set. Tasks
        take it together with `constraint`.
    whole
        The set that was reduced, with vertices at its cusps.
    rule
        Rule by which a state is preferred.
    among
        Cells of the whole set among which the rule chooses.
    cut
        Vertices of the preferred part at which the preference changes.
    barriers
        Curves across which neighbouring points do not have neighbouring states.
    lost
        Edges of the set on which no end of the preferred part was found.
    """

    whole: EquilibriumSet
    rule: Rule
    among: Int[np.ndarray, " own"]
    cut: VertexFlags
    barriers: tuple[Barrier, ...]
    lost: int

    def __repr__(self) -> str:
        """Rule, barriers and gaps."""
        return (
            f"Reduction({self.rule}: {len(self.barriers)} barriers, {len(self.gaps.loops)} gaps "
            f"on {self.whole})"
        )

    def _repr_html_(self) -> str:
        """Table of rule, barriers and gaps, for notebooks."""
        rows = [["preferred", str(self.rule)], ["over", ", ".join(self.whole.names)]]
        rows += [["barriers", f"{len(self.barriers)}"], ["gaps", f"{len(self.gaps.loops)}"]]
        rows += [["size of the gaps", f"{self.gaps.size:.6g}"], ["ends not found", f"{self.lost}"]]
        return html_table("Reduction", [], rows)

    @cached_property
    def coordinates(self) -> Coordinates:
        """The free parameters."""
        return coordinates_of(self.whole, self.whole.names)

    @cached_property
    def preference(self) -> Preference:
        """The rule, ready for the set."""
        return Preference(_candidates(self.whole, self.among), self.rule.on(self.whole))

    @cached_property
    def cells(self) -> Cells:
        """The preferred cells."""
        return Cells(self.eset, self.coordinates, np.arange(len(self.eset.cells)), self.cut)

    @cached_property
    def gaps(self) -> Domain:
        """Points of the box without a state."""
        return gaps_of(self.domain, self.eset.box, self.cells.extent)

    @check_arguments
    def state(self, coords: Points) -> Charted:
        """Preferred states over points; see `Chart.state`."""
        points = self._check_width(coords)
        found = self.preference.over(points)
        code = np.full(len(points), PointStatus.GAP)
        code[found.point] = PointStatus.INSIDE
        beyond = ~self.eset.box.holds(points, slack=IN_BOX)
        code[beyond] = PointStatus.BEYOND_THE_BOX
        code[self._on_barrier(points) & ~beyond] = PointStatus.BARRIER
        return self._answers(found.take(code[found.point] == PointStatus.INSIDE), code)

    @cached_property
    def constraint(self) -> Constraint:
        """The constraint that states are the preferred ones.

        Tasks that lift, track, solve or optimise take it with their other constraints: over the
        preferred part alone, Newton's method may end beyond a barrier.
        """
        return Descriptor("not preferred", "", self.preference.excess) <= 0.0

    def _on_barrier(self, points: Points) -> Bool[np.ndarray, " points"]:
        on = np.zeros(len(points), bool)
        size = self.eset.box.upper - self.eset.box.lower
        for barrier in self.barriers:
            on |= barrier.distance(points, size) <= ON_BARRIER
        return on


@check_arguments
def reduce(
    eset: EquilibriumSet, *, prefer: Rule | Callable[[States], Scores], stable: bool = True
) -> Reduction:
    """Reduce a set to at most one preferred state over each point.

    Vertices over which another state is preferred are left out, and edges between preferred and
    other vertices are cut where the preference changes: at ties of scores, ends of other sheets and
    ends of paths, which Newton's method finds and the exact choice on both sides confirms. Edges
    without such a place are bisected.

    Parameters
    ----------
    eset
        The set.
    prefer
        `quasi_static`, `first_stable_on_path`, `lowest`, `highest`, `nearest`, or a function of
        states whose least value is preferred.
    stable
        Whether the rule chooses among stable states only.

    Returns
    -------
    A single-valued chart with its barriers and gaps.

    Raises
    ------
    InputError
        If the set is empty or has no stable states, or the rule does not fit the set or prefers no
        state at all.
    """
    check_cells(eset)
    eset, _ = with_cusp_vertices(cut_along_crossings(eset))
    rule = rule_of(prefer)
    among = np.flatnonzero((eset.cell_index == 0) | (not stable))
    if len(among) == 0:
        raise InputError("`eset` must have stable states; got none. Pass stable=False.")
    cells = _candidates(eset, among)
    preference = Preference(cells, rule.on(eset))
    chosen, cut, lost = _preferred_part(preference)
    if len(chosen.cells) == 0:
        raise InputError(f"`prefer` must prefer some states of the set; got {rule}.")
    own = Cells(chosen, cells.coordinates, np.arange(len(chosen.cells)), cut)
    return Reduction(chosen, eset, rule, among, cut, barriers_of(own, preference), lost)


def _candidates(eset: EquilibriumSet, among: Int[np.ndarray, " own"]) -> Cells:
    """Cells among which rules choose, with tables that are kept with the set."""
    stable = len(among) < len(eset.cells)
    return from_cache(
        eset,
        ("candidates", stable),
        lambda: Cells(eset, coordinates_of(eset, eset.names), among),
    )


def _preferred_part(preference: Preference) -> tuple[EquilibriumSet, VertexFlags, int]:
    """The preferred part of a set, which of its vertices lie on cuts, and edges without a cut."""
    eset = preference.cells.eset
    among = np.zeros(len(eset.cells), bool)
    among[preference.cells.numbers] = True
    values = _signs(preference)
    # only candidates are cut: their neighbours beyond folds play no part
    excerpt = excerpt_of(eset, among & changing_cells(eset.cells, values))
    own = values[excerpt.used]
    crossings = _Crossings(preference, excerpt.fabric, own)
    cut = cut_between(excerpt.fabric, own, crossings.between)
    recut = excerpt.put_back(cut.fabric)
    values = np.concatenate([values, cut.values[len(own) :]])
    inside = (values[recut.cells] <= 0.0).all(axis=1)
    inside[: len(among)] &= among
    used = np.unique(recut.cells[inside])
    return part_of(recut, inside, values == 0.0, cut.lost), values[used] == 0.0, cut.lost


class _Crossings:
    """Vertices at which the preference changes on edges, all found at once.

    Cuts lead from new vertices, on which the preference is neither, so that no edge is crossed that
    is not crossed before anything is cut.
    """

    def __init__(
        self, preference: Preference, fabric: Fabric, values: Float[np.ndarray, " V"]
    ) -> None:
        ends, of_cells = edges_of(fabric.cells, len(fabric.vertices))
        crossed = values[ends[:, 0]] * values[ends[:, 1]] < 0.0
        marks = fabric.edge_marks(ends)
        lowest = np.full(len(ends), np.iinfo(int).max)
        for side in of_cells.T:
            np.minimum.at(lowest, side, fabric.cell_index)
        self._base = len(fabric.vertices)
        way = Straight(fabric, ends[crossed], marks[crossed], lowest[crossed])
        done, self._found, cusp = locate_changes(preference, way, values[ends[crossed]])
        changed = np.flatnonzero(cusp >= 0)
        values[way.ends[changed, cusp[changed]]] = 0.0
        self._keys = keys_of(way.ends[done], self._base)

    def between(
        self, fabric: Fabric, ends: Ends, mark: int, index: Items, known: Float[np.ndarray, "n 2"]
    ) -> tuple[ItemFlags, Vertices]:
        """Those on some edges; see `cut_between`."""
        wanted = keys_of(ends, self._base)
        done = np.isin(wanted, self._keys) & (ends < self._base).all(axis=1)
        order = np.argsort(self._keys)
        return done, self._found.take(order[np.searchsorted(self._keys[order], wanted[done])])


def _signs(preference: Preference) -> Float[np.ndarray, " V"]:
    """−1 at preferred vertices, 1 elsewhere."""
    eset, corners = preference.cells.eset, preference.cells.corners
    values = np.ones(len(eset.points))
    used = np.unique(corners)
    met = used[eset.kinds[used] == VertexKind.CROSSING]
    values[met] = np.where(_preferred_beside(preference, met), -1.0, 1.0)
    used = used[eset.kinds[used] != VertexKind.CROSSING]
    if preference.choice.score is not None:  # those of states on folds are as good as others
        states, found = eset.points[used], preference.cells.over_vertices[1]
        values[used] = np.where(preference.prefers(states.z, states.p, found), -1.0, 1.0)
        return values
    folded = on_fold(eset.kinds)
    # paths to a fold end just before it or there: look a little way off first
    beside = _preferred_beside_folds(preference, used[folded[used]], folded)
    values[beside] = -1.0
    used = used[values[used] > 0.0]
    states = eset.points[used]
    values[used] = np.where(preference.prefers(states.z, states.p), -1.0, 1.0)
    return values


def _preferred_beside_folds(preference: Preference, some: Items, folded: VertexFlags) -> Items:
    """Those of some vertices on folds whose sheets are preferred a little way off the folds."""
    eset, points = preference.cells.eset, preference.cells.values
    fold, other = _neighbours_off_folds(preference.cells.corners, some, folded)
    there = preference.over((1.0 - BESIDE) * points[fold] + BESIDE * points[other])
    z, structure = eset.points.z, eset.structure
    far = metric_length(structure, there.states.z - z[fold[there.point]])
    side = metric_length(structure, z[other[there.point]] - z[fold[there.point]])
    return np.asarray(fold[there.point[far < MOVED * side]])


def _neighbours_off_folds(
    corners: Int[np.ndarray, "C corners"], some: Items, folded: VertexFlags
) -> tuple[Items, Items]:
    """Those of some vertices that have neighbours off folds, and the first of these of each."""
    wanted = np.zeros(len(folded), bool)
    wanted[some] = True
    corners = corners[wanted[corners].any(axis=1)]
    two = list(permutations(range(corners.shape[1]), 2))
    pairs = np.concatenate([corners[:, list(each)] for each in two])
    pairs = pairs[wanted[pairs[:, 0]] & ~folded[pairs[:, 1]]]
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    first = pairs[np.diff(pairs[:, 0], prepend=-1) > 0]
    return first[:, 0], first[:, 1]


def _preferred_beside(preference: Preference, met: Items) -> ItemFlags:
    """Whether the sheet of each vertex at a crossing is preferred next to that vertex."""
    eset, corners = preference.cells.eset, preference.cells.corners
    out = np.zeros(len(met), bool)
    two = list(permutations(range(corners.shape[1]), 2))
    pairs = np.concatenate([corners[:, list(each)] for each in two])
    cell = np.tile(preference.cells.numbers, len(two))
    regular = ~are_singular(eset.kinds)
    kept = np.flatnonzero(np.isin(pairs[:, 0], met) & regular[pairs[:, 1]])
    _, first = np.unique(pairs[kept, 0], return_index=True)
    vertex, other = pairs[kept[first]].T
    points = preference.cells.values
    there = preference.over((1.0 - BESIDE) * points[vertex] + BESIDE * points[other])
    own = eset.stratum[there.cell] == eset.stratum[cell[kept[first]][there.point]]
    out[np.searchsorted(met, vertex[there.point[own]])] = True
    return out

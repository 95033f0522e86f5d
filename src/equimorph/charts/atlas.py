"""An atlas: charts that together cover a set, and the transitions between them."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import CellNumbers, Int, ItemFlags, Items, Points
from equimorph.charts.chart import Chart
from equimorph.charts.coordinates import Coordinates, coordinates_of
from equimorph.charts.location import Cells, EdgeKind, Found
from equimorph.charts.paths import AtlasPath, Place, path_over_cells
from equimorph.charts.preparation import crossing_facets, first_copies
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import Adjacency, facets_of, flags_of, pieces
from equimorph.structures import State, States
from equimorph.tolerances import SAME_SOLUTION

ON_CURVE = 1e-6
"""Distance from a transition, in ranges of the parameters, within which points lie on it."""


@dataclass(frozen=True, eq=False, repr=False)
class Leaf(Chart):
    """A chart of an atlas: some cells of a set over the free parameters.

    Parameters
    ----------
    numbers
        The cells.
    family
        All cells of the stratum that they were cut from.
    """

    numbers: Int[np.ndarray, " own"]
    family: Cells

    @property
    def coordinates(self) -> Coordinates:
        """The free parameters."""
        return self.family.coordinates

    @property
    def index(self) -> int:
        """Index of the states; 0 is stable."""
        return int(self.eset.cell_index[self.numbers[0]])

    @cached_property
    def cells(self) -> Cells:
        """The chart's cells."""
        return Cells(self.eset, self.coordinates, self.numbers)

    def find(self, points: Points) -> Found:
        """States on the chart's cells: what lies beyond a cut belongs to another chart."""
        found = self.family.find(points)
        return found.take(np.isin(found.cell, self.numbers))


@dataclass(frozen=True, eq=False)
class Transition:
    """A curve along which two charts meet.

    Parameters
    ----------
    charts
        Numbers of both charts.
    kind
        "cut" inside a stratum, "fold", or "crossing" of sheets.
    states
        Exact states along it.
    coords
        Their coordinates in each of both charts; equal rows belong together.
    facets
        Connectivity of the states: along a polyline, or as triangles.
    """

    charts: tuple[int, int]
    kind: str
    states: States
    coords: tuple[Points, Points]
    facets: Int[np.ndarray, "..."]

    def __repr__(self) -> str:
        """Charts, kind and number of points."""
        return f"Transition({self.charts[0]} – {self.charts[1]}: {self.kind} of {len(self.states)})"

    @check_arguments
    def cross(self, coords: Points, source: int) -> Points:
        """Coordinates in the other chart of points on the curve.

        Between two states the curve is a chord in either chart; points keep their relative position
        on it.

        Raises
        ------
        InputError
            If `source` is neither of the two charts, or points do not lie on the curve.
        """
        if source not in self.charts:
            raise InputError(f"`source` must be one of {self.charts}; got {source!r}.")
        ours, theirs = self.coords if source == self.charts[0] else self.coords[::-1]
        if ours.shape[1] != 2:
            raise InputError("`cross` needs an atlas over two parameters.")
        a, b = ours[:-1], ours[1:]
        size = np.maximum(np.ptp(ours, axis=0).max(), 1e-300)
        along = b - a
        squared = np.maximum((along**2).sum(axis=1), 1e-300)
        reach = coords[:, None] - a
        share = np.clip((reach * along).sum(axis=2) / squared, 0.0, 1.0)
        gap = np.linalg.norm(reach - share[:, :, None] * along, axis=2)
        best = gap.argmin(axis=1)
        row = np.arange(len(coords))
        if len(coords) and gap[row, best].max() > ON_CURVE * size:
            worst = coords[gap[row, best].argmax()].tolist()
            raise InputError(f"`coords` must lie on the transition; got {worst}.")
        t = share[row, best][:, None]
        return np.asarray(theirs[best] + t * (theirs[best + 1] - theirs[best]))


@dataclass(frozen=True, eq=False)
class Atlas:
    """Charts over the free parameters that together cover a set, each state once.

    Parameters
    ----------
    eset
        The set, cut exactly along the borders of the charts.
    chart
        Number of the chart of each cell.
    family
        Number of the stratum that each cell was cut from.
    """

    eset: EquilibriumSet
    chart: CellNumbers
    family: CellNumbers

    def __repr__(self) -> str:
        """How many charts and transitions."""
        kinds = [transition.kind for transition in self.transitions]
        return (
            f"Atlas({len(self.charts)} charts, {kinds.count('cut')} cuts, "
            f"{kinds.count('fold')} folds on {self.eset})"
        )

    def __len__(self) -> int:
        """Number of charts."""
        return len(self.charts)

    @cached_property
    def coordinates(self) -> Coordinates:
        """The free parameters."""
        return coordinates_of(self.eset, self.eset.names)

    @cached_property
    def charts(self) -> tuple[Leaf, ...]:
        """The charts, the largest first."""
        families = {
            number: Cells(self.eset, self.coordinates, np.flatnonzero(self.family == number))
            for number in np.unique(self.family).tolist()
        }
        out = []
        for k in range(self.chart.max(initial=-1) + 1):
            own = np.flatnonzero(self.chart == k)
            out.append(Leaf(self.eset, own, families[int(self.family[own[0]])]))
        return tuple(out)

    @property
    def whole(self) -> Adjacency:
        """Which cells share facets."""
        return self.eset.adjacency

    @cached_property
    def transitions(self) -> tuple[Transition, ...]:
        """Curves along which charts meet."""
        a, b = self.chart[self.whole.links].T
        across = np.flatnonzero(a != b)
        pairs = np.sort(np.stack([a, b], axis=1)[across], axis=1)
        facets = self.whole.facets[self.whole.across[across]]
        folded = flags_of(facets, facets_of(self.eset.folds, facets.shape[1]))
        values = self.eset.coordinates
        out = []
        for i, j in np.unique(pairs, axis=0).tolist():
            for kind, flags in ((EdgeKind.CUT, ~folded), (EdgeKind.FOLD, folded)):
                own = facets[(pairs == (i, j)).all(axis=1) & flags]
                for piece in pieces(own):
                    used = piece if piece.ndim == 1 else np.unique(piece)
                    local = (
                        np.arange(len(used)) if piece.ndim == 1 else np.searchsorted(used, piece)
                    )
                    both = (values[used], values[used].copy())
                    states = self.eset.points[used]
                    out.append(Transition((i, j), kind, states, both, local))
        return (*out, *self._crossings())

    def _crossings(self) -> list[Transition]:
        """Curves along which charts of sheets that cross meet, pair by pair."""
        flags = crossing_facets(self.eset, self.whole)
        if not flags.any():
            return []
        cell, corner = np.nonzero(flags[self.whole.cell_facets])
        copies = first_copies(self.eset)
        facets = np.sort(copies[self.whole.facets[self.whole.cell_facets[cell, corner]]], axis=1)
        charts: dict[tuple[int, ...], set[int]] = {}
        for row, chart in zip(facets.tolist(), self.chart[cell].tolist(), strict=True):
            charts.setdefault(tuple(row), set()).add(chart)
        meeting: dict[tuple[int, int], list[tuple[int, ...]]] = {}
        for row, own in charts.items():
            for pair in combinations(sorted(own), 2):
                meeting.setdefault(pair, []).append(row)
        out = []
        for pair, rows in sorted(meeting.items()):
            for piece in pieces(np.array(sorted(rows))):
                used = piece if piece.ndim == 1 else np.unique(piece)
                local = np.arange(len(used)) if piece.ndim == 1 else np.searchsorted(used, piece)
                at = self.eset.coordinates[used]
                both = (at, at.copy())
                out.append(Transition(pair, EdgeKind.CROSSING, self.eset.points[used], both, local))
        return out

    @check_arguments
    def locate(self, states: States | State) -> tuple[Items, Points]:
        """Numbers of the charts of states, −1 without a chart, and their coordinates."""
        batch = states.batch if isinstance(states, State) else states
        points = self.coordinates(batch.z, batch.p)
        cell = self.cell_of(batch)
        return np.where(cell >= 0, self.chart[cell], -1), points

    @check_arguments
    def cell_of(self, batch: States) -> Items:
        """Cell that each state lies on, −1 if none."""
        points = self.coordinates(batch.z, batch.p)
        everything = Cells(self.eset, self.coordinates, np.arange(len(self.eset.cells)))
        found = everything.find(points)
        setting = self.coordinates.setting
        gap = np.linalg.norm(
            embed(setting, found.states.z, found.states.p)
            - embed(setting, batch.z, batch.p)[found.point],
            axis=1,
        )
        order = np.lexsort((gap, found.point))
        first = order[np.diff(found.point[order], prepend=-1) > 0]
        near: ItemFlags = gap[first] < SAME_SOLUTION
        cell = np.full(len(batch), -1)
        cell[found.point[first[near]]] = found.cell[first[near]]
        return cell

    @check_arguments
    def path(self, start: State, goal: State) -> AtlasPath:
        """Continuous path between two states, from chart to chart.

        Raises
        ------
        InputError
            If a state lies on no chart, or no path on the set joins the two states.
        """
        cells = [int(self.cell_of(state.batch)[0]) for state in (start, goal)]
        for name, state, cell in zip(("start", "goal"), (start, goal), cells, strict=True):
            if cell < 0:
                raise InputError(f"`{name}` must be a state of the atlas; got {state}.")
        found = path_over_cells(
            self.eset, self.chart, Place(start, cells[0]), Place(goal, cells[1])
        )
        if found is None:
            raise InputError(
                "`goal` must be joined to `start` on the set; got states that are not."
            )
        return found

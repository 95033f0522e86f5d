"""`reduce`: at most one preferred state over each point, with barriers and gaps.

See docs/decisions.md, "Preferences are asked, not modelled".
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Int, Points, VertexFlags
from equimorph.charts.barriers import Barrier, barriers_of, gaps_of
from equimorph.charts.chart import Chart, Charted, PointStatus
from equimorph.charts.coordinates import Coordinates, coordinates_of
from equimorph.charts.domain import Domain, typical_extent
from equimorph.charts.location import Cells
from equimorph.charts.preference import Preference
from equimorph.charts.preferred_part import preferred_part
from equimorph.charts.preparation import cut_along_crossings, with_cusp_vertices
from equimorph.charts.rules import Rule, Scores, rule_of
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.equilibrium_set import check_cells
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.model import Constraint, Descriptor
from equimorph.structures import States
from equimorph.tables import html_table
from equimorph.tolerances import IN_BOX

ON_BARRIER = 1e-9
"""Distance from a barrier, in ranges of the parameters, within which points lie on it."""


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
        return gaps_of(self.domain, self.eset.box, typical_extent(self.cells))

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
    eset = with_cusp_vertices(cut_along_crossings(eset))
    rule = rule_of(prefer)
    among = np.flatnonzero((eset.cell_index == 0) | (not stable))
    if len(among) == 0:
        raise InputError("`eset` must have stable states; got none. Pass stable=False.")
    cells = _candidates(eset, among)
    preference = Preference(cells, rule.on(eset))
    chosen, cut, lost = preferred_part(preference)
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

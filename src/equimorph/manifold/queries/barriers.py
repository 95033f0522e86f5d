"""Energy barriers of the states of a set, from its sheets of index one.

See docs/barriers.md, "Over a set".
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import (
    Bool,
    Flags,
    Float,
    Int,
    ItemValues,
    Lanes,
    Numbers,
    Parameters,
    Some,
    Values,
)
from equimorph.equilibria import EnergyBarrier
from equimorph.equilibria.saddles import Nowhere, ways_over
from equimorph.equilibria.snap import CRITICAL
from equimorph.errors import InputError
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.points import on_fold
from equimorph.manifold.lookup.cell_index import CellIndex
from equimorph.manifold.lookup.exact_states import StatesOver, root_weights
from equimorph.manifold.queries.barrier_landings import (
    CHUNK,
    NONE,
    Ends,
    Landings,
    SaddleLandings,
    cells_of_landings,
    ends_of_descents,
    landings_of,
    over_parameters,
)
from equimorph.model import Descriptor, Progress, Silent
from equimorph.structures import States
from equimorph.structures.margin import count_below
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_PLACE, SAME_SOLUTION, SAME_STATE

WIDTH = 1.0
"""Largest distance of a landing from what is interpolated between those from the corners of a cell,
relative to the distances of these from each other."""
NEARER = 0.5
"""Largest distance from the state that is meant, relative to that of any other one."""


@dataclass(frozen=True, eq=False)
class Barriers:
    """Energy barriers of states, one after the other.

    Parameters
    ----------
    energy
        The least energy with which each leaves its basin: infinite with nothing to snap to, zero
        for unstable states, not a number where it is unknown.
    released
        Energy of the saddle above that of the landing; not a number without one.
    saddle, landing
        Numbers of both among `states`, −1 without one; a `Nowhere` where no state is met.
    states
        The states of the set over the parameters of all these states.
    """

    energy: Values
    released: Values
    saddle: Numbers
    landing: Numbers
    states: States

    def __len__(self) -> int:
        """Return the number of states."""
        return len(self.energy)

    def __iter__(self) -> Iterator[EnergyBarrier]:
        """Go through the barriers one by one."""
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> EnergyBarrier:
        """Barrier of one of the states."""
        height, saddle, end = (float(self.energy[number]), *self._places(number))
        if np.isnan(height):
            return EnergyBarrier("unknown", height)
        if saddle < 0:
            return EnergyBarrier("unstable" if height == 0.0 else "nothing to snap to", height)
        top = self.states[saddle]
        if end < 0:
            return EnergyBarrier(Nowhere(end).status, height, top)
        freed = float(self.released[number])
        return EnergyBarrier("landed", height, top, self.states[end], freed)

    def _places(self, number: int) -> tuple[int, int]:
        return int(self.saddle[number]), int(self.landing[number])

    def __repr__(self) -> str:
        """Number, and the smallest one."""
        known = self.energy[np.isfinite(self.energy)]
        return f"Barriers({len(self)} states, smallest {known.min(initial=np.inf):.6g})"


@dataclass(frozen=True, eq=False)
class SetBarriers:
    """Energy barriers over a set: call `of` on states, or use `descriptor` like any other.

    Parameters
    ----------
    eset
        The set.
    landings
        Where descents from the corners of its cells of index one end.
    """

    eset: EquilibriumSet
    landings: Landings

    def __repr__(self) -> str:
        """How many cells, and in how many of them the network may change."""
        cells = len(self.landings.radius)
        return (
            f"SetBarriers over {self.eset.box}: {cells} cells of index one, descents from the "
            f"corners of {int(self.changing.sum())} of them end differently"
        )

    @cached_property
    def changing(self) -> Bool[np.ndarray, " cells"]:
        """Whether descents from the corners of each cell of index one end differently."""
        return np.asarray(~np.isfinite(self.landings.radius).all(axis=1))

    @check_arguments
    def of(self, states: States) -> Barriers:
        """Barriers of states of the set.

        Parameters
        ----------
        states
            Over points of the box, with the fixed parameters of the set.

        Raises
        ------
        InputError
            If they belong to another structure, have other fixed parameters or lie beyond the box.
        """
        if states.structure.signature != self.eset.structure.signature:
            raise InputError("`states` must belong to the structure of the set; got others.")
        outside = np.flatnonzero(~self._inside(states.p))
        if len(outside):
            raise InputError(
                f"`states` must lie over {self.eset.box}, with {dict(self.eset.fixed)}; "
                f"got {states[int(outside[0])]!r}."
            )
        return self._of(states.z, states.p, exact=True)

    @cached_property
    def at_vertices(self) -> ItemValues:
        """Values of the descriptor at the vertices of the set, infinite with nothing to snap to."""
        eset = self.eset
        values = np.zeros(len(eset.points))
        stable = np.flatnonzero(eset.index == 0)
        z, p = eset.points.z[stable], eset.points.p[stable]
        values[stable] = self._of(z, p, exact=False).energy
        return values

    @check_arguments
    def least(self, count: int = 81) -> Float[np.ndarray, "rows columns"]:
        """Least barrier among the stable states at each point of a grid over two parameters.

        Rows go along the second parameter. Infinite without one: with nothing to snap to, or no
        stable state.

        Raises
        ------
        InputError
            If the set has another number of free parameters, or `count` is less than two.
        """
        box = self.eset.box
        if len(box.names) != 2 or count < 2:
            raise InputError(
                "`count` must be at least 2, for a set over two parameters; got "
                f"{count} over {', '.join(box.names)}."
            )
        axes = [
            np.linspace(low, high, count) for low, high in zip(box.lower, box.upper, strict=True)
        ]
        places = [each.ravel() for each in np.meshgrid(*axes)]
        over = self.eset.over(**dict(zip(box.names, places, strict=True)))
        stable = np.flatnonzero(over.index == 0)
        values = np.full(count * count, np.inf)
        found = self._of(over.states.z[stable], over.states.p[stable], exact=False).energy
        np.fmin.at(values, over.point[stable], found)
        return values.reshape(count, count)

    @cached_property
    def saddle_landings(self) -> SaddleLandings:
        """Cells of the set on which descents from its vertices of index one end."""
        return cells_of_landings(self.eset, self.landings)

    @cached_property
    def _numbers(self) -> dict[bytes, int]:
        """Numbers of the vertices by their parameters and unknowns, bit for bit."""
        rows = np.concatenate([self.eset.points.p, self.eset.points.z], axis=1)
        return {row.tobytes(): number for number, row in enumerate(rows)}

    @cached_property
    def ceiling(self) -> float:
        """Value of the descriptor where there is nothing to snap to: twice the largest barrier."""
        known = self.at_vertices[np.isfinite(self.at_vertices)]
        return 2.0 * float(known.max(initial=0.0)) or 1.0

    @cached_property
    def descriptor(self) -> Descriptor:
        """The barrier as a descriptor, for constraints, objectives and figures.

        In cells in which the network changes it is a lower bound: there a saddle counts for every
        stable state below it. It is zero for unstable states, and where it is unknown: beyond the
        box, for states that the set lacks. With nothing to snap to it is `ceiling`, so that all
        values are finite; it jumps where a saddle and the state beyond it vanish in a fold.
        """
        unit = self.eset.structure.descriptor("energy").unit
        return Descriptor("barrier", unit, self._values, "ΔE")

    def _values(self, z: Lanes, p: Parameters) -> Values:
        out, ceiling = np.zeros(len(z)), self.ceiling
        rows = np.concatenate([p, z], axis=1)
        vertex = np.array([self._numbers.get(row.tobytes(), NONE) for row in rows], int)
        out[vertex >= 0] = self.at_vertices[vertex[vertex >= 0]]
        inside = self._inside(p) & (vertex < 0)
        if inside.any():
            out[inside] = self._of(z[inside], p[inside], exact=False).energy
        return np.minimum(np.nan_to_num(out, posinf=ceiling), ceiling)

    def _inside(self, p: Parameters) -> Flags:
        setting, box = self.eset.setting, self.eset.box
        free = p[:, setting.free]
        gap = (p - setting.parameters(free)) / self.eset.structure.scales
        same = np.abs(gap).max(axis=1, initial=0.0) <= SAME_PLACE
        return np.asarray(same & box.holds(free))

    def _of(self, z: Lanes, p: Parameters, *, exact: bool) -> Barriers:
        """Barriers; if not exact, a lower bound where it is not certain where saddles lead."""
        eset, structure = self.eset, self.eset.structure
        over = over_parameters(eset, p)
        energy, stable = over.states.energy, over.index == 0
        ways = self.ways(over, exact=exact)
        exits = np.full((len(energy), 2), NONE)
        # the last one written is the way over the lowest saddle
        exits[ways[::-1, 1]] = ways[::-1][:, [0, 2]]
        # a saddle is its own top, so that values are smooth where it meets its minimum
        top = np.where(over.index == 1, energy, np.nan)
        top[stable] = np.where(exits[stable, 0] >= 0, energy[exits[stable, 0]], np.inf)
        if eset.constraints:  # beyond them there may be saddles between several minima
            several = np.bincount(over.point[stable], minlength=len(over)) > 1
            top[np.isposinf(top) & several[over.point]] = np.nan
        number = nearest_states(over, z, top)
        # the last row stands for no state
        top, exits = np.append(top, np.nan), np.append(exits, [[NONE, NONE]], axis=0)
        index = np.append(over.index, 0)[number]
        height = top[number] - structure.energy(z, p) * structure.energy_scale
        height[index > 1] = 0.0
        height[self._critical(z, p, height)] = 0.0
        saddle, landing = exits[number].T
        released = np.full(len(z), np.nan)
        met = landing >= 0
        released[met] = energy[saddle[met]] - energy[landing[met]]
        return Barriers(height, released, saddle, landing, over.states)

    def ways(self, over: StatesOver, *, exact: bool) -> Int[np.ndarray, "ways 3"]:
        """Saddle, a stable state below it, and where it leads beyond, over points; `ways_over`.

        If not exact, saddles of cells in which the network changes count for every stable state
        below them, and lead nowhere.
        """
        saddles, energy = np.flatnonzero(over.index == 1), over.states.energy
        ends, sure = self._ends(over, saddles)
        if exact:
            ends[~sure] = ends_of_descents(over, saddles[~sure])
            return ways_over(saddles, ends, energy)
        rows = [ways_over(saddles[sure], ends[sure], energy)]
        for saddle in saddles[~sure]:
            first, last = np.searchsorted(over.point, over.point[saddle] + np.arange(2))
            below = (over.index[first:last] == 0) & (energy[first:last] < energy[saddle])
            rows += [np.array([[saddle, k, NONE]]) for k in first + np.flatnonzero(below)]
        every = np.concatenate(rows)
        return np.asarray(every[np.argsort(energy[every[:, 0]], kind="stable")])

    def _critical(self, z: Lanes, p: Parameters, height: Values) -> Flags:
        """Which lanes without a saddle are on the edge of stability: they are its saddle."""
        structure, out = self.eset.structure, np.zeros(len(z), bool)
        some = np.flatnonzero(~np.isfinite(height))
        out[some] = count_below(structure, z[some], p[some], CRITICAL) > 0
        return out

    def _ends(self, over: StatesOver, saddles: Some) -> tuple[Ends, Flags]:
        """Where descents from saddles end as from the corners of their cells; what is certain."""
        ends, sure = np.full((len(saddles), 2), NONE), np.zeros(len(saddles), bool)
        table, cell = _table_of_minima(over), over.cell[saddles]
        row = np.where(cell >= 0, self.landings.row[cell], NONE)
        for first in range(0, len(saddles), CHUNK):
            part = np.arange(first, min(first + CHUNK, len(saddles)))
            part = part[row[part] >= 0]
            at = saddles[part]
            ends[part], sure[part] = self._by_cells(over, at, table[over.point[at]])
        return ends, sure

    def _by_cells(
        self, over: StatesOver, saddles: Some, minima: Int[np.ndarray, "saddles most"]
    ) -> tuple[Ends, Flags]:
        """Ends of descents as from the corners of the cells; whether they are certain."""
        structure, known, eset = self.eset.structure, self.landings, self.eset
        cell = over.cell[saddles]
        row = known.row[cell]
        x = over.states.p[saddles][:, eset.setting.free]
        folded = on_fold(eset.kinds[eset.cells[cell]])
        shares = np.clip(np.nan_to_num(self._maps.weights(x, cell)), 0.0, 1.0)
        weights = root_weights(shares / shares.sum(axis=1, keepdims=True), folded)
        guess = np.einsum("sc,scek->sek", weights, known.ends[row])
        gap = metric_length(structure, over.states.z[minima][:, None] - guess[:, :, None])
        gap[np.broadcast_to((minima < 0)[:, None], gap.shape)] = np.inf
        order = np.argsort(gap, axis=2)
        nearest, *others = np.moveaxis(np.take_along_axis(gap, order, axis=2), 2, 0)
        end = np.take_along_axis(minima[:, None], order[:, :, :1], axis=2)[:, :, 0]
        radius = known.radius[row]
        sure = np.isfinite(nearest) & (nearest <= WIDTH * radius + SAME_STATE)
        if others:
            sure &= nearest <= NEARER * others[0]
        elsewhere = known.code[row] < 0
        sure = np.isfinite(radius) & (elsewhere | sure)
        return np.where(elsewhere, known.code[row], end), sure.all(axis=1)

    @cached_property
    def _maps(self) -> CellIndex:
        """Barycentric coordinates of the cells."""
        return CellIndex.of(self.eset.coordinates[self.eset.cells], np.zeros(len(self.eset.cells)))


@check_arguments
def barriers(eset: EquilibriumSet, *, progress: Progress | None = None) -> SetBarriers:
    """Energy barriers over a set: the least energy that takes its stable states out of their basin.

    From the vertices of all cells of index one the energy is followed down both ways. Over any
    point of the box the saddles of the set then lead where those from the corners of their cells
    do, as long as these agree on minima that lie clearly apart; from other saddles, over points
    next to where the network changes, it is followed down itself.

    Parameters
    ----------
    progress
        Sink for progress reports.

    Examples
    --------
    >>> from equimorph import Box, Spring, barriers, equilibrium_set
    >>> eset = equilibrium_set(Spring(), Box(x_l=(0.7, 1.2)), fixed={"F": 0.0}, intervals=(9,))
    >>> barriers(eset).of(eset.at(x_l=0.8).stable).energy.round(9).tolist()
    [0.02, 0.02]
    """
    return SetBarriers(eset, landings_of(eset, progress or Silent()))


def _table_of_minima(over: StatesOver) -> Int[np.ndarray, "points most"]:
    """Numbers of the stable states over each point, `NONE` where there are fewer."""
    minima = np.flatnonzero(over.index == 0)
    point = over.point[minima]
    rank = np.arange(len(minima)) - np.searchsorted(point, point)
    table = np.full((len(over), int(rank.max(initial=0)) + 1), NONE)
    table[point, rank] = minima
    return table


def nearest_states(over: StatesOver, z: Lanes, top: ItemValues) -> Numbers:
    """The state over each point that a configuration is clearly nearest to, −1 without one.

    Of two states with the same top, such as a minimum and its saddle beside a fold, either will do.
    """
    structure = over.states.structure
    shift = (over.states.z - z[over.point])[:, : structure.unknowns]
    gap = metric_length(structure, shift)
    order = np.lexsort((gap, over.point))
    count = np.bincount(over.point, minlength=len(over))
    first = np.cumsum(count) - count
    out = np.full(len(over), NONE)
    some = count > 0
    one = order[first[some]]
    other = order[first[some] + np.minimum(count[some], 2) - 1]
    sure = (gap[one] <= NEARER * gap[other]) | (top[one] == top[other]) | (one == other)
    out[some] = np.where(sure | (gap[one] <= SAME_SOLUTION), one, NONE)
    return out

"""`landscape`: the best stable state at every setting, with barriers and gaps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Values
from equimorph.equilibria import ParameterLine, TraceOptions, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, StatesOver
from equimorph.manifold.queries.locate import pieces_of
from equimorph.model import Constraint, Descriptor, Grid, worst_relative_excess
from equimorph.structures import State, States
from equimorph.structures.metric import metric_length
from equimorph.tasks.maps.actuator_map import settings_of
from equimorph.tasks.maps.brackets import grid_edges
from equimorph.tolerances import SAME_SOLUTION

OVER = 1e-9
"""Relative excess over a bound that counts as none."""

BarrierKind = Literal["stability", "preference"]


@dataclass(frozen=True, eq=False)
class Barriers:
    """Edges of a grid whose ends carry states that are not neighbours on the set.

    Parameters
    ----------
    ends
        Settings of both ends of each edge.
    values
        Objective at both ends: its one-sided limits across the barrier, up to a grid step.
    kind
        "stability": the state of one end loses its stability on the way to the other; "preference":
        it goes on, but another one is better there.
    """

    ends: Float[np.ndarray, "edges 2 2"]
    values: Float[np.ndarray, "edges 2"]
    kind: tuple[BarrierKind, ...]

    def __len__(self) -> int:
        """Number of edges."""
        return len(self.ends)


@dataclass(frozen=True, eq=False)
class Landscape:
    """An objective over two parameters, at the best admissible stable state of each setting.

    Parameters
    ----------
    grid
        Settings.
    value
        Objective at every vertex of the grid, row by row; NaN in gaps.
    states
        The best states, in the order of the vertices that have one.
    gaps
        Vertices without an allowed stable state.
    barriers
        Where the best state is not connected to that of the neighbouring setting.
    """

    grid: Grid
    value: Float[np.ndarray, "rows columns"]
    states: States
    gaps: Bool[np.ndarray, "rows columns"]
    barriers: Barriers

    @property
    def status(self) -> Literal["found", "refused"]:
        """Whether any setting has an allowed stable state."""
        return "found" if len(self.states) else "refused"

    @property
    def why(self) -> str:
        """Why it is refused."""
        return "" if len(self.states) else "no setting of the grid has an allowed stable state"

    @cached_property
    def margin(self) -> Float[np.ndarray, " states"]:
        """Stability margin of each state."""
        return self.states.margin if len(self.states) else np.zeros(0)

    def __repr__(self) -> str:
        """Size, gaps, barriers."""
        shape = " × ".join(map(str, self.value.shape))
        return (
            f"Landscape({shape} settings; {int(self.gaps.sum())} in gaps; "
            f"{len(self.barriers)} edges on barriers)"
        )


@check_arguments
def landscape(  # the knobs of the public face, most by keyword
    eset: EquilibriumSet,
    objective: Descriptor,
    grid: Grid,
    *,
    sense: Literal["min", "max"] = "min",
    within: Sequence[Constraint] = (),
    start: State | None = None,
) -> Landscape:
    """Find the best stable state of a set at every setting of a grid, with barriers and gaps.

    Parameters
    ----------
    eset
        Equilibrium set over two parameters.
    objective
        Descriptor by which the states over one setting are compared.
    grid
        Settings in the box of the set.
    sense
        "min" or "max": whether lower or higher values are better.
    within
        Constraints in addition to those of the set.
    start
        Restricts the choice to the stable piece of the set around this state.

    Returns
    -------
    The landscape: values, states, and edges of the grid across which the best state jumps.

    Raises
    ------
    InputError
        If the grid has other parameters than the two of the set, or the sense is unknown.
    """
    if tuple(grid.names) != tuple(eset.names) or len(grid.names) != 2:
        raise InputError(
            f"`grid` must be over the two free parameters of the set ({', '.join(eset.names)}); "
            f"got {', '.join(grid.names)}."
        )
    settings, shape = settings_of(grid)
    over = eset.over(**dict(zip(grid.names, settings.T, strict=True)))
    allowed = _admissible(eset, over, within, start)
    value = objective(over.states) * (1.0 if sense == "min" else -1.0)
    best = _best(np.where(allowed, value, np.inf), over.point, len(settings))
    known = best >= 0
    states = over.states[best[known]]
    out = np.full(len(settings), np.nan)
    out[known] = objective(states)
    place = np.where(known, np.cumsum(known) - 1, -1)
    barriers = _barriers(states, place.reshape(shape), out, settings)
    return Landscape(grid, out.reshape(shape), states, ~known.reshape(shape), barriers)


def _admissible(
    eset: EquilibriumSet, over: StatesOver, within: Sequence[Constraint], start: State | None
) -> Flags:
    """Stable states that obey the constraints, on the piece of the start."""
    good = over.index == 0
    good &= worst_relative_excess(within, over.states.z, over.states.p) <= OVER
    if start is not None:
        good &= over.stratum == pieces_of(eset, start)[0]
    return np.asarray(good)


def _best(
    value: Values, point: Int[np.ndarray, " lanes"], count: int
) -> Int[np.ndarray, " points"]:
    """Number of the state with the least value over each point, −1 without one."""
    best = np.full(count, -1)
    order = np.lexsort((value, point))
    order = order[np.isfinite(value[order])]
    first = order[np.diff(point[order], prepend=-1) > 0]
    best[point[first]] = first
    return best


def _barriers(
    states: States,
    place: Int[np.ndarray, "rows columns"],
    value: Float[np.ndarray, " vertices"],
    settings: Float[np.ndarray, "vertices 2"],
) -> Barriers:
    """Edges between known neighbours that a straight lift on stable states does not connect."""
    pairs = grid_edges(place.shape)
    pairs = pairs[(place.ravel()[pairs] >= 0).all(axis=1)]
    ends = place.ravel()[pairs]
    structure = states.structure
    a, b = states[ends[:, 0]], states[ends[:, 1]]
    arrived, z = _lift_straight(a, b)
    gap = metric_length(structure, z - b.z)
    apart = np.flatnonzero(~(arrived & (gap < SAME_SOLUTION)))
    back, _ = _lift_straight(b[apart], a[apart])
    kind: tuple[BarrierKind, ...] = tuple(
        "preference" if both else "stability" for both in arrived[apart] & back
    )
    return Barriers(settings[pairs[apart]], value[pairs[apart]], kind)


def _lift_straight(a: States, b: States) -> tuple[Flags, Lanes]:
    """Whether states stay stable on the way to the parameters of given ones, and their ends."""
    line = ParameterLine(a.structure, a.p.copy(), b.p - a.p)
    ended = trace(line, a.z.copy(), (), TraceOptions(record=False))
    return np.asarray(ended.code == EventCode.ARRIVED), ended.z

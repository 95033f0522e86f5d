"""Curves of critical states in two or more parameters: folds, branch points, cusps, bounds."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int, Values
from equimorph.equilibria.critical import normal_form
from equimorph.equilibria.critical_tests import (
    bound,
    branching,
    branchings,
    cubic,
    gap,
    grazing,
    limits,
    places,
    quadratic,
)
from equimorph.equilibria.lift import Event
from equimorph.equilibria.locus import Locus, Spots, nearest
from equimorph.equilibria.locus_events import Landmark, Watch, watch_tests
from equimorph.equilibria.trace_locus import Side, trace_locus
from equimorph.equilibria.trace_options import EventKind, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Box, Constraint, position
from equimorph.structures import State, States

NEAR = 1e-3
"""Distance in the metric by which a start may miss its curve."""
PLACES = 8
"""Decimal places of lengths in which special points that coincide agree."""


@dataclass(frozen=True, repr=False)
class CriticalCurve:
    """A curve of critical states.

    Parameters
    ----------
    kind
        "fold", "branch point", "cusp", "constraint" or "grazing".
    parameters
        Names of the parameters that vary along it.
    states
        Exact states in order.
    length
        Arclength of each state, in the metric and scaled parameters; 0 at the given start.
    index
        Negative eigenvalues in addition to the one that vanishes, per state: 0 where the curve
        bounds stable states.
    events
        Special points in order; `at` is their length. Kinds: "cusp" ("standard": of the three
        states that merge the middle one has the higher index, "dual": the lower), "branch point"
        (of paths along the parameter that `detail` names), "degenerate" (a pitchfork changes its
        criticality), "swallowtail", "double" (a second eigenvalue vanishes), "critical" (an
        eigenvalue vanishes on a curve of regular states).
    ends
        Both ends, in the order of the states: "box", "constraint", "closed" (both, at the start) or
        "lost", with `detail`.
    """

    kind: str
    parameters: tuple[str, ...]
    states: States
    length: Float[np.ndarray, " points"]
    index: Int[np.ndarray, " points"]
    events: tuple[Event, ...]
    ends: tuple[Event, Event]

    def __repr__(self) -> str:
        """Kind, size, special points and ends."""
        kinds = Counter(event.kind for event in self.events)
        passed = "".join(f"{count} {kind}, " for kind, count in kinds.items())
        ends = " to ".join(end.kind for end in self.ends)
        over = ", ".join(self.parameters)
        return f"CriticalCurve({self.kind} over {over}: {len(self.states)} states, {passed}{ends})"

    @property
    def closed(self) -> bool:
        """Whether the curve returns to its start."""
        return self.ends[0].kind == "closed"


def both_ways(
    kind: str, locus: Locus, state: State, watches: list[Watch], options: TraceOptions | None
) -> CriticalCurve:
    """Follow a locus from a state in both directions; refused if the state is not on the locus."""
    options = options or TraceOptions(largest_step=0.2)
    x = locus.join(state.z[None], state.p[None])
    start, found = nearest(locus, x)
    if not found[0] or locus.lengths(start.x - x)[0] > NEAR:
        raise InputError(
            f"`state` must lie on a {kind} curve in {_names(locus)}; no such state was found "
            f"within {NEAR:g} of it."
        )
    start = start.turn(_sign(locus, start))
    sides = trace_locus(locus, start, watches, options)
    return _curve(kind, locus, _at_start(locus, start, watches), sides)


def _names(locus: Locus) -> str:
    return ", ".join(locus.structure.parameters[place].name for place in locus.free)


def _sign(locus: Locus, spot: Spots) -> Values:
    """Sign towards a growing first parameter (or second, if the first does not change)."""
    change = spot.tangent[0, locus.structure.size :]
    moving = np.flatnonzero(np.abs(change) > 1e-6)
    return np.sign(change[moving[:1]]) if len(moving) else np.ones(1)


def _at_start(locus: Locus, start: Spots, watches: list[Watch]) -> list[Landmark]:
    """Special points at the start itself."""
    values, slopes = watch_tests(locus, start, watches, np.zeros((1, len(watches))))
    return [
        Landmark(watch.kind, start, 0.0, watch.detail)
        for watch, value, slope in zip(watches, values[0], slopes[0], strict=True)
        if not watch.ends and value == 0.0 and abs(slope) > 1e-6
    ]


def _curve(
    kind: str, locus: Locus, here: list[Landmark], sides: tuple[Side, Side]
) -> CriticalCurve:
    backward, forward = sides
    assert backward.end is not None, "sides are followed to their ends"
    assert forward.end is not None, "sides are followed to their ends"
    back = [Landmark(m.kind, m.spot, -m.length, m.detail) for m in backward.landmarks[::-1]]
    marks = (*back, *here, *forward.landmarks)
    first = forward.end if forward.closed else backward.end
    ends = (Landmark(first.kind, first.spot, -backward.lengths[-1], first.detail), forward.end)
    spots = [*backward.spots[:0:-1], *forward.spots]
    lengths = np.concatenate([-np.array(backward.lengths[:0:-1]), forward.lengths])
    z, p = locus.split(np.concatenate([spot.x for spot in spots]))
    return CriticalCurve(
        kind,
        tuple(locus.structure.parameters[place].name for place in locus.free),
        States(locus.structure, z, p),
        lengths,
        np.array([*backward.index[:0:-1], *forward.index]),
        tuple(_event(locus, mark) for mark in sorted(marks, key=_place)),
        (_event(locus, ends[0]), _event(locus, ends[1])),
    )


def _place(mark: Landmark) -> tuple[float, str]:
    """Order of special points along a curve; of those that coincide, by their kinds."""
    return round(mark.length, PLACES), mark.kind


def _event(locus: Locus, mark: Landmark) -> Event:
    z, p = locus.split(mark.spot.x)
    detail, critical = mark.detail, None
    if mark.kind == EventKind.CUSP:
        cubic = locus.critical(mark.spot.x, mark.spot.b).cubic[0]
        detail = "standard" if cubic > 0.0 else "dual"
    if mark.kind == EventKind.BRANCH_POINT:
        dp = np.zeros_like(p)
        dp[0, position(locus.structure.parameters, detail)] = 1.0
        critical = normal_form(locus.structure, z, p, dp).kinds[0]
    return Event(mark.kind, State(locus.structure, z[0], p[0]), mark.length, critical, detail)


@check_arguments
def fold_curve(
    state: State,
    parameters: Sequence[str],
    *,
    on: Sequence[Constraint] = (),
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow folds in two parameters, both ways from `state`: the boundary of a stratum.

    ``F = 0, g = 0`` with g from a bordered system, so that every point is regular, cusps included
    [Govaerts2000]_; pseudo-arclength in (z, p). Each constraint in `on` needs one more parameter:
    along the curve, loss of stability and its bound coincide.

    Parameters
    ----------
    state
        A fold, like the end of a lift.
    parameters
        Names of the two (or more) parameters that vary.
    on
        Constraints that hold with equality along the whole curve.
    box
        Limits of parameters; they end the curve.
    within
        Constraints whose violation ends the curve.
    options
        Step control.

    Raises
    ------
    InputError
        If `state` is not such a state or lies outside, or parameters are unknown or too few.
    """
    structure = state.structure
    free = places(structure, parameters, 2 + len(on))
    watches = [Watch(EventKind.CUSP, quadratic), *branchings(structure, free)]
    locus = Locus(structure, state.p, free, (gap, *map(bound, on)))
    return both_ways("fold", locus, state, [*watches, *limits(state, free, box, within)], options)


@check_arguments
def branch_curve(
    state: State,
    parameters: Sequence[str],
    *,
    along: str,
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow branch points of the paths along one parameter, both ways from `state`.

    ``F + βb = 0, g = 0, vᵀF_p = 0``. Branch points that persist by symmetry need two parameters
    (β stays zero); general ones need three.

    Parameters
    ----------
    state
        A branch point, like the end of a lift along the parameter `along`.
    parameters
        Names of the parameters that vary, `along` among them.
    along
        Parameter whose paths branch.
    box, within, options
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is not such a branch point or lies outside, or a parameter is unknown.
    """
    structure = state.structure
    unfolded = len(parameters) == 2
    free = places(structure, parameters, 2 if unfolded else 3)
    if along not in parameters:
        raise InputError(f"`along` must be one of the parameters that vary; got {along!r}.")
    locus = Locus(structure, state.p, free, (gap, branching(structure, along)), unfolded)
    watches = [Watch(EventKind.DEGENERATE, cubic, "the criticality changes")] if unfolded else []
    watches += limits(state, free, box, within)
    return both_ways("branch point", locus, state, watches, options)


@check_arguments
def cusp_curve(
    state: State,
    parameters: Sequence[str],
    *,
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow cusps in three parameters, both ways: where two folds merge and a limit load jumps.

    ``F = 0, g = 0, vᵀF_zz[v, v] = 0``. For paths along one of the parameters these are hysteresis
    points: on one side of the curve the path has two folds more than on the other.

    Parameters
    ----------
    state
        A cusp, like those among the events of a `fold_curve`.
    parameters
        Names of the three parameters that vary.
    box, within, options
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is not a cusp or lies outside, or a parameter is unknown.
    """
    structure = state.structure
    free = places(structure, parameters, 3)
    watches = [Watch(EventKind.SWALLOWTAIL, cubic), *branchings(structure, free)]
    locus = Locus(structure, state.p, free, (gap, quadratic))
    return both_ways("cusp", locus, state, [*watches, *limits(state, free, box, within)], options)


@check_arguments
def constraint_curve(
    state: State,
    parameters: Sequence[str],
    *,
    on: Sequence[Constraint],
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow states on the bounds of constraints, both ways from `state`.

    One constraint and two parameters give the boundary of the admissible region, for example where
    the unloaded structure violates the constraint. Two constraints and three parameters give the
    states at which the constraint that is met first changes.

    Parameters
    ----------
    state
        A state on all bounds, like the end of a lift.
    parameters
        Names of the parameters that vary: one more than constraints.
    on
        Constraints that hold with equality along the whole curve.
    box, within, options
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is not on the bounds or lies outside, or parameters are unknown or too few.
    """
    structure = state.structure
    free = places(structure, parameters, 1 + len(on))
    locus = Locus(structure, state.p, free, tuple(map(bound, on)), singular=False)
    return both_ways("constraint", locus, state, limits(state, free, box, within), options)


@check_arguments
def grazing_curve(
    state: State,
    parameters: Sequence[str],
    *,
    on: Constraint,
    along: str,
    box: Box | None = None,
    within: Sequence[Constraint] = (),
) -> CriticalCurve:
    """Follow states where paths along one parameter touch a bound from inside, both ways.

    ``F = 0, c = 0, dc/ds = 0`` with s the length of the path: on one side of the curve the path
    ends at the bound, on the other it passes below.

    Parameters
    ----------
    state
        A state on the bound where c is largest along the path.
    parameters
        Names of the three parameters that vary, `along` among them.
    on
        The constraint.
    along
        Parameter whose paths touch the bound.
    box, within
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is not such a state or lies outside, or a parameter is unknown.
    """
    structure = state.structure
    free = places(structure, parameters, 3)
    tests = (bound(on), grazing(structure, on, along))
    locus = Locus(structure, state.p, free, tests, singular=False)
    return both_ways("grazing", locus, state, limits(state, free, box, within), None)

"""`verify`: margins along any schedule, or its first violation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int
from equimorph.equilibria import (
    Event,
    Lifts,
    Path,
    TraceOptions,
    check_start,
    settle,
    way_points,
)
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Schedule, names_of
from equimorph.structures import State, States, Structure, from_identity, join_states
from equimorph.structures.metric import metric_length
from equimorph.tasks.distances import path_lengths
from equimorph.tasks.route import describe_obstacle, describe_place, schedule_of
from equimorph.tasks.start import check_schedule, critical, inadmissible
from equimorph.tasks.straight_lines import (
    AT_GOAL,
    FINE,
    Least,
    are_led,
    are_there,
    least_margin,
    lift_straight,
)
from equimorph.tasks.verification.proof import Proof, prove

NEAR = 0.05
"""Distance in the metric up to which a start that was written with few digits is corrected."""

Rows = Float[np.ndarray, "rows parameters"]


@dataclass(frozen=True, eq=False)
class LiftedPolyline:
    """Exact states along a polyline, and how the way ended."""

    states: States
    """All points in order: corners, and those where the lifts stopped between them."""
    at: Float[np.ndarray, " points"]
    """Number of the leg + share of it, per state."""
    corners: Int[np.ndarray, " corners"]
    """Which states are the corners that were reached."""
    end: Event
    """The last event: "arrived", or what ended the way."""


def follow_polyline(
    start: State, rows: Rows, within: tuple[Constraint, ...], options: TraceOptions
) -> LiftedPolyline:
    """Follow the straight legs from the parameters of `start` through those of each row.

    Newton leads from corner to corner; that it stays on the curve is what the lifts of all legs,
    side by side, then show. Where a lift comes to another state, the march goes on from that one.
    """
    legs: list[LiftedPolyline] = []
    done, here = 0, start
    while done < len(rows):
        nodes = _by_newton(here, rows[done:])
        lifts = lift_straight(nodes[:-1], nodes.p[1:], within, options)
        bad = np.flatnonzero(~are_led(lifts, nodes[1:]))
        good = int(bad[0]) if len(bad) else len(lifts)
        legs.append(_part(nodes[0], lifts, good + 1, done))
        done += min(good + 1, len(nodes) - 1)
        here = legs[-1].end.state
        if legs[-1].end.kind != "arrived":
            break
    return _join_parts(start, legs)


def _by_newton(start: State, rows: Rows) -> States:
    """States over rows by Newton from each to the next; at least one beyond the start."""
    structure, z = start.structure, [start.z]
    for row in rows:
        new = settle(structure, z[-1][None], row[None])
        if not new.found[0]:
            break
        z.append(new.z[0])
    # a leg that Newton cannot take is given to the lift, whatever its end
    if len(z) == 1:
        z.append(start.z)
    return States(structure, np.array(z), np.concatenate([start.p[None], rows[: len(z) - 1]]))


def _part(start: State, lifts: Lifts, legs: int, before: int) -> LiftedPolyline:
    """The first legs as one march."""
    legs = min(legs, len(lifts))
    points = lifts.points
    assert points is not None
    inside = (points.at > AT_GOAL) & (points.at < 1.0 - AT_GOAL)
    ours = np.flatnonzero((points.lane < legs) & inside)
    ends = np.arange(legs)
    lane = np.concatenate([points.lane[ours], ends])
    at = np.concatenate([points.at[ours], lifts.at[:legs]])
    order = np.lexsort((at, lane))
    both = (points.states[ours], lifts.states[:legs])
    corner = np.flatnonzero(order >= len(ours))
    end = lifts[legs - 1]
    kind = "arrived" if are_there(lifts)[legs - 1] else end.kind
    ended = Event(kind, end.state, before + legs - 1 + end.at, end.criticality, end.detail)
    states = join_states(start.structure, both)[order]
    return LiftedPolyline(states, before + (lane + at)[order], corner, ended)


def _join_parts(start: State, parts: list[LiftedPolyline]) -> LiftedPolyline:
    states = join_states(start.structure, (start, *(part.states for part in parts)))
    at = np.concatenate([np.zeros(1), *(part.at for part in parts)])
    corners, count = [np.zeros(1, int)], 1
    for part in parts:
        corners.append(part.corners + count)
        count += len(part.states)
    return LiftedPolyline(states, at, np.concatenate(corners), parts[-1].end)


@dataclass(frozen=True, eq=False)
class Verification:
    """Whether a schedule can be executed without a snap.

    Parameters
    ----------
    status
        "verified", or "refused" with the first violation in `why`.
    states
        Equilibria along the schedule, as far as it can be followed.
    at
        Number of the step plus the fraction of it, per state.
    margin
        Smallest stability margin on the way.
    schedule
        The schedule with the margins and descriptors found; only if it was verified.
    violation
        The event that ended the schedule, and where.
    proof
        In proof mode: what is proved, or supported by samples, between the states.
    """

    status: Literal["verified", "refused"]
    why: str
    states: States
    at: Float[np.ndarray, " points"]
    margins: Float[np.ndarray, " points"]
    schedule: Schedule | None = None
    violation: Event | None = None
    proof: Proof | None = None

    def __repr__(self) -> str:
        """Margin and proof, or the violation."""
        if not self.verified:
            return f"Verification(refused at {self.at[-1]:.6g}: {self.why})"
        proof = "" if self.proof is None else f", {self.proof.status}"
        return f"Verification(verified: {len(self.states)} states, margin {self.margin:.4g}{proof})"

    @property
    def verified(self) -> bool:
        """Whether the schedule was verified."""
        return self.status == "verified"

    @cached_property
    def margin(self) -> float:
        """Smallest stability margin on the way, also between the states."""
        return least_margin(self.states, self.margins).margin

    @cached_property
    def path(self) -> Path:
        """States with their lengths, and how the way ended."""
        states, at = self.states, float(self.at[-1])
        lost = "arrived" if self.verified else "constraint"
        end = self.violation or Event(lost, states[-1], at, detail=self.why)
        return Path(states, self.at, path_lengths(states), np.zeros(len(states), int), (end,))


@check_arguments
def verify(
    schedule: Schedule | Sequence[Mapping[str, float]],
    start: State | None = None,
    *,
    structure: Structure | None = None,
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
    monitor: Sequence[Descriptor] = (),
    proof: bool = False,
    options: TraceOptions | None = None,
) -> Verification:
    """Check a schedule from any source: every step is lifted with fine steps, margins are recorded.

    Between its steps parameters change at constant rates. A way-point {name: value} keeps the
    parameters that it does not name.

    Parameters
    ----------
    schedule
        A `Schedule`, of a route or read from files; or way-points, which need a `start`.
    start
        State in which the structure starts. By default the start of the schedule, corrected if it
        was written with few digits.
    structure
        Needed only if neither a start nor the schedule carries one.
    within
        Constraints to obey on the way.
    margin
        Smallest stability margin allowed, in the structure's metric.
    monitor
        Further descriptors for the schedule of the result.
    proof
        Bound the curve between the states, too: that it exists, is the only one nearby and keeps
        its index. This is proved or, where the bounds are sampled, supported; see `ProofStatus`. A
        schedule that is safe but not proved remains verified.
    options
        Step control of the lifts; by default that of the final check of routes.

    Returns
    -------
    The verified schedule, or the first violation.

    Raises
    ------
    InputError
        If there is no start or structure, names are not those of the structure, the start is no
        equilibrium, nothing moves, or `margin` is negative.

    Examples
    --------
    >>> import equimorph as em
    >>> rest = em.Spring().natural_state(x_l=1.5)
    >>> em.verify([{"F": 0.2}, {"x_l": 1.2}], rest, proof=True).proof.status
    <ProofStatus.PROVED: 'proved'>
    """
    begin, rows = _legs(schedule, start, structure)
    constraints = tuple(within)
    why = inadmissible("start", begin, constraints, margin)
    if why:
        return Verification("refused", why, begin.batch, np.zeros(1), np.array([begin.margin]))
    done = follow_polyline(begin, rows, constraints, options or FINE)
    margins = done.states.margin
    why, last = _violation(done, margins, margin, len(rows))
    if why and done.end.at == 0.0:
        why = critical("start", begin) or why
    if why:
        kept = slice(0, last + 1)
        event = done.end if done.end.kind != "arrived" else None
        return Verification(
            "refused", why, done.states[kept], done.at[kept], margins[kept], None, event
        )
    proved = prove(done.states, margin) if proof else None
    table = _table(done, margins, (*(c.descriptor for c in constraints), *monitor))
    return Verification("verified", "", done.states, done.at, margins, table, None, proved)


def _legs(
    schedule: Schedule | Sequence[Mapping[str, float]],
    start: State | None,
    structure: Structure | None,
) -> tuple[State, Float[np.ndarray, "rows parameters"]]:
    """Start, and all parameters at the corners after it."""
    if not isinstance(schedule, Schedule):
        if start is None:
            raise InputError("`start` must be given with way-points; got none.")
        check_start(start)
        return start, _moving(np.array(way_points(start.structure, start.p, schedule)))
    begin = start or first_state(schedule, structure)
    check_schedule(schedule, begin.structure)
    check_start(begin)
    if not np.allclose(schedule.values[0], begin.p, rtol=0, atol=1e-9):
        raise InputError(
            f"`start` must have the first parameters of the schedule; got {begin.parameters}."
        )
    return begin, _moving(np.concatenate([begin.p[None], schedule.values[1:]]))


def _moving(rows: Float[np.ndarray, "rows parameters"]) -> Float[np.ndarray, "moves parameters"]:
    """Corners after the first, without pauses."""
    moves = np.abs(np.diff(rows, axis=0)).max(axis=1, initial=0.0) > 0.0
    if not moves.any():
        raise InputError("`schedule` must change at least one parameter; got one that rests.")
    return np.asarray(rows[1:][moves])


def first_state(schedule: Schedule, structure: Structure | None) -> State:
    """State in which a schedule begins; its structure is that of the schedule by default.

    Refused if it carries no structure, or does not begin at an equilibrium.
    """
    owner, unknowns = structure, schedule.start.get("unknowns")
    if owner is None:
        if schedule.start.get("structure") is None:
            raise InputError(
                "`structure` must be given for a schedule that carries none; got none."
            )
        owner = from_identity(schedule.start["structure"])
    z = np.asarray(unknowns, dtype=float)
    if z.shape != (owner.size,):
        raise InputError(
            f"`schedule` must start with {owner.size} unknowns of its structure; "
            f"got {z.size if unknowns is not None else 'none'}."
        )
    state = State(owner, z, schedule.values[0].copy())
    if state.residual < 1e-10:
        return state
    near = settle(owner, z[None], state.p[None])
    if not (near.found[0] and metric_length(owner, near.z[0] - z) <= NEAR):
        raise InputError(
            f"`schedule` must start at an equilibrium; got a residual of {state.residual:.2g}."
        )
    return State(owner, near.z[0], state.p)


def _violation(
    done: LiftedPolyline, margins: Float[np.ndarray, " points"], margin: float, legs: int
) -> tuple[str, int]:
    """First violation in words, and the number of the state; nothing for none."""
    # the end at a fold has no margin, but the report must name the fold
    count = len(margins) - (done.end.kind != "arrived")
    states, margins = done.states[:count], margins[:count]
    low = np.flatnonzero((margins <= 0.0) | (margins < margin))
    least, names = None, _moved_names(done.states)
    if len(low):
        least = Least(float(margins[low[0]]), states[int(low[0])], int(low[0]))
    elif margin > 0.0:
        least = least_margin(states, margins)
    if least is not None and (len(low) or least.margin < margin):
        where = describe_place(least.state, names)
        fall = f"the stability margin falls to {least.margin:.4g}, below {margin:g}, at {where}"
        return fall, least.number
    if done.end.kind == "arrived":
        return "", len(done.at) - 1
    leg = min(int(done.end.at) + 1, legs)
    return f"step {leg} of {legs} meets {describe_obstacle(done.end, names)}", len(done.at) - 1


def _moved_names(states: States) -> list[str]:
    names = names_of(states.structure.parameters)
    moves = np.ptp(states.p, axis=0) > 0.0
    return [name for name, moving in zip(names, moves, strict=True) if moving]


def _table(
    done: LiftedPolyline, margins: Float[np.ndarray, " points"], descriptors: Sequence[Descriptor]
) -> Schedule:
    """Schedule of all states."""
    at = done.at.copy()
    at[done.corners] = np.arange(len(done.corners))
    path = Path(done.states, at, path_lengths(done.states), np.zeros(len(at), int), (done.end,))
    return schedule_of(path, margins, tuple(dict.fromkeys(descriptors)))

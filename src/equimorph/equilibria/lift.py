"""`lift`: follow a curve in parameter space from a known equilibrium, on the equilibrium set."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.hidden import with_hidden_events
from equimorph.equilibria.normal_form import criticality
from equimorph.equilibria.outcome import KINDS, Outcome, follow
from equimorph.equilibria.tracing import BRANCH, CONSTRAINT, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, parameter_vector
from equimorph.structures import State, States, Structure

Waypoint = Mapping[str, float]

ON_BOUND = 1e-9
"""Relative excess up to which a start counts as on a bound: an earlier lift may end there."""


@dataclass(frozen=True)
class Event:
    """Something that happened on a lift, at an exact state.

    kind: "arrived", "fold", "branch point", "constraint", "returned" (a path that turned at a fold
    came back to the parameters of its start) or "lost"; `at`: number of the segment + share of it;
    `criticality` of branch points; `detail`: one line.
    """

    kind: str
    state: State
    at: float
    criticality: str | None = None
    detail: str = ""


@dataclass(frozen=True)
class Path:
    """A lifted curve: exact states in order, what happened on the way, and how it ended.

    Parameters
    ----------
    states
        Equilibria along the curve, start and end included.
    at
        Segment number + share of the segment, per state.
    length
        Length from the start in the structure's metric and scaled parameters, per state.
    index
        Negative eigenvalues of the constrained Hessian per state; at an end that is critical, the
        index on the near side.
    events
        Events passed, in order, and the end.
    """

    states: States
    at: Float[np.ndarray, " points"]
    length: Float[np.ndarray, " points"]
    index: Int[np.ndarray, " points"]
    events: tuple[Event, ...]

    def __repr__(self) -> str:
        """Number of states and how the lift ended."""
        end = self.end.state
        return f"Path({len(self.states)} states; {self.end.kind} at {end})"

    @property
    def end(self) -> Event:
        """How the lift ended."""
        return self.events[-1]

    @property
    def arrived(self) -> bool:
        """Whether the curve was lifted to its end."""
        return self.end.kind == "arrived"


def way_points(
    structure: Structure, start: Float[np.ndarray, " parameters"], to: Waypoint | Sequence[Waypoint]
) -> list[Float[np.ndarray, " parameters"]]:
    """Corners of a polyline: each way-point changes some parameters and keeps the others.

    Raises
    ------
    InputError
        For an unknown parameter, a value without meaning, or no way-point that moves.
    """
    steps = [to] if isinstance(to, Mapping) else list(to)
    corners = [start]
    for step in steps:
        corners.append(parameter_vector(structure.parameters, step, corners[-1]))
    if all(np.array_equal(corner, start) for corner in corners):
        raise InputError("`to` must change at least one parameter; got the start itself.")
    return corners


def lift(
    state: State,
    to: Waypoint | Sequence[Waypoint],
    *,
    within: Sequence[Constraint] = (),
    through_folds: bool = False,
    options: TraceOptions | None = None,
) -> Path:
    """Follow the polyline from `state` through way-points `to`, on the equilibrium set.

    Error-controlled predictor–corrector in pseudo-arclength; folds and branch points by minimally
    augmented systems, constraints by root finding on the curve. Without `through_folds` the lift
    ends at the first event, as a quasi-static motion would.

    Parameters
    ----------
    state
        Equilibrium from which to start.
    to
        A way-point {name: value}, or several; parameters not named keep their values.
    within
        Constraints, like ``[arch.max_curvature <= 10]``; the first violation ends the lift.
    through_folds
        Continue around folds (and through branch points) instead of ending there. A path that
        turns back passes its start on another sheet: this ends it ("returned").
    options
        Step control.

    Returns
    -------
    The path; a numerical failure is an end of kind "lost" with the reason.

    Raises
    ------
    InputError
        If `state` is no equilibrium, violates a constraint, or a way-point has no meaning.
    """
    check_start(state, within)
    options = replace(
        options or TraceOptions(),
        through_folds=through_folds,
        through_branch_points=through_folds,
        record=True,
    )
    corners = way_points(state.structure, state.p, to)
    pieces: list[_Segment] = []
    here = state
    for number, (start, stop) in enumerate(pairwise(corners)):
        if np.array_equal(start, stop):
            continue
        piece = _segment(here, stop - start, number, tuple(within), options)
        pieces.append(piece)
        if piece.events[-1].kind != "arrived":
            break
        here = piece.events[-1].state
    return _joined(state, pieces)


def _size(constraint: Constraint) -> float:
    return max(1.0, abs(constraint.bound))


def check_start(state: State, within: Sequence[Constraint] = ()) -> None:
    """Raise `InputError` unless `state` is an equilibrium that obeys the constraints."""
    if not state.residual < 1e-8:
        raise InputError(
            f"`state` must be an equilibrium (largest residual below 1e-8); "
            f"got a residual of {state.residual:.2g}."
        )
    for constraint in within:
        if constraint.excess(state.z[None], state.p[None])[0] > ON_BOUND * _size(constraint):
            value = constraint.descriptor(state)
            raise InputError(
                f"`state` must obey {constraint}; got {constraint.descriptor.name} = {value:.6g}."
            )


@dataclass(frozen=True)
class _Segment:
    """One straight piece of a path, without its first point."""

    z: Float[np.ndarray, "points size"]
    p: Float[np.ndarray, "points parameters"]
    at: Float[np.ndarray, " points"]
    length: Float[np.ndarray, " points"]
    index: Int[np.ndarray, " points"]
    events: tuple[Event, ...]


def _segment(
    state: State,
    velocity: Float[np.ndarray, " parameters"],
    number: int,
    within: tuple[Constraint, ...],
    options: TraceOptions,
) -> _Segment:
    structure = state.structure
    curve = ParameterLine(structure, state.p[None].copy(), velocity[None].copy())
    start = state.z[None].copy()
    outcome = with_hidden_events(curve, start, follow(curve, start, within, options), options)
    events = (*_passed(curve, outcome, number), _end(curve, outcome, number, within))
    last = outcome.travelled[0] if outcome.code[0] else np.inf
    points = outcome.points.take(outcome.points.travelled < last)
    ended = slice(0, int(outcome.code[0] != 0))
    z = np.concatenate([points.z, outcome.z[ended]])
    t = np.concatenate([points.t, outcome.t[ended]])
    length = np.concatenate([points.travelled, outcome.travelled[ended]])
    index = np.concatenate([points.index, outcome.index[ended]])
    return _Segment(z, state.p + t[:, None] * velocity, number + t, length, index, events)


def _passed(curve: ParameterLine, outcome: Outcome, number: int) -> list[Event]:
    passed = outcome.passed
    p = curve.start[0] + passed.t[:, None] * curve.velocity[0]
    return [
        Event(
            KINDS[int(code)],
            State(curve.structure, z, parameters),
            number + float(t),
            criticality(curve, z[None], np.array([t]))[0] if code == BRANCH else None,
        )
        for code, z, t, parameters in zip(passed.code, passed.z, passed.t, p, strict=True)
    ]


def _end(
    curve: ParameterLine, outcome: Outcome, number: int, within: tuple[Constraint, ...]
) -> Event:
    code, z, t = int(outcome.code[0]), outcome.z[0], outcome.t
    state = State(curve.structure, z, curve.parameters(t)[0])
    kind, detail, critical = KINDS[code], outcome.why.get(0, ""), None
    if code == CONSTRAINT:
        worst = max(within, key=lambda c: c.excess(state.z[None], state.p[None])[0])
        detail = str(worst)
    if code == BRANCH:
        critical = criticality(curve, z[None], t)[0]
        detail = critical
    return Event(kind, state, number + float(t[0]), critical, detail)


def _joined(start: State, pieces: list[_Segment]) -> Path:
    z = np.concatenate([start.z[None], *(piece.z for piece in pieces)])
    p = np.concatenate([start.p[None], *(piece.p for piece in pieces)])
    at = np.concatenate([[0.0], *(piece.at for piece in pieces)])
    lengths, travelled = [np.zeros(1)], 0.0
    for piece in pieces:
        lengths.append(travelled + piece.length)
        travelled = lengths[-1][-1] if len(piece.length) else travelled
    index = np.concatenate([[start.index], *(piece.index for piece in pieces)]).astype(int)
    passed = [event for piece in pieces for event in piece.events[:-1]]
    middle = [piece.events[-1] for piece in pieces[-1:]]
    states = States(start.structure, z, p)
    return Path(states, at, np.concatenate(lengths), index, (*passed, *middle))

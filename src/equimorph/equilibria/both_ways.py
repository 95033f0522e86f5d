"""Both sides of a curve of critical states, as one result."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria.following import (
    Landmark,
    Side,
    Watch,
    follow_side,
    negative_others,
    watched,
)
from equimorph.equilibria.lift import Event
from equimorph.equilibria.locus import Locus, Spot, settle
from equimorph.equilibria.normal_form import normal_form
from equimorph.equilibria.tracing import TraceOptions
from equimorph.errors import InputError
from equimorph.model import position
from equimorph.structures import State, States

NEAR = 1e-3
"""Distance in the metric by which a start may miss its curve."""


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
        Length along the curve per state, in the metric and scaled parameters; 0 at the start given.
    index
        Negative eigenvalues besides the one that vanishes, per state: 0 where the curve bounds
        stable states.
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
    kind: str,
    locus: Locus,
    state: State,
    watches: list[Watch],
    options: TraceOptions | None,
) -> CriticalCurve:
    """Follow a locus from a state in both directions.

    Raises
    ------
    InputError
        If the state is not on the locus.
    """
    options = options or TraceOptions(largest_step=0.2)
    x = locus.joined(state.z, state.p)
    start = settle(locus, x)
    if start is None or np.sqrt((start.x - x) ** 2 @ locus.weights) > NEAR:
        raise InputError(
            f"`state` must lie on a {kind} curve in {_names(locus)}; no such state was found "
            f"within {NEAR:g} of it."
        )
    start = _oriented(locus, start)
    forward = follow_side(locus, start, watches, options)
    if forward.end.kind == "closed":
        backward = Side([start], [0.0], [], forward.end)
    else:
        back = Spot(start.x, np.vstack([-start.basis[:1], start.basis[1:]]), start.b)
        backward = follow_side(locus, back, watches, options)
        if backward.end.kind == "closed":
            forward = Side([start], [0.0], [], backward.end)
    return _curve(kind, locus, _at_start(locus, start, watches), (backward, forward))


def _names(locus: Locus) -> str:
    return ", ".join(locus.structure.parameters[place].name for place in locus.free)


def _oriented(locus: Locus, spot: Spot) -> Spot:
    """Towards a growing first parameter (or second, if the first does not change)."""
    change = spot.tangent[locus.structure.size :]
    moving = np.flatnonzero(np.abs(change) > 1e-6)
    sign = np.sign(change[moving[0]]) if len(moving) else 1.0
    return Spot(spot.x, np.vstack([sign * spot.basis[:1], spot.basis[1:]]), spot.b)


def _at_start(locus: Locus, start: Spot, watches: list[Watch]) -> list[Landmark]:
    """Special points at the start itself."""
    values, slopes = watched(locus, start, watches, np.zeros(len(watches)))
    return [
        Landmark(watch.kind, start, 0.0, watch.detail)
        for watch, value, slope in zip(watches, values, slopes, strict=True)
        if not watch.ends and value == 0.0 and abs(slope) > 1e-6
    ]


def _curve(
    kind: str, locus: Locus, here: list[Landmark], sides: tuple[Side, Side]
) -> CriticalCurve:
    backward, forward = sides
    back = [Landmark(m.kind, m.spot, -m.length, m.detail) for m in backward.landmarks[::-1]]
    closed = forward.end.kind == "closed"
    first = forward.end if closed else backward.end
    ends = (Landmark(first.kind, first.spot, -backward.lengths[-1], first.detail), forward.end)
    spots = [*backward.spots[:0:-1], *forward.spots]
    lengths = np.concatenate([-np.array(backward.lengths[:0:-1]), forward.lengths])
    z, p = locus.split(np.array([spot.x for spot in spots]))
    return CriticalCurve(
        kind,
        tuple(locus.structure.parameters[place].name for place in locus.free),
        States(locus.structure, z, p),
        lengths,
        np.array([negative_others(locus, spot) for spot in spots]),
        tuple(_event(locus, mark) for mark in (*back, *here, *forward.landmarks)),
        (_event(locus, ends[0]), _event(locus, ends[1])),
    )


def _event(locus: Locus, mark: Landmark) -> Event:
    z, p = locus.split(mark.spot.x[None])
    detail, critical = mark.detail, None
    if mark.kind == "cusp":
        cubic = locus.critical(mark.spot.x[None], mark.spot.b).cubic[0]
        detail = "standard" if cubic > 0.0 else "dual"
    if mark.kind == "branch point":
        dp = np.zeros_like(p)
        dp[0, position(locus.structure.parameters, detail)] = 1.0
        critical = normal_form(locus.structure, z, p, dp).kinds[0]
    return Event(mark.kind, State(locus.structure, z[0], p[0]), mark.length, critical, detail)

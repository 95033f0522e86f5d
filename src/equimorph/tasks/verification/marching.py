"""States along a polyline in parameter space, each leg lifted side by side with the others."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags
from equimorph.equilibria import Event, Lifts, TraceOptions, lift, newton
from equimorph.model import Constraint, names_of
from equimorph.structures import State, States

Rows = Float[np.ndarray, "rows parameters"]

SAME = 1e-6
"""Distance in the metric within which a lifted state is the one that Newton found."""
AT_GOAL = 1e-9
"""Share of a leg that may be missing: steps that end at the goal but for round-off count."""


@dataclass(frozen=True, eq=False)
class March:
    """Exact states along a polyline, and how the way ended.

    Parameters
    ----------
    states
        All points in order: corners, and those where the lifts stopped between them.
    at
        Number of the leg + share of it, per state.
    corners
        Which states are the corners that were reached.
    end
        The last event: "arrived", or what ended the way.
    """

    states: States
    at: Float[np.ndarray, " points"]
    corners: Int[np.ndarray, " corners"]
    end: Event


def march(start: State, rows: Rows, within: tuple[Constraint, ...], options: TraceOptions) -> March:
    """Follow the straight legs from the parameters of `start` through those of each row.

    Newton leads from corner to corner; that it stays on the curve is what the lifts of all legs,
    side by side, then show. Where a lift comes to another state, the march goes on from that one.
    """
    legs: list[March] = []
    done, here = 0, start
    while done < len(rows):
        nodes = _by_newton(here, rows[done:])
        lifts = _lifted(nodes[:-1], nodes.p[1:], within, options)
        good = _true(lifts, nodes[1:])
        legs.append(_part(nodes[0], lifts, good + 1, done))
        done += min(good + 1, len(nodes) - 1)
        here = legs[-1].end.state
        if legs[-1].end.kind != "arrived":
            break
    return _joined(start, legs)


def _by_newton(start: State, rows: Rows) -> States:
    """States over rows by Newton from each to the next; at least one beyond the start."""
    structure, z = start.structure, [start.z]
    for row in rows:
        new, found = newton(structure, z[-1][None], row[None])
        if not found[0]:
            break
        z.append(new[0])
    # a leg that Newton cannot take is given to the lift, whatever its end
    if len(z) == 1:
        z.append(start.z)
    return States(structure, np.array(z), np.concatenate([start.p[None], rows[: len(z) - 1]]))


def _lifted(
    states: States, to: Rows, within: tuple[Constraint, ...], options: TraceOptions
) -> Lifts:
    names = names_of(states.structure.parameters)
    columns = {name: to[:, k].copy() for k, name in enumerate(names)}
    return lift(states, columns, within=within, options=options)


def _true(lifts: Lifts, goals: States) -> int:
    """Number of legs, from the first on, whose lifts arrive at the goal."""
    gap = (lifts.states.z - goals.z)[:, : goals.structure.unknowns] ** 2 @ goals.structure.mass
    bad = np.flatnonzero(~_there(lifts) | (np.sqrt(gap) > SAME))
    return int(bad[0]) if len(bad) else len(goals)


def _there(lifts: Lifts) -> Flags:
    """Which lifts came to their goals."""
    return np.asarray(lifts.arrived | ((lifts.kind == "lost") & (lifts.at > 1.0 - AT_GOAL)))


def _part(start: State, lifts: Lifts, legs: int, before: int) -> March:
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
    z = np.concatenate([points.states.z[ours], lifts.states.z[:legs]])[order]
    p = np.concatenate([points.states.p[ours], lifts.states.p[:legs]])[order]
    corner = np.flatnonzero(order >= len(ours))
    end = lifts[legs - 1]
    kind = "arrived" if _there(lifts)[legs - 1] else end.kind
    ended = Event(kind, end.state, before + legs - 1 + end.at, end.criticality, end.detail)
    states = States(start.structure, z, p)
    return March(states, before + (lane + at)[order], corner, ended)


def _joined(start: State, parts: list[March]) -> March:
    z = np.concatenate([start.z[None], *(part.states.z for part in parts)])
    p = np.concatenate([start.p[None], *(part.states.p for part in parts)])
    at = np.concatenate([np.zeros(1), *(part.at for part in parts)])
    corners, count = [np.zeros(1, int)], 1
    for part in parts:
        corners.append(part.corners + count)
        count += len(part.states)
    return March(States(start.structure, z, p), at, np.concatenate(corners), parts[-1].end)

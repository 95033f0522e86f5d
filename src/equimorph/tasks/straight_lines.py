"""What lies between states where parameters move straight from each to the next."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Flags, Float, Int, Parameters
from equimorph.equilibria import Lifts, TraceOptions, lift
from equimorph.manifold.lookup.exact_states import exact_states
from equimorph.model import Constraint, names_of
from equimorph.structures import State, States, join_states
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_STATE

FINE = TraceOptions(largest_step=0.02, first_step=0.01, turning=0.05, steps=20000)
"""Step control of the final check of every route."""
AT_GOAL = 1e-9
"""Share of a line that may be missing: steps that end at the goal but for round-off count."""

SECTIONS, ROUNDS = 8, 6
"""Parts into which brackets of a least value are divided, and how often: what is left is a 4000th,
and the least value errs by the square of half of that."""
DEEPER = 4.0
"""How much deeper a dip may be than the parabola through the ends and the middle of a line."""
HIGHER = 2.0
"""Ratio to the least margin of both ends up to which a line may dip below it."""

Places = Float[np.ndarray, " lines"]


def lift_straight(
    begin: States, to: Parameters, within: tuple[Constraint, ...] = (), options: TraceOptions = FINE
) -> Lifts:
    """Lift states along straight lines, each to its own parameters."""
    columns = {name: to[:, k].copy() for k, name in enumerate(names_of(begin.structure.parameters))}
    return lift(begin, columns, within=within, options=options)


def are_there(lifts: Lifts) -> Flags:
    """Which lifts came to their goals."""
    return np.asarray(lifts.arrived | ((lifts.kind == "lost") & (lifts.at > 1.0 - AT_GOAL)))


def are_led(lifts: Lifts, goals: States) -> Flags:
    """Which lifts came to the states that were their goals."""
    gap = metric_length(goals.structure, lifts.states.z - goals.z)
    return np.asarray(are_there(lifts) & (gap <= SAME_STATE))


def leads_on(states: States) -> Flags:
    """Which straight lines lead from each state to the next one without a loss."""
    return are_led(lift_straight(states[:-1], states.p[1:]), states[1:])


def states_between(
    states: States, lines: Int[np.ndarray, " lines"], shares: Places
) -> tuple[States, Flags]:
    """Stable states at shares of lines, by their numbers, and where there are any.

    Newton's method from the line between both ends; beside folds, where it fails, lifts.
    """
    z, p = (
        column[lines] + shares[:, None] * (column[lines + 1] - column[lines])
        for column in (states.z, states.p)
    )
    z, good, index = exact_states(states.structure, z, p)
    stable = good & (index == 0)
    lost = np.flatnonzero(~stable)
    if len(lost):
        lifts = lift_straight(states[lines[lost]], p[lost])
        z[lost], stable[lost] = lifts.states.z, are_there(lifts)
    return States(states.structure, z, p), stable


class Least(NamedTuple):
    """Least margin, the state that has it, and the number of the last state before it."""

    margin: float
    state: State
    number: int


def least_margin(states: States, margins: Float[np.ndarray, " states"]) -> Least:
    """Least margin where parameters move straight from state to state; see `least_margins`."""
    return least_margins([states], [margins])[0]


def least_margins(
    chains: Sequence[States], margins: Sequence[Float[np.ndarray, " states"]]
) -> list[Least]:
    """Least margin of each of some chains, where parameters move straight from state to state.

    Every line may be a chord that dips towards a fold. Where its middle leaves a doubt, the least
    is searched among exact states, in smaller and smaller sections.
    """
    if not chains:
        return []
    states, every = join_states(chains[0].structure, chains), np.concatenate(margins)
    chain = np.repeat(np.arange(len(chains)), [len(each) for each in chains])
    out = list[Least]()
    for each, known in zip(chains, margins, strict=True):
        lowest = int(np.argmin(known))
        out.append(Least(float(known[lowest]), each[lowest], lowest))
    low = _doubtful(states, every, chain, np.array([least.margin for least in out]))
    if not len(low):
        return out
    owner, width = np.repeat(chain[low.astype(int)], SECTIONS - 1), 1.0
    for _ in range(ROUNDS):
        width /= SECTIONS
        inner = low[:, None] + width * np.arange(1, SECTIONS)
        places = inner.ravel()
        found, between = _margins(states, places)
        low = low + width * found.reshape(inner.shape).argmin(axis=1)
        width *= 2.0
    for number in np.unique(owner).tolist():
        own = np.flatnonzero(owner == number)
        best = own[np.argmin(found[own])]
        if found[best] < out[number].margin:
            line = int(places[best]) - int(np.searchsorted(chain, number))
            out[number] = Least(float(found[best]), between[best], line)
    return out


def _doubtful(
    states: States,
    margins: Float[np.ndarray, " states"],
    chain: Int[np.ndarray, " states"],
    least: Float[np.ndarray, " chains"],
) -> Places:
    """Numbers of the lines along which the margin may fall below all values of their chains."""
    known = least[chain[:-1]]
    lower = np.minimum(margins[:-1], margins[1:])
    near = lower <= known + (HIGHER - 1) * np.abs(known)
    moved = (states.p[1:] != states.p[:-1]).any(axis=1)
    lines = np.flatnonzero(near & moved & (chain[1:] == chain[:-1]))
    first, last = margins[lines], margins[lines + 1]
    middle = _margins(states, lines + 0.5)[0]
    # the parabola a + slope s + bend s² over −½ ≤ s ≤ ½ around the middle
    slope, bend = last - first, 2.0 * (first + last) - 4.0 * middle
    inside = np.abs(slope) < DEEPER * np.abs(bend)
    lowest = middle - DEEPER * slope**2 / (4.0 * np.maximum(bend, 1e-300))
    low = np.where(inside & (bend > 0.0), np.minimum(lowest, middle), np.inf)
    return np.asarray(lines[(low < known[lines]) | ~np.isfinite(middle)], float)


def _margins(states: States, places: Places) -> tuple[Places, States]:
    """Margins at places between states, and the states there; infinite where none is found."""
    lines = np.minimum(places.astype(int), len(states) - 2)
    between, stable = states_between(states, lines, places - lines)
    margins = np.full(len(places), np.inf)
    margins[stable] = between[np.flatnonzero(stable)].margin
    return margins, between

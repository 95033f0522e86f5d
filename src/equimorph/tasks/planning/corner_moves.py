"""Corners of a route moved to where its legs cost least, every other corner at a time."""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Bool, Float, Int, Values
from equimorph.equilibria import Guards, settle
from equimorph.model import Box
from equimorph.structures import States, join_states
from equimorph.tasks.planning.network import Demands, connect
from equimorph.tasks.planning.objectives import Places, arc_lengths

Some = Int[np.ndarray, " n"]

FEW = Guards(iterations=8)
"""Limits of corrections of moved corners, which begin close to the set."""
SIZES = (0.12, 0.04, 0.013)
"""Moves of corners, in scaled parameters, that are tried one after the other."""
ROUNDS, POLISHING = 6, 2
"""Rounds of moves of one size: from a rough path, and for the last improvements."""
LEAST_GAIN = 2e-6
"""Share of the cost that a move has to gain."""


@dataclass(frozen=True)
class ActuatorBox:
    """Box in which corners may move, and the places of its parameters among all."""

    box: Box
    free: Int[np.ndarray, " d"]


@dataclass(frozen=True)
class _Chain:
    """Corners and the costs of their legs: along chords, and by lifts if these count."""

    corners: Places
    legs: Values
    lifts: Values | None


@dataclass(frozen=True)
class _Moves:
    """Corners elsewhere: which ones, where, and what both legs would cost there."""

    tried: Some
    new: Places
    legs: Float[np.ndarray, "2 n"]
    lifts: Float[np.ndarray, "2 n"] | None = None

    def __getitem__(self, some: Some) -> "_Moves":
        """Some of them."""
        lifts = None if self.lifts is None else self.lifts[:, some]
        return _Moves(self.tried[some], self.new[some], self.legs[:, some], lifts)


def move_by_chords(corners: States, demands: Demands, room: ActuatorBox) -> States:
    """Move corners as long as that makes their chords cheaper.

    A chord runs through the exact state halfway between two corners; costs are summed over its two
    halves, and margins and constraints hold at all of these states. Whether the result can be
    lifted is decided by `connect`.
    """
    return _move_corners(corners, demands, room, SIZES, ROUNDS, by_lifts=False)


def move_by_lifts(corners: States, demands: Demands, room: ActuatorBox, quick: bool) -> States:
    """Move corners as long as that makes the straight lifts between them cheaper.

    `quick`: with small steps and few rounds, for the last improvements.
    """
    sizes, rounds = (SIZES[1:], POLISHING) if quick else (SIZES, ROUNDS)
    return _move_corners(corners, demands, room, sizes, rounds, by_lifts=True)


def chords(
    corners: States, first: Some, second: Some, demands: Demands
) -> tuple[Bool[np.ndarray, " n"], Values]:
    """Whether chords between corners seem admissible, and their costs; lengths are of arcs."""
    places = demands.objective.places(corners)
    return _chords(places[first], places[second], demands, arcs=demands.objective.is_length)


def _move_corners(
    corners: States,
    demands: Demands,
    room: ActuatorBox,
    sizes: tuple[float, ...],
    rounds: int,
    by_lifts: bool,
) -> States:
    """Move every other corner in turn, by smaller and smaller steps, while that saves cost."""
    places = demands.objective.places(corners)
    legs = _chords(places[:-1], places[1:], demands)[1]
    lifts = connect(corners[:-1], corners[1:], demands)[1] if by_lifts else None
    chain = _Chain(places, legs, lifts)
    for size in sizes:
        for _ in range(rounds):
            before = chain
            for odd in (1, 2):
                chain = _move_every_other(chain, odd, size, demands, room)
            if chain is before:
                break
    return chain.corners.states


def _chords(
    first: Places, second: Places, demands: Demands, *, arcs: bool = False
) -> tuple[Bool[np.ndarray, " n"], Values]:
    """Whether the states halfway between pairs are admissible, and the cost through them."""
    a, b = first.states, second.states
    p = 0.5 * (a.p + b.p)
    halfway = settle(a.structure, 0.5 * (a.z + b.z), p, guards=FEW)
    z, good = halfway.z, halfway.found
    some = np.flatnonzero(good)
    amid = States(a.structure, z[some], p[some])
    middle, between = demands.objective.places(amid), demands.objective.between
    cost = np.full(len(p), np.nan)
    halves = between(first[some], middle), between(middle, second[some])
    cost[some] = halves[0] + halves[1]
    if arcs:
        cost[some] = arc_lengths(*halves, between(first[some], second[some]))
    none = np.flatnonzero(~good)
    cost[none] = between(first[none], second[none])
    good[some] = demands.admissible(amid)
    return good, cost


def _move_every_other(
    chain: _Chain, odd: int, size: float, demands: Demands, room: ActuatorBox
) -> _Chain:
    """Chain with every other corner moved, if that makes its two legs cheaper."""
    tried, new = _candidates(chain.corners.states, odd, size, room)
    some = np.flatnonzero(demands.admissible(new)) if len(tried) else tried
    if len(some) == 0:
        return chain
    tried, places = tried[some], demands.objective.places(new[some])
    before = _interleave(chain.corners[tried - 1], places)
    after = _interleave(places, chain.corners[tried + 1])
    good, cost = _chords(before, after, demands)
    moves = _Moves(tried, places, cost.reshape(2, -1))
    gain = _gain(chain.legs, tried, good, cost)
    if chain.lifts is not None:  # lifts are for moves that look good: those that fail take longest
        some = np.flatnonzero(gain > 0.0)
        if len(some) == 0:
            return chain
        moves = moves[some]
        both = np.concatenate([some, some + len(tried)])
        good, cost = connect(before.states[both], after.states[both], demands)
        moves = replace(moves, lifts=cost.reshape(2, -1))
        gain = _gain(chain.lifts, moves.tried, good, cost)
    least = LEAST_GAIN * (chain.legs if chain.lifts is None else chain.lifts).sum()
    return _take_best(chain, moves, np.where(gain > least, gain, 0.0))


def _interleave(first: Places, second: Places) -> Places:
    return Places(
        join_states(first.states.structure, (first.states, second.states)),
        np.concatenate([first.efforts, second.efforts]),
        np.concatenate([first.nearness, second.nearness]),
    )


def _candidates(corners: States, odd: int, size: float, room: ActuatorBox) -> tuple[Some, States]:
    """Equilibria near every second corner, and the corner that each of them would replace.

    Whether these lie on the branch of the corner is what lifts from its neighbours show.
    """
    box, free = room.box, room.free
    at = np.arange(odd, len(corners) - 1, 2)
    structure = corners.structure
    steps = size * structure.scales[free] * _directions(len(free))
    tried, step = np.repeat(at, len(steps)), np.tile(steps, (len(at), 1))
    p = corners.p[tried]
    p[:, free] = np.clip(p[:, free] + step, box.lower, box.upper)
    some = np.flatnonzero(np.abs(p - corners.p[tried]).max(axis=1, initial=0.0) > 0.0)
    tried, p = tried[some], p[some]
    moved = settle(structure, corners.z[tried], p, guards=FEW)
    there = moved.found
    return tried[there], States(structure, moved.z[there], p[there])


def _directions(d: int) -> Float[np.ndarray, "directions d"]:
    """Both directions along every parameter, and diagonals of every two."""
    units = np.eye(d)
    first, second = np.triu_indices(d, 1)
    amid = [units[first] + sign * units[second] for sign in (1.0, -1.0)]
    half = np.concatenate([units, *(0.5**0.5 * each for each in amid)])
    return np.concatenate([half, -half])


def _gain(
    old: Values, tried: Some, good: Bool[np.ndarray, " legs"], cost: Float[np.ndarray, " legs"]
) -> Float[np.ndarray, " n"]:
    """What each move saves; −∞ where a leg is broken."""
    both, total = good.reshape(2, -1).all(axis=0), cost.reshape(2, -1).sum(axis=0)
    return np.where(both, old[tried - 1] + old[tried] - total, -np.inf)


def _take_best(chain: _Chain, moves: _Moves, gain: Float[np.ndarray, " n"]) -> _Chain:
    """Chain with the best of the moves that gain something, one for each corner."""
    best = np.full(len(chain.corners.states), 0.0)
    np.maximum.at(best, moves.tried, gain)
    chosen = np.flatnonzero((gain > 0.0) & (gain == best[moves.tried]))
    if len(chosen) == 0:
        return chain
    took = moves[chosen]
    corners = chain.corners.replace_at(took.tried, took.new)
    legs, lifts = _replace_costs(chain.legs, took.tried, took.legs), chain.lifts
    if lifts is not None and took.lifts is not None:
        lifts = _replace_costs(lifts, took.tried, took.lifts)
    return _Chain(corners, legs, lifts)


def _replace_costs(legs: Values, tried: Some, new: Float[np.ndarray, "2 n"]) -> Values:
    out = legs.copy()
    out[tried - 1], out[tried] = new
    return out

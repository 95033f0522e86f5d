"""Exact states at given parameters: from guesses, along straight moves, or over points."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Numbers, Some
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.manifold.lookup.kernels import root_shares
from equimorph.model import Constraint
from equimorph.structures import States, Structure
from equimorph.structures.metric import metric_coordinates, metric_length
from equimorph.structures.newton import Limits, newton
from equimorph.tolerances import SAME_STATE


@dataclass(frozen=True, eq=False)
class StatesOver:
    """States of a set over points, sorted by point: the sheets over each.

    Parameters
    ----------
    states
        All states.
    point
        Number of the point that each lies over.
    cell
        Cell of the set that each lies on, −1 where only a lift found it.
    index
        Negative eigenvalues; 0 is stable.
    stratum, component
        Numbers of the pieces of the set that each lies on, −1 if not known.
    count
        Number of points.
    """

    states: States
    point: Numbers
    cell: Numbers
    index: Numbers
    stratum: Numbers
    component: Numbers
    count: int

    def __len__(self) -> int:
        """Number of points."""
        return self.count

    def __getitem__(self, number: int) -> "StatesOver":
        """States over one of the points."""
        if not 0 <= number < self.count:
            raise IndexError(f"there are {self.count} points; got number {number}")
        mine = slice(*np.searchsorted(self.point, (number, number + 1)))
        cell, index, stratum, component = (
            column[mine] for column in (self.cell, self.index, self.stratum, self.component)
        )
        alone = np.zeros_like(cell)
        return StatesOver(self.states[mine], alone, cell, index, stratum, component, 1)

    def __iter__(self) -> Iterator["StatesOver"]:
        """Go through the points one by one."""
        return (self[number] for number in range(self.count))

    def __repr__(self) -> str:
        """How many states over how many points."""
        return f"StatesOver({len(self.states)} states over {self.count} points)"


ROUND_OFF = 1e-14
"""Bound of the next Newton correction, in the metric, below which a state is exact."""
NEARER = 0.5
"""Largest correction, relative to the one before, of lanes that get nearer."""
CLOSEST = 1e-3
"""Least share of a cell between its fold and a guess: at the fold Newton's matrix is singular."""
NEAREST = 6
"""States over a point that are lifted across a fold nearby, and cells that are tried for a state:
the nearest ones. Hundreds of sheets of a chain or truss lie over one point."""
COMPARED = 256
"""Pairs of states and guesses that are compared at once: their copies stay in the cache."""

Points = Float[np.ndarray, "points P"]
Found = tuple[Float[np.ndarray, "_ size"], Int[np.ndarray, " _"], Int[np.ndarray, " _"]]
"""States, the points that they lie over, and their cells."""


def exact_states(
    structure: Structure, z: Lanes, p: Points, wanted: Numbers | None = None
) -> tuple[Lanes, Flags, Numbers]:
    """States at fixed parameters, exact to round-off; which were found; and their index.

    Where there is no state beyond a fold, Newton leaps over the fold again and again: lanes that do
    not get nearer and do not have the `wanted` index, if one is given, are given up.
    """
    contraction = np.inf if wanted is None else NEARER
    limits = Limits(
        40, np.inf, 1.0, ROUND_OFF, following=ROUND_OFF, contraction=contraction, free=2,
        exempt=wanted,
    )  # fmt: skip
    found = newton(structure, z, p, limits)
    return found.z, found.found, found.index


STRAIGHT_ON = TraceOptions(
    through_folds=True, through_branch_points=True, record=False, locate_passed=False
)


def lifts_across_folds(
    states: States, velocity: Points
) -> tuple[Float[np.ndarray, "some size"], Some]:
    """States in which moves of the parameters end that turn back at a fold; which moves do.

    Only where the energy is valid: beyond, paths may lead into a singularity in ever smaller steps.
    """
    line = ParameterLine(states.structure, states.p.copy(), velocity)
    outcome = trace(line, states.z.copy(), states.structure.validity, STRAIGHT_ON)
    which = np.flatnonzero(outcome.code == EventCode.RETURNED)
    return outcome.z[which], which


def lift_to(
    states: States, p: Points, constraints: tuple[Constraint, ...]
) -> tuple[Float[np.ndarray, "arrived size"], Int[np.ndarray, " arrived"]]:
    """Equilibria that straight lifts from `states` to p, one for each, reach; which they are."""
    velocity = p - states.p
    still = np.abs(velocity).max(axis=1, initial=0.0) == 0.0
    moving = np.flatnonzero(~still)
    line = ParameterLine(states.structure, states.p[moving].copy(), velocity[moving])
    outcome = trace(line, states.z[moving].copy(), constraints, STRAIGHT_ON)
    arrived = outcome.code == EventCode.ARRIVED
    which = np.concatenate([np.flatnonzero(still), moving[arrived]])
    return np.concatenate([states.z[still], outcome.z[arrived]]), which


def parted(states: States, p: Points, constraints: tuple[Constraint, ...]) -> Flags:
    """Whether violations end straight lifts from `states` to p, one for each."""
    line = ParameterLine(states.structure, states.p.copy(), p - states.p)
    code = trace(line, states.z.copy(), constraints, STRAIGHT_ON).code
    return np.asarray(code == EventCode.CONSTRAINT)


def nearest_pairs(
    structure: Structure,
    z: Float[np.ndarray, "states size"],
    guess: Float[np.ndarray, "guesses size"],
    pairs: Int[np.ndarray, "2 pairs"],
    group: Int[np.ndarray, " pairs"],
    most: int,
) -> Int[np.ndarray, " chosen"]:
    """Of pairs of states and guesses, in sorted groups, the ones nearest to each other of each.

    `pairs` has the numbers of the state and the guess of each. Some are compared at a time, because
    of thousands of states of many unknowns the copies would be longer to write than to compare.
    """
    gap = np.empty(len(group))
    for at in range(0, len(gap), COMPARED):
        state, number = pairs[:, at : at + COMPARED]
        gap[at : at + COMPARED] = metric_length(structure, z[state] - guess[number])
    order = np.lexsort((gap, group))
    rank = np.arange(len(order)) - np.searchsorted(group, group[order])
    return np.sort(order[rank < most])


def root_weights(
    weights: Float[np.ndarray, "n corners"], folded: Bool[np.ndarray, "n corners"]
) -> Float[np.ndarray, "n corners"]:
    """Weights of corners with the root of the share of those off the fold as their share."""
    weights = weights.copy()
    root_shares(weights, folded, CLOSEST)
    return weights


def first_of_same(structure: Structure, z: Lanes) -> Int[np.ndarray, " distinct"]:
    """States that no earlier one is the same as."""
    u = metric_coordinates(structure, z)
    return np.flatnonzero(~np.tril(cdist(u, u) <= SAME_STATE, -1).any(axis=1))


def in_order(parts: list[Found]) -> Found:
    """States of all parts, sorted by point and cell; each state is copied once."""
    point, cell = (np.concatenate([part[k] for part in parts]) for k in (1, 2))
    order = np.lexsort((cell, point))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    z, first = np.empty((len(order), parts[0][0].shape[1])), 0
    for states, _, _ in parts:
        z[place[first : first + len(states)]] = states
        first += len(states)
    return z, point[order], cell[order]

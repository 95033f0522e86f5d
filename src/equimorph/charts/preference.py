"""The choice of a rule over points and at states, and where states tie with the best others."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import (
    Flags,
    Float,
    Lanes,
    Parameters,
    Points,
    Some,
    Values,
)
from equimorph.charts.location import Cells, Found
from equimorph.charts.rules import Choice, Scoring
from equimorph.columns import Columns
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.model import Constraint
from equimorph.structures import States, Structure, join_states
from equimorph.structures.metric import metric_length
from equimorph.structures.newton import Limits, newton

DIFFERENT = 1e-4
"""Distance in the metric from which on two states over a point are different ones."""
ITERATIONS = 24
"""Most steps of the regula falsi with halved values, whose order is 1.44."""
LEAST_STEP = 1e-13
"""Change of a share from which on it counts as exact."""
NEAR = Limits(too_long=1.0)
"""Newton's method from guesses between states: scores do not feel what is left after its last step,
whose square it is."""
ENDS = (EventCode.FOLD, EventCode.BRANCH_POINT, EventCode.CONSTRAINT)


@dataclass(frozen=True, eq=False)
class Preference:
    """A rule and the cells among which it chooses."""

    cells: Cells
    choice: Choice

    def over(self, points: Points) -> Found:
        """Preferred states over points."""
        found = self.cells.find(points)
        return found.take(self.choice.choose(found, points))

    def prefers(self, z: Lanes, p: Parameters, found: Found | None = None) -> Flags:
        """Whether states of the set are the preferred ones over their points.

        `found`: all states over these points, if they are known.
        """
        both, points = self._with_others(z, p, found)
        return self.choice.choose(both, points)[len(both.point) - len(z) :]

    def excess(self, z: Lanes, p: Parameters) -> Values:
        """Function that is positive where another state is preferred.

        The score less that of the best other state, which is smooth where the preference changes;
        −1 where no other state exists. ±1 for rules without a score.
        """
        if self.choice.score is None:
            return np.where(self.prefers(z, p), -1.0, 1.0)
        both, _ = self._with_others(z, p)
        others = len(both.point) - len(z)
        score, best = self.choice.score(both), np.full(len(z), np.inf)
        np.minimum.at(best, both.point[:others], score[:others])
        alone = ~np.isfinite(best)
        return np.where(alone, -1.0, score[others:] - np.where(alone, 0.0, best))

    def changes(self, start: States, stop: States) -> Float[np.ndarray, "lanes k"]:
        """Shares of straight ways at which the choice may change; see `Changes`.

        `start`, `stop`: the same states at both ends of the ways, not preferred and preferred.
        """
        choice, constraints = self.choice, self.cells.eset.constraints
        if choice.changes is not None:
            return choice.changes(start.p, stop.p - start.p)
        if choice.score is None:
            return np.zeros((len(start), 0))
        both, _ = self._with_others(start.z, start.p)
        return _changes_by_score(choice.score, both, stop, constraints)

    def _with_others(
        self, z: Lanes, p: Parameters, found: Found | None = None
    ) -> tuple[Found, Points]:
        """Other states over the points of states, then these; and the points.

        A rule without a score names one state, whatever others there are: they are left out.
        """
        structure = self.cells.eset.structure
        points = self.cells.coordinates(z, p)
        if found is None:
            found = self.cells.find(points if self.choice.score is not None else points[:0])
        own = metric_length(structure, found.states.z - z[found.point]) < DIFFERENT
        # the state itself takes part as it is: at a fold no search would find it
        cell = np.full(len(z), -1)
        cell[found.point[own]] = found.cell[own]
        others = found.take(~own)
        states = join_states(structure, [others.states, States(structure, z, p)])
        itself = np.arange(len(z))
        both = Found(
            states,
            np.concatenate([others.point, itself]),
            np.concatenate([others.cell, cell]),
            np.concatenate([others.inside, np.ones(len(z), bool)]),
        )
        return both, points


@dataclass(frozen=True)
class _Moving(Columns):
    """States at both ends of straight ways, their indices, and the cells where they start."""

    first: Lanes
    last: Lanes
    index: Some
    cell: Some

    def at(self, structure: Structure, p: Parameters, share: Values) -> tuple[Lanes, Flags]:
        """States between the ends, and which were found on the same sheets."""
        guess = self.first + share[:, None] * (self.last - self.first)
        # beside a cusp round-off alone makes Newton's steps longer than `exact_states` allows
        found = newton(structure, guess, p, NEAR)
        return found.z, found.found & (found.index == self.index)


@dataclass(frozen=True)
class _Ways(Columns):
    """Ways along which states and their best rivals move."""

    start: Parameters
    velocity: Parameters
    own: _Moving
    rival: _Moving

    def lead(self, structure: Structure, score: Scoring, share: Values) -> Values:
        """Scores of states less those of their rivals; not numbers where one was not found."""
        p = self.start + share[:, None] * self.velocity
        sides = [each.at(structure, p, share) for each in (self.own, self.rival)]
        states = join_states(structure, [States(structure, z, p) for z, _ in sides])
        cell, lanes = np.concatenate([self.own.cell, self.rival.cell]), np.arange(len(share))
        found = Found(states, np.tile(lanes, 2), cell, np.ones(len(cell), bool))
        own, rival = np.split(score(found), 2)
        return np.where(sides[0][1] & sides[1][1], own - rival, np.nan)


def _changes_by_score(
    score: Scoring, found: Found, stop: States, constraints: tuple[Constraint, ...]
) -> Float[np.ndarray, "lanes 2"]:
    """Shares of straight ways at which states tie with their best rivals, and at which these end.

    Not numbers where they do not. `found` are all states over the starts of the ways, and the
    rivals are those there; `stop` are the states that move at the ends. Constraints end rivals.
    """
    structure, count = stop.structure, len(found.point) - len(stop)
    out, value = np.full((len(stop), 2), np.nan), score(found)
    order = np.lexsort((value[:count], found.point[:count]))
    best = order[np.diff(found.point[order], prepend=-1) > 0]
    lane = found.point[best]
    own, rival = found.states[count:][lane], found.states[best]
    velocity = stop.p[lane] - own.p
    line = ParameterLine(structure, own.p.copy(), velocity)
    out[lane, 1], ended = shares_of_ends(line, rival.z.copy(), constraints)
    ways = _Ways(
        own.p,
        velocity,
        _Moving(own.z, stop.z[lane], structure.index(own.z, own.p), found.cell[count + lane]),
        _Moving(rival.z, ended.z, structure.index(rival.z, rival.p), found.cell[best]),
    )
    there = np.flatnonzero(ended.code == EventCode.ARRIVED)
    out[lane[there], 0] = _ties(structure, score, ways.take(there))
    return out


def shares_of_ends(
    ways: ParameterLine, z: Lanes, constraints: tuple[Constraint, ...]
) -> tuple[Values, Traces]:
    """Shares of ways at which states on them end, and how they do; not numbers where they do not.

    States at the starts are `z`; besides folds and branch points constraints end them.
    """
    ended = trace(ways, z, constraints, TraceOptions(record=False))
    return np.where(np.isin(ended.code, ENDS), ended.t, np.nan), ended


def _ties(structure: Structure, score: Scoring, ways: _Ways) -> Values:
    """Shares at which the lead of states over their rivals vanishes."""
    count = len(ways.start)
    out, lanes = np.full(count, np.nan), np.arange(count)
    low, high = np.zeros(count), np.ones(count)
    below, above = (ways.lead(structure, score, each) for each in (low, high))
    for _ in range(ITERATIONS):
        open_ = (below * above < 0.0) & (np.abs(high - low) > LEAST_STEP)
        lanes, low, high, below, above = (each[open_] for each in (lanes, low, high, below, above))
        if len(lanes) == 0:
            break
        share = (low * above - high * below) / (above - below)
        out[lanes] = share
        here = ways.take(lanes).lead(structure, score, share)
        beyond = here * above < 0.0
        low, below = np.where(beyond, high, low), np.where(beyond, above, 0.5 * below)
        settled = np.abs(share - high) <= LEAST_STEP
        high, above = share, np.where(settled, 0.0, here)
    return out

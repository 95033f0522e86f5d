"""The choice of a rule over points and at states."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import (
    Flags,
    Float,
    Lanes,
    Parameters,
    Points,
    Values,
)
from equimorph.charts.location import Cells, Found
from equimorph.charts.rules import Choice
from equimorph.charts.score_changes import changes_by_score
from equimorph.structures import States, join_states

DIFFERENT = 1e-4
"""Distance in the metric from which on two states over a point are different ones."""


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
        return changes_by_score(choice.score, both, stop, constraints)

    def _with_others(
        self, z: Lanes, p: Parameters, found: Found | None = None
    ) -> tuple[Found, Points]:
        """Other states over the points of states, then these; and the points.

        A rule without a score names one state, whatever others there are: they are left out.
        """
        structure = self.cells.eset.structure
        points, n = self.cells.coordinates(z, p), structure.unknowns
        if found is None:
            found = self.cells.find(points if self.choice.score is not None else points[:0])
        gap = (found.states.z - z[found.point])[:, :n] ** 2 @ structure.mass
        own = np.sqrt(gap) < DIFFERENT
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

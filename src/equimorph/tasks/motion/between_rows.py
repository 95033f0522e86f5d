"""How far targets are missed between the rows of a schedule, where parameters move straight on."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Parameters, Some
from equimorph.equilibria import Event, EventKind, Leg, Path
from equimorph.model import Constraint, Descriptor, are_feasible
from equimorph.structures import States
from equimorph.structures.metric import distances
from equimorph.tasks.distances import path_lengths, step_lengths
from equimorph.tasks.motion.course import EXACT, Course, correct_onto_targets
from equimorph.tasks.route import describe_place
from equimorph.tasks.straight_lines import are_led, lift_straight, states_between
from equimorph.tolerances import SAME_SOLUTION

MOST_ROWS = 20_000
"""Rows of a schedule beyond which none is inserted."""
SURE = 0.5
"""First correction of a state half-way between rows, relative to the way between these, up to which
it is on their branch."""


@dataclass(frozen=True)
class BetweenRows:
    """A motion whose rows meet targets, and what happens half-way between the rows."""

    path: Path
    """The exact states of the rows."""
    legs: Sequence[Leg]
    descriptors: tuple[Descriptor, ...]
    actuators: tuple[str, ...]
    """Targets, what has targets, and the parameters that are solved for."""
    within: tuple[Constraint, ...]
    """Constraints to obey."""

    @property
    def largest(self) -> dict[str, float]:
        """Largest misses of the targets, by the descriptors' names; see `misses`."""
        most = self.misses().max(axis=0, initial=0.0)
        names = (each.name for each in self.descriptors)
        return dict(zip(names, most.tolist(), strict=True))

    def misses(self) -> Float[np.ndarray, "rows m"]:
        """Misses half-way between successive rows, where the parameters are the means of both.

        Where no stable state is found from the mean of both, the miss is infinite.
        """
        states = self.path.states
        first, last, rows = states[:-1], states[1:], np.arange(len(states) - 1)
        here, stable = states_between(states, rows, np.full(len(rows), 0.5))
        leg, share = self._places()
        out = np.zeros((len(rows), len(self.descriptors)))
        for column, each in zip(out.T, self.descriptors, strict=True):
            wanted = _targets(each, self.legs, leg, share, 0.5 * (each(first) + each(last)))
            gap = np.where(stable, np.abs(each(here) - wanted), np.inf)
            column[:] = np.nan_to_num(gap, nan=0.0, posinf=np.inf)
        return out

    def refined(self, accuracy: float) -> tuple["BetweenRows", str]:
        """Insert rows half-way until all misses are small enough; why they do not become so."""
        here = self
        while True:
            misses = here.misses().max(axis=1, initial=0.0)
            coarse = np.flatnonzero(misses > accuracy)
            if not len(coarse):
                return here, ""
            missed = f"the targets are missed by {misses.max():.3g}, not {accuracy:.3g} at most"
            finer, why = here._with_middles(coarse, missed)
            if why:
                return here, why
            here = finer

    def held(self) -> tuple["BetweenRows", str]:
        """Insert rows half-way where stability is lost on the straight line between two of them.

        If it is lost however close these are, the rows end there, and the second answer says why.
        """
        here, holds = self, np.zeros(len(self.path.at) - 1, bool)
        while True:
            states, new = here.path.states, np.flatnonzero(~holds)
            holds[new] = are_led(lift_straight(states[new], states.p[new + 1]), states[new + 1])
            lost = np.flatnonzero(~holds)
            if not len(lost):
                return here, ""
            close = lost[step_lengths(states)[lost] <= SAME_SOLUTION]
            snaps = "parameters that move straight on lose stability"
            finer, why = here._with_middles(lost, snaps)
            if len(close) or why:
                last = int(close[0]) if len(close) else int(lost[0])
                place = describe_place(states[last], here.actuators)
                why = f"{snaps} behind {place}, however close the rows of the schedule are"
                return here._until(last), why
            holds = np.insert(holds, lost, False)
            here = finer

    def _with_middles(self, rows: Some, trouble: str) -> tuple["BetweenRows", str]:
        """Insert rows half-way behind some, or say why there are none."""
        count = len(self.path.at)
        if count + len(rows) > MOST_ROWS:
            return self, f"between {count} rows {trouble}"
        middle, found = self._on_targets(rows)
        if found.all():
            return self._with_rows(rows, middle), ""
        place = describe_place(self.path.states[int(rows[np.argmin(found)])], self.actuators)
        return self, f"no further row within the constraints is found behind {place}"

    def _until(self, last: int) -> "BetweenRows":
        """The rows up to one of them."""
        path, kept = self.path, slice(0, last + 1)
        end = Event(EventKind.CRITICAL, path.states[last], float(path.at[last]))
        states, index = path.states[kept], path.index[kept]
        shorter = Path(states, path.at[kept], path.length[kept], index, (end,))
        return replace(self, path=shorter)

    def _means(self) -> tuple[Lanes, Parameters]:
        states = self.path.states
        return 0.5 * (states.z[:-1] + states.z[1:]), 0.5 * (states.p[:-1] + states.p[1:])

    def _places(self) -> tuple[Int[np.ndarray, " rows"], Float[np.ndarray, " rows"]]:
        """Legs half-way between rows, and the shares of these."""
        at = self.path.at
        middle = 0.5 * (at[:-1] + at[1:])
        leg = np.minimum(middle.astype(int), len(self.legs) - 1)
        return leg, middle - leg

    def _on_targets(self, rows: Some) -> tuple[States, np.ndarray]:
        """Exact states that meet the targets half-way behind rows, and which were found."""
        states, (z, p), (leg, share) = self.path.states, self._means(), self._places()
        structure, found = states.structure, np.zeros(len(rows), bool)
        z, p, leg, share = z[rows], p[rows], leg[rows], share[rows]
        ways = distances(structure, states.z[rows], states.p[rows], z, p)
        for number in np.unique(leg).tolist():
            own = np.flatnonzero(leg == number)
            begin = states[int(np.searchsorted(self.path.at, number))]
            course = Course.of(begin, [self.legs[number]], self.actuators)
            wanted, targets = course.split(course.at(share[own]))
            wanted[:, course.free] = p[own][:, course.free]
            right = correct_onto_targets(
                structure, z[own], wanted, course.free, course.descriptors, targets
            )
            z[own], p[own] = right.z, right.p
            found[own] = right.found & (right.first <= SURE * ways[own] + EXACT)
        middle = States(structure, z, p)
        return middle, found & (middle.index == 0) & are_feasible(self.within, z, p)

    def _with_rows(self, rows: Some, middle: States) -> "BetweenRows":
        path, behind = self.path, rows + 1
        at = np.insert(path.at, behind, 0.5 * (path.at[rows] + path.at[behind]))
        z, p = (
            np.insert(old, behind, new, axis=0)
            for old, new in ((path.states.z, middle.z), (path.states.p, middle.p))
        )
        states = States(middle.structure, z, p)
        index = np.insert(path.index, behind, 0)
        finer = replace(path, states=states, at=at, length=path_lengths(states), index=index)
        return replace(self, path=finer)


def _targets(
    descriptor: Descriptor,
    legs: Sequence[Leg],
    leg: Int[np.ndarray, " rows"],
    share: Float[np.ndarray, " rows"],
    mean: Float[np.ndarray, " rows"],
) -> Float[np.ndarray, " rows"]:
    """Targets of a descriptor half-way between rows; NaN on legs that prescribe none of it.

    Rows meet their targets, so that on legs of constant rates these are the means of both rows.
    """
    out = np.full(len(leg), np.nan)
    for number, own in enumerate(legs):
        mine = leg == number
        if callable(own):
            values = [own(float(t)).get(descriptor, np.nan) for t in share[mine]]
            out[mine] = np.array(values, float)
        elif descriptor in own:
            out[mine] = mean[mine]
    return out

"""Proofs for tubes: a route with a box of errors around it, divided until every cell is proved.

A cell is a segment of the route, shifted by the middle of a part of the box. Its proof shows one
stable equilibrium for each point of it; where two cells share a face, those of both are the same as
soon as they agree in one point of it. So all cells together carry one continuous family of states.
A box of parameters around a single state is a tube around a route without length.

See docs/decisions.md, "Tubes are proved cell by cell".
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from equimorph.arrays import Flags, Float, Int, Items, Lanes, Pairs, Parameters
from equimorph.columns import Columns
from equimorph.equilibria import Event, ParameterLine, TraceOptions, settle, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.manifold.geometry.topology import runs
from equimorph.model import Constraint, worst_relative_excess
from equimorph.structures import State, States, Structure
from equimorph.structures.metric import metric_length
from equimorph.tasks.verification.error_box import Deviation, ErrorBox
from equimorph.tasks.verification.evidence import (
    ProofStatus,
    bounds_in_parts,
    kind_of_bounds,
    no_bounds,
    standing,
)
from equimorph.tasks.verification.newton_kantorovich import Bounds, segment_bounds
from equimorph.tolerances import SAME_SOLUTION

MOST_CELLS = 20_000
"""Cells that are tried at most before the proof of a tube is given up."""
MOST_ENTRIES = 20_000_000
"""Entries of their matrices that are."""
MOST_ROUNDS = 14
"""Bisections of a segment and of the box around it before that."""
LARGEST_SAGITTA = 0.25
"""Distance of the exact state from the expected one, relative to the way there, that is a bend."""
LEAST_SHARE = 1e-12
"""What half widths, squared, count beside the moves of states where a cell is cut."""
HOPELESS = 4.0
"""Ratio of what errors of data and all others move states in a cell that need not be divided."""
ROUNDING = 1e-13
"""More than the rounding of what two cells expect at their common face, relative to the states."""

Corners = Float[np.ndarray, "cells axes"]


@dataclass(frozen=True)
class Cells(Columns):
    """Cells of a tube."""

    before: Lanes
    after: Lanes
    start: Parameters
    end: Parameters
    """Unknowns and parameters at both ends of the segment, at the middle of the box."""
    lower: Corners
    upper: Corners
    """Of the cell: place along the route, in segments, then the errors of parameters in units of
    their half widths."""

    @property
    def middle(self) -> Corners:
        """Places of the middles; exact, as cells are halves of halves."""
        return np.asarray(0.5 * (self.lower + self.upper))

    def place(self, end: int) -> Corners:
        """Places of the ends of the segments at the middle of the box; exact."""
        place = self.middle
        place[:, 0] = (self.lower, self.upper)[end][:, 0]
        return place


@dataclass(frozen=True)
class Judged(Columns):
    """Cells, what is proved of them, and their linear responses to the errors at both ends.

    `good` tells which cells hold stable and admissible states alone, with the margin asked for.
    """

    cells: Cells
    bounds: Bounds
    responses: Float[np.ndarray, "cells ends m size"]
    good: Flags

    def at(self, place: Corners) -> Lanes:
        """States expected at places of the cells, to first order in the errors."""
        cells = self.cells
        share = ((place - cells.lower) / (cells.upper - cells.lower))[:, :1]
        half = 0.5 * (cells.upper - cells.lower)[:, 1:]
        errors = ((place - cells.middle)[:, 1:] / half)[:, :, None]
        first, last = np.moveaxis(self.responses[:, :, : errors.shape[1]], 1, 0)
        z = (1.0 - share) * (cells.before + (first * errors).sum(axis=1))
        return np.asarray(z + share * (cells.after + (last * errors).sum(axis=1)))


@dataclass(frozen=True)
class Division:
    """Cells into which a tube was divided.

    Parameters
    ----------
    why
        Reason if not all are proved or supported, else empty.
    judged
        The cells.
    tried
        Number of all cells that were tried.
    failed
        State in the first cell for which the bound fails, or at which a sheet of states ends.
    """

    why: str
    judged: Judged
    tried: int
    failed: State | None = None


@dataclass(frozen=True, eq=False)
class TubeProof:
    """What is known of all states of a route under all errors of a box.

    Parameters
    ----------
    why
        Reason if there is neither proof nor support, else empty.
    cells
        Number of cells.
    bounds
        "enclosed" or "sampled"; see `Proof`; "unknown" where there are none.
    sampled_constraints
        Whether there were constraints: they are judged by values in each cell.
    failed
        Middle of the first cell for which the bound fails.
    """

    why: str
    cells: int
    bounds: Literal["enclosed", "sampled", "unknown"]
    sampled_constraints: bool = False
    failed: State | None = None

    @property
    def status(self) -> ProofStatus:
        """Proved only if all bounds are enclosed, and there are no constraints."""
        enclosed = self.bounds == "enclosed" and not self.sampled_constraints
        return standing(self.why, enclosed)

    def __repr__(self) -> str:
        """Status and number of cells, or why there is no proof."""
        if self.why:
            return f"TubeProof(unproved: {self.why})"
        return f"TubeProof({self.status}: {self.bounds} bounds on {self.cells} cells)"


@dataclass(frozen=True)
class Tube:
    """A route with a box of errors around it.

    Parameters
    ----------
    states
        Stable equilibria along the route, without errors.
    steps
        Change of all parameters by each error at its half width.
    deviations
        Errors of data.
    within
        Constraints that all states obey.
    within_changed
        The same of the structure of each of the deviations.
    margin
        Stability margin to be proved; None: any.
    most
        Cells that are tried at most; None: as many as memory and `MOST_ROUNDS` bisections allow.
    """

    states: States
    steps: Float[np.ndarray, "m parameters"]
    deviations: tuple[Deviation, ...] = ()
    within: tuple[Constraint, ...] = ()
    within_changed: tuple[tuple[Constraint, ...], ...] = ()
    margin: float | None = None
    most: int | None = None

    def prove(self) -> TubeProof:
        """Prove, or support, that all states of the tube are stable and admissible."""
        kind = kind_of_bounds(self.states)
        sampled = bool(self.within)
        if kind == "unknown":
            return TubeProof(no_bounds(self.states.structure), 0, kind, sampled)
        done = self.divide()
        cells = done.tried if done.why else len(done.judged.good)
        return TubeProof(done.why, cells, kind, sampled, done.failed)

    def divide(self) -> Division:
        """Bisect cells until all are proved and joined, or one of them is lost, or too many.

        A cell whose bound fails is cut across the axis that moves its states most: the route, or
        an error of a parameter. Errors of data are not divided.
        """
        structure, errors = self.states.structure, len(self.steps)
        most = self.most or min(MOST_CELLS, MOST_ENTRIES // structure.size**2)
        rounds = MOST_ROUNDS if self.most is None else most
        whole, why = self._judge(self._first_cells()), f"{rounds} bisections do not suffice"
        tried = len(whole.good)
        for _ in range(rounds):
            bad = np.flatnonzero(~whole.good)
            if len(bad) == 0:
                bad = _apart(whole)
            if len(bad) == 0:
                return Division("", whole, tried)
            if tried + 2 * len(bad) > most:
                why = f"{most} cells do not suffice"
                break
            moves = self._moves(whole.take(bad))
            data = moves[:, 1 + errors :].max(axis=1, initial=0.0)
            if (data > HOPELESS**2 * moves[:, : 1 + errors].max(axis=1)).any():
                why = "errors of data, which are not divided, move the states too far"
                break
            axis = moves[:, : 1 + errors].argmax(axis=1)
            halves, lost = self._halves(whole.take(bad), axis)
            if lost is not None:
                return Division(f"the sheet ends at a {lost.kind}", whole, tried, lost.state)
            if _meet_on_two_sheets(structure, halves, axis):
                why = "states of the route lie on different sheets"
                break
            tried += 2 * len(bad)
            rest = whole.take(np.setdiff1d(np.arange(len(whole.good)), bad))
            whole = Judged.concatenate([rest, self._judge(halves)])
        cell = whole.cells.take(bad[:1])
        z, p = 0.5 * (cell.before + cell.after), 0.5 * (cell.start + cell.end)
        failed = State(structure, settle(structure, z, p).z[0], p[0])
        return Division(why, whole, tried, failed)

    def _first_cells(self) -> Cells:
        z, p = self.states.z, self.states.p
        count, m = len(z) - 1, len(self.steps)
        at = np.arange(count, dtype=float)[:, None]
        lower = np.concatenate([at, -np.ones((count, m))], axis=1)
        upper = np.concatenate([at + 1.0, np.ones((count, m))], axis=1)
        return Cells(z[:-1], z[1:], p[:-1], p[1:], lower, upper)

    def _parameters(self, place: Corners) -> Parameters:
        """Parameters at places; the same ones at the same place of different cells."""
        route = np.arange(len(self.states))
        along = [np.interp(place[:, 0], route, column) for column in self.states.p.T]
        return np.asarray(np.stack(along, axis=1) + place[:, 1:] @ self.steps)

    def _errors(self, cells: Cells) -> ErrorBox:
        half = 0.5 * (cells.upper - cells.lower)[:, 1:]
        return ErrorBox(half[:, :, None] * self.steps, self.deviations)

    def _judge(self, cells: Cells) -> Judged:
        errors, made = self._errors(cells), self.states.structure
        ends = States(made, cells.before, cells.start), States(made, cells.after, cells.end)

        def part(rows: slice) -> Bounds:
            return segment_bounds(ends[0][rows], ends[1][rows], self.margin, errors.take(rows))

        bounds = bounds_in_parts(ends[0], part)
        responses = np.stack([errors.responses(end) for end in ends], axis=1)
        good = bounds.proved & bounds.stable & (bounds.margin >= (self.margin or 0.0))
        return Judged(cells, bounds, responses, good & self._admissible(cells, responses))

    def _admissible(self, cells: Cells, responses: Float[np.ndarray, "cells ends m size"]) -> Flags:
        """Whether constraints hold with the sum of their changes along all axes of each cell."""
        count = len(cells.lower)
        if not self.within:
            return np.ones(count, bool)
        steps = self._errors(cells).steps
        z, p = 0.5 * (cells.before + cells.after), 0.5 * (cells.start + cells.end)
        middle, axes = responses.mean(axis=1), steps.shape[1]
        moves = [(0.5 * (cells.after - cells.before), 0.5 * (cells.end - cells.start), self.within)]
        moves += [(middle[:, k], steps[:, k], self.within) for k in range(axes)]
        moves += [
            (middle[:, axes + k], np.zeros_like(p), own)
            for k, own in enumerate(self.within_changed)
        ]
        good = np.ones(count, bool)
        for number, each in enumerate(self.within):
            here, change = worst_relative_excess((each,), z, p), np.zeros(count)
            for dz, dp, own in moves:
                sides = [
                    worst_relative_excess((own[number],), z + s * dz, p + s * dp)
                    for s in (-1.0, 1.0)
                ]
                change += np.maximum(*(np.abs(side - here) for side in sides))
            good &= here + change <= 0.0
        return good

    def _moves(self, judged: Judged) -> Float[np.ndarray, "cells axes"]:
        """How far, squared, states move along the route, by errors of parameters, and of data."""
        cells, structure = judged.cells, self.states.structure
        along = 0.5 * (cells.after - cells.before), 0.5 * (cells.end - cells.start)
        turns = np.concatenate([along[0][:, None], judged.responses.mean(axis=1)], axis=1)
        steps = np.concatenate([along[1][:, None], self._errors(cells).steps], axis=1)
        moves = metric_length(structure, turns) ** 2
        widths = ((steps / structure.scales) ** 2).sum(axis=2)
        moves[:, : widths.shape[1]] += LEAST_SHARE * widths
        return moves

    def _halves(
        self, judged: Judged, axis: Int[np.ndarray, " cells"]
    ) -> tuple[Cells, Event | None]:
        """Both halves of cells with the states at their ends; or what a lift to one of them met."""
        cells, rows = judged.cells, np.arange(len(axis))
        lower, upper = cells.lower.copy(), cells.upper.copy()
        lower[rows, axis] = upper[rows, axis] = cells.middle[rows, axis]
        halves = Cells.concatenate([replace(cells, upper=upper), replace(cells, lower=lower)])
        twice, structure = Judged.concatenate([judged, judged]), self.states.structure
        ends = []
        for end, (old, p) in enumerate(((halves.before, halves.start), (halves.after, halves.end))):
            place = halves.place(end)
            goal, z = self._parameters(place), old.copy()
            moved = np.flatnonzero((goal != p).any(axis=1))
            origin = States(structure, old[moved], p[moved])
            z[moved], lost = _move(origin, twice.at(place)[moved], goal[moved])
            if lost is not None:
                return halves, lost
            ends.append((z, goal))
        (before, start), (after, last) = ends
        return replace(halves, before=before, after=after, start=start, end=last), None


def _meet_on_two_sheets(structure: Structure, halves: Cells, axis: Items) -> bool:
    """Whether halves of a segment, each followed from its own end, differ where they meet."""
    count = len(axis)
    gap = metric_length(structure, halves.after[:count] - halves.before[count:])
    return bool((gap[axis == 0] > SAME_SOLUTION).any())


def _move(origin: States, guess: Lanes, p: Parameters) -> tuple[Lanes, Event | None]:
    """Stable states near guesses, lifted where these are bad; or what such a lift met."""
    structure = origin.structure
    near = settle(structure, guess, p)
    away = metric_length(structure, near.z - guess)
    way = metric_length(structure, guess - origin.z)
    z, good = near.z, near.found & (away <= LARGEST_SAGITTA * way + 1e-12)
    good[good] = structure.index(z[good], p[good]) == 0
    far = np.flatnonzero(~good)
    if len(far) == 0:
        return z, None
    line = ParameterLine(structure, origin.p[far], p[far] - origin.p[far])
    lifted = trace(line, origin.z[far], (), TraceOptions(record=False))
    lost = np.flatnonzero(lifted.code != EventCode.ARRIVED)
    if len(lost):
        k, t = int(lost[0]), lifted.t[lost[0]]
        state = State(structure, lifted.z[k], line.start[k] + t * line.velocity[k])
        return z, Event(EventCode(int(lifted.code[k])).kind, state, float(t))
    z[far] = lifted.z
    return z, None


def _apart(judged: Judged) -> Int[np.ndarray, " cells"]:
    """Numbers of cells whose states are not shown to be those of a neighbour.

    They are if the state of either, at one point of the common face, lies where the other has only
    one.
    """
    cells, bounds = judged.cells, judged.bounds
    pairs = neighbours(cells.lower, cells.upper)
    one, other = pairs.T
    low = np.maximum(cells.lower[one], cells.lower[other])
    face = 0.5 * (low + np.minimum(cells.upper[one], cells.upper[other]))
    gap = np.abs(judged.take(one).at(face) - judged.take(other).at(face))
    gap += ROUNDING * (1.0 + np.abs(cells.before[one]))
    near, alone = (each[:, None] * bounds.weights for each in (bounds.error, bounds.unique))
    there = (gap + near[one] < alone[other]).all(axis=1)
    back = (gap + near[other] < alone[one]).all(axis=1)
    return np.unique(pairs[~(there | back)])


def neighbours(lower: Corners, upper: Corners) -> Pairs:
    """Pairs of cells that share a face."""
    axis = int(np.argmax([len(np.unique(column)) for column in lower.T]))
    order = np.argsort(lower[:, axis], kind="stable")
    begins = lower[order, axis]
    # of the cells behind each in this order those that begin before it ends
    counts = np.searchsorted(begins, upper[order, axis], side="right") - np.arange(len(order)) - 1
    one, other = (order[each] for each in runs(1 + np.arange(len(order)), counts))
    overlap = np.minimum(upper[one], upper[other]) - np.maximum(lower[one], lower[other])
    faces = (overlap >= 0.0).all(axis=1) & ((overlap == 0.0).sum(axis=1) == 1)
    return np.stack([one[faces], other[faces]], axis=1)

"""Proofs for tubes: a route with a box of errors around it, divided until every cell is proved.

A cell is a segment of the route, shifted by the middle of a part of the box. Its proof shows one
stable equilibrium for each point of it; where two cells share a face, those of both are the same as
soon as they agree in one point of it. So all cells together carry one continuous family of states.

See docs/decisions.md, "Tubes are proved cell by cell".
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from equimorph.array_types import Float, Int
from equimorph.arrays import Flags, Lanes, Pairs, Parameters
from equimorph.columns import Columns
from equimorph.equilibria import ParameterLine, TraceOptions, settle, trace
from equimorph.equilibria.soft_modes import metric_length
from equimorph.equilibria.trace_options import EventCode
from equimorph.model import Constraint, worst_relative_excess
from equimorph.structures import State, States, Structure
from equimorph.tasks.verification.error_box import Deviation, ErrorBox
from equimorph.tasks.verification.newton_kantorovich import Bounds, segment_bounds
from equimorph.tasks.verification.proof import (
    LARGEST_SAGITTA,
    ProofStatus,
    bounds_in_parts,
    kind_of_bounds,
)

MOST_CELLS = 20_000
"""Cells that are tried at most before the proof of a tube is given up."""
MOST_ENTRIES = 20_000_000
"""Entries of their matrices that are."""
MOST_ROUNDS = 14
"""Bisections of a segment and of the box around it before that."""
HOPELESS = 4.0
"""Ratio of what errors of data and all others move states in a cell that need not be divided."""
ROUNDING = 1e-13
"""More than the rounding of what two cells expect at their common face, relative to the states."""

Corners = Float[np.ndarray, "cells axes"]


@dataclass(frozen=True)
class _Cells(Columns):
    """Cells of a tube.

    Parameters
    ----------
    before, after, start, end
        Unknowns and parameters at both ends of the segment, at the middle of the box.
    lower, upper
        Of the cell: place along the route, in segments, then the errors of parameters in units of
        their half widths.
    """

    before: Lanes
    after: Lanes
    start: Parameters
    end: Parameters
    lower: Corners
    upper: Corners


@dataclass(frozen=True)
class _Judged(Columns):
    """Cells, what is proved of them, and their linear responses to the errors at both ends."""

    cells: _Cells
    bounds: Bounds
    responses: Float[np.ndarray, "cells ends m size"]
    admissible: Flags

    @property
    def good(self) -> Flags:
        """Cells with stable and admissible states alone."""
        bounds = self.bounds
        return np.asarray(bounds.proved & bounds.stable & self.admissible)


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
        """Proved only if all bounds are structural; see `ProofStatus`."""
        if self.why:
            return ProofStatus.UNPROVED
        proved = self.bounds == "enclosed" and not self.sampled_constraints
        return ProofStatus.PROVED if proved else ProofStatus.SUPPORTED

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
    """

    states: States
    steps: Float[np.ndarray, "m parameters"]
    deviations: tuple[Deviation, ...] = ()
    within: tuple[Constraint, ...] = ()
    within_changed: tuple[tuple[Constraint, ...], ...] = ()

    def prove(self) -> TubeProof:
        """Prove, or support, that all states of the tube are stable and admissible.

        A cell whose bound fails is bisected along the axis that moves its states most: the route,
        or an error of a parameter. Errors of data are not divided.
        """
        kind = kind_of_bounds(self.states)
        sampled = bool(self.within)
        if kind == "unknown":
            why = (
                f"a {self._structure.kind} with {self._structure.size} unknowns knows no bound of "
                "its second derivatives and has too many to sample"
            )
            return TubeProof(why, 0, kind, sampled)
        most = min(MOST_CELLS, MOST_ENTRIES // self._structure.size**2)
        whole = self._judge(self._first_cells())
        tried = len(whole.cells.lower)
        for _ in range(MOST_ROUNDS):
            bad = np.flatnonzero(~whole.good)
            if len(bad) == 0:
                bad = _apart(whole)
            if len(bad) == 0:
                return TubeProof("", len(whole.good), kind, sampled)
            if tried + 2 * len(bad) > most:
                break
            divided = self._divide(whole.take(bad))
            if divided is None:
                break
            halves, found = divided
            if not found.all():
                lost = self._middle(whole.cells.take(bad[~found][:1]))
                why = "with some errors there is no stable state beside one of the route"
                return TubeProof(why, tried, kind, sampled, lost)
            tried += 2 * len(bad)
            rest = whole.take(np.setdiff1d(np.arange(len(whole.good)), bad))
            whole = _Judged.concatenate([rest, self._judge(halves)])
        failed = self._middle(whole.cells.take(bad[:1]))
        why = f"the bound fails around some states after {tried} cells were tried"
        return TubeProof(why, tried, kind, sampled, failed)

    @property
    def _structure(self) -> Structure:
        return self.states.structure

    def _first_cells(self) -> _Cells:
        z, p = self.states.z, self.states.p
        count, m = len(z) - 1, len(self.steps)
        at = np.arange(count, dtype=float)[:, None]
        lower = np.concatenate([at, -np.ones((count, m))], axis=1)
        upper = np.concatenate([at + 1.0, np.ones((count, m))], axis=1)
        return _Cells(z[:-1], z[1:], p[:-1], p[1:], lower, upper)

    def _ends(self, cells: _Cells) -> tuple[States, States]:
        made = self._structure
        return States(made, cells.before, cells.start), States(made, cells.after, cells.end)

    def _errors(self, cells: _Cells) -> ErrorBox:
        half = 0.5 * (cells.upper - cells.lower)[:, 1:]
        return ErrorBox(half[:, :, None] * self.steps, self.deviations)

    def _judge(self, cells: _Cells) -> _Judged:
        ends, errors = self._ends(cells), self._errors(cells)

        def part(rows: slice) -> Bounds:
            return segment_bounds(ends[0][rows], ends[1][rows], None, errors.take(rows))

        bounds = bounds_in_parts(ends[0], part)
        responses = np.stack([errors.responses(end) for end in ends], axis=1)
        return _Judged(cells, bounds, responses, self._admissible(cells, responses))

    def _admissible(
        self, cells: _Cells, responses: Float[np.ndarray, "cells ends m size"]
    ) -> Flags:
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

    def _divide(self, judged: _Judged) -> tuple[_Cells, Flags] | None:
        """Both halves of cells, and whether their states are stable and near what is expected.

        None if errors of data, which are not divided, move the states of one so much more that
        halves do not help.
        """
        cells, axes = judged.cells, len(self.steps)
        structure, n = self._structure, self._structure.unknowns
        along = metric_length(structure, 0.5 * (cells.after - cells.before)[:, :n])
        aside = np.sqrt(judged.responses.mean(axis=1)[:, :, :n] ** 2 @ structure.mass)
        moves = np.concatenate([along[:, None], aside[:, :axes]], axis=1)
        axis = moves.argmax(axis=1)
        if (aside[:, axes:].max(axis=1, initial=0.0) > HOPELESS * moves.max(axis=1)).any():
            return None
        rows, middle = np.arange(len(axis)), 0.5 * (cells.lower + cells.upper)
        found, halves = np.ones(len(axis), bool), []
        for sign in (-1.0, 1.0):
            lower, upper = cells.lower.copy(), cells.upper.copy()
            (lower if sign > 0.0 else upper)[rows, axis] = middle[rows, axis]
            half = replace(cells, lower=lower, upper=upper)
            half, good = self._with_states(half, judged, axis, sign)
            found &= good
            halves.append(half)
        return _Cells.concatenate(halves), found

    def _with_states(
        self, half: _Cells, judged: _Judged, axis: Int[np.ndarray, " cells"], sign: float
    ) -> tuple[_Cells, Flags]:
        """Halves with the states at their ends, and whether these are as expected."""
        whole, steps = judged.cells, self._errors(judged.cells).steps
        rows = np.arange(len(axis))
        aside, error = axis > 0, np.maximum(axis - 1, 0)
        z, p = [whole.before, whole.after], [whole.start, whole.end]
        split = (0.5 * (z[0] + z[1]), 0.5 * (p[0] + p[1]))
        found = np.ones(len(axis), bool)
        out: list[tuple[Lanes, Parameters]] = []
        for end in (0, 1):
            new_z, new_p = z[end].copy(), p[end].copy()
            inner = ~aside & (end == (sign < 0.0))
            new_z[inner], new_p[inner] = split[0][inner], split[1][inner]
            if len(self.steps):
                dz = 0.5 * sign * judged.responses[rows, end, error]
                dp = 0.5 * sign * steps[rows, error]
                new_z[aside] += dz[aside]
                new_p[aside] += dp[aside]
            moved = np.flatnonzero(aside | inner)
            origin = States(self._structure, z[end][moved], p[end][moved])
            exact, good = self._states(origin, new_z[moved], new_p[moved])
            new_z[moved] = exact
            found[moved] &= good
            out.append((new_z, new_p))
        (before, start), (after, last) = out
        return replace(half, before=before, after=after, start=start, end=last), found

    def _states(self, origin: States, guess: Lanes, p: Parameters) -> tuple[Lanes, Flags]:
        """States near guesses, lifted where these are bad, and whether they are stable."""
        structure, n = self._structure, self._structure.unknowns
        near = settle(structure, guess, p)
        away = metric_length(structure, (near.z - guess)[:, :n])
        way = metric_length(structure, (guess - origin.z)[:, :n])
        z, good = near.z, near.found & (away <= LARGEST_SAGITTA * way + 1e-12)
        far = np.flatnonzero(~good)
        if len(far):
            line = ParameterLine(structure, origin.p[far], p[far] - origin.p[far])
            lifted = trace(line, origin.z[far], (), TraceOptions(record=False))
            exact = settle(structure, lifted.z, p[far])
            z[far], good[far] = exact.z, (lifted.code == EventCode.ARRIVED) & exact.found
        good[good] = structure.index(z[good], p[good]) == 0
        return z, good

    def _middle(self, cell: _Cells) -> State:
        """State in the middle of a cell."""
        z, p = 0.5 * (cell.before + cell.after), 0.5 * (cell.start + cell.end)
        return State(self._structure, settle(self._structure, z, p).z[0], p[0])


def _apart(judged: _Judged) -> Int[np.ndarray, " cells"]:
    """Numbers of cells whose states are not shown to be those of a neighbour."""
    lower, upper = judged.cells.lower, judged.cells.upper
    pairs = neighbours(lower, upper)
    one, other = pairs.T
    low = np.maximum(lower[one], lower[other])
    high = np.minimum(upper[one], upper[other])
    gap = np.abs(_at(judged, one, 0.5 * (low + high)) - _at(judged, other, 0.5 * (low + high)))
    return parted(pairs, gap + ROUNDING * (1.0 + np.abs(judged.cells.before[one])), judged.bounds)


def parted(pairs: Pairs, gap: Lanes, bounds: Bounds) -> Int[np.ndarray, " cells"]:
    """Numbers of cells, among pairs whose expectations differ by a gap, that may have two states.

    They have one if the state of either lies where the other has only one.
    """
    near, alone = (each[:, None] * bounds.weights for each in (bounds.error, bounds.unique))
    one, other = pairs.T
    there = (gap + near[one] < alone[other]).all(axis=1)
    back = (gap + near[other] < alone[one]).all(axis=1)
    return np.unique(pairs[~(there | back)])


def neighbours(lower: Corners, upper: Corners) -> Pairs:
    """Pairs of cells that share a face."""
    order = np.argsort(lower[:, 0], kind="stable")
    begins = lower[order, 0]
    # of the cells behind each in this order those that begin before it ends
    counts = np.searchsorted(begins, upper[order, 0], side="right") - np.arange(len(order)) - 1
    one = np.repeat(np.arange(len(order)), counts)
    other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(counts) - counts, counts)
    one, other = order[one], order[other]
    overlap = np.minimum(upper[one], upper[other]) - np.maximum(lower[one], lower[other])
    faces = (overlap >= 0.0).all(axis=1) & ((overlap == 0.0).sum(axis=1) == 1)
    return np.stack([one[faces], other[faces]], axis=1)


def _at(judged: _Judged, rows: Int[np.ndarray, " pairs"], place: Corners) -> Lanes:
    """What cells expect at places on their faces, to first order in the errors."""
    cells = judged.cells.take(rows)
    share = ((place - cells.lower) / (cells.upper - cells.lower))[:, :1]
    half = 0.5 * (cells.upper - cells.lower)[:, 1:]
    errors = ((place - 0.5 * (cells.lower + cells.upper))[:, 1:] / half)[:, :, None]
    first, last = np.moveaxis(judged.responses[rows, :, : errors.shape[1]], 1, 0)
    z = (1.0 - share) * (cells.before + (first * errors).sum(axis=1))
    return np.asarray(z + share * (cells.after + (last * errors).sum(axis=1)))

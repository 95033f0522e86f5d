"""`certify_box`: one sheet of stable states over a whole box of parameters, proved cell by cell.

In each cell the sheet is compared with its tangent plane at the middle, by the bounds of
`newton_kantorovich` with the half widths of the cell as errors. Where two cells share a face, their
states are the same as soon as they agree in one point of it: both carry exactly one, continuously.
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.arrays import Flags, Lanes, Numbers, Parameters
from equimorph.columns import Columns
from equimorph.equilibria import Event, TraceOptions, lift
from equimorph.equilibria.legs import check_starts
from equimorph.model import Box, position
from equimorph.structures import State, States, Structure
from equimorph.tasks.verification.error_box import ErrorBox, Responses
from equimorph.tasks.verification.newton_kantorovich import Bounds, segment_bounds
from equimorph.tasks.verification.proof import (
    Evidence,
    ProofStatus,
    bounds_in_parts,
    kind_of_bounds,
)
from equimorph.tasks.verification.tube import ROUNDING, neighbours, parted

LEAST_SHARE = 1e-12
"""What half widths count beside the moves of states where a cell is cut."""

Corners = Float[np.ndarray, "cells d"]


@dataclass(frozen=True, eq=False)
class BoxProof:
    """What is known of one sheet of states over a box of parameters.

    Parameters
    ----------
    why
        Reason if there is neither proof nor support, else empty.
    box
        The box.
    states
        Stable equilibria at the middles of the cells into which the box was divided.
    half
        Half widths of the cells, in the order of the box's names.
    tubes
        Half widths, for each unknown and multiplier, of the boxes around the tangent plane at the
        middle of each cell, in which the sheet is the only one.
    margin
        Stability margin that the whole sheet keeps, 0 if unproved.
    bounds
        As of `Proof`.
    failed
        State near which the proof fails.
    """

    why: str
    box: Box
    states: States
    half: Corners
    tubes: Lanes
    margin: float
    bounds: Evidence
    failed: State | None = None

    @property
    def status(self) -> ProofStatus:
        """Proved only if the bounds are enclosed; see `ProofStatus`."""
        if self.why:
            return ProofStatus.UNPROVED
        return ProofStatus.PROVED if self.bounds == "enclosed" else ProofStatus.SUPPORTED

    def __repr__(self) -> str:
        """Status, number of cells and the margin, or why there is no proof."""
        if self.why:
            return f"BoxProof(unproved: {self.why})"
        cells = f"{self.bounds} bounds on {len(self.half)} cells"
        return f"BoxProof({self.status}: {cells}; margin >= {self.margin:.4g})"


@check_arguments
def certify_box(state: State, box: Box, *, margin: float = 0.0, most: int = 10_000) -> BoxProof:
    """Prove that the sheet of a stable state goes on, stable, over a whole box of parameters.

    Then any motion within the box that starts on this sheet stays on it, without a snap. The box is
    bisected, across the parameter that moves the states most, until every cell is proved; other
    parameters keep their values. The sheet is that which a straight lift from the state to the
    middle of the box leads to. Outcomes other than a proof are named in `why`: an unstable or
    missing state, or the work is spent, as must happen where the margin vanishes.

    Parameters
    ----------
    state
        A stable equilibrium.
    box
        Ranges of parameters.
    margin
        Least stability margin to be proved.
    most
        Cells that are tried at most.

    Returns
    -------
    The cells with the tubes that hold the sheet, or why there is no proof.

    Raises
    ------
    InputError
        If the state is no stable equilibrium, the box names unknown parameters, or `margin` is
        negative.

    Examples
    --------
    >>> import equimorph as em
    >>> rest = em.Spring().natural_state(x_l=1.5)
    >>> em.certify_box(rest, em.Box(x_l=(1.2, 1.5), F=(-0.2, 0.2))).status
    <ProofStatus.PROVED: 'proved'>
    """
    check_starts(state.batch)
    sheet = _Sheet(state.structure, box, margin, most)
    corner = np.ones((1, len(box.names)))
    begin = _Cells(state.z[None], state.p[None], -corner, corner)
    kind = kind_of_bounds(state.batch)
    if kind == "unknown":
        why = "the structure knows no bounds of its derivatives and has too many to sample"
        return sheet.result("sampled", begin, why, state)
    if state.index != 0:
        return sheet.result(kind, begin, "the state is unstable", state)
    cells, lost = sheet.move(begin)
    if lost is not None:
        return sheet.result(kind, begin, f"the way to its middle ends at a {lost.kind}", lost.state)
    return sheet.prove(kind, cells)


@dataclass(frozen=True)
class _Cells(Columns):
    """States at the middles of cells, and their corners, as places of the box in [−1, 1]."""

    z: Lanes
    p: Parameters
    lower: Corners
    upper: Corners

    @property
    def middle(self) -> Corners:
        """Places of the middles; exact, as cells are halves of halves."""
        return np.asarray(0.5 * (self.lower + self.upper))


@dataclass(frozen=True)
class _Judged(Columns):
    """Cells with what is proved of them, and the tangent of the sheet at their middles."""

    cells: _Cells
    bounds: Bounds
    responses: Responses

    def at(self, places: Corners) -> Lanes:
        """Tangent planes at places."""
        cells = self.cells
        share = 2.0 * (places - cells.middle) / (cells.upper - cells.lower)
        return np.asarray(cells.z + (share[:, :, None] * self.responses).sum(axis=1))


@dataclass(frozen=True)
class _Sheet:
    """A sheet over cells of a box."""

    structure: Structure
    box: Box
    margin: float
    most: int

    @property
    def places(self) -> Numbers:
        """Numbers of the parameters of the box."""
        known = self.structure.parameters
        return np.array([position(known, name) for name in self.box.names], dtype=int)

    def result(
        self,
        kind: Evidence,
        cells: _Cells,
        why: str,
        failed: State | None,
        bounds: Bounds | None = None,
    ) -> BoxProof:
        """What was found."""
        tubes = np.zeros_like(cells.z)
        if bounds is not None:
            tubes = bounds.unique[:, None] * bounds.weights
        least = float(bounds.margin.min()) if bounds is not None and not why else 0.0
        states = States(self.structure, cells.z, cells.p)
        return BoxProof(why, self.box, states, self.half(cells), tubes, least, kind, failed)

    def prove(self, kind: Evidence, cells: _Cells) -> BoxProof:
        """Bisect cells until all are proved and joined, or one of them is lost, or too many."""
        whole, tried = self._judge(cells), len(cells.lower)
        while True:
            bad = np.flatnonzero(~self._good(whole))
            if len(bad) == 0:
                bad = self._apart(whole)
            if len(bad) == 0:
                return self.result(kind, whole.cells, "", None, whole.bounds)
            tried += 2 * len(bad)
            if tried > self.most:
                near = whole.cells.take(bad[:1])
                failed = State(self.structure, near.z[0], near.p[0])
                return self.result(kind, whole.cells, f"{self.most} cells do not suffice", failed)
            halves, lost = self._halves(whole.take(bad))
            if lost is not None:
                why = f"the sheet ends at a {lost.kind}"
                return self.result(kind, whole.cells, why, lost.state)
            rest = whole.take(np.setdiff1d(np.arange(len(whole.responses)), bad))
            whole = _Judged.concatenate([rest, self._judge(halves)])

    def half(self, cells: _Cells) -> Corners:
        """Half widths of cells in the units of the parameters."""
        return np.asarray(0.25 * (cells.upper - cells.lower) * (self.box.upper - self.box.lower))

    def move(self, cells: _Cells) -> tuple[_Cells, Event | None]:
        """Cells whose states are lifted to their middles; or what a lift met."""
        states, box = States(self.structure, cells.z, cells.p), self.box
        middles = 0.5 * (box.lower + box.upper) + 0.5 * cells.middle * (box.upper - box.lower)
        if np.array_equal(states.p[:, self.places], middles):
            return cells, None
        columns = {name: middles[:, k].copy() for k, name in enumerate(box.names)}
        lifts = lift(states, columns, options=TraceOptions(record=False))
        lost, found = np.flatnonzero(~lifts.arrived), lifts.states
        event = lifts[int(lost[0])] if len(lost) else None
        return replace(cells, z=found.z, p=found.p), event

    def _errors(self, cells: _Cells) -> ErrorBox:
        steps = np.zeros((len(cells.lower), len(self.places), cells.p.shape[1]))
        steps[:, range(len(self.places)), self.places] = self.half(cells)
        return ErrorBox(steps)

    def _judge(self, cells: _Cells) -> _Judged:
        states, errors = States(self.structure, cells.z, cells.p), self._errors(cells)

        def part(rows: slice) -> Bounds:
            return segment_bounds(states[rows], states[rows], self.margin, errors.take(rows))

        return _Judged(cells, bounds_in_parts(states, part), errors.responses(states))

    def _good(self, whole: _Judged) -> Flags:
        bounds = whole.bounds
        return np.asarray(bounds.proved & bounds.stable & (bounds.margin >= self.margin))

    def _halves(self, judged: _Judged) -> tuple[_Cells, Event | None]:
        """Both halves of cells, cut across the parameter that moves their states most."""
        cells, n = judged.cells, self.structure.unknowns
        moves = judged.responses[:, :, :n] ** 2 @ self.structure.mass
        widths = self.half(cells) / self.structure.scales[self.places]
        axis = np.argmax(moves + LEAST_SHARE * widths**2, axis=1)
        rows, lower, upper = np.arange(len(axis)), cells.lower.copy(), cells.upper.copy()
        lower[rows, axis] = upper[rows, axis] = cells.middle[rows, axis]
        parts = replace(cells, upper=upper), replace(cells, lower=lower)
        return self.move(_Cells.concatenate(parts))

    def _apart(self, whole: _Judged) -> Numbers:
        """Cells whose states are not shown to be those of a neighbour at their common face."""
        pairs = neighbours(whole.cells.lower, whole.cells.upper)
        one, other = (whole.take(rows) for rows in pairs.T)
        low = np.maximum(one.cells.lower, other.cells.lower)
        place = 0.5 * (low + np.minimum(one.cells.upper, other.cells.upper))
        gap = np.abs(one.at(place) - other.at(place)) + ROUNDING * (1.0 + np.abs(one.cells.z))
        return parted(pairs, gap, whole.bounds)

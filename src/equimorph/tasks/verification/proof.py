"""Proofs that states exist and are unique: along a schedule, and over a box (`certify_box`).

A box is the tube around a route without length, the state at its middle: in each cell the sheet is
compared with its tangent plane there, with the half widths of the cell as errors.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes
from equimorph.equilibria import Event, lift
from equimorph.equilibria.legs import check_starts
from equimorph.model import Box, position
from equimorph.structures import State, States, join_states
from equimorph.tasks.verification.evidence import (
    Evidence,
    ProofStatus,
    kind_of_bounds,
    no_bounds,
    standing,
)
from equimorph.tasks.verification.tube import Judged, Tube


@dataclass(frozen=True, eq=False)
class Proof:
    """What is known of a polyline in parameter space between known equilibria.

    Parameters
    ----------
    why
        Reason if there is neither proof nor support, else empty.
    states
        Equilibria between which a bound holds, those added by bisection included.
    error
        For each segment, largest distance of the true curve from the chord between its ends: of
        any unknown or multiplier.
    margin
        Stability margin that the curve keeps everywhere, 0 if unproved.
    bounds
        "enclosed": over whole boxes with outward rounding; "sampled": estimated from samples, as
        for rods and frames in space; "structural", in older files: with allowances for round-off.
    failed
        First segment for which the bound fails, by its ends.
    tubes
        Half widths of the boxes around the chord, for each unknown and multiplier, in which the
        curve is the only one; None in older files.
    """

    why: str
    states: States
    error: Float[np.ndarray, " segments"]
    margin: float
    bounds: Evidence
    failed: States | None = None
    tubes: Float[np.ndarray, "segments size"] | None = None

    @property
    def status(self) -> ProofStatus:
        """Proved only if the bounds are enclosed; see `ProofStatus`."""
        return standing(self.why, self.bounds == "enclosed")

    def __repr__(self) -> str:
        """Status, number of segments and the margin, or why there is no proof."""
        if self.why:
            return f"Proof(unproved: {self.why})"
        segments = f"{self.bounds} bounds on {len(self.error)} segments"
        return f"Proof({self.status}: {segments}; margin >= {self.margin:.4g})"


def prove(states: States, margin: float = 0.0) -> Proof:
    """Prove that one curve of stable equilibria joins consecutive states, or support it.

    Newton–Kantorovich bound on every segment, the `Tube` around the route without errors; where it
    fails the segment is bisected. It says,
    for all parameters on the straight segments between those of the states, that an equilibrium
    exists near the chord, that it is the only one there and continuous, and that its index is 0
    with at least `margin`. This is proved where the structure encloses F and its first derivatives
    over whole boxes (spring, truss, planar rod and frame, formulas), and supported where they are
    sampled. A proof counts rounding outward throughout. It is about the discretised structure, with
    the tables of numbers that it computes with.
    """
    structure = states.structure
    kind = kind_of_bounds(states)
    if kind == "unknown":
        return Proof(no_bounds(structure), states, np.zeros(0), 0.0, "sampled")
    route, none = _without_repeats(states), np.zeros((0, states.p.shape[1]))
    done = Tube(route, none, margin=margin).divide()
    judged = done.judged.take(np.argsort(done.judged.cells.lower[:, 0]))
    cells, bounds = judged.cells, judged.bounds
    begins = States(structure, cells.before, cells.start)
    whole = join_states(structure, (begins, route[-1]))
    error = np.asarray(bounds.error * bounds.weights.max(axis=1))
    if done.why:
        bad = np.flatnonzero(~judged.good)
        failed = whole[bad[0] : bad[0] + 2] if len(bad) else None
        return Proof(done.why, whole, error, 0.0, kind, failed)
    tubes = bounds.unique[:, None] * bounds.weights
    return Proof("", whole, error, float(bounds.margin.min()), kind, tubes=tubes)


def _without_repeats(states: States) -> States:
    moved = np.abs(np.diff(states.p, axis=0)).max(axis=1, initial=0.0) > 0.0
    return states[np.flatnonzero(np.concatenate([[True], moved]))]


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
        Stability margin that the whole sheet keeps, by bounds of this kind; 0 if unproved.
    bounds
        As of `Proof`.
    failed
        State near which the proof fails.
    """

    why: str
    box: Box
    states: States
    half: Float[np.ndarray, "cells d"]
    tubes: Lanes
    margin: float
    bounds: Evidence
    failed: State | None = None

    @property
    def status(self) -> ProofStatus:
        """Proved only if the bounds are enclosed; see `ProofStatus`."""
        return standing(self.why, self.bounds == "enclosed")

    def __repr__(self) -> str:
        """Status, number of cells and the margin, or why there is no proof."""
        if self.why:
            return f"BoxProof(unproved: {self.why})"
        cells = f"{self.bounds} bounds on {len(self.half)} cells"
        return f"BoxProof({self.status}: {cells}; margin >= {self.margin:.4g})"


@check_arguments
def certify_box(state: State, box: Box, *, margin: float = 0.0, most: int = 10_000) -> BoxProof:
    """Prove, or support, that one sheet of stable states extends over a whole box of parameters.

    Then any motion within the box that starts on this sheet stays on it, without a snap. The box is
    bisected, across the parameter that moves the states most, until the bounds, enclosed or sampled
    (`ProofStatus`), hold in every cell; other parameters keep their values. The sheet is that which
    a straight lift from the state to the middle of the box leads to. Failures are named in `why`:
    an unstable or missing state, or the work is spent, as must happen where the margin vanishes.

    Parameters
    ----------
    state
        A stable equilibrium.
    box
        Ranges of parameters.
    margin
        Least stability margin to be shown.
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
    kind = kind_of_bounds(state.batch)
    if kind == "unknown":
        return _nothing(box, state, "sampled", no_bounds(state.structure), state)
    if state.index != 0:
        return _nothing(box, state, kind, "the state is unstable", state)
    middle, lost = _lift_to_the_middle(state, box)
    if lost is not None:
        why = f"the way to its middle ends at a {lost.kind}"
        return _nothing(box, state, kind, why, lost.state)
    known, half = state.structure.parameters, 0.5 * (box.upper - box.lower)
    steps = np.zeros((len(half), len(known)))
    steps[range(len(half)), [position(known, name) for name in box.names]] = half
    both = join_states(state.structure, (middle, middle))
    done = Tube(both, steps, margin=margin, most=most).divide()
    cells, bounds = done.judged.cells, done.judged.bounds
    why = done.why or _other_sheet(done.judged, middle)
    widths = 0.5 * (cells.upper - cells.lower)[:, 1:] * half
    states = States(state.structure, cells.before, cells.start)
    tubes = bounds.unique[:, None] * bounds.weights
    least = 0.0 if why else float(bounds.margin.min())
    return BoxProof(why, box, states, widths, tubes, least, kind, done.failed)


def _other_sheet(judged: Judged, middle: State) -> str:
    """Reason against a proof if a cell around the middle of the box need not hold its state."""
    held = (judged.cells.lower[:, 1:] <= 0.0) & (judged.cells.upper[:, 1:] >= 0.0)
    around = judged.take(np.flatnonzero(held.all(axis=1)))
    gap = np.abs(around.at(np.zeros_like(around.cells.lower)) - middle.z)
    inside = (gap < around.bounds.unique[:, None] * around.bounds.weights).all()
    return "" if inside else "a cell may hold another sheet of states"


def _nothing(box: Box, state: State, kind: Evidence, why: str, failed: State) -> BoxProof:
    """No proof, for a reason that is known before a cell is tried."""
    half = 0.5 * (box.upper - box.lower)[None]
    return BoxProof(why, box, state.batch, half, np.zeros_like(state.batch.z), 0.0, kind, failed)


def _lift_to_the_middle(state: State, box: Box) -> tuple[State, Event | None]:
    """State at the middle of a box, or what a straight lift there met."""
    middle = dict(zip(box.names, (0.5 * (box.lower + box.upper)).tolist(), strict=True))
    if all(state[name] == value for name, value in middle.items()):
        return state, None
    path = lift(state, middle)
    return path.end.state, None if path.arrived else path.end

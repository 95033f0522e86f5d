"""Proof mode: between the states of a schedule, too, the lifted curve exists and is unique."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float
from equimorph.structures import States, join_states
from equimorph.tasks.verification.evidence import (
    Evidence,
    ProofStatus,
    kind_of_bounds,
    no_bounds,
    standing,
)
from equimorph.tasks.verification.tube import Tube


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

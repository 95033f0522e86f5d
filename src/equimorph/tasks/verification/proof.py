"""Proof mode: between the states of a schedule, too, the lifted curve exists and is unique."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import numpy as np

from equimorph.array_types import Bool, Float, Int
from equimorph.equilibria import settle
from equimorph.linalg.intervals import Interval
from equimorph.structures import States, Structure
from equimorph.tasks.verification.newton_kantorovich import Bounds, segment_bounds
from equimorph.tasks.verification.sampled_bounds import allows_sampling

MOST_BISECTIONS = 12
"""Bisections of a segment before it counts as unproved."""
LARGEST_SAGITTA = 0.25
"""Distance of the exact middle from the chord, relative to its length, that counts as a bend."""
ENTRIES_AT_ONCE = 100_000
"""Entries of the inverse matrices that are held at a time."""


class ProofStatus(StrEnum):
    """Evidence that one stable curve joins the states; each member equals its text."""

    PROVED = "proved"
    """The bounds hold on all segments, and all that enters them is enclosed over whole boxes with
    outward rounding: a theorem on the structure with the numbers that it computes with."""
    SUPPORTED = "supported"
    """The bounds hold on all segments if the second derivatives nowhere exceed twice their largest
    change seen in samples and round-off its allowance: evidence, no proof."""
    UNPROVED = "unproved"
    """The bounds fail somewhere, or there are none."""


def standing(why: str, enclosed: bool) -> ProofStatus:
    """Status of a proof that failed for a reason, or else has bounds that are enclosed or not."""
    if why:
        return ProofStatus.UNPROVED
    return ProofStatus.PROVED if enclosed else ProofStatus.SUPPORTED


def no_bounds(structure: Structure) -> str:
    """Reason why nothing is proved of a structure whose derivatives have no bounds."""
    return (
        f"a {structure.kind} with {structure.size} unknowns knows no bounds of its "
        "derivatives and has too many to sample"
    )


Evidence = Literal["enclosed", "structural", "sampled"]


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
        for frames and rods in space; "structural", in older files: with allowances for round-off.
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

    Newton–Kantorovich bound on every segment; where it fails the segment is bisected. It says,
    for all parameters on the straight segments between those of the states, that an equilibrium
    exists near the chord, that it is the only one there and continuous, and that its index is 0
    with at least `margin`. This is proved where the structure encloses F and its first derivatives
    over whole boxes (spring, truss, planar rod, formulas), and supported where they are sampled.
    A proof counts rounding outward throughout. It is about the discretised structure, with the
    tables of numbers that it computes with.
    """
    structure = states.structure
    kind = kind_of_bounds(states)
    if kind == "unknown":
        return Proof(no_bounds(structure), states, np.zeros(0), 0.0, "sampled")
    states = _without_repeats(states)
    bounds = _all_bounds(states[:-1], states[1:], margin)
    for _ in range(MOST_BISECTIONS):
        bad = np.flatnonzero(_wrong(bounds, margin))
        if len(bad) == 0:
            return _conclude(states, bounds, kind)
        divided = _bisect(states, bad)
        if divided is None:
            break
        states, new = divided
        bounds = _renew(bounds, states, bad, new, margin)
    bad = np.flatnonzero(_wrong(bounds, margin))
    if len(bad) == 0:
        return _conclude(states, bounds, kind)
    k = int(bad[0])
    why = _why(bounds, k, margin)
    return Proof(why, states, _errors(bounds), 0.0, kind, states[k : k + 2])


def kind_of_bounds(states: States) -> Literal["enclosed", "sampled", "unknown"]:
    """How F and its derivatives are bounded; "unknown": not at all."""
    structure = states.structure
    if structure.enclosure(Interval.at(states.z[:1]), Interval.at(states.p[:1])) is not None:
        return "enclosed"
    return "sampled" if allows_sampling(structure) else "unknown"


def _without_repeats(states: States) -> States:
    moved = np.abs(np.diff(states.p, axis=0)).max(axis=1, initial=0.0) > 0.0
    return states[np.flatnonzero(np.concatenate([[True], moved]))]


def _all_bounds(first: States, last: States, margin: float) -> Bounds:
    return bounds_in_parts(first, lambda rows: segment_bounds(first[rows], last[rows], margin))


def bounds_in_parts(states: States, part: Callable[[slice], Bounds]) -> Bounds:
    """Bounds of many segments, a part at a time, as their matrices take much memory."""
    structure = states.structure
    entries = structure.size**2
    if kind_of_bounds(states) == "sampled":
        entries *= structure.size
    count = max(1, ENTRIES_AT_ONCE // entries)
    return Bounds.concatenate([part(slice(k, k + count)) for k in range(0, len(states), count)])


def _wrong(bounds: Bounds, margin: float) -> Bool[np.ndarray, " segments"]:
    """Segments without a bound, without margin, or whose curve need not go on in the next."""
    wrong = ~bounds.proved | ~_keeps(bounds, margin)
    # the equilibrium at a shared end must lie where the next segment has only one
    reach = bounds.at_ends.max(axis=1)[:, None] * bounds.weights
    alone = bounds.unique[:, None] * bounds.weights
    for one, other in ((reach[:-1], alone[1:]), (reach[1:], alone[:-1])):
        apart = (one > other).any(axis=1)
        wrong[:-1] |= apart
    return np.asarray(wrong)


def _keeps(bounds: Bounds, margin: float) -> Bool[np.ndarray, " segments"]:
    """Whether segments keep a margin; a bound σ > 0 says that all eigenvalues lie above σ."""
    return np.asarray((bounds.margin >= margin) & (bounds.margin > 0.0))


def _bisect(
    states: States, bad: Int[np.ndarray, " bad"]
) -> tuple[States, Int[np.ndarray, " bad"]] | None:
    """States with exact ones in the middle of the bad segments, and where these stand; else None.

    A curve that leaves its chord by a quarter of its length, or an unstable state, cannot be meant.
    """
    structure: Structure = states.structure
    middle = 0.5 * (states.z[bad] + states.z[bad + 1])
    p = 0.5 * (states.p[bad] + states.p[bad + 1])
    amid = settle(structure, middle, p)
    z, found = amid.z, amid.found
    n, mass = structure.unknowns, structure.mass
    away = np.sqrt((z - middle)[:, :n] ** 2 @ mass)
    chord = np.sqrt((states.z[bad + 1] - states.z[bad])[:, :n] ** 2 @ mass)
    if not (found & (away <= LARGEST_SAGITTA * chord + 1e-12)).all():
        return None
    if (structure.index(z, p) != 0).any():
        return None
    joined = States(
        structure, np.insert(states.z, bad + 1, z, axis=0), np.insert(states.p, bad + 1, p, axis=0)
    )
    return joined, bad + 1 + np.arange(len(bad))


def _renew(
    bounds: Bounds,
    states: States,
    bad: Int[np.ndarray, " bad"],
    new: Int[np.ndarray, " bad"],
    margin: float,
) -> Bounds:
    """Bounds of all segments: those of the halves are computed."""
    halves = np.sort(np.concatenate([new - 1, new]))
    fresh = _all_bounds(states[halves], states[halves + 1], margin)
    kept = np.setdiff1d(np.arange(len(bounds.proved)), bad)
    place = np.setdiff1d(np.arange(len(states) - 1), halves)
    order = np.argsort(np.concatenate([place, halves]))
    return Bounds.concatenate([bounds.take(kept), fresh]).take(order)


def _errors(bounds: Bounds) -> Float[np.ndarray, " segments"]:
    return np.asarray(bounds.error * bounds.weights.max(axis=1))


def _conclude(states: States, bounds: Bounds, kind: Evidence) -> Proof:
    tubes = bounds.unique[:, None] * bounds.weights
    return Proof("", states, _errors(bounds), float(bounds.margin.min()), kind, tubes=tubes)


def _why(bounds: Bounds, k: int, margin: float) -> str:
    if not bounds.proved[k]:
        return f"the bound fails on a segment after {MOST_BISECTIONS} bisections"
    if not _keeps(bounds, margin)[k]:
        return f"a margin of {max(margin, 0.0):g} could not be proved on a segment"
    return "neighbouring segments could not be joined"

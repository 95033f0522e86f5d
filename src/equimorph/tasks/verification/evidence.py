"""What a proof is worth: by its bounds, which are enclosed, sampled, or missing."""

from collections.abc import Callable
from enum import StrEnum
from typing import Literal

from equimorph.linalg.intervals import Interval
from equimorph.structures import States, Structure
from equimorph.tasks.verification.error_box import allows_sampling
from equimorph.tasks.verification.newton_kantorovich import Bounds

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


def kind_of_bounds(states: States) -> Literal["enclosed", "sampled", "unknown"]:
    """How F and its derivatives are bounded; "unknown": not at all."""
    structure = states.structure
    if structure.enclosure(Interval.at(states.z[:1]), Interval.at(states.p[:1])) is not None:
        return "enclosed"
    return "sampled" if allows_sampling(structure) else "unknown"


def bounds_in_parts(states: States, part: Callable[[slice], Bounds]) -> Bounds:
    """Bounds of many segments, a part at a time, as their matrices take much memory."""
    structure = states.structure
    entries = structure.size**2
    if kind_of_bounds(states) == "sampled":
        entries *= structure.size
    count = max(1, ENTRIES_AT_ONCE // entries)
    return Bounds.concatenate([part(slice(k, k + count)) for k in range(0, len(states), count)])

"""What a proof is worth: by its bounds, which are enclosed, sampled, or missing; sampled bounds."""

from collections.abc import Callable
from enum import StrEnum
from typing import Literal

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters
from equimorph.linalg.intervals import Interval
from equimorph.structures import Direction, Enclosed, States, Structure
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


Tensor = Float[np.ndarray, "lanes size entries entries"]

DIFFERENCE = 1e-4
"""Step of the central differences that give F_z independently of the solver."""
ROUNDING = 1e-13
"""Relative error assumed for every entry of F."""
MOST_ENTRIES = 80
"""Unknowns, multipliers and parameters up to which all second derivatives are formed."""
CORNERS = 4
"""Random corners of each box at which second derivatives are sampled."""
SAFETY = 2.0
"""Factor on the largest change of a second derivative seen in the box."""


def allows_sampling(structure: Structure) -> bool:
    """Whether the second derivatives are few enough."""
    return structure.size + len(structure.parameters) <= MOST_ENTRIES


def sampled_enclosure(structure: Structure, z: Interval, p: Interval) -> Enclosed:
    """F, F_z and F_p at the centres of boxes, with changes by the second derivatives.

    Second derivatives are taken at the centre and at random corners: an estimate, not a proof.
    """
    here, reach = (z.middle, p.middle), (z.radius, p.radius)
    size = structure.size
    first = np.concatenate([_matrix(structure, *here), _columns(structure, *here)], axis=2)
    both = np.concatenate(reach, axis=1)[:, :, None]
    change = np.zeros_like(first)
    if both.any():
        change = (_second_derivatives(structure, *here, reach) @ both[:, None])[..., 0]
    rounding = ROUNDING * (np.abs(first[:, :, :size]) @ np.abs(here[0])[:, :, None])
    moved = (np.abs(first) @ both + rounding)[:, :, 0]
    derivatives = Interval.around(first, change)
    return Enclosed(
        Interval.around(structure.residual(*here), moved),
        derivatives[:, :, :size],
        derivatives[:, :, size:],
    )


def _matrix(structure: Structure, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes size size"]:
    """F_z by central differences of F."""
    lanes, size = z.shape
    steps = DIFFERENCE * np.eye(size)
    many = np.repeat(p, size, axis=0)
    ahead, behind = (
        structure.residual((z[:, None] + sign * steps).reshape(-1, size), many)
        for sign in (1.0, -1.0)
    )
    rows = ((ahead - behind) / (2.0 * DIFFERENCE)).reshape(lanes, size, size)
    return np.asarray(0.5 * (rows + rows.transpose(0, 2, 1)))


def _columns(
    structure: Structure, z: Lanes, p: Parameters
) -> Float[np.ndarray, "lanes size parameters"]:
    """F_p."""
    units = np.eye(p.shape[1])
    columns = [structure.parameter_derivative(z, p, np.tile(one, (len(p), 1))) for one in units]
    return np.stack(columns, axis=2)


def _second_derivatives(structure: Structure, z: Lanes, p: Parameters, reach: Direction) -> Tensor:
    """|D²F| at the centre of boxes, and twice its largest change to a corner."""
    generator = np.random.default_rng(7)
    centre = _tensor(structure, z, p)
    change = np.zeros_like(centre)
    for _ in range(CORNERS):
        sides = [generator.choice([-1.0, 1.0], each.shape) * each for each in reach]
        there = _tensor(structure, z + sides[0], p + sides[1])
        change = np.maximum(change, np.abs(there - centre))
    return np.asarray(np.abs(centre) + SAFETY * change)


def _tensor(structure: Structure, z: Lanes, p: Parameters) -> Tensor:
    """All second derivatives of F by unknowns, multipliers and parameters."""
    lanes, size, count = len(z), structure.size, structure.size + len(structure.parameters)
    first, second = np.triu_indices(count)
    units = np.eye(count)
    table = np.empty((lanes, size, count, count))
    for lane in range(lanes):
        v, w = ((units[at, :size], units[at, size:]) for at in (first, second))
        here, there = (np.tile(each[lane], (len(first), 1)) for each in (z, p))
        values = structure.second_derivative(here, there, v, w).T
        table[lane][:, first, second] = values
        table[lane][:, second, first] = values
    return table

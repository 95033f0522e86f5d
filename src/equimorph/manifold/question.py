"""What a set is asked for: its grid, its tiles and its setting, checked."""

import math
from collections.abc import Mapping
from itertools import product

import numpy as np

from equimorph.argument_kinds import short
from equimorph.equilibria.legs import check_isolated
from equimorph.errors import InputError
from equimorph.manifold.geometry.setting import Setting
from equimorph.model import Box, Constraint, parameter_vector, position
from equimorph.structures import Structure
from equimorph.tolerances import SAME_TO_ROUNDING

LIMIT = 60_000, 30
"""Default limit of the number of equilibria: this constant, or this many per grid point."""
MOST_POINTS = 1_000_000
"""Points of a grid above which a set is refused, if no limit allows more: they take 6 GB."""
INTERVALS = {1: (200,), 2: (47, 81), 3: (24, 24, 24)}
"""Of the grid, by the number of free parameters, if not given."""


def intervals_of(box: Box, intervals: tuple[int, ...] | None) -> tuple[int, ...]:
    """Grid intervals along each parameter, given or by default."""
    d = len(box.names)
    if d not in INTERVALS:
        raise InputError(
            f"`box` must have one, two or three parameters; got {d} ({', '.join(box.names)})."
        )
    if intervals is None:
        return INTERVALS[d]
    if len(intervals) != d:
        number = ("one whole number", "two whole numbers", "three whole numbers")[d - 1]
        raise InputError(f"`intervals` must be {number} >= 2; got {intervals!r}.")
    return tuple(intervals)


def limit_of(intervals: tuple[int, ...], limit: int | None) -> int:
    """Most equilibria of a set over a grid that is not too large."""
    points = math.prod(count + 1 for count in intervals)
    most = MOST_POINTS if limit is None else limit
    if points > most:
        raise InputError(
            f"`intervals` must give at most {most} points of the grid, or `limit` allow more; got "
            f"{short(intervals)}, which give {points:.3g}."
        )
    least, each = LIMIT
    return max(least, each * points) if limit is None else limit


def tiles_of(intervals: tuple[int, ...], tiles: tuple[int, ...] | None) -> tuple[int, ...] | None:
    """Numbers of tiles along each parameter, if there are tiles."""
    if tiles is None:
        return None
    if len(tiles) != len(intervals) or any(np.greater(tiles, intervals)):
        most = short(intervals)
        raise InputError(
            f"`tiles` must be one whole number for each parameter, at most the intervals {most}; "
            f"got {short(tiles)}."
        )
    return tuple(tiles)


def setting_of(
    structure: Structure, box: Box, fixed: Mapping[str, float], within: tuple[Constraint, ...]
) -> Setting:
    """Structure, parameters and constraints of a set over a box."""
    both = set(box.names) & set(fixed)
    if both:
        raise InputError(f"`fixed` must not name a parameter of the box; got {', '.join(both)}.")
    free = np.array([position(structure.parameters, name) for name in box.names])
    for corner in (box.lower, box.upper):
        values = dict(zip(box.names, corner.tolist(), strict=True))
        base = parameter_vector(structure.parameters, {**fixed, **values})
    sides = zip(box.lower.tolist(), box.upper.tolist(), strict=True)
    corners = np.repeat(base[None], 2 ** len(free), axis=0)
    corners[:, free] = list(product(*sides))
    if structure.have_orbits(corners).all():
        check_isolated(structure, corners)
    for name, width in zip(box.names, box.upper - box.lower, strict=True):
        period = structure.parameters[position(structure.parameters, name)].period
        if width > period * (1.0 + SAME_TO_ROUNDING):
            raise InputError(
                f"`box.{name}` must be no wider than {period:g}, after which the structure is the "
                f"same again; got {width:g}."
            )
    validity = tuple(each for each in structure.validity if each not in within)
    return Setting(structure, base, free, (*within, *validity))

"""Descriptors by the names under which they are written: those of every structure, then its own."""

import re
from collections.abc import Callable
from functools import partial

from equimorph.errors import InputError
from equimorph.model import Box, Descriptor
from equimorph.model.obstacle import Disc, HalfPlane
from equimorph.structures.contract import Structure
from equimorph.structures.quantities import (
    distance_to,
    effort_of,
    margin_of,
    outside,
    shape_coordinate,
    value_of,
)

_CALL = re.compile(r"\s*(\w+)\((.*)\)\s*", re.DOTALL)
_RANGE = re.compile(r"\s*(\w+)\s+(\S+)\s+to\s+(\S+)\s*")


def descriptor_named(structure: Structure, text: str) -> Descriptor:
    """Descriptor that a text means.

    Beside those of the structure: ``Theta`` (any parameter), ``effort(Theta)``,
    ``stability_margin``, ``distance(half_plane(x, y, nx, ny))``, ``distance(disc(x, y, r))``,
    ``distance(room(x, y, r))``, ``outside(Theta 1 to 2, Delta 0 to 1)`` and, of the drawn shape,
    ``shape_y(0.3)``.

    Raises
    ------
    InputError
        If it means nothing here.

    Examples
    --------
    >>> from equimorph import Spring
    >>> descriptor_named(Spring(), "effort(x_l)").symbol
    '∂L/∂x_l'
    """
    name = text.strip()
    if name in {each.name for each in structure.parameters}:
        return value_of(structure, name)
    if name == "stability_margin":
        return margin_of(structure)
    called = _CALL.fullmatch(name)
    if called and called[1] in _FORMS:
        return _FORMS[called[1]](structure, called[2])
    return structure.descriptor(text)


def _effort(structure: Structure, inner: str) -> Descriptor:
    return effort_of(structure, inner.strip())


def _distance(structure: Structure, inner: str) -> Descriptor:
    called = _CALL.fullmatch(inner)
    words = called[2].split(",") if called else []
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    match (called[1] if called else "", numbers):
        case ("half_plane", [x, y, a, b]):
            return distance_to(structure, HalfPlane((x, y), (a, b)))
        case ("disc", [x, y, r]):
            return distance_to(structure, Disc((x, y), r))
        case ("room", [x, y, r]):
            return distance_to(structure, Disc((x, y), r, inside=True))
    raise InputError(
        "`distance` must be that from half_plane(x, y, nx, ny), disc(x, y, r) or room(x, y, r), "
        f"with numbers; got {inner!r}."
    )


def _outside(structure: Structure, inner: str) -> Descriptor:
    found = [_RANGE.fullmatch(part) for part in inner.split(",")]
    try:
        sides = {each[1]: (float(each[2]), float(each[3])) for each in found if each}
    except ValueError:
        sides = {}
    if len(sides) < len(found):
        raise InputError(
            f"`outside` must read like outside(Theta 1 to 2, Delta 0 to 1); got {inner!r}."
        )
    return outside(structure, Box(**sides))


def _shape(axis: str, structure: Structure, inner: str) -> Descriptor:
    try:
        s = float(inner)
    except ValueError:
        raise InputError(
            f"`shape_{axis}` must be at a number from 0 to 1; got {inner!r}."
        ) from None
    return shape_coordinate(structure, axis, s)


_FORMS: dict[str, Callable[[Structure, str], Descriptor]] = {
    "effort": _effort,
    "distance": _distance,
    "outside": _outside,
    "shape_x": partial(_shape, "x"),
    "shape_y": partial(_shape, "y"),
    "shape_z": partial(_shape, "z"),
}

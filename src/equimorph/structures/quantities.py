"""Descriptors that every structure has, as functions and by the names under which they are written.

Compared with a number, each is a `Constraint` for any task: ``effort_of(arch, "Theta") <= 0.2``.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Box, Descriptor, largest_of, position, remember_call
from equimorph.model.obstacle import Disc, HalfPlane, Obstacle, nearest
from equimorph.model.units import FORCE, LENGTH, UNITS
from equimorph.structures.contract import Structure
from equimorph.structures.margin import stability_margin

FORCES = [name for name, (_, of) in UNITS.items() if of == FORCE]
LENGTHS = [name for name, (_, of) in UNITS.items() if of == LENGTH]
EFFORTS = {
    **{f"{force} {length}": "M" for force in FORCES for length in LENGTHS},
    **dict.fromkeys(FORCES, "F"),
    **{"4π²B/L": "M", "4π²B/L²": "F", "force·length": "M", "force": "F"},
    **dict.fromkeys((*LENGTHS, "length", "L"), "−δ"),
}
"""Symbols of efforts by unit: couples M, forces F, and the travel δ of forces, which they lose."""

GENERIC = (
    *("a parameter", "effort(parameter)", "stability_margin", "abs(…)", "largest(…, …)"),
    *("distance(…)", "outside(…)", "shape_x(s)", "shape_y(s)"),
)
"""What texts may mean of every structure, for messages."""


@remember_call
@check_arguments
def value_of(structure: Structure, name: str) -> Descriptor:
    """Value of a parameter, to bound an actuator: ``value_of(arch, "Theta") <= 2``.

    Raises
    ------
    InputError
        If the name is unknown.
    """
    at = position(structure.parameters, name)

    def value(z: Lanes, p: Parameters) -> Values:
        return p[:, at].copy()

    return Descriptor(name, structure.parameters[at].unit, value, name, structure.signature)


@remember_call
@check_arguments
def shape_coordinate(structure: Structure, axis: str, s: float) -> Descriptor:
    """Coordinate of the drawn shape at a share of its points: ``shape_coordinate(arch, "y", 0.3)``.

    Raises
    ------
    InputError
        If the axis is not x, y or z, or `s` lies outside 0 to 1.
    """
    if axis not in ("x", "y", "z") or not 0.0 <= s <= 1.0:
        raise InputError(f"`shape` must be x, y or z at s from 0 to 1; got {axis} at {s:g}.")
    k, place = "xyz".index(axis), np.array([s])

    def value(z: Lanes, p: Parameters) -> Values:
        shape = structure.shape(z, p, place)
        if k >= shape.shape[2]:
            raise InputError("`shape` must be x or y: this structure lies in a plane; got z.")
        return np.asarray(shape[:, 0, k])

    return Descriptor(f"shape_{axis}({s:g})", structure.length_unit, value, "", structure.signature)


@remember_call
@check_arguments
def effort_of(structure: Structure, name: str) -> Descriptor:
    """Effort ∂L/∂p of a parameter: the couple or force of an actuator, the displacement of a load.

    Raises
    ------
    InputError
        If the name is unknown.
    """
    at, unit = position(structure.parameters, name), structure.energy_scale

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(unit * structure.effort(z, p)[:, at])

    label = structure.effort_unit(structure.parameters[at])
    symbol = f"{EFFORTS.get(label, 'Q')}({name})"
    return Descriptor(f"effort({name})", label, value, symbol, structure.signature)


@remember_call
@check_arguments
def margin_of(structure: Structure) -> Descriptor:
    """Stability margin: smallest eigenvalue of the constrained Hessian in the metric."""

    def value(z: Lanes, p: Parameters) -> Values:
        return stability_margin(structure, z, p)

    return Descriptor("stability_margin", "1", value, "margin", structure.signature)


@remember_call
@check_arguments
def distance_to(structure: Structure, obstacle: Obstacle) -> Descriptor:
    """Signed distance of the shape from an obstacle: negative where it enters what is forbidden.

    Its `place` is the share of the shape's way where it comes nearest. Rods are followed along
    their exact positions and angles, other structures along what `shape` draws. In space,
    obstacles extend along the z-axis without end.

    Raises
    ------
    InputError
        If `obstacle` is neither a `HalfPlane` nor a `Disc`.

    Examples
    --------
    >>> from equimorph import Disc, Spring, distance_to
    >>> spring = Spring()
    >>> away = distance_to(spring, Disc((0.5, 0.2), 0.1))
    >>> round(away(spring.natural_state(x_l=1.2)), 6)
    0.1
    """
    if not isinstance(obstacle, HalfPlane | Disc):
        raise InputError(f"`obstacle` must be a HalfPlane or a Disc; got {obstacle!r}.")

    def value(z: Lanes, p: Parameters) -> Values:
        return nearest(structure.arcs(z, p), obstacle)[0]

    def place(z: Lanes, p: Parameters) -> Values:
        return nearest(structure.arcs(z, p), obstacle)[1]

    name = f"distance({obstacle})"
    unit, origin = structure.length_unit, structure.signature
    return Descriptor(name, unit, value, "distance", origin, place, obstacle=obstacle)


@remember_call
@check_arguments
def outside(structure: Structure, box: Box) -> Descriptor:
    """Distance of parameters from a box, in their scales; negative inside.

    The largest distance along one parameter, so that ``outside(arch, Box(...)) >= 0`` keeps
    actuators out of a region.

    Raises
    ------
    InputError
        If the structure does not have a parameter of the box.
    """
    at = np.array([position(structure.parameters, name) for name in box.names])
    scales = structure.scales[at]

    def value(z: Lanes, p: Parameters) -> Values:
        here = p[:, at]
        gaps = np.maximum(box.lower - here, here - box.upper) / scales
        return np.asarray(gaps.max(axis=1))

    bounds = zip(box.names, box.lower.tolist(), box.upper.tolist(), strict=True)
    written = ", ".join(f"{name} {low:.9g} to {high:.9g}" for name, low, high in bounds)
    return Descriptor(f"outside({written})", "scales", value, "outside", structure.signature)


_CALL = re.compile(r"\s*(\w+)\((.*)\)\s*", re.DOTALL)
_COMMA = re.compile(r",(?![^(]*\))")
"""Between texts, not inside their brackets."""
_RANGE = re.compile(r"\s*(\w+)\s+(\S+)\s+to\s+(\S+)\s*")


def find_descriptor(structure: Structure, text: str) -> Descriptor:
    """Descriptor that a text means.

    Beside those of the structure: ``Theta`` (any parameter), ``effort(Theta)``,
    ``abs(effort(Theta))``, ``largest(abs(end_moment(0)), abs(end_moment(1)))`` of several,
    ``stability_margin``, ``distance(half_plane(x, y, nx, ny))``, ``distance(disc(x, y, r))``,
    ``distance(room(x, y, r))``, ``outside(Theta 1 to 2, Delta 0 to 1)`` and, of the drawn shape,
    ``shape_y(0.3)``.

    Raises `InputError` if it means nothing here.

    Examples
    --------
    >>> from equimorph import Spring
    >>> find_descriptor(Spring(), "effort(x_l)").symbol
    'F(x_l)'
    """
    name = text.strip()
    if name in {each.name for each in structure.parameters}:
        return value_of(structure, name)
    if name == "stability_margin":
        return margin_of(structure)
    called = _CALL.fullmatch(name)
    if called and called[1] in _FORMS:
        return _FORMS[called[1]](structure, called[2])
    try:
        return structure.descriptor(text)
    except InputError as error:
        own, got, rest = str(error).partition("; got ")
        if not own.startswith("`descriptor` must be one of"):
            raise
        more = ", ".join(each for each in GENERIC if each not in own)
        raise InputError(f"{own}, {more}{got}{rest}") from None


def _largest(structure: Structure, inner: str) -> Descriptor:
    parts = [find_descriptor(structure, part) for part in _COMMA.split(inner)]
    largest = largest_of(f"largest({', '.join(each.name for each in parts)})", *parts)
    return replace(largest, symbol=f"max({', '.join(each.symbol or each.name for each in parts)})")


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
    "abs": lambda structure, inner: abs(find_descriptor(structure, inner)),
    "effort": lambda structure, inner: effort_of(structure, inner.strip()),
    "largest": _largest,
    "distance": _distance,
    "outside": _outside,
    "shape_x": partial(_shape, "x"),
    "shape_y": partial(_shape, "y"),
    "shape_z": partial(_shape, "z"),
}

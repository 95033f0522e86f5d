"""Names of a study file, looked up: parameters, descriptors, points, with the key of what fails."""

from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from equimorph.equilibria import worst_named
from equimorph.errors import InputError
from equimorph.manifold import INTERVALS
from equimorph.model import Box, Constraint, Descriptor, parameter_vector, position
from equimorph.structures import Structure
from equimorph.study.expressions import parse_comparison
from equimorph.study.sections.extent import SetSection, StateSection

LARGEST_ANGLE = 20.0
"""Radians; ends turned further against each other need curvatures above 40 everywhere."""


@dataclass(frozen=True)
class Extent:
    """A part of parameter space with a grid, as objects: of the set, or of a map."""

    box: Box
    fixed: Mapping[str, float]
    constraints: tuple[Constraint, ...]
    intervals: tuple[int, ...]


@dataclass(frozen=True)
class Ground:
    """What all questions of a study share."""

    structure: Structure
    extent: Extent | None
    """Of the set, if it is asked for."""

    @property
    def height(self) -> Descriptor:
        """Descriptor that figures use as the height of the surface."""
        return self.structure.elevation

    @property
    def box(self) -> Box:
        """Box of the set, which there is where a question needs it."""
        assert self.extent is not None
        return self.extent.box


def extent_of_set(structure: Structure, wanted: SetSection) -> Extent:
    """Look up the names of the section on the set.

    Raises
    ------
    InputError
        For names that the structure does not have, or values without meaning.
    """
    with at_key("set.box"):
        box = Box(**{name: (bounds[0], bounds[1]) for name, bounds in wanted.box.items()})
        for name, corner in zip(box.names * 2, [*box.lower, *box.upper], strict=True):
            check_value(structure, name, corner)
    _check_fixed(structure, box, wanted.fixed)
    constraints = _bounds(structure, wanted.within)
    return Extent(box, wanted.fixed, constraints, _intervals(wanted))


@contextmanager
def at_key(key: str) -> Generator[None]:
    """Put the key of the study file before the message of an `InputError`."""
    try:
        yield
    except InputError as error:
        raise InputError(f"in `{key}`: {error}") from error


def check_point(box: Box, point: Mapping[str, float], key: str, *, whole: bool = True) -> None:
    """Refuse a point that names other parameters than the box, or lies outside it.

    Parameters
    ----------
    box
        The box of the study.
    point
        Values by name.
    key
        Key of the study file, for the message.
    whole
        Whether all parameters of the box must be named.
    """
    names = ", ".join(box.names)
    if not set(point) <= set(box.names) or (whole and len(point) < len(box.names)):
        need = f"name the free parameters {names}" if whole else f"name some of {names}"
        raise InputError(f"`{key}` must {need}; got {', '.join(point)}.")
    for name, value in point.items():
        i = box.names.index(name)
        if not box.lower[i] <= value <= box.upper[i]:
            raise InputError(
                f"`{key}.{name}` must lie in the box, {box.lower[i]:g} to {box.upper[i]:g}; "
                f"got {value:g}. Widen `set.box`, or move the point."
            )


def check_value(structure: Structure, name: str, value: float) -> None:
    """Refuse a value without meaning, and angles that must be degrees."""
    parameter = structure.parameters[position(structure.parameters, name)]
    parameter.check(value)
    if parameter.unit == "rad" and abs(value) > LARGEST_ANGLE:
        raise InputError(
            f"`{name}` must be an angle in radians, within ±{LARGEST_ANGLE:g}; got {value:g}. "
            f"If these are degrees, write {np.deg2rad(value):.4g}."
        )


def check_parameters(structure: Structure, names: Iterable[str], key: str) -> None:
    """Refuse names that are no parameters; `key` for the message."""
    for name in names:
        with at_key(key):
            position(structure.parameters, name)


def constraints_of(structure: Structure, texts: Sequence[str], key: str) -> tuple[Constraint, ...]:
    """Look up comparisons; `InputError` names the key of one that means nothing."""
    constraints = []
    for i, text in enumerate(texts):
        with at_key(f"{key}[{i}]"):
            constraints.append(parse_comparison(text).on(structure))
    return tuple(constraints)


def check_state(ground: Ground, section: StateSection, key: str) -> None:
    """Refuse a point outside the box, and descriptors to choose by that there are not."""
    check_point(ground.box, section.at, f"{key}.at")
    for text in (section.highest, section.lowest, *(section.near or ())):
        if text is not None:
            descriptor_at(ground.structure, text, key)


def descriptor_at(structure: Structure, text: str, key: str) -> Descriptor:
    """Look up a descriptor; `InputError` names the key if it means nothing."""
    with at_key(key):
        return worst_named(structure, text)


def descriptors_of(
    structure: Structure, values: Mapping[str, float], key: str
) -> dict[Descriptor, float]:
    """Look up the descriptors of values."""
    return {descriptor_at(structure, text, key): value for text, value in values.items()}


def _check_fixed(structure: Structure, box: Box, fixed: Mapping[str, float]) -> None:
    both = sorted(set(box.names) & set(fixed))
    if both:
        raise InputError(f"`set.fixed` must not name what `set.box` frees; got {', '.join(both)}.")
    with at_key("set.fixed"):
        for name, value in fixed.items():
            check_value(structure, name, value)
        middle = dict(zip(box.names, 0.5 * (box.lower + box.upper), strict=True))
        vector = parameter_vector(structure.parameters, {**middle, **fixed})
    assert np.isfinite(vector).all()


def _intervals(wanted: SetSection) -> tuple[int, ...]:
    """Intervals of the grid; what a study leaves out takes the library's default."""
    return tuple(wanted.intervals or INTERVALS[len(wanted.box)])


def _bounds(structure: Structure, texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Constraints of the set; structures with equilibria without end need a bound."""
    constraints = constraints_of(structure, texts, "set.within")
    bounded = {each.descriptor.name for each in constraints if each.sense == "<="}
    needed = structure.endless_in
    if needed and needed not in bounded:
        raise InputError(
            f"`set.within` must bound the {needed} of this structure, which has equilibria without "
            f'end; got {", ".join(texts) or "nothing"}. Add "{needed} <= 20".'
        )
    return constraints

"""From a study file to the objects of the library, with the key of whatever does not fit."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from equimorph.errors import InputError
from equimorph.manifold import INTERVALS
from equimorph.model import Box, Constraint, Descriptor, Grid, parameter_vector, position
from equimorph.structures import Structure, from_identity
from equimorph.study.expressions import parse_comparison
from equimorph.study.problem import (
    MapSection,
    RouteSection,
    SetSection,
    StateSection,
    StructureSection,
    Study,
)
from equimorph.tasks import unloaded_base

LARGEST_ANGLE = 20.0
"""Radians; ends turned further against each other need curvatures above 40 everywhere."""


@dataclass(frozen=True)
class Task:
    """A route that is wanted, with its constraints as objects."""

    key: str
    section: RouteSection
    constraints: tuple[Constraint, ...]


@dataclass(frozen=True)
class MapTask:
    """A map that is wanted, with its grid, constraints and descriptor as objects."""

    key: str
    section: MapSection
    grid: Grid
    constraints: tuple[Constraint, ...]
    descriptor: Descriptor | None


@dataclass(frozen=True)
class SetTask:
    """The part of the equilibrium set that is wanted, as objects."""

    box: Box
    fixed: dict[str, float]
    constraints: tuple[Constraint, ...]
    intervals: tuple[int, int]


@dataclass(frozen=True)
class Problem:
    """A study whose names all mean something."""

    structure: Structure
    equilibrium_set: SetTask | None
    points: tuple[dict[str, float], ...]
    tasks: tuple[Task, ...]
    maps: tuple[MapTask, ...]
    height: Descriptor
    """Descriptor that figures use as the height of the surface."""


def prepare(study: Study) -> Problem:
    """Build the structure of a study and look up all its names.

    Parameters
    ----------
    study
        A study whose keys and types are right.

    Raises
    ------
    InputError
        For a parameter or descriptor that the structure does not have, a value without meaning, or
        a point outside the box; the line names the key.
    """
    with at_key("structure"):
        structure = build_structure(study.structure)
    wanted = study.equilibrium_set
    extent = None if wanted is None else _set_task(structure, wanted)
    points: tuple[dict[str, float], ...] = ()
    tasks: tuple[Task, ...] = ()
    if extent is not None:
        for i, point in enumerate(study.equilibria):
            check_point(extent.box, point.at, f"equilibria[{i}].at")
        points = tuple(point.at for point in study.equilibria)
        tasks = tuple(_task(structure, extent.box, each, i) for i, each in enumerate(study.routes))
    return Problem(
        structure=structure,
        equilibrium_set=extent,
        points=points,
        tasks=tasks,
        maps=tuple(_map_task(structure, each, i) for i, each in enumerate(study.maps)),
        height=structure.elevation,
    )


def _set_task(structure: Structure, wanted: SetSection) -> SetTask:
    with at_key("set.box"):
        box = Box(**{name: (bounds[0], bounds[1]) for name, bounds in wanted.box.items()})
        for name, corner in zip(box.names * 2, [*box.lower, *box.upper], strict=True):
            _check_value(structure, name, corner)
    _check_fixed(structure, box, wanted.fixed)
    constraints = _bounds(structure, wanted.within)
    return SetTask(box, wanted.fixed, constraints, _intervals(wanted))


def build_structure(section: StructureSection) -> Structure:
    """Structure that a section describes; what it leaves out takes the structure's default."""
    return from_identity(section.model_dump(exclude_none=True))


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


def _check_value(structure: Structure, name: str, value: float) -> None:
    """Refuse a value without meaning, and angles that must be degrees."""
    parameter = structure.parameters[position(structure.parameters, name)]
    parameter.check(value)
    if parameter.unit == "rad" and abs(value) > LARGEST_ANGLE:
        raise InputError(
            f"`{name}` must be an angle in radians, within ±{LARGEST_ANGLE:g}; got {value:g}. "
            f"If these are degrees, write {np.deg2rad(value):.4g}."
        )


def _check_fixed(structure: Structure, box: Box, fixed: Mapping[str, float]) -> None:
    both = sorted(set(box.names) & set(fixed))
    if both:
        raise InputError(f"`set.fixed` must not name what `set.box` frees; got {', '.join(both)}.")
    with at_key("set.fixed"):
        for name, value in fixed.items():
            _check_value(structure, name, value)
        middle = dict(zip(box.names, 0.5 * (box.lower + box.upper), strict=True))
        vector = parameter_vector(structure.parameters, {**middle, **fixed})
    assert np.isfinite(vector).all()


def _intervals(wanted: SetSection) -> tuple[int, int]:
    """Intervals of the grid; what a study leaves out takes the library's default."""
    first, second = wanted.intervals or INTERVALS[len(wanted.box)]
    return first, second


def _bounds(structure: Structure, texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Constraints of the set; a rod has equilibria of any curvature, so that it needs a bound."""
    constraints = _constraints(structure, texts, "set.within")
    bounded = {each.descriptor.name for each in constraints if each.sense == "<="}
    if structure.kind == "rod" and "max_curvature" not in bounded:
        raise InputError(
            "`set.within` must bound the curvature of a rod, which has equilibria without end; "
            f'got {", ".join(texts) or "nothing"}. Add "max_curvature <= 20".'
        )
    return constraints


def _constraints(structure: Structure, texts: Sequence[str], key: str) -> tuple[Constraint, ...]:
    constraints = []
    for i, text in enumerate(texts):
        with at_key(f"{key}[{i}]"):
            constraints.append(parse_comparison(text).on(structure))
    return tuple(constraints)


def _task(structure: Structure, box: Box, route: RouteSection, number: int) -> Task:
    key = f"route[{number}]"
    for end, section in (("start", route.start), ("goal", route.goal)):
        check_point(box, section.at, f"{key}.{end}.at")
        _check_choice(structure, section, f"{key}.{end}")
    for i, corner in enumerate(route.via or ()):
        check_point(box, corner, f"{key}.via[{i}]", whole=False)
    return Task(key, route, _constraints(structure, route.within, f"{key}.within"))


def _map_task(structure: Structure, section: MapSection, number: int) -> MapTask:
    key = f"map[{number}]"
    with at_key(key):
        for name, bounds in section.box.items():
            for corner in bounds:
                _check_value(structure, name, corner)
        sides = zip(section.box.items(), section.intervals, strict=True)
        grid = Grid(**{name: (*bounds, count) for (name, bounds), count in sides})
        base = unloaded_base(structure, grid, section.load, section.fixed)
        low = base[position(structure.parameters, section.load)]
        if not low < section.bound:
            raise InputError(f"`bound` must exceed {section.load} = {low:g}; got {section.bound}.")
        if section.at is not None and not low < section.at < section.bound:
            raise InputError(
                f"`at` must lie between {section.load} = {low:g} and `bound` = "
                f"{section.bound:g}; got {section.at:g}."
            )
        shown = "max_curvature" if section.descriptor is None else section.descriptor
        descriptor = structure.descriptor(shown) if section.at is not None else None
    constraints = _constraints(structure, section.within, f"{key}.within")
    return MapTask(key, section, grid, constraints, descriptor)


def _check_choice(structure: Structure, section: StateSection, key: str) -> None:
    choices = (section.highest, section.lowest, *(section.near or ()))
    for text in choices:
        if text is not None:
            with at_key(key):
                structure.descriptor(text)

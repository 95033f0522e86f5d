"""Parameters, descriptors, points and rules of a study, looked up; the key of what fails."""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import model_validator

from equimorph import charts
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria import worst_named
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, SetBarriers, barriers
from equimorph.model import Box, Constraint, Descriptor, position
from equimorph.structures import Structure
from equimorph.study.fields import Positive, Section, parse_comparison, requirement

BARRIER = "barrier"
"""Name of the descriptor of energy barriers over the set."""
LARGEST_ANGLE = 20.0
"""Radians; ends turned further against each other need curvatures above 40 everywhere."""


@dataclass(frozen=True)
class Extent:
    """A part of parameter space with a grid, as objects: of the set, or of a map."""

    box: Box
    fixed: Mapping[str, float]
    constraints: tuple[Constraint, ...]
    intervals: tuple[int, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    """Whatever else the computation of a set takes."""


@dataclass(frozen=True)
class Ground:
    """What all questions of a study share."""

    structure: Structure
    extent: Extent | None
    """Of the set, if the study has one."""
    eset: EquilibriumSet | None = None
    """The set, as soon as it is there."""

    @property
    def height(self) -> Descriptor:
        """Descriptor that figures use as the height of the surface."""
        return self.structure.elevation

    @property
    def box(self) -> Box:
        """Box of the set, which there is where a question needs it."""
        assert self.extent is not None
        return self.extent.box

    @cached_property
    def field(self) -> SetBarriers:
        """Energy barriers over the set, computed when they are first asked for."""
        assert self.eset is not None
        return barriers(self.eset)

    @cached_property
    def descriptors(self) -> Mapping[str, Descriptor]:
        """What the set tells of its states, by name."""
        if self.extent is None:
            return {}
        unit = self.structure.descriptor("energy").unit
        return {BARRIER: Descriptor(BARRIER, unit, self._barrier, "ΔE", self.structure.signature)}

    def _barrier(self, z: Lanes, p: Parameters) -> Values:
        return self.field.descriptor.function(z, p)


@dataclass(frozen=True)
class Later:
    """What becomes an argument of a task only when the set is there."""

    on: Callable[[Ground], Any]


@contextmanager
def at_key(key: str) -> Generator[None]:
    """Put the key of the study file before the message of an `InputError`."""
    try:
        yield
    except InputError as error:
        raise InputError(f"in `{key}`: {error}") from error


def check_point(box: Box, point: Mapping[str, float], key: str, *, whole: bool = True) -> None:
    """Refuse a point that names other parameters than the study's box, or lies outside it.

    `whole`: whether all parameters of the box must be named; `key` is that of the study file.
    """
    names = ", ".join(box.names)
    if not set(point) <= set(box.names) or (whole and len(point) < len(box.names)):
        need = (
            f"name the free parameters {names}" if whole else f"name only free parameters ({names})"
        )
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


def check_values(structure: Structure, values: Mapping[str, float], key: str) -> None:
    """Refuse names that are no parameters, and values without meaning; `key` for the message."""
    with at_key(key):
        for name, value in values.items():
            check_value(structure, name, value)


def check_parameters(structure: Structure, names: Iterable[str], key: str) -> None:
    """Refuse names that are no parameters; `key` for the message."""
    for name in names:
        with at_key(key):
            position(structure.parameters, name)


def constraints_of(ground: Ground, texts: Sequence[str], key: str) -> tuple[Constraint, ...]:
    """Look up comparisons; `InputError` names the key of one that means nothing."""
    constraints = []
    for i, text in enumerate(texts):
        with at_key(f"{key}[{i}]"):
            constraints.append(parse_comparison(text).on(ground.structure, ground.descriptors))
    return tuple(constraints)


def descriptor_at(ground: Ground, text: str, key: str) -> Descriptor:
    """Look up a descriptor; `InputError` names the key if it means nothing."""
    with at_key(key):
        return worst_named(ground.structure, text, ground.descriptors)


def descriptors_of(
    ground: Ground, values: Mapping[str, float], key: str
) -> dict[Descriptor, float]:
    """Look up the descriptors of values."""
    return {descriptor_at(ground, text, key): value for text, value in values.items()}


class RuleSection(Section):
    """Which of the states over a point is preferred; see `equimorph.reduce`."""

    highest: str | None = None
    lowest: str | None = None
    quasi_static: str | None = None
    first_stable_on_path: str | None = None
    bound: Positive | None = None

    @model_validator(mode="after")
    def _one_rule(self) -> "RuleSection":
        rules = (self.highest, self.lowest, self.quasi_static, self.first_stable_on_path)
        if sum(rule is not None for rule in rules) != 1:
            raise requirement("give one of highest, lowest, quasi_static, first_stable_on_path")
        if self.bound is not None and self.first_stable_on_path is None:
            raise requirement("give a bound of the load to first_stable_on_path only")
        return self


def rule_of(ground: Ground, section: RuleSection, key: str) -> charts.Rule:
    """Rule that a section describes."""
    if section.highest is not None:
        return charts.highest(descriptor_at(ground, section.highest, f"{key}.highest"))
    if section.lowest is not None:
        return charts.lowest(descriptor_at(ground, section.lowest, f"{key}.lowest"))
    if section.quasi_static is not None:
        check_parameters(ground.structure, [section.quasi_static], f"{key}.quasi_static")
        return charts.quasi_static(section.quasi_static)
    load = section.first_stable_on_path or ""
    check_parameters(ground.structure, [load], f"{key}.first_stable_on_path")
    bound = {} if section.bound is None else {"bound": section.bound}
    return charts.first_stable_on_path(load, **bound)

"""What part of an equilibrium set a study speaks of: its section, from the signature of the set."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, create_model, model_validator

from equimorph.errors import InputError
from equimorph.manifold import INTERVALS, equilibrium_set
from equimorph.model import Box, Constraint, parameter_vector
from equimorph.structures import Structure
from equimorph.study.complaint import Findings
from equimorph.study.fields import ComparisonText, Count, Interval, Point, Section, requirement
from equimorph.study.lookup import Extent, Ground, at_key, check_value, constraints_of
from equimorph.study.signatures import arguments_of

WRITTEN = ("box", "fixed", "within", "intervals")
"""Arguments of sets with hand-written keys below; the remaining ones are options, by type."""
OPTIONS = arguments_of(equilibrium_set, left_out=WRITTEN)


def _one_to_three(table: dict[str, Any]) -> dict[str, Any]:
    if not 1 <= len(table) <= 3:
        raise requirement("span one, two or three free parameters")
    return table


class _Extent(Section):
    """The part of the equilibrium set to compute."""

    box: Annotated[dict[str, Interval], AfterValidator(_one_to_three)]
    fixed: Point = Field(default_factory=dict)
    within: list[ComparisonText] = Field(default_factory=list)
    intervals: list[Count] | None = None

    @model_validator(mode="after")
    def _one_each(self) -> "_Extent":
        for key in ("intervals", "tiles"):
            numbers = getattr(self, key)
            if numbers is not None and len(numbers) != len(self.box):
                raise requirement(f"give one number of {key} for each parameter of its box")
        return self


_options: dict[str, Any] = {key: each for one in OPTIONS for key, each in one.keys().items()}
SetSection: type[Any] = create_model("SetSection", __base__=_Extent, **_options)
"""Section on the set; see `equimorph.equilibrium_set`."""


class PointSection(Section):
    """A point of the parameter space whose equilibria are computed."""

    at: Point = Field(min_length=1)


def extent_of_set(structure: Structure, wanted: Any) -> Extent:
    """Look up the names of the section on the set."""
    findings, constraints = Findings(), tuple[Constraint, ...]()
    with at_key("set.box"):
        box = Box(**{name: (bounds[0], bounds[1]) for name, bounds in wanted.box.items()})
    for name, corner in zip(box.names * 2, [*box.lower, *box.upper], strict=True):
        with findings.collect(), at_key("set.box"):
            check_value(structure, name, corner)
    with findings.collect():
        _check_fixed(structure, box, wanted.fixed)
    with findings.collect():
        constraints = _bounds(structure, wanted.within)
    findings.refuse()
    options = {each.name: getattr(wanted, each.key) for each in OPTIONS}
    return Extent(box, wanted.fixed, constraints, _intervals(wanted), options)


def _check_fixed(structure: Structure, box: Box, fixed: Mapping[str, float]) -> None:
    both = sorted(set(box.names) & set(fixed))
    if both:
        raise InputError(
            f"`set.fixed` must not name free parameters of `set.box`; got {', '.join(both)}."
        )
    with at_key("set.fixed"):
        for name, value in fixed.items():
            check_value(structure, name, value)
        middle = dict(zip(box.names, 0.5 * (box.lower + box.upper), strict=True))
        vector = parameter_vector(structure.parameters, {**middle, **fixed})
    assert np.isfinite(vector).all()


def _intervals(wanted: Any) -> tuple[int, ...]:
    """Intervals of the grid; what a study leaves out takes the library's default."""
    return tuple(wanted.intervals or INTERVALS[len(wanted.box)])


def _bounds(structure: Structure, texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Constraints of the set; structures with equilibria without end need a bound."""
    constraints = constraints_of(Ground(structure, None), texts, "set.within")
    if missing := structure.missing_bound(constraints):
        told = ", ".join(texts) or "nothing"
        raise InputError(
            f"`set.within` must bound the {missing.split()[0]} of this structure, which has "
            f'equilibria without end; got {told}. Add "{missing}".'
        )
    return constraints

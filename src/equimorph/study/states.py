"""States of a study: chosen on the set, or lifted from a natural state."""

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from equimorph.arrays import Values
from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.model import names_of, parameter_vector
from equimorph.structures import State, States
from equimorph.study.fields import Point, Section, Step, one, requirement
from equimorph.study.lookup import Ground, at_key, check_point, check_values, descriptor_at

AGREEMENT = 1e-3
"""A descriptor given with `near` agrees when it is this close: values are copied from a report."""


class StateSection(Section):
    """One stable equilibrium over a point, chosen by a descriptor where there are several."""

    at: Point = Field(min_length=1)
    highest: str | None = None
    lowest: str | None = None
    near: Annotated[Point, AfterValidator(one)] | None = None

    @model_validator(mode="after")
    def _one_choice(self) -> "StateSection":
        if sum(choice is not None for choice in (self.highest, self.lowest, self.near)) > 1:
            raise requirement("choose by one of highest, lowest, near")
        return self


class NaturalSection(Section):
    """A state without a set: the natural one at some parameters, and steps from there."""

    at: Point = Field(default_factory=dict)
    steps: list[Step] = Field(default_factory=list)


def check_state(ground: Ground, section: StateSection, key: str) -> None:
    """Refuse a point outside the box, and descriptors to choose by that do not exist."""
    check_point(ground.box, section.at, f"{key}.at")
    for text in (section.highest, section.lowest, *(section.near or ())):
        if text is not None:
            descriptor_at(ground, text, key)


def check_natural(ground: Ground, given: NaturalSection, key: str) -> None:
    """Refuse loads where natural states are, and values without meaning."""
    structure = ground.structure
    check_values(structure, given.at, f"{key}.at")
    loaded = [name for name in structure.unloaded() if given.at.get(name, 0.0) != 0.0]
    if loaded:
        raise InputError(
            f"`{key}.at` must have no loads: that is where natural states are; got {loaded[0]} = "
            f"{given.at[loaded[0]]:g}. Put loads into `{key}.steps`."
        )
    for i, step in enumerate(given.steps):
        check_values(structure, step, f"{key}.steps[{i}]")
    with at_key(f"{key}.at"):
        parameter_vector(structure.parameters, {**given.at, **structure.unloaded()})


def choose_state(ground: Ground, section: StateSection, key: str) -> State:
    """Return the stable equilibrium that a section of a study describes.

    Refused if no state is stable there, the choice is ambiguous, or `near` meets no equilibrium.
    """
    assert ground.eset is not None
    here = ground.eset.at(**section.at)
    stable = here.stable
    if not len(stable):
        raise InputError(
            f"`{key}.at` must have a stable equilibrium; got {len(here)} equilibria, none stable, "
            f"at {_point(section.at)}."
        )
    if section.near is not None:
        return _nearest(ground, here, section.near, key)
    if section.highest is not None:
        values = descriptor_at(ground, section.highest, key)(stable)
        return stable[int(np.argmax(values))]
    if section.lowest is not None:
        values = descriptor_at(ground, section.lowest, key)(stable)
        return stable[int(np.argmin(values))]
    if len(stable) > 1:
        raise InputError(
            f"`{key}` must choose by highest, lowest or near; got {len(stable)} stable equilibria "
            f"at {_point(section.at)}."
        )
    return stable[0]


def _nearest(ground: Ground, here: States, near: dict[str, float], key: str) -> State:
    ((text, wanted),) = near.items()
    values: Values = descriptor_at(ground, text, key)(here)
    best = int(np.argmin(np.abs(values - wanted)))
    state = here[best]
    if abs(values[best] - wanted) > AGREEMENT:
        found = ", ".join(f"{value:.4g}" for value in np.sort(values[here.index == 0]))
        raise InputError(
            f"`{key}.near` must be an equilibrium within {AGREEMENT:g}; got {text} = {wanted:g}, "
            f"but stable ones have {found}."
        )
    if not state.stable:
        raise InputError(
            f"`{key}.near` must be a stable equilibrium; got {text} = {wanted:g}, "
            f"which has index {state.index}."
        )
    return state


def _point(point: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in point.items())


def lift_state(ground: Ground, given: NaturalSection, key: str) -> State:
    """Return the natural state of a section, lifted along its steps."""
    structure = ground.structure
    values = {**given.at, **structure.unloaded()}
    p = parameter_vector(structure.parameters, values)
    z, found = structure.natural(p[None])
    names = names_of(structure.parameters)
    if not found[0]:
        at = ", ".join(f"{name} = {value:g}" for name, value in zip(names, p, strict=True))
        raise InputError(f"`{key}.at` must have a natural state; none is found at {at}.")
    state = State(structure, z[0], p)
    if not given.steps:
        return state
    path = lift(state, [dict(step) for step in given.steps])
    if not path.arrived:
        raise InputError(
            f"`{key}.steps` must be steps that the structure can make; got a {path.end.kind} in "
            f"step {min(int(path.end.at) + 1, len(given.steps))}."
        )
    return path.end.state

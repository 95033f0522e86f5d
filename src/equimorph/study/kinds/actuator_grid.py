"""What kinds have in common that look at every setting of two actuators."""

from typing import Any

from equimorph.errors import InputError
from equimorph.model import Constraint, Grid, Progress, position
from equimorph.structures import Structure
from equimorph.study.lookup import at_key, check_value
from equimorph.study.sections.maps import ActuatorGridSection
from equimorph.tasks import unloaded_base


def grid_of(structure: Structure, section: ActuatorGridSection, key: str) -> Grid:
    """Look up actuators and load.

    Raises
    ------
    InputError
        For parameters that the structure does not have, or values without meaning.
    """
    with at_key(key):
        for name, bounds in section.box.items():
            for corner in bounds:
                check_value(structure, name, corner)
        sides = zip(section.box.items(), section.intervals, strict=True)
        grid = Grid(**{name: (*bounds, count) for (name, bounds), count in sides})
        low = unloaded_load(structure, section, grid)
        if not low < section.bound:
            raise InputError(f"`bound` must exceed {section.load} = {low:g}; got {section.bound}.")
    return grid


def unloaded_load(structure: Structure, section: ActuatorGridSection, grid: Grid) -> float:
    """Value of the load in the natural states."""
    base = unloaded_base(structure, grid, section.load, section.fixed)
    return float(base[position(structure.parameters, section.load)])


def common_of(
    section: ActuatorGridSection, constraints: tuple[Constraint, ...], sink: Progress
) -> dict[str, Any]:
    """Arguments that all maps take by name."""
    return {
        "within": constraints,
        "fixed": section.fixed,
        "bound": section.bound,
        "progress": sink,
    }

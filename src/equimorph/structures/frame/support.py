"""Supports of a frame's joints: what is held, what is sprung."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.errors import InputError
from equimorph.structures.unit_system import UnitSystem

AXES = ("x", "y", "angle")
WORDS = {"fixed": AXES, "pinned": ("x", "y")}
HELD = "held"
SPRINGS = {"x": "force/length", "y": "force/length", "angle": "force·length"}
"""What the stiffnesses of springs measure."""


def stiffnesses(joint: str, given: Any, system: UnitSystem) -> Float[np.ndarray, "3"]:
    """Stiffness of a support against moves in x, in y and against turning; ∞ where it holds.

    Parameters
    ----------
    joint
        Name of the joint, for messages.
    given
        "fixed", "pinned", the axes that a roller holds ("x", "y", "xy"), or a table from axes
        ("x", "y", "angle") to "held" or a spring's stiffness.
    system
        Units of the stiffnesses.
    """
    table = given
    if isinstance(given, str):
        axes = WORDS.get(given, tuple(given))
        table = dict.fromkeys(axes, HELD)
        if len(table) < len(axes):
            table = {}
    if not isinstance(table, Mapping) or not table or not set(table) <= set(AXES):
        raise InputError(
            f"`supports.{joint}` must be fixed, pinned, axes to hold (x, y or xy), or a table of "
            f"x, y, angle; got {given!r}."
        )
    values = np.zeros(3)
    for axis, value in table.items():
        what = f"supports.{joint}.{axis}"
        stiff = np.inf if value == HELD else system.number(value, SPRINGS[axis], what)
        spring = isinstance(stiff, int | float) and 0.0 < stiff < np.inf
        if value != HELD and not spring:
            raise InputError(f"`{what}` must be held or a positive stiffness; got {value!r}.")
        values[AXES.index(axis)] = stiff
    return values


def support_data(values: Float[np.ndarray, "3"]) -> dict[str, Any]:
    """Return the table from which the stiffnesses come."""
    pairs = zip(AXES, values.tolist(), strict=True)
    return {axis: HELD if np.isinf(value) else value for axis, value in pairs if value > 0.0}

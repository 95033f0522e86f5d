"""Supports of the joints of a frame in space, as their user describes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from equimorph.argument_kinds import one_of
from equimorph.argument_notes import SPACE_DIRECTION, positive_quantity
from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.structures.unit_system import UnitSystem

AXES = ("x", "y", "z")
HELD, FREE = "held", "free"
WORDS: dict[str, dict[str, Any]] = {
    "fixed": {**dict.fromkeys(AXES, HELD), "rotation": HELD},
    "pinned": dict.fromkeys(AXES, HELD),
}
KEYS = (*AXES, "plane", "line", "rotation")

SpatialSupportSpec = (
    str
    | Annotated[
        Mapping[
            Annotated[str, one_of(*KEYS)],
            Annotated[str, one_of(HELD)]
            | Annotated[float | str, positive_quantity]
            | Annotated[Sequence[float], SPACE_DIRECTION],
        ],
        "tables",
    ]
)


@dataclass(frozen=True, eq=False)
class SpatialSupport:
    """What holds a joint.

    Parameters
    ----------
    directions
        Orthonormal directions along which it holds the place.
    stiffness
        Of each of them; ∞ where it holds.
    rotation
        "free", "held", or the axis about which alone the joint turns.
    data
        What it is made from, as plain data.
    """

    directions: Float[np.ndarray, "held 3"]
    stiffness: Float[np.ndarray, " held"]
    rotation: str | tuple[float, float, float]
    data: Mapping[str, Any]

    @property
    def holds_rotation(self) -> bool:
        """Whether it holds the rotation, all of it or but for one axis."""
        return self.rotation != FREE

    def holds(self, direction: Float[np.ndarray, "3"]) -> bool:
        """Whether a move along a direction is held or sprung, and nothing across it."""
        rest = direction - self.directions.T @ (self.directions @ direction)
        return bool(np.linalg.norm(rest) < 1e-12)


NO_SUPPORT = SpatialSupport(np.zeros((0, 3)), np.zeros(0), FREE, {})


def spatial_support(joint: str, given: SpatialSupportSpec, system: UnitSystem) -> SpatialSupport:
    """Support from "fixed", "pinned", axes to hold ("x", "yz"), or a table.

    Raises
    ------
    InputError
        For words without meaning, or a table that holds nothing or says things twice.
    """
    table: Mapping[str, Any] = given if isinstance(given, Mapping) else _table_of_word(given)
    places = [key for key in table if key != "rotation"]
    mixed = len(places) > 1 and ("plane" in places or "line" in places)
    if not table or not set(table) <= set(KEYS) or mixed:
        raise InputError(
            f"`supports.{joint}` must be fixed, pinned, axes to hold (x, yz, xyz), or a table of "
            "rotation and either x, y, z, or plane (its normal), or line (its direction); got "
            f"{given!r}."
        )
    directions, stiffness = np.zeros((0, 3)), []
    data: dict[str, Any] = {}
    for key in places:
        value, what = table[key], f"supports.{joint}.{key}"
        if key in AXES:
            stiff = np.inf if value == HELD else system.number(value, "force/length", what)
            if not isinstance(stiff, int | float):
                raise InputError(
                    f"`{what}` must be 'held' or the stiffness of a spring; got {value!r}."
                )
            directions = np.concatenate([directions, np.eye(3)[[AXES.index(key)]]])
            stiffness.append(float(stiff))
            data[key] = HELD if value == HELD else float(stiff)
            continue
        unit = _unit(value, what)
        data[key] = [float(x) for x in value]
        held = unit[None] if key == "plane" else _across(unit)
        directions = np.concatenate([directions, held])
        stiffness += [np.inf] * len(held)
    rotation = _rotation(table.get("rotation", FREE), f"supports.{joint}.rotation")
    if rotation != FREE:
        data["rotation"] = rotation if isinstance(rotation, str) else list(table["rotation"])
    return SpatialSupport(directions, np.array(stiffness), rotation, data)


def _table_of_word(given: str) -> Mapping[str, Any]:
    if given in WORDS:
        return WORDS[given]
    fine = set(given) <= set(AXES) and len(set(given)) == len(given)
    return dict.fromkeys(given, HELD) if fine else {}


def _unit(value: Any, what: str) -> Float[np.ndarray, "3"]:
    if isinstance(value, str | int | float):
        raise InputError(f"`{what}` must be a direction (x, y, z); got {value!r}.")
    found = np.array(value, dtype=float)
    return np.asarray(found / np.linalg.norm(found))


def _across(unit: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2 3"]:
    """Two orthonormal directions across a line."""
    first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(unit, first)])


def _rotation(value: Any, what: str) -> str | tuple[float, float, float]:
    if value in (HELD, FREE):
        return str(value)
    x, y, z = _unit(value, what).tolist()
    return x, y, z

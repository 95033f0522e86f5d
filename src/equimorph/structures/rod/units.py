"""Units of rods: numbers of the user to and from the non-dimensional ones inside."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from equimorph.errors import InputError
from equimorph.model.units import STANDARD_GRAVITY
from equimorph.structures.unit_system import UnitSystem, kilograms

FOUR_PI_SQUARED = 4.0 * np.pi**2
SI = UnitSystem("N", "m")
LABELS = {
    "length": ("L", "length"),
    "force": ("4π²B/L²", "force"),
    "line": ("4π²B/L²", "force/length"),
    "tension": ("4π²B/L²", "force"),
    "couple": ("4π²B/L", "force·length"),
    "curvature": ("1/L", "1/length"),
    "angle": ("rad", "rad"),
    "spring": ("4π²B/L³", "force/length"),
}
"""Labels without units, and quantities as `UnitSystem` writes them."""


PLAIN_EFFORTS = {
    "rad": "4π²B/L",
    "L": "4π²B/L²",
    "4π²B/L²": "L",
    "4π²B/L": "rad",
    "1/L": "4π²B",
}
"""Units of efforts by those of parameters, without EI and length."""


@dataclass(frozen=True)
class Units:
    """Non-dimensional numbers times `value(quantity)` are the user's.

    Inside, lengths are measured by L, forces by 4π²B/L², moments and energies by 4π²B/L. Without
    bending stiffness and length the user's numbers are those; with them they are in the units of
    `system`.
    """

    bending_stiffness: float | None = None
    """B = EI."""
    length: float | None = None
    """L."""
    system: UnitSystem = field(default_factory=UnitSystem)
    """Units of the user's numbers; SI if none are named."""
    mass: float | None = None
    """Of the whole rod, in kilograms, if it is given."""
    weight: float | None = None
    """Of a section, in units of force per length, if it is known; mass and weight exclude each
    other."""

    def __post_init__(self) -> None:
        """Check that both or none are given, and positive."""
        given = {"EI": self.bending_stiffness, "length": self.length}
        if all(value is None for value in given.values()):
            return
        for name, value in given.items():
            if value is None:
                other = next(key for key in given if key != name)
                raise InputError(
                    f"`{name}` must be given together with `{other}`; got {other} alone."
                )

    @property
    def plain(self) -> bool:
        """Whether numbers are non-dimensional."""
        return self.length is None

    @property
    def time_label(self) -> str:
        """Unit of time."""
        return "T" if self.plain else "s"

    def time(self) -> float | None:
        """T = √(mL³/(4π²B)) in `time_label`: 1 in units of itself; None if the mass is unknown."""
        if self.length is None or self.bending_stiffness is None:
            return 1.0
        long, force = self._labelled.si("length"), self._labelled.si("force")
        mass = self.mass
        if mass is None and self.weight is not None:
            mass = self.weight * self.length * force / STANDARD_GRAVITY
        if mass is None:
            return None
        return float(np.sqrt(mass * self.length * long / (self.value("force") * force)))

    def value(self, quantity: str) -> float:
        """Value of one non-dimensional unit of a quantity named in `LABELS`."""
        if self.length is None or self.bending_stiffness is None:
            return 1.0
        length = float(self.length)
        force = FOUR_PI_SQUARED * float(self.bending_stiffness) / length**2
        return {
            "length": length,
            "force": force,
            "line": force / length,
            "tension": force,
            "couple": force * length,
            "curvature": 1.0 / length,
            "angle": 1.0,
            "spring": force / length,
        }[quantity]

    def label(self, quantity: str) -> str:
        """Its unit."""
        plain, words = LABELS[quantity]
        return plain if self.plain else self._labelled.label(words)

    def conjugate(self, unit: str) -> str | None:
        """Unit of what does work on a parameter with a unit; None if it is not known."""
        if self.plain:
            return PLAIN_EFFORTS.get(unit)
        return self._labelled.conjugate(unit)

    def number(self, given: Any, quantity: str, what: str) -> Any:
        """Number of a quantity that may be a text with units; see `UnitSystem.number`."""
        system = self.system if self.plain else self._labelled
        return system.number(given, quantity, what)

    @property
    def _labelled(self) -> UnitSystem:
        return SI if self.system.plain else self.system

    @property
    def energy_label(self) -> str:
        """Unit of energy."""
        if self.plain:
            return LABELS["couple"][0]
        return "J" if self._labelled == SI else self._labelled.label("force·length")

    def data(self) -> dict[str, Any]:
        """What a rod is given of it; empty if plain."""
        if self.plain:
            return {}
        given = {"EI": self.bending_stiffness, "length": self.length}
        if self.mass is not None:
            given["mass"] = self.mass
        return given if self.system.plain else {**given, "units": self.system.data()}


def rod_units(
    EI: Any, length: Any, system: UnitSystem, mass: Any = None, weight: float | None = None
) -> Units:
    """Units of a rod from its bending stiffness, length and mass, which may be texts with units.

    `weight` is that of its section, if it has one of known density. Refused if one of them is
    missing or not positive, units or a mass are named without them, or a mass beside a section that
    gives it.
    """
    if EI is None and length is None and not system.plain:
        raise InputError(
            f"`units` must come with EI and length; got {system.data()} alone. Without these two a "
            "rod is non-dimensional."
        )
    if mass is not None and (EI is None or length is None):
        raise InputError(
            f"`mass` must come with EI and length; got {mass!r} alone. Without these two a rod is "
            "non-dimensional, and its mass is the unit."
        )
    if mass is not None and weight is not None:
        raise InputError(
            f"`mass` must be left out for a rod whose section gives it; got {mass!r}. Leave it "
            "out, or the density of the section."
        )
    own = SI if system.plain else system
    stiff, long = own.number(EI, "force·length²", "EI"), own.number(length, "length", "length")
    return Units(stiff, long, system, None if mass is None else kilograms(mass, "mass"), weight)

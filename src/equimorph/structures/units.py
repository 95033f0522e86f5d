"""Units of bending structures: numbers of the user to and from the non-dimensional ones inside."""

from dataclasses import dataclass

import numpy as np

from equimorph.errors import InputError

FOUR_PI_SQUARED = 4.0 * np.pi**2
LABELS = {
    "length": ("L", "m"),
    "force": ("4π²B/L²", "N"),
    "line": ("4π²B/L²", "N/m"),
    "tension": ("4π²B/L²", "N"),
    "couple": ("4π²B/L", "N m"),
    "curvature": ("1/L", "1/m"),
    "angle": ("rad", "rad"),
    "spring": ("4π²B/L³", "N/m"),
}


@dataclass(frozen=True)
class Units:
    """Non-dimensional numbers times `value(quantity)` are the user's.

    Inside, lengths are measured by L, forces by 4π²B/L², moments and energies by 4π²B/L. Without
    bending stiffness and length the user's numbers are those; with them they are in any consistent
    units, labelled as SI.

    Parameters
    ----------
    bending_stiffness
        B = EI in N m².
    length
        L in m.
    """

    bending_stiffness: float | None = None
    length: float | None = None

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
            number = float(value) if isinstance(value, int | float) else np.nan
            if not 0.0 < number < np.inf:
                raise InputError(f"`{name}` must be a positive number; got {value!r}.")

    @property
    def plain(self) -> bool:
        """Whether numbers are non-dimensional."""
        return self.length is None

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
        return LABELS[quantity][0 if self.plain else 1]

    @property
    def energy_label(self) -> str:
        """Unit of energy."""
        return "4π²B/L" if self.plain else "J"

"""One bar of a truss."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from equimorph.errors import InputError
from equimorph.structures.unit_system import Quantity, UnitSystem, check_positive

QUANTITIES = {"EA": "force", "EI": "force·length²", "rest": "length"}
"""What each number of a bar measures."""


@dataclass(frozen=True)
class Bar:
    """A straight bar between two joints, which it does not bend.

    Numbers are in the units of the truss; texts like "12 kN" are converted to these.

    Parameters
    ----------
    ends
        Names of its two joints.
    EA
        Axial stiffness, in units of force; positive.
    EI
        Bending stiffness, for the Euler load of the bar; None if its buckling is of no interest.
    rest
        Length at which it is free of stress; None for the distance of its joints.
    """

    ends: Sequence[str]
    EA: Quantity = 1.0
    EI: Quantity | None = None
    rest: Quantity | None = None

    def __post_init__(self) -> None:
        """Check ends and numbers."""
        two = not isinstance(self.ends, str) and len(self.ends) == 2
        if not (two and all(isinstance(end, str) for end in self.ends)):
            raise InputError(f"`ends` of a bar must be the names of two joints; got {self.ends!r}.")
        if self.ends[0] == self.ends[1]:
            raise InputError(f"`ends` of a bar must differ; got {self.ends[0]} twice.")
        for name in QUANTITIES:
            value = getattr(self, name)
            if value is not None or name == "EA":
                check_positive(value, name, f" of bar {self.name}")

    @property
    def name(self) -> str:
        """Its joints, joined: A-B."""
        return "-".join(self.ends)

    def measured(self, system: UnitSystem) -> "Bar":
        """The same bar with its numbers in a system of units."""
        return system.measured(self, QUANTITIES, f"bar {self.name}")

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        given = {key: value for key, value in asdict(self).items() if value is not None}
        return {**given, "ends": list(self.ends)}


def bar_of(given: Any) -> Bar:
    """Bar from a `Bar`, its data, or the names of its ends."""
    if isinstance(given, Bar):
        return given
    data = given if isinstance(given, Mapping) else {"ends": given}
    try:
        return Bar(**data)
    except TypeError:
        raise InputError(
            f"`bars` must hold Bars (ends, EA, EI, rest) or pairs of joints; got {given!r}."
        ) from None

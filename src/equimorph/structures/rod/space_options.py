"""What a rod is told about its stiffnesses out of the plane, and what follows from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from equimorph.errors import InputError
from equimorph.structures.rod.lateral import LateralStiffness
from equimorph.structures.rod.sections import CrossSection, SectionProperties, cross_section
from equimorph.structures.rod.units import Units, rod_units
from equimorph.structures.unit_system import UnitSystem


@dataclass(frozen=True, eq=False)
class SpaceOptions:
    """Stiffnesses out of the plane as the user gives them; see `Rod`."""

    torsion: Any
    lateral: Any
    section: CrossSection | None

    @classmethod
    def read(
        cls, torsion: Any, lateral: Any, section: CrossSection | Mapping[str, Any] | None
    ) -> "SpaceOptions":
        """Options with a section or its data."""
        return cls(torsion, lateral, None if section is None else cross_section(section))

    def check(self, EI: Any, length: Any) -> "SpaceOptions":
        """The same, if it is complete and says nothing twice.

        Refused are one stiffness without the other, a section without length, or beside what it
        gives.
        """
        given = {"EI": EI, "torsion": self.torsion, "lateral": self.lateral}
        if self.section is not None:
            for name, value in given.items():
                if value is not None:
                    raise InputError(
                        f"`{name}` must be left out for a rod with a section, which gives it; got "
                        f"{name} = {value!r}."
                    )
            if length is None:
                raise InputError("`length` must be given together with `section`; got none.")
        for name, other in (("torsion", "lateral"), ("lateral", "torsion")):
            if given[name] is None and given[other] is not None:
                raise InputError(
                    f"`{name}` must be given together with `{other}`; got {other} alone."
                )
        return self

    @property
    def quantities(self) -> dict[str, Any]:
        """Quantities of the section, by name."""
        return {} if self.section is None else self.section.quantities

    def units(self, EI: Any, length: Any, system: UnitSystem, mass: Any) -> Units:
        """Units of the rod, whose bending stiffness and weight are those of the section, if any."""
        if self.section is None:
            return rod_units(EI, length, system, mass)
        made = self.section.in_system(system)
        return rod_units(made.EI, length, system, mass, made.weight)

    def properties(self, units: Units) -> SectionProperties | None:
        """Those of the section, in the rod's units."""
        return None if self.section is None else self.section.in_system(units.system)

    def stiffness(self, units: Units, kinks: Sequence[float]) -> LateralStiffness | None:
        """Torsional and lateral stiffness relative to that in the plane; None if not given."""
        properties = self.properties(units)
        if properties is not None:
            return LateralStiffness(properties.torsion, properties.lateral)
        if self.torsion is None:
            return None
        return LateralStiffness(self.ratio("torsion", units), self.ratio("lateral", units), kinks)

    def ratio(self, name: str, units: Units) -> Any:
        """A stiffness with a unit, relative to EI; anything else is relative already."""
        given = getattr(self, name)
        if not isinstance(given, str):
            return given
        return units.number(given, "force·length²", name) / units.bending_stiffness

    def data(self) -> dict[str, Any]:
        """What the rod was given, as plain data."""
        if self.section is not None:
            return {"section": self.section.data()}
        out = {}
        for name in ("torsion", "lateral"):
            value = getattr(self, name)
            if callable(value):
                raise InputError(
                    f"`{name}` must be a number, a text or a table to be written to a file; got a "
                    "callable. Sample it into a table [[s, f], ...]."
                )
            if value is not None:
                out[name] = value.tolist() if isinstance(value, np.ndarray) else value
        return out

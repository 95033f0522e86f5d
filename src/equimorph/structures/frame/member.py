"""Members of frames, in the plane or in space: what stiffness they have by themselves."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from equimorph.errors import InputError
from equimorph.structures.network import Edge, arc_length
from equimorph.structures.rod.fibres import Fibres
from equimorph.structures.rod.sections import CrossSection, SectionProperties, cross_section
from equimorph.structures.rod.units import SI
from equimorph.structures.unit_system import Quantity, UnitSystem


@dataclass(frozen=True)
class Stiffness:
    """Numbers of a cross-section in the units of the frame.

    strain: in the plane against bending; in space against twist, bending about n and bending about
    b; EA None: inextensible; fibres: of a section whose size is known.
    """

    strain: tuple[float, ...]
    EA: float | None
    weight: float | None
    fibres: Fibres | None


class AnyMember(Edge, ABC):
    """A member with its section or its stiffnesses: a frozen dataclass."""

    edge: ClassVar[str] = "member"
    from_section: ClassVar[tuple[str, ...]]
    """Fields that a section gives."""
    section: CrossSection | Mapping[str, Any] | None
    EA: Quantity | None
    inextensible: bool
    weight: Quantity | None
    curvature: Quantity

    def check_section(self) -> None:
        """Refuse what a section gives, too."""
        twice = [key for key in self.from_section if getattr(self, key) is not None]
        if self.section is not None and twice:
            raise InputError(
                f"`{twice[0]}` of member {self.name} must be left out beside `section`, which "
                f"gives it; got {getattr(self, twice[0])!r}."
            )

    @abstractmethod
    def bending_and_twist(self, section: SectionProperties | None) -> tuple[float, ...]:
        """Stiffnesses of a section, or those given, in the order of `Stiffness.strain`."""

    def stiffness(self, system: UnitSystem) -> Stiffness:
        """Stiffnesses and weight in the units of the frame."""
        made, fibres, axial, weight = None, None, self.EA, self.weight
        if self.section is not None:
            shape = cross_section(self.section)
            made, fibres = shape.in_system(system), shape.fibres(SI if system.plain else system)
            axial, weight = made.EA, made.weight
        axial = None if self.inextensible or axial is None else float(axial)
        weight = None if weight is None else float(weight)
        return Stiffness(self.bending_and_twist(made), axial, weight, fibres)

    def arc_length(self, chord: float, stiff: Stiffness) -> float:
        """Length of an arc over a chord; InputError if no slender arc fits."""
        gyration = 0.0 if stiff.EA is None else float(np.sqrt(min(stiff.strain[-2:]) / stiff.EA))
        return arc_length(self, float(self.curvature), chord, gyration)

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        given = super().data()
        if self.section is not None:
            given["section"] = cross_section(self.section).data()
        return given

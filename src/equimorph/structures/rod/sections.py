"""Cross-sections of rods: stiffnesses and weight from a shape and a material."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import Range
from equimorph.errors import InputError, suggestion
from equimorph.structures.rod.fibres import Fibres, circle, rectangle, torsion_constant
from equimorph.structures.rod.units import SI
from equimorph.structures.unit_system import Quantity, Units, UnitSystem, unit_system


@check_arguments
@dataclass(frozen=True)
class SectionProperties:
    """What a rod needs of its cross-section, as numbers in one system of units.

    Parameters
    ----------
    EI
        Bending stiffness in the plane of the rod, force·length².
    EI_out
        Bending stiffness out of this plane, force·length².
    GJ
        Torsional stiffness, force·length².
    EA
        Axial stiffness, force; None if unknown.
    weight
        Force per length; None if unknown. It is the rod's own weight as a uniform load.
    """

    EI: float
    EI_out: float
    GJ: float
    EA: float | None = None
    weight: float | None = None

    @property
    def torsion(self) -> float:
        """GJ/EI."""
        return self.GJ / self.EI

    @property
    def lateral(self) -> float:
        """EI out of the plane over EI in it."""
        return self.EI_out / self.EI


class CrossSection(ABC):
    """A cross-section of a rod; its numbers are in the units of the rod, texts have their own."""

    word: ClassVar[str]

    @check_arguments
    def properties(self, units: Units | None = None) -> SectionProperties:
        """Stiffnesses and weight in a system of units like ``{"force": "N", "length": "mm"}``.

        Parameters
        ----------
        units
            The system of plain numbers, given and returned; SI by default.

        Raises
        ------
        InputError
            For units of other quantities.
        """
        return self.in_system(unit_system(units))

    def in_system(self, system: UnitSystem) -> SectionProperties:
        """`properties` in a system of units; SI if it names none."""
        system.check_all_have_units(self.quantities)
        return self._in(SI if system.plain else system)

    @property
    def quantities(self) -> dict[str, Any]:
        """Those whose plain numbers are in the units of the rod, by name."""
        names = [each.name for each in fields(self)]  # type: ignore[arg-type]  # as below
        return {name: getattr(self, name) for name in names if name not in ("nu", "density")}

    def fibres(self, system: UnitSystem) -> Fibres | None:
        """Fibres in the surface, in a system of units; None where the size is not known."""
        return None

    @abstractmethod
    def _in(self, system: UnitSystem) -> SectionProperties:
        """Stiffnesses and weight in a system of units."""

    def data(self) -> dict[str, Any]:
        """Return the section as plain data, without what was left out."""
        names = [each.name for each in fields(self)]  # type: ignore[arg-type]  # all are dataclasses
        given = {name: getattr(self, name) for name in names}
        return {"kind": self.word, **{name: x for name, x in given.items() if x is not None}}

    def _number(self, name: str, quantity: str, system: UnitSystem) -> Any:
        return system.number(getattr(self, name), quantity, f"{name} of the {self.word}")


PoissonRatio = Annotated[
    float,
    Range(-1.0, 0.5, "Poisson's ratio, above -1 and at most 0.5", "Poisson's ratios", above=True),
]


class _Shape(CrossSection):
    """A section of one isotropic material."""

    E: Quantity
    nu: PoissonRatio
    density: Quantity | None

    def fibres(self, system: UnitSystem) -> Fibres:
        """Fibres in the surface, in a system of units."""
        return self._surface(system, self._number("E", "force/length²", system))

    def _surface(self, system: UnitSystem, young: float) -> Fibres:
        """That of a circle."""
        diameter, axial = self._number("diameter", "length", system), self._in(system).EA
        assert axial is not None  # known of all shapes
        return circle(diameter, young, self.nu, axial)

    def _stiffnesses(
        self, area: float, second: tuple[float, float], torsion: float, system: UnitSystem
    ) -> SectionProperties:
        """Those of an area, its second moments in the plane and out of it, and J."""
        young, heavy = self._number("E", "force/length²", system), None
        if self.density is not None:
            dense = self.density if isinstance(self.density, str) else f"{self.density!r} kg/m^3"
            what = f"density of the {self.word}"
            heavy = area * system.number(dense, "force/length³", what)
        shear = young / (2.0 * (1.0 + self.nu))
        stiff = (young * second[0], young * second[1], shear * torsion, young * area)
        return SectionProperties(*stiff, heavy)

    def _annulus(self, diameter: float, hole: float, system: UnitSystem) -> SectionProperties:
        """Those of a circle with a circular hole."""
        second = np.pi / 64.0 * (diameter**4 - hole**4)
        area = np.pi / 4.0 * (diameter**2 - hole**2)
        return self._stiffnesses(area, (second, second), 2.0 * second, system)


@check_arguments
@dataclass(frozen=True)
class Strip(_Shape):
    """A rectangular strip that bends over its thickness: A = (width/thickness)².

    Parameters
    ----------
    width
        Across the plane of the rod.
    thickness
        In the plane.
    E
        Young's modulus, force/length².
    nu
        Poisson's ratio.
    density
        A number is in kg/m³; a text may also be a weight per volume.

    Raises
    ------
    InputError
        For dimensions, moduli or densities that are not positive, or ν outside (−1, 0.5].

    References
    ----------
    J: the series of [TimoshenkoGoodier1970]_, section 109.

    Examples
    --------
    >>> steel = Strip("20 mm", "0.5 mm", E="210 GPa", nu=0.3, density=7850)
    >>> mine = steel.properties({"force": "N", "length": "mm"})
    >>> round(mine.EI, 6), round(mine.lateral), round(mine.torsion, 6)
    (43750.0, 1600, 1.514221)
    """

    width: Quantity
    thickness: Quantity
    E: Quantity
    nu: PoissonRatio
    density: Quantity | None = None
    word: ClassVar[str] = "strip"

    def _in(self, system: UnitSystem) -> SectionProperties:
        w, t = (self._number(name, "length", system) for name in ("width", "thickness"))
        second = (w * t**3 / 12.0, t * w**3 / 12.0)
        return self._stiffnesses(w * t, second, torsion_constant(w, t), system)

    def _surface(self, system: UnitSystem, young: float) -> Fibres:
        w, t = (self._number(name, "length", system) for name in ("width", "thickness"))
        return rectangle(w, t, young, self.nu)


@check_arguments
@dataclass(frozen=True)
class Tube(_Shape):
    """A circular tube; arguments besides these as of `Strip`.

    Parameters
    ----------
    diameter
        Outside.
    wall
        Thickness of the wall, at most half the diameter.

    Raises
    ------
    InputError
        As of `Strip`, or for a wall thicker than half the diameter.

    Examples
    --------
    >>> round(Tube("10 mm", "1 mm", E="70 GPa", nu=0.3).properties().EI, 4)
    20.2868
    """

    diameter: Quantity
    wall: Quantity
    E: Quantity
    nu: PoissonRatio
    density: Quantity | None = None
    word: ClassVar[str] = "tube"

    def _in(self, system: UnitSystem) -> SectionProperties:
        d, wall = (self._number(name, "length", system) for name in ("diameter", "wall"))
        hole = d - 2.0 * wall
        if hole < 0.0:
            raise InputError(
                f"`wall` of the tube must be at most half its diameter, {self.diameter!r}; got "
                f"{self.wall!r}."
            )
        return self._annulus(d, hole, system)


@check_arguments
@dataclass(frozen=True)
class Round(_Shape):
    """A solid circular rod: A = 1, C = 1/(1 + ν); arguments besides `diameter` as of `Strip`.

    Examples
    --------
    >>> wire = Round("2 mm", E="70 GPa", nu=0.33, density=2700).properties()
    >>> round(wire.EI, 8), wire.lateral, round(wire.torsion, 6), round(wire.weight, 6)
    (0.05497787, 1.0, 0.75188, 0.083183)
    """

    diameter: Quantity
    E: Quantity
    nu: PoissonRatio
    density: Quantity | None = None
    word: ClassVar[str] = "round"

    def _in(self, system: UnitSystem) -> SectionProperties:
        return self._annulus(self._number("diameter", "length", system), 0.0, system)


@check_arguments
@dataclass(frozen=True)
class OwnSection(CrossSection):
    """A cross-section whose stiffnesses are known, from tests or another program.

    Parameters
    ----------
    EI, EI_out, GJ
        Stiffness against bending in the plane and out of it, and against twist: force·length².
    EA
        Axial stiffness: force.
    weight
        Force per length, or as a text mass per length.

    Examples
    --------
    >>> OwnSection("2 N m^2", "8 N m^2", GJ="1.5 N m^2").properties().lateral
    4.0
    """

    EI: Quantity
    EI_out: Quantity
    GJ: Quantity
    EA: Quantity | None = None
    weight: Quantity | None = None
    word: ClassVar[str] = "own section"

    def _in(self, system: UnitSystem) -> SectionProperties:
        stiff = [self._number(name, "force·length²", system) for name in ("EI", "EI_out", "GJ")]
        more = (("EA", "force"), ("weight", "force/length"))
        return SectionProperties(*stiff, *(self._number(*each, system) for each in more))


SECTIONS: dict[str, type[CrossSection]] = {
    kind.word: kind for kind in (Strip, Round, Tube, OwnSection)
}


def cross_section(given: Any) -> CrossSection:
    """Section of plain data, like ``{"kind": "round", "diameter": ...}``, or the section itself."""
    if isinstance(given, CrossSection):
        return given
    content = dict(given) if isinstance(given, Mapping) else {}
    kind = str(content.get("kind"))
    if kind not in SECTIONS:
        raise InputError(
            f"`section` must be a Strip, Round, Tube or OwnSection, or a table with the kind "
            f"{', '.join(map(repr, SECTIONS))}; got {content.get('kind', given)!r}."
            f"{suggestion(kind, list(SECTIONS))}"
        )
    del content["kind"]
    return SECTIONS[kind](**content)

"""Quantities with their units: what a user writes as "12 kN m^2" as numbers in one system.

They become numbers where they enter, with the right dimension; nothing further inside knows units.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any, TypeVar

from equimorph.argument_kinds import is_number, one_of
from equimorph.argument_notes import QUANTITY, quantity
from equimorph.errors import InputError
from equimorph.model.units import (
    COMPARED,
    FORCE,
    LENGTH,
    MASS,
    STANDARD_GRAVITY,
    UNITS,
    Unit,
    read_unit,
)

Quantity = Annotated[float | str, quantity]
"""A number in the units at hand, or a text with a unit, like "12 kN"."""
Units = Annotated[
    Mapping[Annotated[str, one_of("force", "length")], str],
    'names of units by what they measure, like `{"force": "N", "length": "mm"}`',
]
"""Units in which plain numbers are."""

_POWER = {2: "²", 3: "³"}
Part = TypeVar("Part")


@dataclass(frozen=True)
class UnitSystem:
    """The units of force and of length in which a structure's numbers are given and returned."""

    force: str | None = None
    length: str | None = None
    """Names in `UNITS`; None: numbers are in any one system, and texts are refused."""

    def __post_init__(self) -> None:
        """Check that both or none are given, and that they are what they should be."""
        if self.plain:
            return
        for name, dimension in (("force", FORCE), ("length", LENGTH)):
            given = getattr(self, name)
            fitting = [unit for unit, (_, of) in UNITS.items() if of == dimension]
            if given not in fitting:
                raise InputError(
                    f"`units.{name}` must be one of {', '.join(fitting)}; got {given!r}."
                )

    @property
    def plain(self) -> bool:
        """Whether no units are named."""
        return self.force is None and self.length is None

    @cached_property
    def _own(self) -> dict[str, Unit]:
        """The words force and length as units."""
        return {
            "force": UNITS[self.force or "N"],
            "length": UNITS[self.length or "m"],
            "1": UNITS["1"],
        }

    def si(self, quantity: str) -> float:
        """SI value of one unit of a quantity written in the words force and length; SI if plain."""
        return read_unit(quantity, self._own, quantity)[0]

    @property
    def time_unit(self) -> str:
        """Seconds, or any unit of time that goes with the others."""
        return "time" if self.plain else "s"

    def mass(self, given: Any, what: str) -> float:
        """Mass in units of force·time²/length; given in kilograms or as a text, or plain."""
        if not self.plain:
            return kilograms(given, what) * self.si("length") / self.si("force")
        return float(self.number(given, "force/length", what))

    def label(self, quantity: str) -> str:
        """Label of a quantity written in the words force and length: "force·length" is N m."""
        if self.plain:
            return quantity
        words = quantity.replace("·", " ")
        return words.replace("force", str(self.force)).replace("length", str(self.length))

    def number(self, given: Any, quantity: str, what: str) -> Any:
        """Number of a quantity in these units; what is no text is returned as it is.

        Parameters
        ----------
        given
            A number in these units, or a text with a unit.
        quantity
            What it measures, in the words force and length, like ``force·length²``. A force per
            length, area or volume may be given as a mass per such, which standard gravity makes
            heavy.
        what
            Its name, for messages.

        Raises
        ------
        InputError
            For a text without number, with unknown units, or with those of another quantity.

        Examples
        --------
        >>> UnitSystem("N", "mm").number("0.2 kN m^2", "force·length²", "EI")
        200000000.0
        """
        if not isinstance(given, str):
            return given
        found = QUANTITY.fullmatch(given)
        if found is None or not found.group(2).strip():
            raise InputError(f"`{what}` must be a number, with or without its unit; got {given!r}.")
        value, dimension = read_unit(found.group(2).strip(), UNITS, what)
        if self.plain:
            raise InputError(
                f"`units` must be given where a quantity has a unit; got {what} = {given!r}. "
                'Add units={"force": "N", "length": "m"}, say: plain numbers are in these.'
            )
        unit, wanted = read_unit(quantity, self._own, what)
        per = [read_unit(f"force/length{k}", self._own, what)[1] for k in ("", "2", "3")]
        if wanted in per and dimension == (1, wanted[1] - 1, 0):
            value, dimension = STANDARD_GRAVITY * value, wanted
        if dimension != wanted:
            raise InputError(
                f"`{what}` must be in units of {quantity}, like {self.label(quantity)}; got "
                f"{given!r}."
            )
        return float(found.group(1)) * value / unit

    def conjugate(self, unit: str) -> str:
        """Unit of what does work on a parameter: force·length over the parameter's own unit.

        Examples
        --------
        >>> UnitSystem("N", "mm").conjugate("rad"), UnitSystem("N", "mm").conjugate("N")
        ('N mm', 'mm')
        """
        _, (mass, length, _) = read_unit(unit or "1", COMPARED, "unit")
        powers = {"force": 1 - mass, "length": 1 - length + mass}
        words = [
            name if power == 1 else f"{name}{_POWER.get(power, f'^{power}')}"
            for name, power in powers.items()
            if power
        ]
        return self.label("·".join(words)) or "1"

    def check_all_have_units(self, given: Mapping[str, Any]) -> None:
        """Refuse plain numbers together with texts with units where no units are named for them.

        The first number other than zero without a unit is named; None where a quantity is not
        given.
        """
        texts = [name for name, each in given.items() if isinstance(each, str)]
        plain = [name for name, each in given.items() if is_number(each) and each != 0]
        if self.plain and texts and plain:
            beside, name = texts[0], plain[0]
            raise InputError(
                f"`{name}` must have a unit, as {beside} = {given[beside]!r} has one; got "
                f"{given[name]!r}. Or add `units`, in which plain numbers are."
            )

    def numbers(self, given: Sequence[Any], quantity: str, what: str) -> list[Any]:
        """The same for every entry of a list of numbers or texts."""
        return [self.number(each, quantity, what) for each in given]

    def measured(self, part: Part, quantities: Mapping[str, str], what: str) -> Part:
        """A dataclass with its quantities as numbers, by field and what it measures."""
        values = {
            name: self.number(getattr(part, name), quantity, f"{name} of {what}")
            for name, quantity in quantities.items()
        }
        return replace(part, **values)  # type: ignore[type-var]

    def data(self) -> dict[str, str]:
        """Return what it is made from; empty if plain."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return {} if self.plain else given


def kilograms(given: Any, what: str) -> float:
    """Mass in kilograms of a number of these, or of a text with a unit of mass.

    Raises `InputError` for a text with other units.

    Examples
    --------
    >>> kilograms("250 g", "mass")
    0.25
    """
    if not isinstance(given, str):
        return float(given)
    found = QUANTITY.fullmatch(given)
    value, dimension = read_unit(found.group(2).strip(), UNITS, what) if found else (0.0, LENGTH)
    if found is None or dimension != MASS:
        raise InputError(f"`{what}` must be a mass in kg, or with its unit; got {given!r}.")
    return float(found.group(1)) * value


def unit_system(given: Units | None) -> UnitSystem:
    """System of units from a table, or none; half a system and unknown units are refused."""
    if given is None:
        return UnitSystem()
    if len(given) < 2:
        raise InputError(
            f'`units` must be a table like {{"force": "N", "length": "mm"}}; got {given!r}.'
        )
    return UnitSystem(**given)

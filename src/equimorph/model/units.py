"""Units of measurement: their names, values and dimensions."""

import re
from collections.abc import Mapping

import numpy as np

from equimorph.argument_notes import QUANTITY
from equimorph.errors import InputError, suggestion

Dimension = tuple[int, int, int]
"""Powers of kilogram, metre and second."""
Unit = tuple[float, Dimension]

STANDARD_GRAVITY = 9.80665
"""m/s², by definition [BIPM2019]_: what turns a mass per length into a weight per length."""
POUND, INCH = 0.45359237, 0.0254
"""In kilograms, and in metres."""
LENGTH, FORCE, MASS = (0, 1, 0), (1, 1, -2), (1, 0, 0)
"""Exponents of mass, length and time."""
UNITS: dict[str, Unit] = {
    **{name: (value, LENGTH) for name, value in {
        "m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "um": 1e-6, "in": INCH, "ft": 12.0 * INCH,
    }.items()},
    **{name: (value, FORCE) for name, value in {
        "N": 1.0, "mN": 1e-3, "uN": 1e-6, "kN": 1e3, "MN": 1e6, "lbf": POUND * STANDARD_GRAVITY,
        "kip": 1e3 * POUND * STANDARD_GRAVITY, "kgf": STANDARD_GRAVITY,
    }.items()},
    **{name: (value, MASS) for name, value in {
        "kg": 1.0, "g": 1e-3, "t": 1e3, "lb": POUND,
    }.items()},
    **{name: (value, (1, -1, -2)) for name, value in {
        "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": POUND * STANDARD_GRAVITY / INCH**2,
    }.items()},
    **{name: (value, (1, 2, -2)) for name, value in {"J": 1.0, "mJ": 1e-3, "kJ": 1e3}.items()},
    "1": (1.0, (0, 0, 0)),
}  # fmt: skip
"""Values in SI."""
_FACTOR = re.compile(r"\s*([·*/]?)\s*([A-Za-z]+|1)(?:\^?(-?\d+))?\s*")
_POWERS = str.maketrans({"²": "2", "³": "3", "⁴": "4"})
COMPARED: dict[str, Unit] = {**UNITS, "rad": (1.0, (0, 0, 0)), "deg": (np.pi / 180.0, (0, 0, 0))}
"""Units of numbers with which descriptors are compared."""


def read_unit(text: str, known: Mapping[str, Unit], what: str) -> Unit:
    """Value and dimension of a product of powers of units, like ``kN m^2`` or ``N/mm``.

    Parameters
    ----------
    text
        Units with an optional power, joined by ``/``, ``·``, ``*`` or a space.
    known
        Units by name.
    what
        What the text is the unit of, for messages.

    Raises
    ------
    InputError
        For a unit that is not known, or a text that is no product.

    Examples
    --------
    >>> read_unit("kN mm^2", UNITS, "EI")
    (0.001, (1, 3, -2))
    """
    rest, value, powers = text.translate(_POWERS), 1.0, np.zeros(3, int)
    while rest:
        found = _FACTOR.match(rest)
        name = found.group(2) if found else rest
        if found is None or name not in known:
            units = [each for each in known if each != "1"]
            raise InputError(
                f"`{what}` must be in units such as kN or N mm^2, of {', '.join(units)}; got "
                f"{text!r}.{suggestion(name, units)}"
            )
        power = int(found.group(3) or 1) * (-1 if found.group(1) == "/" else 1)
        one, dimension = known[name]
        value, powers = value * one**power, powers + power * np.array(dimension)
        rest = rest[found.end() :]
    mass, length, time = powers.tolist()
    return value, (mass, length, time)


def in_unit(text: str, unit: str, what: str) -> float:
    """Number of a text like "0.5 N m" in a unit.

    Raises `InputError` for a text without number, or units that measure something else.

    Examples
    --------
    >>> in_unit("0.5 N m", "N mm", "effort(theta_A)")
    500.0
    """
    found = QUANTITY.fullmatch(text)
    wanted = f"`{what}` must be compared with a number, or a text in units of {unit}"
    try:
        one, dimension = read_unit(unit, COMPARED, what)
    except InputError:
        raise InputError(
            f"`{what}` must be compared with a number in {unit}; got {text!r}."
        ) from None
    given = found[2].strip() if found else ""
    value, measured = read_unit(given, COMPARED, what) if given else (one, dimension)
    if found is None or measured != dimension:
        raise InputError(f"{wanted}; got {text!r}.")
    return float(found[1]) * value / one

"""Parameters of structures; boxes and grids of their values, and smooth curves through these."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import is_number
from equimorph.argument_notes import BOUNDS, DIVIDED
from equimorph.argument_vocabulary import FINITE, PERIOD, POSITIVE
from equimorph.arrays import Bool, Float, Place
from equimorph.errors import InputError, suggestion

Samples = Float[np.ndarray, "knots *lanes"]
LARGEST = 1e150
"""Largest size of a value, in scales: squares of distances between parameters stay finite."""


class Spline:
    """Cubic spline through samples: ``Spline(Theta=[0.9, 1.1, 1.0], q=[0, 1, 3])``.

    The spline is twice continuously differentiable; its third derivative is continuous at the
    second knot and the last but one ("not a knot"). Three samples give a parabola, two a straight
    line.

    Parameters
    ----------
    t
        Knots, increasing from 0 to 1; equidistant if None.
    values
        Values of each parameter at the knots: (knots,), or (knots, lanes) for many lanes.

    Raises
    ------
    InputError
        If there are fewer than two samples, numbers of samples differ, or knots do not increase
        from 0 to 1.

    Examples
    --------
    >>> Spline(q=[0.0, 1.0, 4.0])(0.25)
    {'q': array(0.25)}
    """

    @check_arguments
    def __init__(
        self,
        t: Sequence[float] | Float[np.ndarray, " knots"] | None = None,
        /,
        **values: Sequence[float] | Samples,
    ) -> None:
        if not values:
            raise InputError("`Spline` must name at least one parameter; got none.")
        self.samples = {name: np.array(each, dtype=float) for name, each in values.items()}
        counts = {name: len(values) for name, values in self.samples.items()}
        knots = next(iter(counts.values()))
        if knots < 2 or len(set(counts.values())) > 1:
            raise InputError(
                f"`Spline` must have two or more samples, as many of each parameter; got {counts}."
            )
        self.t = np.linspace(0.0, 1.0, knots) if t is None else np.array(t, dtype=float)
        good = self.t.shape == (knots,) and self.t[0] == 0.0 and self.t[-1] == 1.0
        if not (good and (np.diff(self.t) > 0.0).all()):
            raise InputError(
                f"`t` must be {knots} numbers that grow from 0 to 1, one per sample; got {t!r}."
            )

    def __repr__(self) -> str:
        """Parameters and number of knots."""
        return f"Spline({', '.join(self.samples)}: {len(self.t)} knots)"

    @cached_property
    def pieces(self) -> dict[str, CubicSpline]:
        """The cubics of each parameter."""
        return {name: CubicSpline(self.t, values) for name, values in self.samples.items()}

    @check_arguments
    def __call__(self, t: float) -> dict[str, Float[np.ndarray, " *lanes"]]:
        """Values of the parameters at t between 0 and 1."""
        return {name: np.asarray(cubics(t)) for name, cubics in self.pieces.items()}


Role = Literal["actuator", "load", "fixed"]
SPACING = 1e-9
"""Relative difference of the steps of a grid that count as equal: round-off of written numbers."""


@check_arguments
@dataclass(frozen=True)
class Parameter:
    """One parameter of a structure.

    `role` is its usual role; a problem may give it another. `scale` is the change that counts as
    one unit of length in the parameter space; `lower` and `upper` are the open limits of its
    meaning (a span between 0 and 1, say), not of a study. `period` is the change after which the
    structure is the same again, like the turn of a clamp; boxes of sets are no wider.
    """

    name: str
    unit: str
    scale: Annotated[float, POSITIVE]
    role: Role
    default: float | None = None
    lower: float = -np.inf
    upper: float = np.inf
    period: Annotated[float, PERIOD] = np.inf

    def check(self, value: float) -> float:
        """Return `value` as a float, or raise `InputError` if it has no meaning."""
        number = float(value) if is_number(value) and FINITE.holds(value) else np.nan
        if abs(number) > LARGEST * self.scale:
            most = f"{LARGEST * self.scale:g}"
            raise InputError(f"`{self.name}` must be at most {most} in size; got {value!r}.")
        if not self.admits(np.asarray(number)).all():
            unit = "" if self.unit == "1" else f" in units of {self.unit}"
            quantity = isinstance(value, str) and value.strip()[:1].isdigit()  # like "320 mm"
            remedy = f" Write a number{unit}." if quantity else ""
            raise InputError(
                f"`{self.name}` must be a finite number{self._limits()}; got {value!r}.{remedy}"
            )
        return number

    def admits(self, numbers: Float[np.ndarray, "*values"]) -> Bool[np.ndarray, "*values"]:
        """Whether values have a meaning, each."""
        inside = (numbers > self.lower) & (numbers < self.upper)
        return np.asarray(inside & (np.abs(numbers) <= LARGEST * self.scale))

    def _limits(self) -> str:
        if np.isinf(self.lower) and np.isinf(self.upper):
            return ""
        bounds = {self.lower, self.upper} - {-np.inf, np.inf}
        unit = "" if self.unit == "1" or bounds == {0.0} else f" {self.unit}"
        if np.isinf(self.upper):
            return f" greater than {self.lower:g}{unit}"
        return f" between {self.lower:g} and {self.upper:g}{unit} (both excluded)"


def names_of(parameters: Sequence[Parameter]) -> tuple[str, ...]:
    """Names of parameters in order."""
    return tuple(parameter.name for parameter in parameters)


def position(parameters: Sequence[Parameter], name: str) -> int:
    """Place of the parameter called `name`; `InputError` names the ones there are."""
    names = names_of(parameters)
    if name not in names:
        raise InputError(
            f"`{name}` must be a parameter ({', '.join(names)}); got {name!r}."
            f"{suggestion(str(name), names)}"
        )
    return names.index(name)


def parameter_vector(
    parameters: Sequence[Parameter],
    values: Mapping[str, float],
    base: Float[np.ndarray, " parameters"] | None = None,
) -> Float[np.ndarray, " parameters"]:
    """Vector of all parameters: `values` over `base`, or over the defaults without `base`.

    Raises
    ------
    InputError
        If a name is unknown, a value has no meaning, or a parameter has neither value nor default.
    """
    for name in values:
        position(parameters, name)
    vector = np.empty(len(parameters))
    for i, parameter in enumerate(parameters):
        value = values.get(parameter.name, parameter.default if base is None else base[i])
        if value is None:
            raise InputError(f"`{parameter.name}` must be given; got no value.")
        vector[i] = parameter.check(value)
    return vector


class Box:
    """An axis-parallel box: ``Box(Theta=(0.2, 2.5), Delta=(-2, 2))``."""

    @check_arguments
    def __init__(self, **bounds: Annotated[Sequence[float], BOUNDS]) -> None:
        if not bounds:
            raise InputError("`Box` must name at least one parameter; got none.")
        pairs = [tuple(map(float, value)) for value in bounds.values()]
        self.names: tuple[str, ...] = tuple(bounds)
        self.lower: Place = np.array([pair[0] for pair in pairs])
        self.upper: Place = np.array([pair[1] for pair in pairs])

    def __repr__(self) -> str:
        """Return the call that makes this box."""
        ranges = zip(self.names, self.lower, self.upper, strict=True)
        return f"Box({', '.join(f'{name}=({low:g}, {high:g})' for name, low, high in ranges)})"

    @check_arguments
    def contains(
        self, points: Float[np.ndarray, "*lanes d"], slack: float = 0.0
    ) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
        """Whether points lie in the box, widened by `slack` times its widths."""
        return self.holds(points, slack)

    def holds(
        self, points: Float[np.ndarray, "*lanes d"], slack: float = 0.0
    ) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
        """Like `contains`, without checks, for points that the package has computed."""
        inside = points >= self.lower
        inside &= points <= self.upper
        if slack and not inside.all():
            room = slack * (self.upper - self.lower)
            inside = (points >= self.lower - room) & (points <= self.upper + room)
        return np.asarray(inside.all(axis=-1))


class Grid:
    """A regular grid of settings: ``Grid(Theta=(0.2, 2.5, 93), ...)`` has 93 intervals in Theta."""

    @check_arguments
    def __init__(self, **ranges: Annotated[Sequence[float], DIVIDED]) -> None:
        if not ranges:
            raise InputError("`Grid` must name at least one parameter; got none.")
        self.box = Box(**{name: triple[:2] for name, triple in ranges.items()})
        self.names = self.box.names
        self.intervals: tuple[int, ...] = tuple(int(triple[2]) for triple in ranges.values())

    @classmethod
    @check_arguments
    def of_values(cls, **values: Sequence[float] | Float[np.ndarray, " points"]) -> "Grid":
        """Grid through equidistant values: ``Grid.of_values(Theta=np.linspace(0.2, 2.5, 94))``.

        Raises
        ------
        InputError
            If there are fewer than two values of a parameter, or they do not increase in equal
            steps.
        """
        ranges = {}
        for name, given in values.items():
            steps = np.diff(np.asarray(given, float))
            if not (len(steps) and steps[0] > 0.0 and np.allclose(steps, steps[0], rtol=SPACING)):
                raise InputError(
                    f"`{name}` must be two or more values that increase in equal steps; got "
                    f"{np.array2string(np.asarray(given), threshold=6)}."
                )
            ranges[name] = (float(given[0]), float(given[-1]), len(steps))
        return cls(**ranges)

    def __repr__(self) -> str:
        """Return the call that makes this grid."""
        sides = zip(self.names, self.box.lower, self.box.upper, self.intervals, strict=True)
        return f"Grid({', '.join(f'{name}=({a:g}, {b:g}, {n})' for name, a, b, n in sides)})"

    def axes(self) -> tuple[Float[np.ndarray, " points"], ...]:
        """Grid lines per parameter, ends included."""
        sides = zip(self.box.lower, self.box.upper, self.intervals, strict=True)
        return tuple(np.linspace(low, high, count + 1) for low, high, count in sides)

"""Families of structures: variables with bounds, the structure of each choice, carried states."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from equimorph.argument_kinds import as_array, short
from equimorph.arrays import Float, Lanes, Parameters
from equimorph.errors import InputError
from equimorph.structures import Structure
from equimorph.tasks.calibration.measurements import by_data

Vector = Float[np.ndarray, " k"]
Bounds = Annotated[
    Mapping[str, Any],
    "variables by name with bounds, like {'B': (0.4, 2.5)} or {'B': (0.4, 2.5, 1.0)}",
]
Scalars = Callable[[Structure, Lanes, Parameters], Float[np.ndarray, "lanes m"]]
"""Scalars of states, which may differ from one structure of a family to the next."""

KEPT = 64
"""Structures that are remembered, the last ones made."""


@dataclass
class DesignFamily:
    """The structures of a family by the vector of its variables, each scaled to 0 … 1."""

    make: Callable[..., Structure]
    """Structure of variables by name."""
    names: tuple[str, ...]
    shapes: tuple[tuple[int, ...], ...]
    """What they are called; the shape of each: () for a number."""
    low: Vector
    width: Vector
    given: Vector
    """Lower bounds, widths of the ranges, and start of all entries in turn."""
    _made: dict[bytes, Structure] = field(default_factory=dict)

    @classmethod
    def of(cls, make: Callable[..., Structure], variables: Bounds) -> "DesignFamily":
        """Read bounds (low, high) or (low, high, start) of each variable.

        Refused if there is none, `make` does not take their names, bounds are not finite with low <
        high, or a start lies outside.
        """
        if not variables:
            raise InputError("`variables` must name at least one variable; got none.")
        read = [_read_bounds(name, given) for name, given in variables.items()]
        check_names(make, variables, "family")
        low, high, start = (np.concatenate([each[k].ravel() for each in read]) for k in range(3))
        shapes = tuple(each[0].shape for each in read)
        width = high - low
        return cls(make, tuple(variables), shapes, low, width, start)

    @property
    def start(self) -> Vector:
        """Scaled variables at the start."""
        return np.asarray((self.given - self.low) / self.width)

    def values(self, x: Vector) -> dict[str, Any]:
        """Variables by name: numbers, or arrays where the bounds are arrays."""
        same, found, at = x == self.start, dict[str, Any](), 0
        flat = np.where(same, self.given, self.low + self.width * x)
        for name, shape in zip(self.names, self.shapes, strict=True):
            part = flat[at : at + int(np.prod(shape))]
            found[name] = part.reshape(shape).copy() if shape else float(part[0])
            at += len(part)
        return found

    def structure(self, x: Vector) -> Structure:
        """Structure of scaled variables; another thing, or one of another size, is refused."""
        key = x.tobytes()
        if key not in self._made:
            made = self.make(**self.values(x))
            self._check(made)
            if len(self._made) >= KEPT:
                self._made.pop(next(iter(self._made)))
            self._made[key] = made
        return self._made[key]

    def _check(self, made: Any) -> None:
        if not isinstance(made, Structure):
            raise InputError(f"`family` must return structures; got {short(made)}.")
        known = next(iter(self._made.values()), made)
        if (made.size, len(made.parameters)) != (known.size, len(known.parameters)):
            raise InputError(
                "`family` must return structures with the same unknowns and parameters; got "
                f"{made.size} and {known.size} unknowns. Keep the nodes of tables where they are."
            )

    def derivative(
        self, scalars: Scalars, x: Vector, k: int, at: "Carried", along: "Carried"
    ) -> Float[np.ndarray, "lanes m"]:
        """Derivative of scalars by scaled variable k, as (z, p) move along a direction with it."""
        unit = np.zeros_like(x)
        unit[k] = 1.0
        here, size = self.structure(x), at.z.shape[1]

        def value(made: Structure, both: Lanes) -> Float[np.ndarray, "lanes m"]:
            p = both[:, size:] + default_changes(here, made, at.p)
            return scalars(made, np.ascontiguousarray(both[:, :size]), p)

        joined, ways = (np.concatenate([each.z, each.p], axis=1) for each in (at, along))
        return by_data(value, lambda h: self.structure(x + h * unit), 1.0, joined, ways)


def check_names(function: Callable[..., Any], variables: Mapping[str, Any], name: str) -> None:
    """Refuse a function, called `name`, that does not take variables by their names."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # compiled ones may have none
        return
    try:
        signature.bind(**variables)
    except TypeError as error:
        raise InputError(
            f"`{name}` must be a function of {', '.join(map(str, variables))}; got one of "
            f"{signature}."
        ) from error


@dataclass(frozen=True)
class Carried:
    """Unknowns and parameters, or changes of these (lanes)."""

    z: Lanes
    p: Parameters


def default_changes(old: Structure, new: Structure, p: Parameters) -> Parameters:
    """What parameters change by that have their default, like the span of a rod."""
    before, after = (np.array([_default(each) for each in s.parameters]) for s in (old, new))
    return np.asarray(np.where(p == before, after - before, 0.0))


def _default(parameter: Any) -> float:
    return np.nan if parameter.default is None else float(parameter.default)


def _read_bounds(name: str, given: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower bound, upper bound and start of one variable, of one shape."""
    wanted = f"`{name}` must have finite bounds (low, high) or (low, high, start), low < high"
    try:
        low, high, *rest = map(as_array, given)
        start = rest[0] if rest else low + 0.5 * (high - low)
        low, high, start = (np.array(each) for each in np.broadcast_arrays(low, high, start))
    except (TypeError, ValueError) as error:
        raise InputError(f"{wanted}; got {short(given)}.") from error
    if len(rest) > 1 or not (np.isfinite([low, high, start]).all() and (low < high).all()):
        raise InputError(f"{wanted}; got {short(given)}.")
    if not ((low <= start) & (start <= high)).all():
        raise InputError(f"`{name}` must start within its bounds; got {short(given)}.")
    return low, high, start

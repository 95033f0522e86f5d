"""What was measured: descriptors or shapes, with standard deviations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import NUMBERS
from equimorph.arrays import Float, Lanes, Parameters
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures import States, Structure
from equimorph.structures.metric import move_length

Columns = Float[np.ndarray, "lanes columns"]
Numbers = Annotated[ArrayLike, NUMBERS]

STEP = 1e-3
"""Of differences along a direction of length one: fourth order, so that they err by 1e-12."""
WEIGHTS = ((1.0, 8.0 / 12.0), (-1.0, -8.0 / 12.0), (2.0, -1.0 / 12.0), (-2.0, 1.0 / 12.0))
"""Steps and weights of the central difference of fourth order."""


class Readings(NamedTuple):
    """Measured numbers, one row per state, and their standard deviations, if known."""

    values: Columns
    sigma: Columns | None


@runtime_checkable
class Measurement(Protocol):
    """Measured numbers, some for each state, and how to compute them."""

    def table(self, start: States) -> Readings:
        """Measured numbers and standard deviations; `InputError` if they do not fit the states."""

    def predict(self, structure: Structure, z: Lanes, p: Parameters) -> Columns:
        """Return what a measurement without errors would give."""


@check_arguments
@dataclass(frozen=True, eq=False)
class MeasuredValues:
    """Measured values of a descriptor, one for each state; NaN where a state was not measured.

    Parameters
    ----------
    descriptor
        The measured descriptor, in its unit.
    values
        One value per state.
    sigma
        Standard deviation of the errors, one for all states or one for each; all measurements of a
        calibration have one, or none has.
    """

    descriptor: Descriptor
    values: Numbers
    sigma: Numbers | None = None

    def table(self, start: States) -> Readings:
        """Measured numbers and standard deviations."""
        name, shape = f"values of {self.descriptor.name}", (len(start), 1)
        values = _fitting(name, np.atleast_1d(self.values), (len(start),)).reshape(shape)
        return Readings(values, _deviations(self.sigma, shape, 1))

    def predict(self, structure: Structure, z: Lanes, p: Parameters) -> Columns:
        """Return the values of the descriptor, or of its namesake on another structure."""
        own = self.descriptor
        if own.origin != structure.signature:
            own = structure.descriptor(own.name)
        return np.asarray(own.function(z, p)[:, None])


@check_arguments
@dataclass(frozen=True, eq=False)
class MeasuredShape:
    """Measured points of the shape, the same material points in each state.

    Parameters
    ----------
    points
        Coordinates (states, points, 2) in the structure's unit of length; NaN where a point was
        not measured.
    s
        Places of the points along the structure; None for those that the structure draws.
    sigma
        Standard deviation of both coordinates, one for all, or one for each state or point
        (states, points, 2).
    """

    points: Numbers
    s: Sequence[float] | None = None
    sigma: Numbers | None = None

    def table(self, start: States) -> Readings:
        """Measured numbers and standard deviations."""
        drawn = start.shape(self._places).shape
        points = _fitting("points of the shape", np.asarray(self.points), drawn)
        return Readings(points.reshape(len(start), -1), _deviations(self.sigma, drawn, 3))

    def predict(self, structure: Structure, z: Lanes, p: Parameters) -> Columns:
        """Return the coordinates of the points."""
        return structure.shape(z, p, self._places).reshape(len(z), -1)

    @property
    def _places(self) -> Float[np.ndarray, " points"] | None:
        return None if self.s is None else np.asarray(self.s, float)


def derivative(
    measurement: Measurement,
    structure: Structure,
    z: Lanes,
    p: Parameters,
    dz: Lanes,
    dp: Parameters,
) -> Columns:
    """Derivative of what is measured along directions (dz, dp), by differences of fourth order."""
    h = (STEP / np.maximum(move_length(structure, dz, dp), 1e-300))[:, None]
    total = sum(
        weight * measurement.predict(structure, z + steps * h * dz, p + steps * h * dp)
        for steps, weight in WEIGHTS
    )
    return np.asarray(total / h)


def by_data(
    value: Callable[[Structure, Lanes], Float[np.ndarray, "lanes n"]],
    made: Callable[[float], Structure],
    size: float,
    z: Lanes,
    dz: Lanes,
) -> Float[np.ndarray, "lanes n"]:
    """Derivative of a value by data of the structure, as unknowns z move along dz with them.

    made: structure where the data are changed by an amount; size: of the data. Fourth order.
    """
    h = STEP * size
    return np.asarray(
        sum(weight * value(made(steps * h), z + steps * h * dz) for steps, weight in WEIGHTS) / h
    )


def _fitting(name: str, given: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    if given.shape != shape:
        raise InputError(f"`{name}` must have the shape {shape}, states first; got {given.shape}.")
    numbers = np.asarray(given, float)
    if np.isinf(numbers).any():
        raise InputError(
            f"`{name}` must be finite numbers, or nan where nothing was measured; got inf."
        )
    return numbers


def _deviations(sigma: Numbers | None, shape: tuple[int, ...], axes: int) -> Columns | None:
    if sigma is None:
        return None
    given = np.asarray(sigma, float)
    if given.ndim == 1 and axes > 1:
        given = given[:, None, None]
    if given.ndim == 1:
        given = given[:, None]
    if not (given > 0.0).all() or not np.isfinite(given).all():
        raise InputError(f"`sigma` must be positive and finite; got {sigma!r}.")
    try:
        return np.broadcast_to(given, shape).reshape(shape[0], -1)
    except ValueError as error:
        raise InputError(
            f"`sigma` must be one number, or have one per state; got the shape {given.shape}."
        ) from error

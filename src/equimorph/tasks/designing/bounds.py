"""Bounds of a design: on functions of the variables, and on what questions are answered with."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import as_array, short
from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.tasks.designing.family import DesignFamily, Vector, check_names
from equimorph.tasks.designing.questions import LoadLimit, StateValue
from equimorph.tasks.designing.routes import RouteExtreme

Asked = StateValue | LoadLimit | RouteExtreme
Function = Callable[..., Any]
Numbers = Float[np.ndarray, " m"]

DIFFERENCE = 1e-6
"""Step of differences of functions of the variables, relative to the ranges of these."""


@check_arguments
@dataclass(frozen=True, eq=False)
class DesignBound:
    """Bounds that a design obeys.

    Parameters
    ----------
    of
        A function of the variables, by their names, that returns a number or an array, like
        ``lambda B0, B1: 0.5 * (B0 + B1)``; or a question: `LoadLimit`, `StateValue`,
        `RouteExtreme`.
    lower, upper
        Least and largest value allowed; equal ones prescribe it.

    Raises
    ------
    InputError
        If both are infinite, `lower` exceeds `upper`, or a question is bounded from the wrong side:
        what is made small has an upper bound only, what is made large a lower one.
    """

    of: Annotated[Asked | Function, "a function of the variables, or a question"]
    lower: float = -np.inf
    upper: float = np.inf

    def __post_init__(self) -> None:
        """Check the sides."""
        if not self.lower <= self.upper or np.isinf([self.lower, self.upper]).all():
            raise InputError(
                "`lower` must not exceed `upper`, and one must be finite; got "
                f"{self.lower:g} and {self.upper:g}."
            )
        if isinstance(self.of, Asked):
            side, other = ("upper", "lower") if self.of.sign > 0.0 else ("lower", "upper")
            if np.isfinite(getattr(self, other)):
                word = "small" if self.of.sign > 0.0 else "large"
                raise InputError(
                    f"`{other}` must not be given for what is made {word}; got "
                    f"{getattr(self, other):g}. Give `{side}`."
                )

    @property
    def question(self) -> Asked | None:
        """The question that is bounded, if it is one."""
        return self.of if isinstance(self.of, Asked) else None

    @property
    def level(self) -> float:
        """Bound of a question, times its sign: an upper one."""
        assert self.question is not None
        return self.upper if self.question.sign > 0.0 else -self.lower

    @property
    def size(self) -> float:
        """What the excess is compared with: the level, if it is not zero."""
        return abs(self.level) or 1.0

    def excess(self, value: float) -> float:
        """By how much a question's value, times its sign, exceeds the level."""
        return (value - self.level) / self.size


@dataclass(frozen=True)
class VariableBounds:
    """All bounds on functions of the variables: g(x) = 0 and h(x) ≥ 0.

    Parameters
    ----------
    family
        Family with the variables.
    bounds
        Bounds on functions.
    """

    family: DesignFamily
    bounds: tuple[DesignBound, ...]

    def equal(self, x: Vector) -> Numbers:
        """What must vanish."""
        return self._join([v - b.lower for b, v in self._values(x) if b.lower == b.upper])

    def above(self, x: Vector) -> Numbers:
        """What must not be negative."""
        parts = []
        for bound, value in self._values(x):
            if bound.lower < bound.upper:
                ends = (value - bound.lower, bound.upper - value)
                parts += [each for each in ends if np.isfinite(each).all()]
        return self._join(parts)

    def slopes(self, function: Callable[[Vector], Vector], x: Vector) -> Float[np.ndarray, "m k"]:
        """Derivatives of `equal` or `above` by differences, exact where they are linear."""
        steps = DIFFERENCE * np.eye(len(x))
        rows = [(function(x + h) - function(x - h)) / (2.0 * DIFFERENCE) for h in steps]
        return np.array(rows).T

    def violation(self, x: Vector) -> float:
        """Largest violation, relative to the size of the bounds."""
        parts = np.concatenate([np.abs(self.equal(x)), -self.above(x)])
        return float(parts.max(initial=0.0))

    def _values(self, x: Vector) -> list[tuple[DesignBound, np.ndarray]]:
        values: Mapping[str, Any] = self.family.values(x)
        return [(each, _numbers(each.of, values)) for each in self.bounds]

    @staticmethod
    def _join(parts: list[np.ndarray]) -> np.ndarray:
        return np.concatenate([np.zeros(0), *parts])


def _numbers(function: Any, values: Mapping[str, Any]) -> np.ndarray:
    check_names(function, values, "of")
    found = function(**values)
    try:
        numbers = as_array(found).ravel()
    except (TypeError, ValueError):
        numbers = np.array([np.nan])
    if not np.isfinite(numbers).all():
        raise InputError(f"`of` must return finite numbers; got {short(found)}.")
    return numbers

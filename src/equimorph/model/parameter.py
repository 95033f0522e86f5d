"""Parameters of a structure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from equimorph.errors import InputError, suggestion

Role = Literal["actuator", "load", "fixed"]


@dataclass(frozen=True)
class Parameter:
    """One parameter of a structure.

    `role` is its usual role; a problem may give it another. `scale` is the change that counts as
    one unit of length in the parameter space; `lower` and `upper` are the open limits of its
    meaning (a span between 0 and 1, say), not of a study.
    """

    name: str
    unit: str
    scale: float
    role: Role
    default: float | None = None
    lower: float = -np.inf
    upper: float = np.inf

    def check(self, value: float) -> float:
        """Return `value` as a float, or raise `InputError` if it has no meaning."""
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = np.nan
        if not (np.isfinite(number) and self.lower < number < self.upper):
            raise InputError(
                f"`{self.name}` must be a finite number{self._limits()}; got {value!r}."
            )
        return number

    def _limits(self) -> str:
        if np.isinf(self.lower) and np.isinf(self.upper):
            return ""
        if np.isinf(self.upper):
            return f" greater than {self.lower:g}"
        return f" between {self.lower:g} and {self.upper:g} (both excluded)"


def names_of(parameters: Sequence[Parameter]) -> tuple[str, ...]:
    """Names of parameters in order."""
    return tuple(parameter.name for parameter in parameters)


def position(parameters: Sequence[Parameter], name: str) -> int:
    """Place of the parameter called `name`; `InputError` names the ones there are."""
    names = names_of(parameters)
    if name not in names:
        raise InputError(
            f"`{name}` must be a parameter ({', '.join(names)}); got {name!r}."
            f"{suggestion(name, names)}"
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
        For an unknown name, a value without meaning, or a parameter with neither value nor default.
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

"""What a route should have least of: length, travel, work, time, nearness to instability."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float, Int

from equimorph.errors import InputError, suggestion
from equimorph.model import Rates, names_of
from equimorph.structures import States, Structure

Values = Float[np.ndarray, " pairs"]
Numbers = Int[np.ndarray, " pairs"]
Name = Literal["length", "travel", "work", "clearance"]
Term = Name | Rates
Wish = Term | Sequence[tuple[float, Term]]

NAMES: tuple[Name, ...] = get_args(Name)
LEAST_MARGIN = 1e-6
"""Margin below which clearance counts no further."""


@dataclass(frozen=True)
class Objective:
    """A weighted sum of what is spent along a curve of equilibria.

    Terms: "length" in the metric (configuration and scaled parameters); "travel", the length of the
    way of the parameters, in their scales; "work", ``Σᵢ ∫|∂L/∂aᵢ daᵢ|``, what actuators spend that
    get nothing back; "clearance", ``∫ ds/margin``, large near instability; `Rates`, the time that
    limited rates take.

    Parameters
    ----------
    terms
        Weights and terms.
    """

    terms: tuple[tuple[float, Term], ...]

    def __str__(self) -> str:
        """Return it as it was asked for."""
        words = [
            f"{'' if weight == 1.0 else f'{weight:g} '}{term if isinstance(term, str) else 'time'}"
            for weight, term in self.terms
        ]
        return " + ".join(words)

    @cached_property
    def is_length(self) -> bool:
        """Whether lengths alone count."""
        return all(term == "length" for _, term in self.terms)

    @cached_property
    def needs_margins(self) -> bool:
        """Whether stability margins count."""
        return any(term == "clearance" for _, term in self.terms)

    def costs(self, states: States, first: Numbers, second: Numbers) -> Values:
        """Cost of the short way between pairs of states, by the trapezoidal rule."""
        total = np.zeros(len(first))
        for weight, term in self.terms:
            total += weight * _costs(term, states, first, second)
        return total

    def along(self, states: States) -> float:
        """Cost of the way through states in turn."""
        at = np.arange(len(states))
        return float(self.costs(states, at[:-1], at[1:]).sum())


def objective_of(wish: Wish, structure: Structure) -> Objective:
    """Check what a caller wishes for.

    Raises
    ------
    InputError
        For an unknown name, a weight that is not positive, or rates of unknown parameters.
    """
    single = isinstance(wish, str | Rates)
    terms = [(1.0, wish)] if single else list(wish)  # type: ignore[arg-type]
    checked: list[tuple[float, Term]] = []
    for entry in terms:
        weight, term = _pair(entry)
        if isinstance(term, Rates):
            unknown = [name for name in term.limits if name not in names_of(structure.parameters)]
            if unknown:
                known = ", ".join(names_of(structure.parameters))
                raise InputError(
                    f"`objective` must limit parameters ({known}); got {unknown[0]!r}."
                )
        elif term not in NAMES:
            raise InputError(
                f"`objective` must be made of {', '.join(NAMES)} or Rates; got {term!r}."
                f"{suggestion(str(term), NAMES)}"
            )
        checked.append((weight, term))
    if not checked:
        raise InputError("`objective` must have at least one term; got none.")
    return Objective(tuple(checked))


def _pair(entry: object) -> tuple[float, Term]:
    if not (isinstance(entry, Sequence) and len(entry) == 2 and not isinstance(entry, str)):
        raise InputError(f"`objective` must be a term or pairs (weight, term); got {entry!r}.")
    weight, term = entry
    try:
        number = float(weight)
    except (TypeError, ValueError):
        number = np.nan
    if not (np.isfinite(number) and number > 0.0):
        raise InputError(f"`objective` must have positive weights; got {weight!r}.")
    return number, term


def _costs(term: Term, states: States, first: Numbers, second: Numbers) -> Values:
    structure = states.structure
    dp = (states.p[second] - states.p[first]) / structure.scales
    if isinstance(term, Rates):
        return _times(term, states, first, second)
    if term == "travel":
        return np.asarray(np.linalg.norm(dp, axis=1))
    if term == "work":
        effort = structure.effort(states.z, states.p) * structure.energy_scale
        mean = 0.5 * (effort[first] + effort[second])
        return np.asarray(np.abs(mean * (states.p[second] - states.p[first])).sum(axis=1))
    n = structure.unknowns
    dz = states.z[second, :n] - states.z[first, :n]
    length = np.sqrt(dz**2 @ structure.mass + (dp**2).sum(axis=1))
    if term == "length":
        return np.asarray(length)
    nearness = 1.0 / np.maximum(states.margin, LEAST_MARGIN)
    return np.asarray(length * 0.5 * (nearness[first] + nearness[second]))


def _times(rates: Rates, states: States, first: Numbers, second: Numbers) -> Values:
    names = names_of(states.structure.parameters)
    at = [names.index(name) for name in rates.limits]
    bounds = np.array(list(rates.limits.values()), dtype=float)
    return np.asarray((np.abs(states.p[second] - states.p[first])[:, at] / bounds).max(axis=1))

"""What a route minimises: length, travel, work, time, nearness to instability."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal, get_args

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import ANYTHING, short
from equimorph.arrays import Flags, Float, Int
from equimorph.equilibria import settle
from equimorph.errors import InputError, suggestion
from equimorph.model import Constraint, Descriptor, Rates, Schedule, names_of
from equimorph.structures import States, Structure, stability_margin
from equimorph.structures.metric import move_length

Values = Float[np.ndarray, " pairs"]
Numbers = Int[np.ndarray, " pairs"]
Name = Literal["length", "travel", "work", "clearance"]
Term = Name | Rates | Descriptor

NAMES: tuple[Name, ...] = get_args(Name)
LEAST_MARGIN = 1e-6
"""Margin, or value of a descriptor, below which clearance counts no further."""
LONGEST = 1.2
"""Way between two states over that at their mean parameters, in their chord, at most."""
EXACT, NEAR, ROUGH = 1e-11, 1e-4, 1e-2
"""Relative errors of margins: in results, where paths are compared, and on a mesh."""


@dataclass(frozen=True)
class Places:
    """States, with the quantities that an objective needs at each of them.

    Efforts of the parameters, and reciprocals of margins and descriptors, a column for each term;
    empty where they do not count.
    """

    states: States
    efforts: Float[np.ndarray, "lanes efforts"]
    nearness: Float[np.ndarray, "lanes terms"]

    def __getitem__(self, key: slice | Int[np.ndarray, " some"]) -> "Places":
        """Some of them."""
        return Places(self.states[key], self.efforts[key], self.nearness[key])

    def replace_at(self, at: Int[np.ndarray, " some"], new: "Places") -> "Places":
        """Others in some places."""
        z, p = self.states.z.copy(), self.states.p.copy()
        efforts, nearness = self.efforts.copy(), self.nearness.copy()
        z[at], p[at] = new.states.z, new.states.p
        efforts[at], nearness[at] = new.efforts, new.nearness
        return Places(States(self.states.structure, z, p), efforts, nearness)


@dataclass(frozen=True)
class Objective:
    """A weighted sum of what is spent along a curve of equilibria.

    Terms: "length" in the metric (configuration and scaled parameters); "travel", the length of the
    path of the scaled parameters; "work", ``Σᵢ ∫|∂L/∂aᵢ daᵢ|``, of actuators that recover no
    energy; "clearance", ``∫ ds/margin``, large near instability; a `Descriptor` d with positive
    values, ``∫ ds/d``, large where it is small; `Rates`, the time that limited rates take.

    Parameters
    ----------
    terms
        Weights and terms.
    """

    terms: tuple[tuple[float, Term], ...]

    def __str__(self) -> str:
        """Return the words that define it."""
        words = [
            f"{'' if weight == 1.0 else f'{weight:g} '}{_word(term)}" for weight, term in self.terms
        ]
        return " + ".join(words)

    @cached_property
    def is_length(self) -> bool:
        """Whether lengths alone count."""
        return all(term == "length" for _, term in self.terms)

    @cached_property
    def needs_margins(self) -> bool:
        """Whether stability margins count, or values of descriptors in their place."""
        return any(_is_near(term) for _, term in self.terms)

    @property
    def key(self) -> Hashable:
        """What costs of links depend on."""
        return repr(self), tuple(term for _, term in self.terms if isinstance(term, Descriptor))

    def places(self, states: States, error: float = NEAR) -> Places:
        """States with the quantities that it needs, margins up to a relative error."""
        count, structure = len(states), states.structure
        efforts, nearness = np.zeros((count, 0)), np.zeros((count, 0))
        if any(term == "work" for _, term in self.terms):
            efforts = structure.effort(states.z, states.p) * structure.energy_scale
        if self.needs_margins:
            values = [
                term(states) if isinstance(term, Descriptor) else _margins(states, error)
                for _, term in self.terms
                if _is_near(term)
            ]
            nearness = 1.0 / np.maximum(np.stack(values, axis=1), LEAST_MARGIN)
        return Places(states, efforts, nearness)

    def between(self, first: Places, second: Places) -> Values:
        """Cost of the short way from each of the first to each of the second, trapezoidal."""
        total, column = np.zeros(len(first.states)), 0
        for weight, term in self.terms:
            if _is_near(term):
                near = 0.5 * (first.nearness + second.nearness)[:, column]
                total += weight * _cost("length", first, second) * near
                column += 1
            else:
                total += weight * _cost(term, first, second)
        return total

    def costs(self, states: States, first: Numbers, second: Numbers, error: float = NEAR) -> Values:
        """Cost of the short way between pairs of states, by the trapezoidal rule."""
        places = self.places(states, error)
        return self.between(places[first], places[second])

    def with_times(self, schedule: Schedule) -> Schedule:
        """A schedule with the times of its rates, if they limit every parameter that moves."""
        for _, term in self.terms:
            if isinstance(term, Rates) and set(schedule.moving) <= set(term.limits):
                return schedule.in_time(term)
        return schedule

    def along(self, states: States) -> float:
        """Cost of the way through states in turn, between which the parameters go straight."""
        if self.is_length:
            return sum(weight for weight, _ in self.terms) * length_through(states)
        at = np.arange(len(states))
        return float(self.costs(states, at[:-1], at[1:], EXACT).sum())


def length_through(states: States) -> float:
    """Length in the metric of the way through states in turn, to fourth order in the steps.

    Each step is two arcs; see `arc_lengths`.
    """
    moved = np.flatnonzero(_chords(states[:-1], states[1:]) > 0.0)
    first, last = states[:-1][moved], states[1:][moved]
    middle, good = _between(first, last)
    arc = _arcs(first, middle) + _arcs(middle, last)
    return float(np.where(good, arc, _chords(first, last)).sum())


def arc_lengths(first: Values, second: Values, chord: Values) -> Values:
    """Lengths of arcs with two chords a and b in turn, and a chord c over both.

    ``a + b + (a + b − c) (a² − ab + b²)/(3ab)`` up to the fifth order: the curvature follows from
    what both chords together are longer.
    """
    a, b = first, second
    share = (a**2 - a * b + b**2) / np.maximum(3.0 * a * b, 1e-300)
    return np.asarray(a + b + (a + b - chord) * share)


def _arcs(first: States, last: States) -> Values:
    """Lengths of arcs between pairs of states; their chords where no state is between them."""
    middle, good = _between(first, last)
    chord = _chords(first, last)
    arc = arc_lengths(_chords(first, middle), _chords(middle, last), chord)
    return np.where(good, arc, chord)


def _between(first: States, last: States) -> tuple[States, Flags]:
    """States at the mean parameters of pairs, and whether they lie between them."""
    amid = settle(first.structure, 0.5 * (first.z + last.z), 0.5 * (first.p + last.p))
    middle = States(first.structure, amid.z, amid.p)
    around = _chords(first, middle) + _chords(middle, last)
    return middle, amid.found & (around < LONGEST * _chords(first, last))


def _chords(first: States, last: States) -> Values:
    return _cost("length", _bare(first), _bare(last))


def _bare(states: States) -> Places:
    none = np.zeros((len(states), 0))
    return Places(states, none, none)


@dataclass(frozen=True)
class Extreme:
    """Largest value of a descriptor along a route, kept low, or its least one, kept high.

    Made by `peak` and `least`. `sign` is 1 for the largest and −1 for the least value. Routes may
    exceed the best value by the share `slack` of it, or of its difference to that of an end.
    """

    descriptor: Descriptor
    sign: float
    slack: float = 1e-3

    def __str__(self) -> str:
        """Return the words that define it."""
        return f"{'peak' if self.sign > 0.0 else 'least'} {self.descriptor.name}"

    def along(self, states: States) -> float:
        """Largest or least value on states."""
        return float(self.sign * (self.sign * self.descriptor(states)).max())

    def bound(self, value: float, room: float) -> Constraint:
        """Return the constraint that routes exceed a value by no more than that."""
        limit = value + self.sign * room
        return self.descriptor <= limit if self.sign > 0.0 else self.descriptor >= limit


@check_arguments
def peak(descriptor: Descriptor, slack: float = 1e-3) -> Extreme:
    """Objective of `plan` that minimises the largest value of a descriptor along the route.

    Of all routes that come as low up to the slack, the shortest one is sought.

    Parameters
    ----------
    descriptor
        What is kept low: an effort, a curvature, a stress.
    slack
        Share of the lowest peak by which the route may exceed it; positive.

    Examples
    --------
    >>> import equimorph as em
    >>> print(em.peak(em.Spring().angle))
    peak angle
    """
    return Extreme(descriptor, 1.0, slack)


@check_arguments
def least(descriptor: Descriptor, slack: float = 1e-3) -> Extreme:
    """Objective of `plan` that maximises the least value of a descriptor along the route.

    Parameters
    ----------
    descriptor
        What is kept high: a margin, a clearance.
    slack
        Share of the highest least value by which the route may fall below it; positive.

    Raises
    ------
    InputError
        If the descriptor is the largest of several functions, like an absolute value.

    Examples
    --------
    >>> import equimorph as em
    >>> print(em.least(em.margin_of(em.Spring())))
    least stability_margin
    """
    if descriptor.branches is not None:
        raise InputError(
            "`descriptor` must not be the largest of several functions where it is kept high; got "
            f"{descriptor.name}. Keep one of these high."
        )
    return Extreme(descriptor, -1.0, slack)


Wish = Annotated[Term | Sequence[tuple[float, Term]] | Objective, ANYTHING]
"""What a caller may pass as an objective."""


def objective_of(wish: Wish, structure: Structure) -> Objective:
    """Check the objective that a caller passes.

    Refused for an unknown name, a weight that is not positive, or rates of unknown parameters.
    """
    given = wish.terms if isinstance(wish, Objective) else wish
    single = isinstance(given, str | Rates | Descriptor) or not isinstance(given, Sequence)
    terms = [(1.0, given)] if single else list(given)  # type: ignore[arg-type]
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
        elif not isinstance(term, Descriptor) and term not in NAMES:
            raise InputError(
                f"`objective` must be made of {', '.join(NAMES)}, Rates or descriptors; got "
                f"{short(term)}."
                f"{suggestion(str(term), NAMES)}"
            )
        checked.append((weight, term))
    if not checked:
        raise InputError("`objective` must have at least one term; got none.")
    return Objective(tuple(checked))


def _pair(entry: object) -> tuple[float, Term]:
    if not (isinstance(entry, Sequence) and len(entry) == 2 and not isinstance(entry, str)):
        raise InputError(f"`objective` must be a term or pairs (weight, term); got {short(entry)}.")
    weight, term = entry
    try:
        number = float(weight)
    except (TypeError, ValueError):
        number = np.nan
    if not (np.isfinite(number) and number > 0.0):
        raise InputError(f"`objective` must have positive weights; got {weight!r}.")
    return number, term


def _word(term: Term) -> str:
    if isinstance(term, Descriptor):
        return f"length/{term.name}"
    return term if isinstance(term, str) else "time"


def _is_near(term: Term) -> bool:
    """Whether lengths are divided by a margin or a descriptor."""
    return term == "clearance" or isinstance(term, Descriptor)


def _margins(states: States, error: float) -> Float[np.ndarray, " lanes"]:
    if error == EXACT:
        return states.margin
    return stability_margin(states.structure, states.z, states.p, error)


def _cost(term: Term, first: Places, second: Places) -> Values:
    structure = first.states.structure
    dp = second.states.p - first.states.p
    if isinstance(term, Rates):
        return _times(term, names_of(structure.parameters), dp)
    if term == "work":
        mean = 0.5 * (first.efforts + second.efforts)
        return np.asarray(np.abs(mean * dp).sum(axis=1))
    if term == "travel":
        return np.asarray(np.sqrt(((dp / structure.scales) ** 2).sum(axis=1)))
    return move_length(structure, second.states.z - first.states.z, dp)


def _times(rates: Rates, names: Sequence[str], dp: Float[np.ndarray, "pairs params"]) -> Values:
    at = [names.index(name) for name in rates.limits]
    bounds = np.array(list(rates.limits.values()), dtype=float)
    return np.asarray((np.abs(dp)[:, at] / bounds).max(axis=1))

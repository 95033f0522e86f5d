"""Descriptors: scalars of a state; constraints: comparisons of descriptors with numbers."""

import json
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol, overload, runtime_checkable

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import is_number
from equimorph.argument_notes import QUANTITY
from equimorph.argument_vocabulary import LARGEST
from equimorph.arrays import Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model.families import Evaluate
from equimorph.model.obstacle import Obstacle
from equimorph.model.rebuilding import Rebuilt, remember_call
from equimorph.model.units import in_unit

Branches = Callable[
    [Lanes, Parameters],
    tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]],
]

CONSTRAINT = "constraint"
"""Event of a path that meets any other constraint."""
EASE = 1e-9
"""Relative excess over a bound that counts as rounding."""


@runtime_checkable
class OneState(Protocol):
    """What a descriptor needs of a single state."""

    @property
    def z(self) -> Float[np.ndarray, " size"]:
        """Unknowns and multipliers."""

    @property
    def p(self) -> Float[np.ndarray, " parameters"]:
        """All parameters."""


@runtime_checkable
class ManyStates(Protocol):
    """What a descriptor needs of a batch of states."""

    @property
    def z(self) -> Lanes:
        """Unknowns and multipliers."""

    @property
    def p(self) -> Parameters:
        """All parameters."""

    def __len__(self) -> int:
        """Return the number of states."""


@dataclass(frozen=True)
class Vanishing:
    """What a path meets where a descriptor vanishes, if that is an event of its own.

    Parameters
    ----------
    event
        Its kind, in words.
    criticality
        Of states there: "supercritical", "subcritical" or "not judged".
    """

    event: str
    criticality: Callable[[Lanes, Parameters], list[str]]


@check_arguments
@dataclass(frozen=True, eq=False)
class Descriptor(Rebuilt):
    """A scalar of a state, with its name, unit and symbol for axes.

    Call it on a state for a float, on a batch of states for an array; compare it with a number for
    a `Constraint`.

    Parameters
    ----------
    name, unit, symbol
        Its name as it is written in a study, its unit, and its symbol for axes.
    function
        Values on a batch of unknowns and parameters.
    origin
        Signature of the structure that it describes. Descriptors of the same origin and name are
        equal, whenever they were made; without an origin, those with the same function.
    place
        For extrema along the structure: the arclength where they are.
    branches
        For the largest of several smooth functions: all of them (−∞ where there are fewer) and
        their places, which identify them.
    obstacle
        For the distance of the shape from an obstacle: that obstacle, for figures.
    vanishing
        For eigenvalues: the event where they vanish.
    """

    name: str
    unit: str
    function: Evaluate
    symbol: str = ""
    origin: Hashable = None
    place: Evaluate | None = None
    branches: Branches | None = None
    obstacle: Obstacle | None = None
    vanishing: Vanishing | None = None

    # one and many states differ by the number of axes only, which static types do not see
    @overload
    def __call__(  # type: ignore[overload-overlap]
        self, states: ManyStates
    ) -> Values: ...
    @overload
    def __call__(self, states: OneState) -> float: ...
    def __call__(self, states: Any) -> Any:
        """Value on a state (float) or on a batch of states (array).

        Raises
        ------
        InputError
            If the states belong to another structure than the descriptor.
        """
        self._check_origin(states)
        if states.z.ndim == 1:
            return float(self.function(states.z[None], states.p[None])[0])
        return self.function(states.z, states.p)

    def _check_origin(self, states: Any) -> None:
        structure = getattr(states, "structure", None)
        if self.origin is None or structure is None or structure.signature == self.origin:
            return
        raise InputError(
            f"`{self.name}` must be a descriptor of the structure of the state, a "
            f"{structure.kind}; got one of {_kind_of(self.origin)}."
        )

    def __repr__(self) -> str:
        """Name and unit."""
        return f"Descriptor({self.name}, {self.unit})"

    @property
    def _meaning(self) -> Hashable:
        return (self.name, self.function if self.origin is None else self.origin)

    def __eq__(self, other: object) -> bool:
        """Whether both are the same scalar of the same structure."""
        if not isinstance(other, Descriptor):
            return NotImplemented
        return self._meaning == other._meaning

    def __hash__(self) -> int:
        """Return equal numbers for equal descriptors."""
        return hash(self._meaning)

    def __le__(self, bound: float | str) -> "Constraint":
        """Return the constraint that the descriptor stays at or below `bound`.

        A bound may be a text with its unit: ``abs(effort_of(rod, "theta_A")) <= "0.5 N m"``.
        """
        return Constraint(self, "<=", _number(self.name, bound, self.unit))

    def __ge__(self, bound: float | str) -> "Constraint":
        """Return the constraint that the descriptor stays at or above `bound`."""
        return Constraint(self, ">=", _number(self.name, bound, self.unit))

    @remember_call
    def __abs__(self) -> "Descriptor":
        """Return its absolute value, whose minima at zero are kinks."""

        def value(z: Lanes, p: Parameters) -> Values:
            return np.abs(self.function(z, p))

        def both(
            z: Lanes, p: Parameters
        ) -> tuple[Float[np.ndarray, "lanes 2"], Float[np.ndarray, "lanes 2"]]:
            found = self.function(z, p)
            return np.stack([found, -found], axis=1), np.tile([0.0, 1.0], (len(z), 1))

        symbol = f"|{self.symbol or self.name}|"
        return Descriptor(
            f"abs({self.name})", self.unit, value, symbol, self.origin, self.place, both
        )


def _kind_of(origin: Hashable) -> str:
    """Kind of the structure of a signature, in words."""
    try:
        return f"a {json.loads(str(origin))['kind']} with other data"
    except (ValueError, KeyError, TypeError):
        return "another structure"


def _number(name: str, bound: Any, unit: str) -> float:
    if isinstance(bound, str) and QUANTITY.fullmatch(bound):
        bound = in_unit(bound, unit, name)
    number = float(bound) if is_number(bound) and abs(bound) <= LARGEST else np.nan
    if not np.isfinite(number):
        raise InputError(f"`{name}` must be compared with a finite number; got {bound!r}.")
    return number


@check_arguments
@dataclass(frozen=True)
class Constraint:
    """A descriptor held on one side of a bound, which it may exceed by `ease`."""

    descriptor: Descriptor
    sense: Literal["<=", ">="]
    bound: float
    ease: float = 0.0

    def __str__(self) -> str:
        """Return it as it is written."""
        return f"{self.descriptor.name} {self.sense} {self.bound:g}"

    @property
    def event(self) -> str:
        """Kind of the event where a path violates the constraint."""
        vanishing = self.descriptor.vanishing if self.bound == 0.0 else None
        return CONSTRAINT if vanishing is None else vanishing.event

    def criticality(self, z: Lanes, p: Parameters) -> list[str]:
        """Criticality of the event at each state; an empty text where it has none."""
        if self.event == CONSTRAINT or self.descriptor.vanishing is None:
            return [""] * len(z)
        return self.descriptor.vanishing.criticality(z, p)

    @property
    def size(self) -> float:
        """What its excess is compared with: its bound, but at least one."""
        return max(1.0, abs(self.bound))

    def excess(self, z: Lanes, p: Parameters) -> Values:
        """Amount by which states exceed the bound: positive where violated."""
        sign = 1.0 if self.sense == "<=" else -1.0
        return sign * (self.descriptor.function(z, p) - self.bound) - self.ease

    @check_arguments
    def holds(self, states: ManyStates) -> Flags:
        """Whether states obey the constraint."""
        return self.excess(states.z, states.p) <= 0.0


def worst_excess(constraints: Sequence[Constraint], z: Lanes, p: Parameters) -> Values:
    """Largest amount by which states exceed one of the bounds; −∞ without constraints."""
    worst = np.full(len(z), -np.inf)
    for constraint in constraints:
        worst = np.maximum(worst, constraint.excess(z, p))
    return worst


def worst_relative_excess(constraints: Sequence[Constraint], z: Lanes, p: Parameters) -> Values:
    """Largest excess relative to its bound; −∞ without constraints."""
    worst = np.full(len(z), -np.inf)
    for constraint in constraints:
        worst = np.maximum(worst, constraint.excess(z, p) / constraint.size)
    return worst


def are_feasible(
    constraints: Sequence[Constraint], z: Lanes, p: Parameters, slack: float = 0.0
) -> Flags:
    """Which states obey all constraints, up to a slack in units of the descriptors."""
    if len(constraints) == 0:
        return np.ones(len(z), bool)
    good = constraints[0].excess(z, p) <= slack
    for constraint in constraints[1:]:
        good[good] = constraint.excess(z[good], p[good]) <= slack
    return good


@remember_call
@check_arguments
def function_of(
    name: str, function: Callable[..., Any], *descriptors: Descriptor, unit: str = "1"
) -> Descriptor:
    """Function of descriptors: ``function_of("gap", lambda a, b: a - b, one, other)``.

    Parameters
    ----------
    name
        Name of the result, which must differ from those of other descriptors of the structure.
    function
        Function of as many arrays (lanes) as there are descriptors, evaluated entry by entry.
    descriptors
        At least one, of one structure.
    unit
        Its unit.

    Raises
    ------
    InputError
        If there are no descriptors, or they belong to different structures.
    """
    if len({each.origin for each in descriptors}) != 1:
        raise InputError(
            "`descriptors` must be one or more of one structure; got "
            f"{', '.join(each.name for each in descriptors) or 'none'}."
        )

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(function(*(each.function(z, p) for each in descriptors)), dtype=float)

    return Descriptor(name, unit, value, name)


@remember_call
@check_arguments
def largest_of(name: str, *descriptors: Descriptor) -> Descriptor:
    """Largest of several smooth descriptors; its minima, kinks among them, can be found exactly.

    Raises
    ------
    InputError
        As for `function_of`.
    """
    whole = function_of(name, lambda *values: np.max(values, axis=0), *descriptors)
    unit = descriptors[0].unit

    def branches(
        z: Lanes, p: Parameters
    ) -> tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]:
        values = np.stack([each.function(z, p) for each in descriptors], axis=1)
        return values, np.tile(np.arange(float(len(descriptors))), (len(z), 1))

    return Descriptor(name, unit, whole.function, name, branches=branches)


@check_arguments
def ease(constraint: Constraint) -> Constraint:
    """Constraint that rounding does not violate: optima lie on bounds."""
    return replace(constraint, ease=EASE * constraint.size)

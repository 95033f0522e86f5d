"""Bounds of a design: on functions of the variables, and on what questions are answered with."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import as_array, short
from equimorph.arrays import Float, Lanes, Parameters
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.model import Constraint
from equimorph.structures import State, Structure, margin_of
from equimorph.tasks.designing.family import Carried, DesignFamily, Vector, check_names
from equimorph.tasks.designing.pieces import Piece, carry_over, stable_near, value_piece
from equimorph.tasks.designing.questions import Answer, LoadLimit, StateValue, no_answer
from equimorph.tasks.optimising.passes import passes_near
from equimorph.tasks.optimising.programme import Objective, Programme, match_branches, stability
from equimorph.tasks.optimising.sqp import CriticalPoint
from equimorph.tasks.planning.bottlenecks import find_bottleneck
from equimorph.tasks.planning.objectives import Extreme


@check_arguments
@dataclass(frozen=True, eq=False)
class RouteExtreme:
    """Lowest peak, or highest least value, of a descriptor on stable routes between two states.

    Parameters
    ----------
    eset
        Equilibrium set of the structure that the variables start with. For other structures it is
        computed anew, over the same box, grid and constraints.
    start, goal
        Two of its stable states; their parameters stay as they are.
    extreme
        `peak(descriptor)` or `least(descriptor)`.
    within
        Constraints that routes obey in addition to those of the set.
    margin
        Smallest stability margin of routes.
    """

    eset: EquilibriumSet
    start: State
    goal: State
    extreme: Extreme
    within: Sequence[Constraint] = ()
    margin: float = 0.0

    @property
    def states(self) -> tuple[State, ...]:
        """Start and goal."""
        return self.start, self.goal

    @property
    def sign(self) -> float:
        """1 if a peak is made small, −1 if a least value is made large."""
        return self.extreme.sign

    def answer(self, structure: Structure, near: Sequence[State]) -> Answer:
        """By a set over the whole box and the lowest way on it."""
        known = near or (self.start, self.goal)
        ends = [stable_near(structure, each) for each in known]
        if ends[0] is None or ends[1] is None:
            word = "start" if ends[0] is None else "goal"
            return no_answer(f"the {word} of the route is lost or no longer stable")
        start, goal = ends[0], ends[1]
        eset = self.set_of(structure)
        extreme, within = self._on(structure)
        passing = find_bottleneck(eset, (start, goal), extreme, within, self.margin)
        if passing is None:
            return no_answer("no stable route within the constraints is known")
        found = passing.bottleneck
        goal_of = Objective(extreme.descriptor, extreme.sign)
        pieces = [value_piece("start", start, goal_of), value_piece("goal", goal, goal_of)]
        if found.kind == "vertex":
            return no_answer("the peak of the route is known up to the mesh only")
        if passing.point is not None:
            pieces.append(pass_piece(self, structure, passing.point, passing.reach))
        return Answer(found.value, tuple(pieces), self._bounds(start, goal), (start, goal), found)

    def set_of(self, structure: Structure) -> EquilibriumSet:
        """Equilibrium set of a structure over the same box."""
        given = self.eset
        if structure.signature == given.structure.signature:
            return given
        within = carry_over(given.constraints, given.structure, structure)
        return equilibrium_set(
            structure, given.box, fixed=given.fixed, within=within, intervals=given.intervals,
            checks=0,
        )  # fmt: skip

    def _on(self, structure: Structure) -> tuple[Extreme, tuple[Constraint, ...]]:
        return carry_over((self.extreme, tuple(self.within)), self.eset.structure, structure)

    def _bounds(self, start: State, goal: State) -> tuple[Piece, ...]:
        """Excess of both ends over the constraints."""
        structure = start.structure
        all_of = (*self.eset.constraints, *self.within)
        constraints = list(carry_over(all_of, self.eset.structure, structure))
        if self.margin > 0.0:
            constraints.append(margin_of(structure) >= self.margin)
        found = []
        for each in constraints:
            sign = 1.0 if each.sense == "<=" else -1.0
            excess = Objective(each.descriptor, sign)
            found += [
                value_piece(f"{name}: {each}", end, excess, sign * each.bound)
                for name, end in (("start", start), ("goal", goal))
            ]
        return tuple(found)

    def programme(self, structure: Structure) -> Programme:
        """What is made small within which bounds, on the set of a structure."""
        extreme, within = self._on(structure)
        constraints = carry_over(self.eset.constraints, self.eset.structure, structure)
        frame = replace(self.eset, structure=structure, constraints=())
        goal = Objective(extreme.descriptor, extreme.sign)
        return Programme.over(
            frame, goal, (*constraints, *within, stability(structure, self.margin))
        )


def pass_piece(
    question: RouteExtreme, structure: Structure, point: CriticalPoint, reach: float
) -> Piece:
    """Value of a pass of a structure's route, with the gradient of its Lagrangian.

    `reach` is the size of the cells around it, within which it is sought on other structures.
    """
    z, p, rows = point.point.z, point.point.p, point.point.rows
    programme = question.programme(structure)
    own, active = point.binding
    base = programme.objective.branches(z, p)
    setting = programme.setting

    def scalars(made: Structure, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes m"]:
        there = question.programme(made)
        lanes = tuple(np.repeat(each, len(z), axis=0) for each in base)
        values = match_branches((lanes[0], lanes[1]), there.objective.branches(z, p))
        total = values[:, own] @ point.answer.weights[own]
        for k in active:
            bound = there.all[k]
            total += point.answer.multipliers[k] * bound.excess(z, p) / bound.size
        return np.asarray(total[:, None])

    def follow(made: Structure, guess: State) -> Piece | None:
        near = SetPoints(guess.z[None], guess.p[None], rows)
        (found,) = passes_near(question.programme(made), near, np.array([reach]), point)
        return pass_piece(question, made, found[0], reach) if found else None

    tangents = Carried(*split_step(setting, np.ascontiguousarray(point.frames[0])))
    value = np.array([float(point.expansion.f[0, own].max())])
    state = State(setting.structure, z[0], p[0])
    return Piece("pass", state, value, scalars, setting.free, tangents, follow)


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
    """All bounds on functions of the variables: g(x) = 0 and h(x) ≥ 0."""

    family: DesignFamily
    """Family with the variables."""
    bounds: tuple[DesignBound, ...]
    """Bounds on functions."""

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

"""Questions about routes: the lowest peak, or the highest least value, of a descriptor."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.model import Constraint
from equimorph.structures import State, Structure, margin_of
from equimorph.tasks.designing.family import Carried
from equimorph.tasks.designing.pieces import Piece, moved, stable_near, value_piece
from equimorph.tasks.designing.questions import Answer, unanswered
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
            return unanswered(f"the {word} of the route is lost or no longer stable")
        start, goal = ends[0], ends[1]
        eset = self.set_of(structure)
        extreme, within = self._on(structure)
        passing = find_bottleneck(eset, (start, goal), extreme, within, self.margin)
        if passing is None:
            return unanswered("no stable route within the constraints is known")
        found = passing.bottleneck
        goal_of = Objective(extreme.descriptor, extreme.sign)
        pieces = [value_piece("start", start, goal_of), value_piece("goal", goal, goal_of)]
        if found.kind == "vertex":
            return unanswered("the peak of the route is known up to the mesh only")
        if passing.point is not None:
            pieces.append(pass_piece(self, structure, passing.point, passing.reach))
        return Answer(found.value, tuple(pieces), self._bounds(start, goal), (start, goal), found)

    def set_of(self, structure: Structure, checks: int = 0) -> EquilibriumSet:
        """Equilibrium set of a structure over the same box."""
        given = self.eset
        if structure.signature == given.structure.signature:
            return given
        within = moved(given.constraints, given.structure, structure)
        return equilibrium_set(
            structure, given.box, fixed=given.fixed, within=within, intervals=given.intervals,
            checks=checks,
        )  # fmt: skip

    def _on(self, structure: Structure) -> tuple[Extreme, tuple[Constraint, ...]]:
        return moved((self.extreme, tuple(self.within)), self.eset.structure, structure)

    def _bounds(self, start: State, goal: State) -> tuple[Piece, ...]:
        """Excess of both ends over the constraints."""
        structure = start.structure
        all_of = (*self.eset.constraints, *self.within)
        constraints = list(moved(all_of, self.eset.structure, structure))
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
        constraints = moved(self.eset.constraints, self.eset.structure, structure)
        frame = replace(self.eset, structure=structure, constraints=())
        goal = Objective(extreme.descriptor, extreme.sign)
        return Programme.over(
            frame, goal, (*constraints, *within, stability(structure, self.margin))
        )


def pass_piece(
    question: RouteExtreme, structure: Structure, point: CriticalPoint, reach: float
) -> Piece:
    """Value of a pass, with the gradient of its Lagrangian.

    Parameters
    ----------
    question
        The question of the route.
    structure, point
        The structure and its pass.
    reach
        Size of the cells around it, within which it is sought on other structures.
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

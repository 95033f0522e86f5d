"""`solve_shape`: all equilibria of a set whose descriptors take given values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int, Values
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, Level
from equimorph.manifold.complex.equilibrium_set import check_cells
from equimorph.model import NOT_KEPT, Constraint, Descriptor, Schedule, worst_relative_excess
from equimorph.structures import State, States, join_states
from equimorph.tasks.distances import distinct
from equimorph.tasks.optimising.programme import stability
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.route import Route
from equimorph.tasks.shapes.prediction import (
    Predictor,
    best_fits,
    predictor,
    solution_family,
    states_predicted,
)
from equimorph.tasks.stable_part import feasible_vertices, stable_vertices
from equimorph.tolerances import SAME_STATE

AT_EDGE = 1e-9
"""Largest excess of a solution over the box or a constraint, in their units."""
EXACT = 1e-8
"""Misfit, in ranges over the set, below which values are met."""

Rank = Literal["route", "energy", "margin"]


@dataclass(frozen=True, eq=False)
class Shapes:
    """Equilibria at which descriptors take target values.

    Parameters
    ----------
    status
        "solved"; "fitted": there are more descriptors than free parameters and no state meets them
        all; or "refused" with the reason in `why`.
    states
        All solutions, best first: stable ones before unstable ones, then by rank. For fits, the
        local minima of the misfit, the smallest first. For families (fewer descriptors than free
        parameters), the members nearest to the vertices that come nearest; see `solution_family`.
    index
        Negative eigenvalues of each; 0 is stable.
    misfit
        Misfit of each: root of the sum of squared deviations from the targets, in ranges over the
        set.
    routes
        Route to each solution from the start, or the reason of a refusal; empty without a start.
    closest, miss
        Vertex of the set whose descriptors come nearest to the targets, and its distance from
        them; see `nearest` for the exact state.
    unresolved
        Solutions that the discretisation does not resolve; they are left out, and any number more
        may be there. Refine it (`rod.resolving`), or exclude them by a constraint.
    """

    status: Literal["solved", "fitted", "refused"]
    why: str
    states: States
    index: Int[np.ndarray, " lanes"]
    misfit: Values
    routes: tuple[Route, ...]
    closest: State
    miss: Mapping[str, float]
    targets: Float[np.ndarray, " k"]
    within: tuple[Constraint, ...]
    known: Predictor | None = field(default=None, metadata=NOT_KEPT)
    unresolved: int = 0

    def __repr__(self) -> str:
        """Number of solutions, or the reason of a refusal."""
        if self.status == "refused":
            return f"Shapes(refused: {self.why})"
        stable = int(np.sum(self.index == 0))
        return f"Shapes({len(self)} states, {stable} of them stable{self.left_out})"

    @property
    def left_out(self) -> str:
        """Says that solutions were left out, if any were."""
        if not self.unresolved:
            return ""
        return f"; {self.unresolved} left out that the discretisation does not resolve"

    def __len__(self) -> int:
        """Number of solutions."""
        return len(self.states)

    @property
    def solved(self) -> bool:
        """Whether there is a solution."""
        return self.status == "solved"

    @property
    def stable(self) -> States:
        """The stable solutions, best first."""
        mine: States = self.states[self.index == 0]
        return mine

    @cached_property
    def margin(self) -> Values:
        """Stability margin of each solution."""
        return self.states.margin if len(self) else np.zeros(0)

    @property
    def schedule(self) -> Schedule | None:
        """Schedule to the best solution that can be reached from the start, if there is a start."""
        return next((route.schedule for route in self.routes if route.arrived), None)

    @cached_property
    def nearest(self) -> State | None:
        """Stable state within the constraints that comes nearest to the targets."""
        known = self._known
        eset = known.eset
        allowed = feasible_vertices(eset, self.within)
        if not allowed.any():
            allowed = stable_vertices(eset)
        within = (*self.within, stability(eset.structure, 0.0))
        found, _ = best_fits(known, self.targets, within, allowed)
        return found[0] if len(found) else None

    @cached_property
    def family(self) -> Level | None:
        """All states that meet fewer targets than there are free parameters: curves or surfaces.

        None if there are at least as many targets as free parameters.
        """
        known = self._known
        if len(self.targets) >= len(known.eset.names):
            return None
        return solution_family(known, self.targets)

    @property
    def _known(self) -> Predictor:
        if self.known is None:
            raise InputError(
                "`Shapes` must know their set; got some from a file, which does not hold it and "
                "must be solved again."
            )
        return self.known


@check_arguments
def solve_shape(
    eset: EquilibriumSet,
    targets: Mapping[Descriptor, float],
    *,
    within: Sequence[Constraint] = (),
    start: State | None = None,
    rank: Rank | None = None,
) -> Shapes:
    """Find all states of a set at which descriptors take given values.

    Cells over which the linear interpolation of the descriptors comes near the targets predict
    states, which Newton corrects along the set; folds are no obstacle. Where cells predict one of
    two close solutions, the other one follows from it, or from the curve on which both meet
    (`DescriptorChart`). With more descriptors than free parameters the fits of least squares are
    found, with fewer the family of solutions.

    Parameters
    ----------
    eset
        Equilibrium set over the actuators.
    targets
        Descriptors of the structure with their values.
    within
        Constraints that solutions have to obey, in addition to those of the set.
    start
        Stable state from which to plan a route to each stable solution.
    rank
        "route" (shortest first; the default with a start), "energy" (lowest first; the default
        without) or "margin" (largest first).

    Returns
    -------
    The solutions; refused, with the nearest vertex, if none exists.

    Raises
    ------
    InputError
        If there are no targets, a value is not finite, the set is empty, or routes rank solutions
        without a start.
    """
    columns = {each: np.array([value], dtype=float) for each, value in targets.items()}
    return _answers(eset, columns, within, start, rank)[0]


@check_arguments
def solve_shapes(
    eset: EquilibriumSet,
    targets: Mapping[Descriptor, Sequence[float] | Float[np.ndarray, " many"]],
    *,
    within: Sequence[Constraint] = (),
    start: State | None = None,
    rank: Rank | None = None,
) -> tuple[Shapes, ...]:
    """Answer many questions of `solve_shape` at once: values of each descriptor, one per question.

    Tables of the set are kept with it, so that later questions are answered faster.

    Parameters
    ----------
    eset
        Equilibrium set over the actuators.
    targets
        Descriptors of the structure with their values, one per question.
    within
        Constraints that solutions have to obey, in addition to those of the set.
    start
        Stable state from which to plan a route to each stable solution.
    rank
        Order of the solutions; see `solve_shape`.

    Returns
    -------
    The solutions of each question.

    Raises
    ------
    InputError
        As for `solve_shape`, or if numbers of values differ.
    """
    return _answers(eset, targets, within, start, rank)


def _answers(
    eset: EquilibriumSet,
    targets: Mapping[Descriptor, Sequence[float] | Float[np.ndarray, " many"]],
    within: Sequence[Constraint],
    start: State | None,
    rank: Rank | None,
) -> tuple[Shapes, ...]:
    """Solutions of each question; see `solve_shapes`."""
    numbers = _numbers(eset, targets)
    rank = rank or ("energy" if start is None else "route")
    if rank == "route" and start is None:
        raise InputError(
            f"`rank` must be energy or margin, or route if there is a start; got {rank!r}."
        )
    known = predictor(eset, tuple(targets))
    constraints = tuple(dict.fromkeys((*eset.constraints, *within)))
    if numbers.shape[1] > len(eset.names):
        groups, left = [_fit(known, each, constraints) for each in numbers], [0] * len(numbers)
    else:
        groups, left = _solve(known, numbers, constraints)
    index, own = _sort_keys(eset, [own for own, _ in groups], "" if rank == "route" else rank)
    closest, answers = known.closest(numbers), []
    for k, (values, (states, misfit)) in enumerate(zip(numbers, groups, strict=True)):
        routes = [] if start is None else [plan(eset, start, s, within=within) for s in states]
        key = np.nan_to_num([each.length for each in routes], nan=np.inf) if routes else own[k]
        order = np.lexsort((key, index[k], np.where(misfit > EXACT, misfit, 0.0)))
        ways = tuple(routes[i] for i in order) if routes else ()
        found = states[order], index[k][order], misfit[order], ways
        answer = _answer(known, values, constraints, *found, int(closest[k]))
        answers.append(_with_left_out(answer, left[k]))
    return tuple(answers)


def _sort_keys(
    eset: EquilibriumSet, groups: list[States], rank: str
) -> tuple[list[Int[np.ndarray, " lanes"]], list[Values]]:
    """Index of each state of groups, and what is least for the best of each: energy or margin."""
    states = join_states(eset.structure, groups)
    key = np.zeros(len(states))
    if len(states) and rank:
        key = states.energy if rank == "energy" else -states.margin
    index = states.index if len(states) else np.zeros(0, int)
    bounds = [slice(*ends) for ends in pairwise(accumulate(map(len, groups), initial=0))]
    return [index[own] for own in bounds], [key[own] for own in bounds]


def _numbers(
    eset: EquilibriumSet,
    targets: Mapping[Descriptor, Sequence[float] | Float[np.ndarray, " many"]],
) -> Float[np.ndarray, "many k"]:
    if not targets:
        raise InputError("`targets` must give at least one descriptor; got none.")
    if len({np.shape(value) for value in targets.values()}) != 1:
        raise InputError(
            "`targets` must give equally many values of each descriptor; got "
            f"{', '.join(f'{len(v)} of {d.name}' for d, v in targets.items())}."
        )
    check_cells(eset)
    return np.stack([np.asarray(value, dtype=float) for value in targets.values()], axis=1)


def _answer(
    known: Predictor,
    targets: Float[np.ndarray, " k"],
    within: tuple[Constraint, ...],
    states: States,
    index: Int[np.ndarray, " lanes"],
    misfit: Values,
    routes: tuple[Route, ...],
    closest: int,
) -> Shapes:
    """Solutions of one question, in order, with their indices, misfits and routes."""
    gaps = (known.values[closest] - targets).tolist()
    miss = dict(zip([each.name for each in known.descriptors], gaps, strict=True))
    status: Literal["solved", "fitted", "refused"] = "solved"
    if (misfit > EXACT).all():
        status = "fitted" if len(misfit) else "refused"
    why = "" if status == "solved" else _why(known.descriptors, targets, miss)
    vertex = known.eset.points[closest]
    return Shapes(status, why, states, index, misfit, routes, vertex, miss, targets, within, known)


def _with_left_out(answer: Shapes, unresolved: int) -> Shapes:
    """Return the answer with the number of solutions that are not resolved, also in a refusal."""
    answer = replace(answer, unresolved=unresolved)
    return replace(answer, why=answer.why + answer.left_out) if answer.why else answer


def _solve(
    known: Predictor, targets: Float[np.ndarray, "many k"], within: tuple[Constraint, ...]
) -> tuple[list[tuple[States, Values]], list[int]]:
    """Exact solutions of each question in the box and within constraints, each once.

    And how many more there are that the discretisation does not resolve.
    """
    structure, eset, charted = known.eset.structure, known.eset, None
    if targets.shape[1] == len(eset.names) and known.chart is not None:
        charted = known.chart.find(targets)
    states, owner = states_predicted(known, targets, charted)
    if charted is not None:
        owner = np.concatenate([owner, charted.point])
        order = np.argsort(owner, kind="stable")
        states, owner = join_states(structure, [states, charted.states])[order], owner[order]
    allowed = eset.box.holds(states.p[:, known.setting.free], slack=AT_EDGE)
    states, owner = states[allowed], owner[allowed]
    held = worst_relative_excess(within, states.z, states.p) <= AT_EDGE
    states, owner = states[held], owner[held]
    held = known.holds(states)
    states, owner = states[held], owner[held]
    bounds = np.searchsorted(owner, np.arange(len(targets) + 1))
    groups, left = [], []
    for first, last in pairwise(bounds):
        own = states[first:last]
        own = own[distinct(own, SAME_STATE)]
        resolved = own.resolved if len(own) else np.zeros(0, bool)
        left.append(int(np.sum(~resolved)))
        groups.append((own[resolved], np.zeros(int(resolved.sum()))))
    if targets.shape[1] < len(eset.names):
        # the shortest way to a family may leave the box
        groups = [
            group if len(group[0]) else _members(known, values, within)
            for group, values in zip(groups, targets, strict=True)
        ]
    return groups, left


def _members(
    known: Predictor, targets: Float[np.ndarray, " k"], within: tuple[Constraint, ...]
) -> tuple[States, Values]:
    """Members of a family within the box and constraints."""
    states, misfit = _fit(known, targets, within)
    return states[misfit <= EXACT], misfit[misfit <= EXACT]


def _fit(
    known: Predictor, targets: Float[np.ndarray, " k"], within: tuple[Constraint, ...]
) -> tuple[States, Values]:
    """Different fits of least squares."""
    states, misfit = best_fits(known, targets, within)
    kept = distinct(states, SAME_STATE)
    return states[kept], misfit[kept]


def _why(
    descriptors: tuple[Descriptor, ...],
    targets: Float[np.ndarray, " k"],
    miss: Mapping[str, float],
) -> str:
    asked = ", ".join(f"{d.name} = {v:g}" for d, v in zip(descriptors, targets, strict=True))
    gaps = ", ".join(f"{name} by {gap:.3g}" for name, gap in miss.items())
    return f"no state of the set has {asked}; the nearest vertex misses {gaps}"

"""`optimise`: stable states of a set at which an objective is least or largest."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.equilibrium_set import check_cells
from equimorph.manifold.queries.nearest import SetPoints, local_minima, points_at_vertices
from equimorph.model import Constraint, Descriptor, Schedule
from equimorph.structures import State, States, join_states
from equimorph.tasks.distances import distinct
from equimorph.tasks.optimising.certificates import Certificate, certificate
from equimorph.tasks.optimising.dips import vertices_beside_dips
from equimorph.tasks.optimising.feasible_starts import (
    FeasibleStarts,
    feasible_points_in_cells,
    least_violation,
)
from equimorph.tasks.optimising.programme import Objective, Programme, is_stability, stability
from equimorph.tasks.optimising.sqp import CriticalPoint, descend
from equimorph.tasks.optimising.tangent_steps import move_into_box, tangent_planes
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.route import Route
from equimorph.tasks.stable_part import (
    feasible_vertices,
    stable_edges,
    stable_piece,
    stable_values,
    stable_vertices,
)
from equimorph.tasks.start import (
    check_equilibrium,
    check_fixed_parameters,
    check_stable,
    inadmissible,
)
from equimorph.tolerances import FEASIBLE, SAME_SOLUTION

CANDIDATES = 8
"""Local minima over the vertices from which optima are searched."""
STEP_BACK = 1e-3
"""Way back from the stability boundary, in the metric, at which a route to it ends."""

Sense = Literal["min", "max"]


@dataclass(frozen=True, eq=False)
class Optimum:
    """One local optimum.

    Parameters
    ----------
    state, value
        The state, and the objective there.
    certificate
        Optimality conditions at the state.
    route
        Route from the start, if there is a start and a route was requested. A route to the
        stability boundary ends 0.001 (in the metric) before it.
    """

    state: State
    value: float
    certificate: Certificate
    route: Route | None = None

    def __repr__(self) -> str:
        """Value and where it sits."""
        return f"Optimum({self.value:.8g} at {self.state.parameters}: {self.certificate.kind})"


@dataclass(frozen=True, eq=False)
class Optima:
    """The best stable states of a set, with certificates.

    Parameters
    ----------
    status
        "found", or "refused" with the reason in `why`.
    all
        Local optima that were found, the best first.
    states
        States of the local optima.
    """

    status: Literal["found", "refused"]
    why: str
    sense: Sense
    all: tuple[Optimum, ...]
    states: States

    def __repr__(self) -> str:
        """The best optimum, or the reason of a refusal."""
        if self.status == "refused":
            return f"Optima(refused: {self.why})"
        return f"Optima(best of {len(self.all)}: {self.best})"

    def __len__(self) -> int:
        """Number of local optima."""
        return len(self.all)

    @property
    def found(self) -> bool:
        """Whether there is an optimum."""
        return self.status == "found"

    @property
    def best(self) -> Optimum:
        """The best local optimum.

        Raises
        ------
        InputError
            If there is no optimum; check `status` first.
        """
        if not self.found:
            raise InputError(f"`best` needs an optimum; got none: {self.why}.")
        return self.all[0]

    @property
    def margin(self) -> float:
        """Stability margin of the best; zero on the stability boundary; nan if refused."""
        return self.best.state.margin if self.all else np.nan

    @property
    def schedule(self) -> Schedule | None:
        """Schedule that leads to the best optimum, if there is a start."""
        return self.best.route.schedule if self.all and self.best.route else None


@check_arguments
def optimise(  # the knobs of the public face, all by keyword
    eset: EquilibriumSet,
    objective: Descriptor,
    *,
    sense: Sense = "min",
    within: Sequence[Constraint] = (),
    start: State | None = None,
    margin: float = 0.0,
) -> Optima:
    """Find the stable states of a set at which an objective is least (or largest).

    The vertices of the complex that no neighbour beats are starts of sequential quadratic
    programming in coordinates of the tangent spaces, so that every iterate is an equilibrium and
    folds are no obstacle. The least value of a maximum, like max |κ|, is found in its epigraph form
    over all extrema.

    Parameters
    ----------
    eset
        Equilibrium set over the parameters to choose.
    objective
        A descriptor of the set's structure; `function_of` makes new ones.
    sense
        "min" or "max".
    within
        Constraints in addition to those of the set.
    start
        Stable state. If given, only states that can be reached from it without a snap are
        considered, and the route is planned.
    margin
        Smallest stability margin allowed.

    Returns
    -------
    Local optima, the best first, each with its certificate; or the reason of a refusal.

    Raises
    ------
    InputError
        If the sense is unknown, the margin negative, the set empty, or the start not a stable state
        of the set.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> eset = em.equilibrium_set(spring, em.Box(x_l=(0.5, 1.2)), fixed={"F": 0.01})
    >>> flattest = em.optimise(eset, spring.angle, within=[spring.angle >= 0.1])
    >>> flattest.best.certificate.kind
    'stability boundary'
    """
    _check(eset, sense, margin, start)
    sign = 1.0 if sense == "min" else -1.0
    constraints = tuple(dict.fromkeys((*eset.constraints, *within)))
    goal = Objective(objective, sign)
    fault = "" if start is None else inadmissible("start", start, constraints, margin, FEASIBLE)
    if fault:
        return _refusal(fault, sense, eset)
    programme = Programme.over(eset, goal, (*constraints, stability(eset.structure, margin)))
    watched = constraints if margin == 0.0 else (*constraints, programme.constraints[-1])
    ground, least = None, None
    if start is None:
        starts, least = _starts(eset, programme, watched)
    else:
        # those of the set hold on its cells
        further = tuple(each for each in watched if each not in eset.constraints)
        ground = stable_piece(eset, start, further)
        starts = _starts_around(ground, programme, start)
    ends = _optima(programme, descend(programme, starts))
    found = [_optimum(programme, end) for end in ends]
    if start is not None and found:
        goals = [
            move_into_box(eset, _before_the_edge(programme, end) or each.state)
            for end, each in zip(ends, found, strict=True)
        ]
        reached = _first_reachable(eset, ground, start, goals, within, margin)
        if reached is None:
            return _refusal(f"no route was found to {found[0]}", sense, eset)
        number, route = reached
        found = [replace(found[number], route=route), *found[number + 1 :]]
    if not found:
        return _refusal(_nothing(within, least), sense, eset)
    states = join_states(eset.structure, [each.state for each in found])
    return Optima("found", "", sense, tuple(found), states)


def _refusal(why: str, sense: Sense, eset: EquilibriumSet) -> Optima:
    return Optima("refused", why, sense, (), eset.points[:0])


def _check(eset: EquilibriumSet, sense: str, margin: float, start: State | None) -> None:
    check_cells(eset)
    if start is None:
        return
    check_equilibrium("start", start, eset.constraints)
    check_stable("start", start)
    check_fixed_parameters("start", start, eset)


def _nothing(within: Sequence[Constraint], least: FeasibleStarts | None) -> str:
    asked = f" within {', '.join(map(str, within))}" if within else ""
    why = f"no stable optimum{asked} was found"
    if least is None or not np.isfinite(least.least):
        return why
    return f"{why}; the least largest excess over the bounds is {least.least:.3g}"


def _starts(
    eset: EquilibriumSet, programme: Programme, constraints: tuple[Constraint, ...]
) -> tuple[SetPoints, FeasibleStarts | None]:
    """Feasible states, at and between vertices, that no feasible neighbour beats.

    If no state is feasible, the result of the search for the least violation.
    """
    parts = _best_vertices(eset, programme, feasible_vertices(eset, constraints))
    # those of the set hold on its cells
    constraints = tuple(each for each in constraints if each not in eset.constraints)
    if constraints:
        cells = eset.cells[eset.cell_index == 0]
        thin = feasible_points_in_cells(eset, programme, constraints, cells)
        some = programme.objective.values(thin.z, thin.p).argsort(kind="stable")[:CANDIDATES]
        parts = SetPoints.concatenate([parts, thin.take(some)])
        if not len(parts):
            least = least_violation(eset, programme, constraints, cells)
            return least.spots, least
    return parts, None


def _starts_around(ground: EquilibriumSet | None, programme: Programme, start: State) -> SetPoints:
    """Vertices of the feasible piece around the start that no neighbour beats; else the start."""
    if ground is None or not len(ground.cells):
        return SetPoints(
            start.z[None], start.p[None], tangent_planes(programme.setting, start.batch)
        )
    return _best_vertices(ground, programme, stable_vertices(ground))


def _best_vertices(
    eset: EquilibriumSet, programme: Programme, allowed: Bool[np.ndarray, " V"]
) -> SetPoints:
    """Allowed vertices that no allowed neighbour beats, the best first, or beside narrow dips."""
    goal = programme.objective
    value = goal.sign * stable_values(eset, goal.descriptor)
    edges = stable_edges(eset)
    edges = edges[allowed[edges].all(axis=1)]
    alone = np.setdiff1d(np.flatnonzero(allowed), edges)
    both = np.concatenate([local_minima(edges, value), alone])
    best = both[np.argsort(value[both], kind="stable")][:CANDIDATES]
    if goal.kinked:
        best = np.concatenate([best, vertices_beside_dips(eset, programme, allowed, value, best)])
    return points_at_vertices(eset, best)


def _optima(programme: Programme, ends: list[CriticalPoint]) -> list[CriticalPoint]:
    """Different feasible ends, the best first."""
    structure, feasible = programme.setting.structure, list[CriticalPoint]()
    for end in sorted(ends, key=lambda each: float(each.expansion.f.max())):
        stable = structure.index(end.point.z, end.point.p)[0] == 0
        on_edge = any(
            is_stability(c) and abs(e) < FEASIBLE
            for c, e in zip(programme.all, end.expansion.g[0], strict=True)
        )
        if end.expansion.g.max() <= FEASIBLE and (stable or on_edge):
            feasible.append(end)
    if not feasible:
        return []
    points = SetPoints.concatenate([end.point for end in feasible])
    return [feasible[k] for k in distinct(States(structure, points.z, points.p), SAME_SOLUTION)]


def _optimum(programme: Programme, end: CriticalPoint) -> Optimum:
    state = State(programme.setting.structure, end.point.z[0], end.point.p[0])
    value = programme.objective.descriptor(state)
    return Optimum(state, value, certificate(programme, end))


def _first_reachable(
    eset: EquilibriumSet,
    piece: EquilibriumSet | None,
    start: State,
    goals: list[State],
    within: Sequence[Constraint],
    margin: float,
) -> tuple[int, Route] | None:
    """Number of the first goal to which a route leads, with the route; None if no route exists.

    Searched over the whole set, and where a corridor may pass between its vertices, over the
    feasible piece around the start.
    """
    for number, goal in enumerate(goals):
        route = plan(eset, start, goal, within=within, margin=0.99 * margin)
        if not route.arrived and within and piece is not None and len(piece.cells):
            route = plan(piece, start, goal, within=within, margin=0.99 * margin)
        if route.arrived:
            return number, route
    return None


def _before_the_edge(programme: Programme, end: CriticalPoint) -> State | None:
    """State a little inside the stability boundary, if the point is on it."""
    active = np.flatnonzero(np.abs(end.expansion.g[0]) < FEASIBLE)
    on_edge = any(is_stability(programme.all[k]) for k in active)
    inside = end.inside(np.zeros((1, end.frames.shape[1])), np.array([STEP_BACK]))
    there, good = end.beside(programme.setting, inside)
    return there[0] if on_edge and good[0] else None

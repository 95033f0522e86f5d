"""`optimise`: stable states of a set at which an objective is least or largest."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria import check_start, newton
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.nearest import local_minima
from equimorph.model import Constraint, Descriptor, Schedule
from equimorph.structures import State, States
from equimorph.tasks.optimising.certificates import Certificate, certificate
from equimorph.tasks.optimising.descent import Settled, descend
from equimorph.tasks.optimising.objectives import Objective
from equimorph.tasks.optimising.plane import Spots, plane_of, settled, spots_of, stepped
from equimorph.tasks.optimising.programme import Programme
from equimorph.tasks.optimising.stability import is_stability, stability
from equimorph.tasks.planning import plan
from equimorph.tasks.prepared import (
    feasible_vertices,
    pieces_of_vertices,
    stable_edges,
    stable_vertices,
    vertex_values,
)
from equimorph.tasks.route import Route

CANDIDATES = 8
"""Local minima over the vertices from which optima are searched."""
SAME = 1e-5
"""Distance in the metric and scaled parameters below which two optima are one."""
VIOLATED = 1e-7
"""Relative excess over a bound with which a point is no optimum."""
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
        Why it is one.
    route
        Way to it from the start, if there is a start and it was looked for. To the stability
        boundary it ends 0.001 (in the metric) before.
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
    """Answer to "which stable state is best".

    Parameters
    ----------
    status
        "found", or "refused" with the reason in `why`.
    all
        Local optima that were found, the best first.
    """

    status: Literal["found", "refused"]
    why: str
    sense: Sense
    all: tuple[Optimum, ...]

    def __repr__(self) -> str:
        """The best, or why there is none."""
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
        """The best one."""
        return self.all[0]

    @property
    def states(self) -> States:
        """States of all optima."""
        each = [optimum.state.batch for optimum in self.all]
        z, p = np.concatenate([one.z for one in each]), np.concatenate([one.p for one in each])
        return States(self.best.state.structure, z, p)

    @property
    def margin(self) -> float:
        """Stability margin of the best; zero on the stability boundary."""
        return self.best.state.margin

    @property
    def schedule(self) -> Schedule | None:
        """How to get to the best one, if there is a start."""
        return self.best.route.schedule if self.best.route else None


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
    objective
        A descriptor of the set's structure; make others by `combined`.
    sense
        "min" or "max".
    within
        Constraints, beside those of the set.
    start
        Stable state: only what can be reached from it without a snap counts, and the route is
        planned.
    margin
        Smallest stability margin allowed.

    Returns
    -------
    Local optima, the best first, each with its certificate; or why there is none.

    Raises
    ------
    InputError
        For an unknown sense, a negative margin, an empty set, or a start that is no stable state of
        the set.

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
    fault = "" if start is None else _violation(start, constraints, margin)
    if fault:
        return Optima("refused", fault, sense, ())
    programme = Programme.over(eset, goal, (*constraints, stability(eset.structure, margin)))
    starts = _starts(eset, programme, _watched(programme, constraints, margin), start)
    ends = _optima(programme, descend(programme, spots_of(eset, starts)))
    found = [_optimum(programme, end) for end in ends]
    if start is not None:
        pairs = list(zip(ends, found, strict=True))
        found = _reached(eset, programme, start, (within, margin), pairs)
    if not found:
        return Optima("refused", _nothing(start, within), sense, ())
    return Optima("found", "", sense, tuple(found))


def _check(eset: EquilibriumSet, sense: str, margin: float, start: State | None) -> None:
    if sense not in ("min", "max"):
        raise InputError(f"`sense` must be min or max; got {sense!r}.")
    if not margin >= 0.0:
        raise InputError(f"`margin` must be a number >= 0; got {margin!r}.")
    if not len(eset.cells):
        raise InputError("`eset` must have cells; got an empty set.")
    if start is None:
        return
    try:
        check_start(start, eset.constraints)
    except InputError as error:
        raise InputError(str(error).replace("`state`", "`start`")) from None
    if not start.stable:
        raise InputError(f"`start` must be stable; got index {start.index}.")
    wanted = eset.parameters_at({name: start[name] for name in eset.names})
    if not np.allclose(wanted, start.p, rtol=0, atol=1e-9):
        raise InputError(
            f"`start` must have the fixed parameters of the set ({dict(eset.fixed)}); "
            f"got {start.parameters}."
        )


def _nothing(start: State | None, within: Sequence[Constraint]) -> str:
    where = "" if start is None else " that can be reached from the start without a snap"
    asked = f" within {', '.join(map(str, within))}" if within else ""
    return f"no stable optimum{asked}{where} was found"


def _violation(start: State, constraints: tuple[Constraint, ...], margin: float) -> str:
    """Why a start is outside what is allowed, if it is."""
    for constraint in constraints:
        if not constraint.excess(start.z[None], start.p[None])[0] <= VIOLATED:
            value = constraint.descriptor(start)
            return f"the start violates {constraint}: {constraint.descriptor.name} = {value:.6g}"
    if margin > 0.0 and start.margin < margin:
        return f"the start has a stability margin of {start.margin:.4g}, below {margin:g}"
    return ""


def _same_piece(
    eset: EquilibriumSet,
    piece: Int[np.ndarray, " V"],
    allowed: Bool[np.ndarray, " V"],
    start: State,
) -> Bool[np.ndarray, " V"]:
    """Vertices on the piece of the start: that of the cell below it, or of the nearest vertex."""
    here = eset.over(**{name: np.array([start[name]]) for name in eset.names})
    n, mass = eset.structure.unknowns, eset.structure.mass
    gap = (here.states.z - start.z)[:, :n] ** 2 @ mass
    cell = int(here.cell[gap.argmin()]) if len(gap) else -1
    corners = eset.cells[cell] if cell >= 0 else np.zeros(0, int)
    corners = corners[allowed[corners]]
    if len(corners) == 0:
        some = np.flatnonzero(allowed)
        away = (eset.points.z[some] - start.z)[:, :n] ** 2 @ mass
        away += (((eset.points.p[some] - start.p) / eset.structure.scales) ** 2).sum(axis=1)
        corners = some[[away.argmin()]] if len(some) else some
    return np.isin(piece, piece[corners])


def _watched(
    programme: Programme, constraints: tuple[Constraint, ...], margin: float
) -> tuple[Constraint, ...]:
    """Constraints for the vertices, all of which are stable."""
    return constraints if margin == 0.0 else (*constraints, programme.constraints[-1])


def _starts(
    eset: EquilibriumSet,
    programme: Programme,
    constraints: tuple[Constraint, ...],
    start: State | None,
) -> Int[np.ndarray, " n"]:
    """Allowed vertices that no allowed neighbour beats, the best first.

    Where no vertex is allowed, those that violate the constraints least.
    """
    goal = programme.objective
    allowed = feasible_vertices(eset, constraints)
    value = goal.sign * vertex_values(eset, goal.descriptor)
    if start is not None:
        allowed &= _same_piece(eset, pieces_of_vertices(eset, allowed), allowed, start)
    if not allowed.any():
        allowed = stable_vertices(eset)
        value = np.sum([_excess(eset, each) for each in constraints], axis=0)
    edges = stable_edges(eset)
    edges = edges[allowed[edges].all(axis=1)]
    alone = np.setdiff1d(np.flatnonzero(allowed), edges)
    both = np.concatenate([local_minima(edges, value), alone])
    return np.asarray(both[np.argsort(value[both], kind="stable")][:CANDIDATES])


def _excess(eset: EquilibriumSet, constraint: Constraint) -> Float[np.ndarray, " V"]:
    """Relative violation of a constraint at the vertices."""
    sign = 1.0 if constraint.sense == "<=" else -1.0
    over = sign * (vertex_values(eset, constraint.descriptor) - constraint.bound)
    return np.asarray(np.maximum(over, 0.0) / max(1.0, abs(constraint.bound)))


def _optima(programme: Programme, ends: list[Settled]) -> list[Settled]:
    """Different feasible ends, the best first."""
    setting, kept = programme.setting, []
    places: list[Float[np.ndarray, " coordinates"]] = []
    for end in sorted(ends, key=lambda each: float(each.expansion.f.max())):
        stable = programme.setting.structure.index(end.spot.z, end.spot.p)[0] == 0
        on_edge = any(
            is_stability(c) and abs(e) < VIOLATED
            for c, e in zip(programme.all, end.expansion.g[0], strict=True)
        )
        if end.expansion.g.max() > VIOLATED or not (stable or on_edge):
            continue
        u = end.spot.z[0, : setting.structure.unknowns] * np.sqrt(setting.structure.mass)
        place = np.concatenate([u, end.spot.p[0] / setting.structure.scales])
        if all(np.linalg.norm(place - other) > SAME for other in places):
            places.append(place)
            kept.append(end)
    return kept


def _optimum(programme: Programme, end: Settled) -> Optimum:
    state = State(programme.setting.structure, end.spot.z[0], end.spot.p[0])
    value = programme.objective.descriptor(state)
    return Optimum(state, value, certificate(programme, end))


def _reached(
    eset: EquilibriumSet,
    programme: Programme,
    start: State,
    demands: tuple[Sequence[Constraint], float],
    found: list[tuple[Settled, Optimum]],
) -> list[Optimum]:
    """Optima from the first on to which a route leads."""
    within, margin = demands
    for number, (end, optimum) in enumerate(found):
        goal = _in_the_box(eset, _before_the_edge(programme, end) or optimum.state)
        route = plan(eset, start, goal, within=within, margin=0.99 * margin)
        if route.arrived:
            first = Optimum(optimum.state, optimum.value, optimum.certificate, route)
            return [first, *(other for _, other in found[number + 1 :])]
    return []


def _before_the_edge(programme: Programme, end: Settled) -> State | None:
    """State a little inside the stability boundary, if the point is on it.

    Inside all bounds that are active there, so that none is violated on the way back.
    """
    active = np.flatnonzero(np.abs(end.expansion.g[0]) < VIOLATED)
    if not any(is_stability(programme.all[k]) for k in active):
        return None
    slopes = end.expansion.g_slope[0, active]
    slopes = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-300)
    step, *_ = np.linalg.lstsq(slopes, np.full(len(active), -STEP_BACK), rcond=1e-6)
    spot = Spots(end.spot.z, end.spot.p, end.spot.rows)
    guess = stepped(programme.setting, spot, end.frames, step[None])
    there, good = settled(programme.setting, *guess, spot.rows)
    return State(programme.setting.structure, there.z[0], there.p[0]) if good[0] else None


def _in_the_box(eset: EquilibriumSet, state: State) -> State:
    """State whose parameters do not exceed the box by rounding."""
    box, free = eset.box, plane_of(eset).free
    p = state.p.copy()
    p[free] = np.clip(p[free], box.lower, box.upper)
    z, good = newton(state.structure, state.z[None], p[None])
    return State(state.structure, z[0], p) if good[0] else state

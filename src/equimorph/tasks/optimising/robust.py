"""`robust_optimum`: the state that is best in the worst case over a box, and its price."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.equilibria import Ray, least_room, rays_of, worst_on_lattice
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, States
from equimorph.tasks.optimising.certificates import Certificate, certificate
from equimorph.tasks.optimising.optimum import Optimum, Sense, optimise
from equimorph.tasks.optimising.programme import Objective, Programme, stability
from equimorph.tasks.optimising.sqp import CriticalPoint, descend
from equimorph.tasks.optimising.tangent_steps import tangent_planes
from equimorph.tolerances import FEASIBLE

Branches = Float[np.ndarray, "lanes m"]

ROOMS = (1.1, 1.02, 1.005, 1.001)
"""Shares of the box around which it is stable in the first searches; values at the very edge have
no slopes."""
EXCHANGES = 7
"""Searches for an optimum: what each of them overlooks in the box joins the next one."""
FINER = 2
"""Factor on the intervals of the lattice by which a worst case is judged."""
NEW = 1e-3
"""Distance in half widths from known points on the sides of the box above which one is new."""
OTHERWHERE = 1e6
"""Place of the branch of a point that is no corner, far from all others."""
BEYOND = 1e-6
"""Worst value, relative to the values over the box, and share of the way to a side, by which a
judgement may differ."""


@dataclass(frozen=True, eq=False)
class RobustOptimum:
    """The stable state with the best guaranteed value under imperfections.

    Parameters
    ----------
    status
        "found": nothing worse was found in the box around the state, and no better state, from the
        vertices of the set and from dips between them that their slopes show; "refused" with the
        reason in `why`; or "not converged": the worst case is that of
        the state, but after all exchanges the box still held what the search for the state had
        overlooked, so that others may be better.
    offsets
        The box of imperfections, by parameter.
    nominal
        The best state without imperfections.
    state
        The robust state; None if refused.
    value
        The objective there, without imperfections.
    guaranteed
        Its worst value over the box. At the edge of stability the least upper bound: the limit from
        inside.
    at_risk
        Worst value over the box around the nominal optimum; infinite if stability is lost.
    edge
        Point on the side of the box, often a corner, at which the robust state is just about to
        lose its stability: offsets in half widths of the box, by parameter; empty if there is none.
    exchanges
        Searches for the state, each with what the one before had overlooked in the box.
    certificate
        Optimality conditions at the state.
    """

    status: Literal["found", "refused", "not converged"]
    why: str
    sense: Sense
    offsets: Mapping[str, float]
    nominal: Optimum | None = None
    state: State | None = None
    value: float = np.nan
    guaranteed: float = np.nan
    at_risk: float = np.nan
    edge: Mapping[str, float] | None = None
    certificate: Certificate | None = None
    exchanges: int = 0

    def __repr__(self) -> str:
        """Nominal and robust values, and the price."""
        if self.status == "refused":
            return f"RobustOptimum(refused: {self.why})"
        edge = "; at the edge of stability" if self.edge else ""
        edge += f"; not converged: {self.why}" if self.status == "not converged" else ""
        return (
            f"RobustOptimum(guaranteed {self.guaranteed:.8g} against {self.at_risk:.8g}; "
            f"price {self.price:.6g}{edge})"
        )

    @property
    def found(self) -> bool:
        """Whether there is a robust optimum."""
        return self.status == "found"

    @property
    def price(self) -> float:
        """Loss against the nominal optimum if there is no imperfection."""
        return np.nan if self.nominal is None else abs(self.value - self.nominal.value)

    @property
    def states(self) -> States | None:
        """The robust state, as a batch."""
        return None if self.state is None else self.state.batch

    @property
    def margin(self) -> float:
        """Stability margin of the robust state without imperfections."""
        return np.nan if self.state is None else self.state.margin


@check_arguments
def robust_optimum(
    eset: EquilibriumSet,
    objective: Descriptor,
    offsets: Mapping[str, float],
    *,
    sense: Sense = "min",
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
) -> RobustOptimum:
    """Find the stable state whose worst case over a box of imperfections is best.

    The worst case is the largest over the whole box, inside and on its sides (see `worst_over`). It
    is infinite where stability is lost on the way, so that an optimum may lie where the box touches
    the edge of stability. There, the fraction of the way at which stability is lost is smooth, and
    so is the limit of the objective from inside; both determine the optimum on the edge exactly.

    The first search knows the corners of the box alone. Each optimum is judged
    [BlankenshipFalk1976]_: its worst case is searched for from a lattice twice as fine, and the way
    on which stability is lost first among all that lead through the sides. What is worse than the
    search had found joins it, and the optimum is searched for again.

    Parameters
    ----------
    eset
        Equilibrium set over the parameters to choose.
    objective
        A descriptor of the set's structure.
    offsets
        Largest errors of parameters, by name: actuators, loads or others.
    sense
        "min" or "max".
    within
        Constraints in addition to those of the set; they hold without imperfections.
    margin
        Smallest stability margin allowed without imperfections.

    Returns
    -------
    Nominal and robust optimum, the guaranteed value, and the price; or the reason of a refusal.

    Raises
    ------
    InputError
        As for `optimise` and `worst_over`.

    References
    ----------
    [BlankenshipFalk1976]_

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> eset = em.equilibrium_set(spring, em.Box(x_l=(0.5, 1.2)), fixed={"F": 0.01})
    >>> angle = spring.angle
    >>> flat = em.robust_optimum(eset, angle, {"F": 0.005}, within=[angle >= 0.1])
    >>> round(flat.nominal.value, 4), round(flat.value, 4), round(flat.guaranteed, 4)
    (0.2171, 0.3569, 0.3974)
    """
    nominal = optimise(eset, objective, sense=sense, within=within, margin=margin)
    if not nominal.found:
        return RobustOptimum("refused", nominal.why, sense, dict(offsets))
    cost = objective if sense == "min" else _negative(objective)
    question = _Question(eset, cost, dict(offsets), tuple(within), margin)
    kept: _Judged | None = None
    searches = 0
    for _ in range(EXCHANGES):
        searches += 1
        best, refusal = _best(question)
        if best is None and kept is None:
            return RobustOptimum("refused", refusal, sense, dict(offsets), nominal.best)
        if best is None:
            break
        judged = _judge(question, best)
        if kept is None or kept.why or judged.worst < kept.worst:
            kept = judged
        elif not judged.why:
            break
        if judged.further is question:
            break
        question = judged.further
    assert kept is not None
    sign, end = (1.0 if sense == "min" else -1.0), kept.end
    at_risk = _worst_around(question.judge, nominal.best.state)
    return RobustOptimum(
        "not converged" if kept.why else "found", kept.why, sense, dict(offsets), nominal.best,
        end.state, objective(end.state), sign * kept.worst, sign * at_risk, end.edge,
        end.certificate, searches,
    )  # fmt: skip


@dataclass(frozen=True)
class _Question:
    """What is asked, the lattice of the box, and points on its sides besides the corners.

    The first search knows the corners alone: its optimum, if the judgement finds nothing worse in
    the box, is that of the whole box, whose worst case nowhere is less.
    """

    eset: EquilibriumSet
    cost: Descriptor
    offsets: Mapping[str, float]
    within: tuple[Constraint, ...]
    margin: float
    finer: int = 0
    further: tuple[Float[np.ndarray, " k"], ...] = ()

    @cached_property
    def worst(self) -> Descriptor:
        """Worst case over the box."""
        return worst_on_lattice(self.eset.structure, self.cost, self.offsets, "max", self.finer)

    @cached_property
    def judge(self) -> "_Question":
        """The same over a finer lattice."""
        return replace(self, finer=FINER * max(1, self.finer))

    @cached_property
    def rays(self) -> tuple[Ray, ...]:
        """Ways through the sides of the box."""
        return rays_of(self.eset.structure, self.cost, self.offsets, self.further)


def _best(question: _Question) -> tuple["_End | None", str]:
    """The best state, inside or where the box touches the edge of stability; or why none."""
    best, why = None, ""
    for room in ROOMS:
        rooms = [ray.room >= room for ray in question.rays]
        within = (*question.within, *rooms)
        found = optimise(question.eset, question.worst, within=within, margin=question.margin)
        why = why or found.why
        for each in found.all:
            ends = [_inner(each), *_on_edges(question, each, room)]
            best = min([*ends, *([best] if best else [])], key=lambda one: one.worst)
        if best is not None and not best.bound:
            break
    return best, why


@dataclass(frozen=True)
class _Judged:
    """A candidate, its worst case over the box, what the search overlooked, and how to go on."""

    end: "_End"
    worst: float
    why: str
    further: _Question


def _worst_around(question: _Question, state: State) -> float:
    """Worst case over the box around a state, ∞ where a way through its sides is not stable."""
    share, _ = least_room(state, question.offsets)
    return np.inf if share < 1.0 else question.worst(state)


def _judge(question: _Question, best: "_End") -> _Judged:
    """Search the box around a candidate again, from a finer lattice and over all its sides."""
    judge = question.judge
    branches = _at_edge(judge, best.ray).branches if best.edge else judge.worst.branches
    assert branches is not None
    values = branches(best.state.z[None], best.state.p[None])[0][0]
    worst = max(float(values.max()), best.worst)
    size = float(np.abs(values[np.isfinite(values)]).max(initial=1e-300))
    share, end = least_room(best.state, question.offsets)
    known = [
        np.abs(np.abs(end) - 1.0).max(),
        *(np.abs(end - each).max() for each in question.further),
    ]
    beside = replace(question, further=(*question.further, end))
    if share < 1.0 - BEYOND:
        widths = np.array(list(question.offsets.values()))
        text = ", ".join(
            f"{name} {value:+.6g}"
            for name, value in zip(question.offsets, (end * widths).tolist(), strict=True)
        )
        why = f"stability is lost at {share:.6g} of the way to {text}"
        return _Judged(best, np.inf, why, beside)
    if worst > best.worst + BEYOND * size:
        why = f"the worst case is {worst:.8g}, not {best.worst:.8g}"
        return _Judged(best, worst, why, replace(question, finer=max(1, FINER * question.finer)))
    # searches end where stability is about to be lost on a way that they do not know
    halted = not best.edge and share < ROOMS[0] and min(known) > NEW
    return _Judged(best, worst, "", beside if halted else question)


@dataclass(frozen=True)
class _End:
    """A candidate; `bound`: whether the required room binds, or it would be better off the edge.

    ray: number of the way at whose point on the side it is about to lose its stability.
    """

    state: State
    worst: float
    edge: Mapping[str, float]
    certificate: Certificate
    bound: bool
    ray: int = -1


def _inner(found: Optimum) -> _End:
    bound = any(name.startswith("room(") for name in found.certificate.active)
    return _End(found.state, found.value, {}, found.certificate, bound)


def _on_edges(question: _Question, near: Optimum, room: float) -> list[_End]:
    """Optima at which points on the sides of the box are critical, from one close to that."""
    ends = []
    for number, ray in enumerate(question.rays):
        if ray.room(near.state) > room + 1e-4:
            continue
        programme = _edge_programme(question, number)
        state = near.state
        start = SetPoints(
            state.z[None], state.p[None], tangent_planes(programme.setting, state.batch)
        )
        ends += [
            _edge(programme, ray, number, end)
            for end in descend(programme, start)
            if end.converged and end.expansion.g.max() <= FEASIBLE
        ]
    return ends


def _edge_programme(question: _Question, number: int) -> Programme:
    """Least worst case while one point on the sides is critical: values there are limits."""
    eset, rays = question.eset, question.rays
    rules = [ray.room >= 1.0 for ray in rays]
    rules.append(rays[number].room <= 1.0)
    constraints = dict.fromkeys((*eset.constraints, *question.within, *rules))
    own = (*constraints, stability(eset.structure, question.margin))
    return Programme.over(eset, Objective(_at_edge(question, number), 1.0), own)


def _at_edge(question: _Question, number: int) -> Descriptor:
    """Worst case with the limit of the value at a point on the sides, instead of the value."""
    ray, branches = question.rays[number], question.worst.branches
    corners = 2 ** len(question.offsets)
    assert branches is not None

    def each(z: Lanes, p: Parameters) -> tuple[Branches, Branches]:
        values, places = branches(z, p)
        limit = ray.limit.function(z, p)
        values = values.copy()
        for other in range(corners):  # mirror images are critical together
            lost = np.isposinf(values[:, 1 + other])
            edge = lost & (question.rays[other].room.function(z, p) >= 1.0 - BEYOND)
            values[edge, 1 + other] = question.rays[other].limit.function(z, p)[edge]
        if number < corners:
            values[:, 1 + number] = limit
            return values, places
        place = np.full((len(z), 1), OTHERWHERE)
        return np.hstack([values, limit[:, None]]), np.hstack([places, place])

    return replace(
        question.worst,
        name=f"{question.worst.name} at its edge",
        function=lambda z, p: each(z, p)[0].max(axis=1),
        branches=each,
    )


def _edge(programme: Programme, ray: Ray, number: int, end: CriticalPoint) -> _End:
    state = State(programme.setting.structure, end.point.z[0], end.point.p[0])
    found = certificate(programme, end)
    rules = ray.room >= 1.0, ray.room <= 1.0
    outward, inward = (found.active.get(str(rule), 0.0) for rule in rules)
    held = outward > inward + BEYOND * max(found.active.values(), default=0.0)
    return _End(state, float(end.expansion.f.max()), ray.offsets, found, not held, number)


def _negative(descriptor: Descriptor) -> Descriptor:
    """Negative of a descriptor, to be made small."""

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(-descriptor.function(z, p))

    name, origin = f"-{descriptor.name}", descriptor.origin
    return Descriptor(name, descriptor.unit, value, name, origin)

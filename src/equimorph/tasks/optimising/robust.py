"""`robust_optimum`: the state that is best in the worst case over a box, and its price."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.equilibria import Corner, corners_of, worst_over
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

ROOMS = (1.1, 1.02, 1.005)
"""Shares of the box around which it is stable in the first searches; values at the very edge have
no slopes."""


@dataclass(frozen=True, eq=False)
class RobustOptimum:
    """The stable state with the best guaranteed value under imperfections.

    Parameters
    ----------
    status
        "found", or "refused" with the reason in `why`.
    offsets
        The box of imperfections, by parameter.
    nominal
        The best state without imperfections.
    state
        The robust state; None if refused.
    value
        The objective there, without imperfections.
    guaranteed
        Its worst value at the state and at the corners of the box; inside the box an objective that
        turns there, like a square about a target, may be worse. At the edge of stability the least
        upper bound: the limit from inside.
    at_risk
        Worst value over the box around the nominal optimum; infinite if stability is lost.
    edge
        Corner of the box at which the robust state is just about to lose its stability, by
        parameter; empty if there is no such corner.
    certificate
        Optimality conditions at the state.
    """

    status: Literal["found", "refused"]
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

    def __repr__(self) -> str:
        """Nominal and robust values, and the price."""
        if self.status == "refused":
            return f"RobustOptimum(refused: {self.why})"
        edge = "; at the edge of stability" if self.edge else ""
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

    The worst case is taken over the state and the corners of the box, to which it is lifted along
    straight lines (see `worst_over`). It is infinite where stability is lost on the way, so that an
    optimum may lie where the box touches the edge of stability. There, the fraction of the way at
    which stability is lost is smooth, and so is the limit of the objective from inside; both
    determine the optimum on the edge exactly.

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
    worst = worst_over(eset.structure, cost, offsets)
    corners = corners_of(eset.structure, cost, offsets)
    question = _Question(eset, worst, corners, tuple(within), margin)
    best, why = None, ""
    for room in ROOMS:
        rooms = [corner.room >= room for corner in corners]
        found = optimise(eset, worst, within=(*within, *rooms), margin=margin)
        why = why or found.why
        for each in found.all:
            ends = [_inner(each), *_on_edges(question, each, room)]
            best = min([*ends, *([best] if best else [])], key=lambda one: one.worst)
        if best is not None and not best.bound:
            break
    if best is None:
        return RobustOptimum("refused", why, sense, dict(offsets), nominal.best)
    sign = 1.0 if sense == "min" else -1.0
    return RobustOptimum(
        "found", "", sense, dict(offsets), nominal.best, best.state, objective(best.state),
        sign * best.worst, sign * worst(nominal.best.state), best.edge, best.certificate,
    )  # fmt: skip


@dataclass(frozen=True)
class _Question:
    eset: EquilibriumSet
    worst: Descriptor
    corners: tuple[Corner, ...]
    within: tuple[Constraint, ...]
    margin: float


@dataclass(frozen=True)
class _End:
    """A candidate; `bound`: whether the required room binds, and not the edge."""

    state: State
    worst: float
    edge: Mapping[str, float]
    certificate: Certificate
    bound: bool


def _inner(found: Optimum) -> _End:
    bound = any(name.startswith("room(") for name in found.certificate.active)
    return _End(found.state, found.value, {}, found.certificate, bound)


def _on_edges(question: _Question, near: Optimum, room: float) -> list[_End]:
    """Optima at which corners of the box are critical, from one that is close to that."""
    ends = []
    for number, corner in enumerate(question.corners):
        if corner.room(near.state) > room + 1e-4:
            continue
        programme = _edge_programme(question, number)
        state = near.state
        start = SetPoints(
            state.z[None], state.p[None], tangent_planes(programme.setting, state.batch)
        )
        ends += [
            _edge(programme, corner, end)
            for end in descend(programme, start)
            if end.converged and end.expansion.g.max() <= FEASIBLE
        ]
    return ends


def _edge_programme(question: _Question, number: int) -> Programme:
    """Least worst case while one corner is critical: values there are limits."""
    eset, corners = question.eset, question.corners
    edge = corners[number]
    rules = [corner.room >= 1.0 for corner in corners]
    rules.append(edge.room <= 1.0)
    constraints = dict.fromkeys((*eset.constraints, *question.within, *rules))
    own = (*constraints, stability(eset.structure, question.margin))
    branches = question.worst.branches
    assert branches is not None

    def each(z: Lanes, p: Parameters) -> tuple[Branches, Branches]:
        values, places = branches(z, p)
        values = values.copy()
        values[:, 1 + number] = edge.limit.function(z, p)
        return values, places

    goal = replace(
        question.worst,
        name=f"{question.worst.name} at its edge",
        function=lambda z, p: each(z, p)[0].max(axis=1),
        branches=each,
    )
    return Programme.over(eset, Objective(goal, 1.0), own)


def _edge(programme: Programme, corner: Corner, end: CriticalPoint) -> _End:
    state = State(programme.setting.structure, end.point.z[0], end.point.p[0])
    found = certificate(programme, end)
    return _End(state, float(end.expansion.f.max()), corner.offsets, found, False)


def _negative(descriptor: Descriptor) -> Descriptor:
    """Negative of a descriptor, to be made small."""

    def value(z: Lanes, p: Parameters) -> Values:
        return np.asarray(-descriptor.function(z, p))

    name, origin = f"-{descriptor.name}", descriptor.origin
    return Descriptor(name, descriptor.unit, value, name, origin)

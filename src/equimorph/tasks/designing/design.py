"""`design`: the structure of a family for which a task goes best; `design_front`: trade-offs.

See docs/decisions.md, "Designs are judged by rebuilt sets".
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import short
from equimorph.argument_vocabulary import count
from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.structures import State, Structure
from equimorph.tasks.designing.bounds import Asked, DesignBound
from equimorph.tasks.designing.family import Bounds, DesignFamily
from equimorph.tasks.designing.search import (
    DesignProblem,
    DesignSearch,
    DesignStatus,
    DesignStep,
    Judged,
)

EQUILIBRIUM = 1e-6
"""Residual up to which states are equilibria."""


@dataclass(frozen=True, eq=False)
class Design:
    """A structure of a family, and how it was found.

    Parameters
    ----------
    status
        "found": no better design nearby, to first order, up to the tolerance; "stalled": rebuilt
        designs no longer gain what their gradients promise; "infeasible": no design within all
        bounds was reached; "undefined start": the question has no answer for the start; "budget
        spent": `rebuilds` were used up.
    why
        Reason for a status other than "found".
    variables, structure
        The last accepted design.
    value
        What the question is answered with there, after a full rebuild.
    found
        For each objective the limit load, the state, or the bottleneck of the route.
    active
        What determines the value: kinds of the states that have it, and bounds that are met.
    history
        Accepted designs, the first of which is the start.
    rebuilds
        Designs that were judged, accepted or not.
    """

    status: DesignStatus
    why: str
    variables: Mapping[str, Any]
    structure: Structure
    value: float
    found: tuple[Any, ...] = ()
    active: tuple[str, ...] = ()
    history: tuple[DesignStep, ...] = ()
    rebuilds: int = 0

    def __repr__(self) -> str:
        """Status and value, or why there is none."""
        if not self.history:
            return f"Design({self.status}: {self.why})"
        first = self.history[0].value
        return f"Design({self.status}: {self.value:.8g} from {first:.6g}; {self.rebuilds} rebuilds)"


@check_arguments
def design(
    family: Callable[..., Structure],
    variables: Bounds,
    objective: Asked | Sequence[Asked],
    within: Sequence[DesignBound] = (),
    *,
    tolerance: float = 1e-5,
    rebuilds: int = 60,
) -> Design:
    """Choose the structure of a family with the best limit load, route or state.

    The values of exact folds, states and passes are followed by the variables, with exact
    gradients; SLSQP moves the worst of them within a trust region. Each design is then judged by a
    full rebuild: the path to the limit load again, or the whole set over the box (without the
    independent search for what it lacks) and the lowest way on it. What it gets worse by than the
    model is shrinks the trust region; what counts there joins the model.

    Parameters
    ----------
    family
        Structure of the variables, by their names: ``lambda B, k: Rod(stiffness=[[0, B], ...])``.
        All have the same unknowns and parameters, so that nodes of tables stay where they are; it
        is asked for variables slightly beyond their bounds, too.
    variables
        Bounds (low, high) of each variable, with the value to start from as a third entry; without
        it the middle. Arrays are bounds of an array.
    objective
        `LoadLimit`, `RouteExtreme` or `StateValue`, of the structure at the start; or several, all
        made small or all large, of which the worst one counts.
    within
        Bounds on functions of the variables, like the volume, and on other questions.
    tolerance
        Relative change of the value that counts as none; positive.
    rebuilds
        Most designs that are judged.

    Returns
    -------
    A locally best design, or how far it came and why not further.

    Raises
    ------
    InputError
        If bounds have no meaning, the family makes something else than structures or ones of
        different sizes, or a question is not one about the structure at the start.

    References
    ----------
    [BonnansShapiro2000]_, section 4.3, for the gradients of optima.

    Examples
    --------
    The limit load of a shallow arch of two bars of given weight:

    >>> import equimorph as em
    >>> def arch(rise):
    ...     joints = {"A": (-1.0, 0.0), "B": (0.0, rise), "C": (1.0, 0.0)}
    ...     bars, held = [("A", "B"), ("B", "C")], {"A": "xy", "B": "x", "C": "xy"}
    ...     return em.Truss(joints, bars, held, {"F": {"B": (0.0, -1.0)}})
    >>> start = arch(0.1).natural_state()
    >>> found = em.design(arch, {"rise": (0.05, 0.2, 0.1)}, em.LoadLimit(start, "F"))
    >>> found.status, round(found.variables["rise"], 6)
    ('found', 0.2)
    """
    problem = problem_of(family, variables, objective, within, tolerance)
    search = DesignSearch(problem, rebuilds)
    return report(search, *search.run(problem.family.start))


def report(search: DesignSearch, last: Judged, status: DesignStatus, why: str) -> Design:
    """What is reported of a search."""
    family, objectives = search.problem.family, search.problem.objectives
    return Design(
        status, why, family.values(last.x), family.structure(last.x),
        np.nan if last.why else objectives[0].sign * last.level,
        tuple(each.found for each in last.answers[: len(objectives)]), search.active(last),
        tuple(search.history), search.rebuilds,
    )  # fmt: skip


def problem_of(
    family: Callable[..., Structure],
    variables: Bounds,
    objective: Asked | Sequence[Asked],
    within: Sequence[DesignBound],
    tolerance: float,
) -> DesignProblem:
    """Check what belongs together."""
    read = DesignFamily.of(family, variables)
    start = read.structure(read.start)
    own = (objective,) if isinstance(objective, Asked) else tuple(objective)
    if len({each.sign for each in own}) != 1:
        raise InputError(
            "`objective` must be one or more questions, all of which are made small or all large; "
            f"got {short(objective)}."
        )
    made = DesignProblem(read, own, tuple(within), tolerance)
    for question, _ in made.questions:
        for state in question.states:
            _check_state(state, start)
    return made


def _check_state(state: State, start: Structure) -> None:
    same = state.structure.kind == start.kind and len(state.z) == start.size
    if not same or State(start, state.z, state.p).residual > EQUILIBRIUM:
        raise InputError(
            "`objective` and `within` must have states of the structure that the family makes of "
            f"the start of the variables; got {state}."
        )


LOOSE = 1e300
"""A bound that is none."""


@dataclass(frozen=True, eq=False)
class DesignFront:
    """Designs from the best one by the first objective to the best one by the second.

    Parameters
    ----------
    designs
        In turn; their `value` is that of the first objective, but for the last one.
    values
        Both objectives of each design, after a full rebuild.
    """

    designs: tuple[Design, ...]
    values: Float[np.ndarray, "n 2"]

    def __repr__(self) -> str:
        """Both ends."""
        ends = " to ".join(f"({a:.6g}, {b:.6g})" for a, b in self.values[[0, -1]])
        return f"DesignFront({len(self.designs)} designs: {ends})"


@check_arguments
def design_front(
    family: Callable[..., Structure],
    variables: Bounds,
    objectives: Sequence[Asked],
    within: Sequence[DesignBound] = (),
    *,
    points: Annotated[int, count(2, 100)] = 5,
    tolerance: float = 1e-5,
    rebuilds: int = 60,
) -> DesignFront:
    """Trade two objectives of a family off against each other: bound the second in equal steps.

    Parameters
    ----------
    family
        Structure of the variables, by their names.
    variables
        Bounds (low, high) of each variable, or with the start (low, high, start).
    objectives
        Two questions.
    within
        Bounds that all designs obey.
    points
        Number of designs, both ends among them.
    tolerance
        Relative change of a value that counts as none; positive.
    rebuilds
        Most designs that are judged for each of them.

    Returns
    -------
    The front; a single design where the first question has no answer at the start.

    Raises
    ------
    InputError
        As for `design`, or if there are not two objectives.

    References
    ----------
    [Miettinen1999]_, section 3.2: the ε-constraint method.
    """
    if len(objectives) != 2:
        raise InputError(f"`objectives` must be two questions; got {len(objectives)}.")
    first, second = objectives
    problem = problem_of(family, variables, first, (*within, _bound(second, LOOSE)), tolerance)
    start = DesignSearch(problem, rebuilds)
    ended = start.run(problem.family.start)
    found = [(report(start, *ended), ended[0])]
    if ended[0].why:
        return DesignFront((found[0][0],), np.full((1, 2), np.nan))
    other = replace(problem, objectives=(second,), within=(*tuple(within), _bound(first, LOOSE)))
    search = DesignSearch(other, rebuilds)
    last = search.run(ended[0].x, _swap(ended[0]))
    levels = [second.sign * each.answers[k].value for each, k in ((ended[0], -1), (last[0], 0))]
    for level in np.linspace(levels[0], levels[1], points)[1:-1].tolist():
        bounded = replace(problem, within=(*tuple(within), _bound(second, level)))
        found.append(_between(bounded, rebuilds, found[-1][1]))
    found.append((report(search, *last), _swap(last[0])))
    values = [[judged.answers[0].value, judged.answers[-1].value] for _, judged in found]
    return DesignFront(tuple(each for each, _ in found), np.array(values))


def _between(problem: DesignProblem, rebuilds: int, near: Judged) -> tuple[Design, Judged]:
    search = DesignSearch(problem, rebuilds)
    ended = search.run(near.x, near)
    return report(search, *ended), ended[0]


def _bound(question: Asked, level: float) -> DesignBound:
    """Bound of a question on the side where it is worse, by its value times its sign."""
    if question.sign > 0.0:
        return DesignBound(question, upper=level)
    return DesignBound(question, lower=-level)


def _swap(judged: Judged) -> Judged:
    """The same design with the first and the last question exchanged."""
    first, *between, last = judged.answers
    return replace(judged, answers=(last, *between, first))

"""`design_front`: the designs between which one objective gains only where another one loses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.structures import Structure
from equimorph.tasks.designing.bounds import Asked, DesignBound
from equimorph.tasks.designing.bundle import DesignProblem, Judged
from equimorph.tasks.designing.design import Design, problem_of, report
from equimorph.tasks.designing.family import Bounds
from equimorph.tasks.designing.search import DesignSearch

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
    """Designs of a family between two objectives, by bounding the second in equal steps.

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
    found = [(report(start, ended), ended[0])]
    if ended[0].why:
        return DesignFront((found[0][0],), np.full((1, 2), np.nan))
    other = replace(problem, objectives=(second,), within=(*tuple(within), _bound(first, LOOSE)))
    search = DesignSearch(other, rebuilds)
    last = search.run(ended[0].x, _swapped(ended[0]))
    levels = [second.sign * each.answers[k].value for each, k in ((ended[0], -1), (last[0], 0))]
    for level in np.linspace(levels[0], levels[1], points)[1:-1].tolist():
        bounded = replace(problem, within=(*tuple(within), _bound(second, level)))
        found.append(_between(bounded, rebuilds, found[-1][1]))
    found.append((report(search, last), _swapped(last[0])))
    values = [[judged.answers[0].value, judged.answers[-1].value] for _, judged in found]
    return DesignFront(tuple(each for each, _ in found), np.array(values))


def _between(problem: DesignProblem, rebuilds: int, near: Judged) -> tuple[Design, Judged]:
    search = DesignSearch(problem, rebuilds)
    ended = search.run(near.x, near)
    return report(search, ended), ended[0]


def _bound(question: Asked, level: float) -> DesignBound:
    """Bound of a question on the side where it is worse, by its value times its sign."""
    if question.sign > 0.0:
        return DesignBound(question, upper=level)
    return DesignBound(question, lower=-level)


def _swapped(judged: Judged) -> Judged:
    """The same design with the first and the last question exchanged."""
    first, *between, last = judged.answers
    return replace(judged, answers=(last, *between, first))

"""What a run of a study found."""

from dataclasses import dataclass
from typing import Any

from equimorph.manifold import EquilibriumSet
from equimorph.structures import States
from equimorph.study.kinds.kind import Asked
from equimorph.study.prepare import Problem
from equimorph.study.problem import Study


@dataclass(frozen=True)
class Answered:
    """A question with its answer."""

    asked: Asked
    answer: Any

    @property
    def name(self) -> str:
        """Name in the study file; files of the answer begin with it."""
        return self.asked.name


@dataclass(frozen=True)
class Outcome:
    """All answers of a study.

    Parameters
    ----------
    study, problem
        What was asked.
    equilibrium_set
        The set in the box, if it was asked for.
    points
        Equilibria at each wanted point, in the order of the file.
    answers
        Answers to the questions, in the order of `Problem.tasks`.
    reused
        Whether the set was read from the folder instead of computed.
    seconds
        Wall time of each stage.
    """

    study: Study
    problem: Problem
    equilibrium_set: EquilibriumSet | None
    points: tuple[States, ...]
    answers: tuple[Answered, ...]
    reused: bool
    seconds: dict[str, float]

    def of(self, table: str) -> dict[str, Any]:
        """Answers to the questions of one kind, by name: ``outcome.of("route")``."""
        mine = (each for each in self.answers if each.asked.kind.table == table)
        return {each.name: each.answer for each in mine}

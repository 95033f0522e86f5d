"""From a study file to the objects of the library; errors name the key."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from equimorph.manifold import EquilibriumSet
from equimorph.structures import States, Structure, from_identity
from equimorph.study.extent import extent_of_set
from equimorph.study.kinds import KINDS
from equimorph.study.lookup import Extent, Ground, at_key, check_point
from equimorph.study.problem import Study
from equimorph.study.question import Question
from equimorph.study.structures import StructureSection


@dataclass(frozen=True)
class Problem:
    """A study whose names all mean something."""

    ground: Ground
    points: tuple[dict[str, float], ...]
    questions: tuple[Question, ...]
    """Kind by kind, in the order of the file."""

    @property
    def structure(self) -> Structure:
        """Of the whole study."""
        return self.ground.structure

    @property
    def extents(self) -> Mapping[str, Extent]:
        """Every grid over which something is computed, by its key in the study file."""
        own = {} if self.ground.extent is None else {"set": self.ground.extent}
        found = {each.key: each.kind.extent(each) for each in self.questions}
        return own | {key: extent for key, extent in found.items() if extent is not None}


@dataclass(frozen=True)
class Answered:
    """A question with its answer."""

    question: Question
    answer: Any

    @property
    def name(self) -> str:
        """Name in the study file; files of the answer begin with it."""
        return self.question.name


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
        Equilibria at each point that was asked for, in the order of the file.
    answers
        Answers to the questions, in the order of `Problem.questions`.
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
        mine = (each for each in self.answers if each.question.kind.table == table)
        return {each.name: each.answer for each in mine}


def prepare(study: Study) -> Problem:
    """Build the structure of a study and look up all its names.

    Parameters
    ----------
    study
        A study whose keys and types are right.

    Raises
    ------
    InputError
        For a parameter or descriptor that the structure does not have, a value without meaning, or
        a point outside the box; the line names the key.
    """
    with at_key("structure"):
        structure = build_structure(study.structure)
    section = study.equilibrium_set
    ground = Ground(structure, None if section is None else extent_of_set(structure, section))
    for i, point in enumerate(study.equilibria):
        check_point(ground.box, point.at, f"equilibria[{i}].at")
    questions = tuple(
        kind.look_up(ground, section, f"{kind.table}[{i}]")
        for kind in KINDS
        for i, section in enumerate(study.tasks[kind.table])
    )
    return Problem(ground, tuple(point.at for point in study.equilibria), questions)


def build_structure(section: StructureSection) -> Structure:
    """Structure that a section describes; what it leaves out takes the structure's default."""
    return from_identity(section.model_dump(exclude_none=True))

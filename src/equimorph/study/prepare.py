"""From a study file to the objects of the library; errors name the key."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from equimorph.manifold import EquilibriumSet
from equimorph.structures import States, Structure, from_identity
from equimorph.study.complaint import Findings
from equimorph.study.kinds import KINDS
from equimorph.study.lookup import Extent, Ground, at_key, check_point
from equimorph.study.problem import Study, extent_of_set
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

    def on(self, eset: EquilibriumSet) -> "Problem":
        """The same with what its texts mean of the states of the set."""
        ground = replace(self.ground, eset=eset)
        looked_up = (each.kind.look_up(ground, each.section, each.key) for each in self.questions)
        return replace(self, ground=ground, questions=tuple(looked_up))

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

    @property
    def refusal(self) -> str:
        """Why the question was refused; empty if it was answered."""
        return self.question.kind.refusal(self.question, self.answer)

    @property
    def line(self) -> str:
        """Verdict or refusal as one line for the screen, in rich's markup."""
        return self.question.kind.line(self.question, self.answer)


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

    @property
    def refused(self) -> tuple[Answered, ...]:
        """Questions that were refused, with the reasons in their answers."""
        return tuple(each for each in self.answers if each.refusal)

    def of(self, table: str) -> dict[str, Any]:
        """Answers to the questions of one kind, by name: ``outcome.of("route")``."""
        mine = (each for each in self.answers if each.question.kind.table == table)
        return {each.name: each.answer for each in mine}


def prepare(study: Study, places: Mapping[str, Sequence[int]] | None = None) -> Problem:
    """Build the structure of a study and look up all its names.

    Parameters
    ----------
    study
        A study whose keys and types are right.
    places
        Numbers by which messages name the entries of lists of tables; 0, 1, ... by default.

    Raises
    ------
    StudyError
        For parameters or descriptors that the structure does not have, values without meaning, and
        points outside the box; a line for each names the key.
    """
    with at_key("structure"):
        structure = build_structure(study.structure)
    section = study.equilibrium_set
    ground = Ground(structure, None if section is None else extent_of_set(structure, section))
    findings = Findings()
    for key, point in _number_entries("equilibria", study.equilibria, places):
        with findings.collect():
            check_point(ground.box, point.at, f"{key}.at")
    questions = []
    for kind in KINDS:
        for key, section in _number_entries(kind.table, study.tasks[kind.table], places):
            with findings.collect():
                questions.append(kind.look_up(ground, section, key))
    findings.refuse()
    return Problem(ground, tuple(point.at for point in study.equilibria), tuple(questions))


def _number_entries(
    table: str, sections: Sequence[Any], places: Mapping[str, Sequence[int]] | None
) -> list[tuple[str, Any]]:
    """Pair entries of a list of tables with their keys for messages."""
    numbers = (places or {}).get(table, range(len(sections)))
    return [(f"{table}[{i}]", each) for i, each in zip(numbers, sections, strict=True)]


def build_structure(section: StructureSection) -> Structure:
    """Structure that a section describes; what it leaves out takes the structure's default."""
    return from_identity(section.model_dump(exclude_none=True))

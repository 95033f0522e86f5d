"""A new task needs its module, its kind of question and its test: all else follows.

The task here is defined as a user of the code would, in one function; its section, its look-ups and
its defaults come from the signature.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pytest
from pydantic import ValidationError

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Progress, Silent
from equimorph.structures import State
from equimorph.study import Outcome
from equimorph.study.kinds import KINDS
from equimorph.study.prepare import Problem
from equimorph.study.question import Kind, Question
from equimorph.study.signatures import MONITOR, SUPPLIED, Form, alternatives


@dataclass(frozen=True)
class Height:
    """How far a descriptor lies above a target."""

    above: float


def height_above(  # noqa: PLR0913  # one of each sort
    eset: EquilibriumSet,
    start: State,
    descriptor: Descriptor,
    targets: Mapping[Descriptor, float],
    *,
    within: Sequence[Constraint] = (),
    load: str = "F",
    margin: float = 0.0,
    sense: Literal["min", "max"] = "min",
    progress: Progress | None = None,
) -> Height:
    """Return how far a descriptor lies above the sum of some targets.

    Parameters
    ----------
    eset
        The set.
    start
        Where.
    """
    assert progress is not None
    assert all(each.holds(start.batch).all() for each in within)
    return Height(descriptor(start) - sum(targets.values()) - margin)


class HeightKind(Kind[Height]):
    """Height above a target."""

    table = "height"
    tasks = (height_above,)

    def words(self, question: Question, answer: Height) -> str:
        return f"**above** by {answer.above:.6f}"


GIVEN = {
    "name": "here",
    "start": {"at": {"x_l": 0.8, "F": 0.0}, "highest": "angle"},
    "descriptor": "angle",
    "targets": {"energy": 0.5},
    "within": ["angle >= 0"],
}


def asked(problem: Problem, **changed: Any) -> Question:
    kind = HeightKind()
    return kind.look_up(problem.ground, kind.section.model_validate(GIVEN | changed), "height[0]")


def test_a_section_has_the_keys_and_defaults_of_the_signature():
    fields = HeightKind().section.model_fields
    assert list(fields) == [
        "name", "start", "descriptor", "targets", "within", "load", "margin", "sense"
    ]  # fmt: skip
    assert [key for key, each in fields.items() if each.is_required()] == [
        "name", "start", "descriptor", "targets"
    ]  # fmt: skip
    assert fields["margin"].default == 0.0


def test_names_are_looked_up_and_the_task_is_called(finished: tuple[Outcome, Path]):
    """At F = 0 and x_l = 0.8 the spring rests at cos δ = 0.8."""
    outcome = finished[0]
    question = asked(outcome.problem)
    assert question["descriptor"] == outcome.problem.structure.descriptor("angle")
    found = question.answer(Silent())
    assert found.above == pytest.approx(0.6435011088 - 0.5, abs=1e-9)
    title, words = question.kind.report(question, found, Path())
    assert title == "<h2>Height here</h2>"
    assert words == '<p class="verdict"><strong>Above</strong> by 0.143501</p>'
    assert question.kind.line(question, found) == "Height here: [bold green]above[/] by 0.143501"


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"descriptor": "angel"}, r"in `height\[0\]\.descriptor`.*Did you mean angle"),
        ({"targets": {"curl": 1.0}}, r"in `height\[0\]\.targets`.*curl"),
        ({"load": "G"}, r"in `height\[0\]\.load`.*G"),
        ({"within": ["curl <= 1"]}, r"in `height\[0\]\.within\[0\]`.*curl"),
        ({"start": {"at": {"x_l": 3.0, "F": 0.0}}}, r"`height\[0\]\.start\.at\.x_l` must lie in"),
    ],
)
def test_names_that_mean_nothing_are_refused(finished: tuple[Outcome, Path], changed, message):
    with pytest.raises(InputError, match=message):
        asked(finished[0].problem, **changed)


@pytest.mark.parametrize(
    "changed",
    [{"margin": -1.0}, {"sense": "least"}, {"targets": {}}, {"within": ["angle"]}, {"x": 1}],
)
def test_values_of_the_wrong_type_are_refused(changed):
    with pytest.raises(ValidationError):
        HeightKind().section.model_validate(GIVEN | changed)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.table)
def test_every_argument_of_every_task_has_a_key_or_a_reason(kind: Kind[Any]):
    """Keys are complete: what no key gives is supplied, or named as left out."""
    by_name = {each.name for each in kind.arguments}
    for task in kind.tasks:
        for name, parameter in inspect.signature(task).parameters.items():
            supplied = Form(name, alternatives(parameter.annotation)).is_any(*SUPPLIED)
            assert supplied or name == MONITOR or name in by_name or name in kind.left_out, name
    for each in kind.arguments:
        assert set(each.keys()) <= set(kind.section.model_fields)


def test_a_type_that_a_study_cannot_write_is_named():
    class Strange(HeightKind):
        tasks = (open,)

    with pytest.raises(TypeError, match="of open must have a type that a study can write"):
        Strange().section  # noqa: B018

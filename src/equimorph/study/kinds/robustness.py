"""Robustness: ``[[sensitivity]]``, ``[[imperfection]]``, ``[[room]]`` and ``[[trials]]``."""

from collections import Counter
from collections.abc import Mapping
from functools import partial
from html import escape
from types import MappingProxyType
from typing import Annotated

from pydantic import Field

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.plotting.robustness import MOST_BARS
from equimorph.study import html
from equimorph.study.lookup import check_parameters
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.tasks.robustness.derivatives import Sensitivity, sensitivity
from equimorph.tasks.robustness.imperfection import ImperfectionLaw, imperfection_law
from equimorph.tasks.robustness.room import Room, stable_room
from equimorph.tasks.robustness.trials import Trials, random_trials


class SensitivityKind(Kind[Sensitivity]):
    """How descriptors change with parameters."""

    table = "sensitivity"
    tasks = (sensitivity,)
    names = MappingProxyType({"names": "parameters"})
    own = MappingProxyType({"descriptors": (Annotated[list[str], Field(min_length=1)], ...)})

    def figures(self, question: Question, answer: Sensitivity) -> list[Figure]:
        """Bars, where they are few enough to be read."""
        draw = partial(plotting.sensitivities, question.structure, answer)
        caption = "Changes of the descriptors for one scale of each parameter."
        few = len(answer.names) * len(answer.descriptors) <= MOST_BARS
        return [still(question.files, draw, caption)] if few else []

    def words(self, question: Question, answer: Sensitivity) -> str:
        """Name the largest change."""
        scales = {each.name: each.scale for each in question.structure.parameters}
        lines = []
        for each in answer.descriptors:
            name = max(answer.names, key=lambda one: abs(answer[each, one]) * scales[one])
            lines.append(f"d {each}/d {name} = {html.number(answer[each, name], 6)}")
        return f"largest are {', '.join(lines)}."

    def details(self, question: Question, answer: Sensitivity) -> list[str]:
        """A table: one row for each parameter."""
        rows = [
            [escape(name), *(html.number(answer[each, name], 6) for each in answer.descriptors)]
            for name in answer.names
        ]
        return [html.table(["", *(f"d {escape(each)}" for each in answer.descriptors)], rows)]


class ImperfectionKind(Kind[Mapping[str, ImperfectionLaw]]):
    """How a limit load changes with imperfections."""

    table = "imperfection"
    tasks = (imperfection_law,)
    names = MappingProxyType({"start": "state"})
    left_out = ("imperfection",)
    own = MappingProxyType(
        {
            "imperfections": (
                Annotated[list[str], Field(min_length=1)],
                Field(description="Parameters that may be off, one law for each."),
            )
        }
    )

    def look_up_more(self, question: Question) -> None:
        """Refuse imperfections that are no parameters, or the load itself."""
        names, key = question.section.imperfections, f"{question.key}.imperfections"
        check_parameters(question.structure, names, key)
        if question["load"] in names:
            raise InputError(f"`{key}` must not name the load; got {question['load']}.")

    def answer(self, question: Question, arguments: Arguments) -> Mapping[str, ImperfectionLaw]:
        """Fit a law to each imperfection."""
        given = arguments.of(imperfection_law)
        return {
            name: imperfection_law(**given, imperfection=name)
            for name in question.section.imperfections
        }

    def figures(self, question: Question, answer: Mapping[str, ImperfectionLaw]) -> list[Figure]:
        """Return the powers on logarithmic axes, if any was found."""
        known = {name: law for name, law in answer.items() if law.status == "fitted"}
        draw = partial(plotting.imperfection_laws, question.structure, known, question.section.load)
        caption = "Changes of the limit load with imperfections, and the fitted powers."
        return [still(question.files, draw, caption)] if known else []

    def words(self, question: Question, answer: Mapping[str, ImperfectionLaw]) -> str:
        """Return the formulas."""
        load = question.section.load
        return "; ".join(_in_words(load, name, law) for name, law in answer.items()) + "."

    def details(self, question: Question, answer: Mapping[str, ImperfectionLaw]) -> list[str]:
        """A table: one row for each imperfection."""
        rows = [
            [
                escape(name),
                html.number(law.perfect, 8),
                html.number(law.coefficient, 5),
                html.number(law.exponent, 5),
                escape(law.law if law.status == "fitted" else law.why),
            ]
            for name, law in answer.items()
        ]
        head = ["imperfection ε", "limit load", "coefficient", "fitted exponent", "law"]
        return [html.table(head, rows)]

    def refusal(self, question: Question, answer: Mapping[str, ImperfectionLaw]) -> str:
        """Reasons why no law is known, where none is."""
        if any(law.status == "fitted" for law in answer.values()):
            return ""
        return "; ".join(f"{name}: {law.why.rstrip('.')}" for name, law in answer.items()) + "."


def _in_words(load: str, name: str, law: ImperfectionLaw) -> str:
    """Return the limit load as a formula in an imperfection."""
    if law.status != "fitted":
        return f"{name}: {law.status}, {law.why.rstrip('.')}"
    sign = "−" if law.coefficient < 0 else "+"
    power = "" if law.power == 1 else f"^{html.number(law.power, 3)}"
    change = f"{sign} {html.number(abs(law.coefficient))} |{name}|{power}"
    return f"limit {load} = {html.number(law.perfect)} {change} ({law.law})"


class RoomKind(Kind[Room]):
    """How far parameters may stray from a state."""

    table = "room"
    tasks = (stable_room,)
    names = MappingProxyType({"states": "state"})

    def figures(self, question: Question, answer: Room) -> list[Figure]:
        """Where it lies, over two parameters."""
        draw = partial(plotting.room, answer.states[0], answer, question.eset)
        caption = "The room around the state (●) and where it ends (×)."
        two = len(question.section.tolerances) == 2
        return [still(question.files, draw, caption)] if two else []

    def words(self, question: Question, answer: Room) -> str:
        """Its size."""
        size = f"the {question.section.shape} of {html.number(answer.least, 6)} tolerances"
        if answer.kind[0] == "arrived":
            return f"{size} is stable, the largest that was tried."
        return f"stable up to {size}; then {answer.kind[0]}."

    def details(self, question: Question, answer: Room) -> list[str]:
        """Its sides."""
        box = answer.boxes[0]
        rows = [
            [escape(name), html.number(low, 6), html.number(high, 6)]
            for name, low, high in zip(box.names, box.lower, box.upper, strict=True)
        ]
        return [html.table(["", "from", "to"], rows)]


class TrialsKind(Kind[Trials]):
    """What becomes of a schedule under random imperfections."""

    table = "trials"
    tasks = (random_trials,)
    within_set = True

    def figures(self, question: Question, answer: Trials) -> list[Figure]:
        """Return the trials by their offsets."""
        draw = partial(plotting.trials, question.structure, answer)
        return [still(question.files, draw, "Each trial by the errors of the parameters.")]

    def words(self, question: Question, answer: Trials) -> str:
        """Return the share that arrived."""
        low, high = (html.number(end, 3) for end in answer.interval)
        return (
            f"{int(answer.arrived.sum())} of {len(answer.kind)} arrived; with 95 % confidence the "
            f"probability lies between {low} and {high}."
        )

    def details(self, question: Question, answer: Trials) -> list[str]:
        """How many ended where."""
        counts = Counter(answer.kind.tolist())
        rows = [[escape(kind), str(count)] for kind, count in counts.most_common()]
        return [html.table(["ended at", "trials"], rows)]

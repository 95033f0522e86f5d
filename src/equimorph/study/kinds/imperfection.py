"""Limit loads of imperfect structures: ``[[imperfection]]``."""

from collections.abc import Mapping
from functools import partial
from html import escape
from types import MappingProxyType
from typing import Annotated

from pydantic import Field

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.lookup import check_parameters
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.tasks.robustness.imperfection import ImperfectionLaw, imperfection_law


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

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Mapping[str, ImperfectionLaw]
    ) -> list[Figure]:
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

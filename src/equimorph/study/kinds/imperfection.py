"""Limit loads of imperfect structures: ``[[imperfection]]``."""

from collections.abc import Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.study import html
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.kinds.of_state import OfState, of_state
from equimorph.study.lookup import Ground, at_key
from equimorph.study.names import task_files
from equimorph.study.sections.robustness import ImperfectionSection
from equimorph.tasks import ImperfectionLaw, imperfection_law

ImperfectionTask = OfState[ImperfectionSection]


class ImperfectionKind(Kind[ImperfectionSection, ImperfectionTask, Mapping[str, ImperfectionLaw]]):
    """How a limit load changes with imperfections."""

    table = "imperfection"

    def prepared(self, ground: Ground, section: ImperfectionSection, key: str) -> ImperfectionTask:
        """Look up state, load, imperfections and constraints."""
        task = of_state(
            ground, section, key, load=[section.load], imperfections=section.imperfections
        )
        if section.load in section.imperfections:
            raise InputError(f"`{key}.imperfections` must not name the load; got {section.load}.")
        return task

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: ImperfectionTask, sink: Progress
    ) -> Mapping[str, ImperfectionLaw]:
        """Fit a law to each imperfection."""
        section, state = task.section, task.state(eset)
        with at_key(task.key):
            return {
                name: imperfection_law(state, section.load, name, within=task.constraints)
                for name in section.imperfections
            }

    def figures(
        self,
        ground: Ground,
        eset: EquilibriumSet | None,
        task: ImperfectionTask,
        answer: Mapping[str, ImperfectionLaw],
    ) -> Sequence[Figure]:
        """Return the powers on logarithmic axes, if any was found."""
        known = {name: law for name, law in answer.items() if law.status == "fitted"}
        if not known:
            return []
        draw = partial(plotting.imperfection_laws, ground.structure, known, task.section.load)
        return [still(task_files(self.table, task.section.name), draw)]

    def report(
        self, task: ImperfectionTask, answer: Mapping[str, ImperfectionLaw], folder: Path
    ) -> list[str]:
        """A table: one row for each imperfection."""
        files = task_files(self.table, task.section.name)
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
        caption = "Changes of the limit load with imperfections, and the fitted powers."
        head = ["imperfection ε", "limit load", "coefficient", "fitted exponent", "law"]
        return [
            heading(self.table, task.section.name),
            html.table(head, rows),
            html.pictures(folder, {}, {f"{files}.png": caption}),
        ]

    def verdict(self, task: ImperfectionTask, answer: Mapping[str, ImperfectionLaw]) -> str:
        """Return the formulas."""
        load = task.section.load
        laws = "; ".join(_in_words(load, name, law) for name, law in answer.items())
        return plain(f"Imperfection {task.section.name}: {laws}.")


def _in_words(load: str, name: str, law: ImperfectionLaw) -> str:
    """Return the limit load as a formula in an imperfection."""
    if law.status != "fitted":
        return f"{name}: {law.status}, {law.why.rstrip('.')}"
    sign = "−" if law.coefficient < 0 else "+"
    power = "" if law.power == 1 else f"^{html.number(law.power, 3)}"
    change = f"{sign} {html.number(abs(law.coefficient))} |{name}|{power}"
    return f"limit {load} = {html.number(law.perfect)} {change} ({law.law})"

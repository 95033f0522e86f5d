"""Routes for many actuators: ``[[sampled_route]]``."""

from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rich.markup import escape as plain

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.answers import (
    figures_of_way,
    heading,
    pictures_of_way,
)
from equimorph.study.fields import requirement
from equimorph.study.names import schedule_table
from equimorph.study.question import Figure, Kind, Question
from equimorph.study.states import NaturalSection
from equimorph.tasks import Route, plan_sampled


class SampledRouteKind(Kind[Route]):
    """Routes by random trees of lifted edges, where no set can be computed."""

    table = "sampled_route"
    tasks = (plan_sampled,)
    natural = True
    own = MappingProxyType({"goal": (NaturalSection | None, None)})

    def check(self, section: Any) -> None:
        """It ends at a goal, or under loads."""
        if section.goal is None and not section.loads:
            raise requirement("give a goal, or loads, of which the last one holds at the goal")

    def look_up_more(self, question: Question) -> None:
        """Refuse actuators among the loads."""
        section = question.section
        for i, leg in enumerate(section.loads):
            both = [name for name in leg if name in section.actuators]
            if both:
                raise InputError(
                    f"`{question.key}.loads[{i}]` must not move actuators; got {both[0]}."
                )

    def write_tables(self, question: Question, answer: Route, folder: Path) -> None:
        """Write the schedule."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(question.files))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Route
    ) -> Sequence[Figure]:
        """Parameters, shapes and margins."""
        return figures_of_way(None, question.files, answer)

    def report(self, question: Question, answer: Route, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        head = heading(question)
        if not answer.arrived:
            return [head, html.refusal_line(answer.why)]
        length = html.number(answer.length)
        return [
            head,
            '<p class="verdict"><strong>Arrived.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(answer.margin)}, length {length}.</p>",
            html.schedule_links(schedule_table(question.files)),
            pictures_of_way(folder, question.files, "route"),
        ]

    def verdict(self, question: Question, answer: Route) -> str:
        """Say whether it arrived."""
        head = f"Sampled route {question.name}"
        if not answer.arrived:
            return f"{head}: [bold red]refused[/]. {plain(answer.why)}"
        return (
            f"{head}: [bold green]arrived[/] without a snap, smallest margin "
            f"{answer.margin:.3f}, length {answer.length:.3f}."
        )

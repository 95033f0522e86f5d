"""Verification of schedules: ``[[verify]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Literal

import numpy as np
from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.given import GivenWay, given_way
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.kinds.way import figures_of_way, pictures_of_way
from equimorph.study.lookup import Ground, at_key
from equimorph.study.names import schedule_table, task_files
from equimorph.study.sections.ways import VerifySection
from equimorph.tasks import Proof, Route, Verification, verify


class VerifyKind(Kind[VerifySection, GivenWay, Verification]):
    """Whether a schedule can be executed without a snap, and whether that is proved."""

    table = "verify"

    def prepared(self, ground: Ground, section: VerifySection, key: str) -> GivenWay:
        """Look up the way and its constraints."""
        return given_way(ground, section, key)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: GivenWay, sink: Progress
    ) -> Verification:
        """Lift it finely."""
        section = task.section
        assert isinstance(section, VerifySection)
        start = task.start(ground, eset)
        with at_key(task.key):
            return verify(
                task.schedule,
                start,
                within=task.bounds(eset),
                margin=section.margin,
                monitor=[ground.height],
                proof=section.proof,
            )

    def write_tables(self, task: GivenWay, answer: Verification, folder: Path) -> None:
        """Write the schedule with its margins."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(_files(task)))

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: GivenWay, answer: Verification
    ) -> Sequence[Figure]:
        """As of a route."""
        return figures_of_way(eset, _files(task), _as_route(answer))

    def report(self, task: GivenWay, answer: Verification, folder: Path) -> list[str]:
        """Verdict, proof, schedule and figures."""
        head = heading(self.table, task.section.name)
        pictures = pictures_of_way(folder, _files(task), "way")
        if not answer.verified:
            return [head, html.refused(_sentence(answer.why)), pictures]
        return [
            head,
            '<p class="verdict"><strong>Verified.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(answer.margin)}.</p>",
            *([] if answer.proof is None else [_proof(answer.proof)]),
            html.schedule_links(schedule_table(_files(task))),
            pictures,
        ]

    def verdict(self, task: GivenWay, answer: Verification) -> str:
        """Say whether it can be executed."""
        head = f"Verify {task.section.name}"
        if not answer.verified:
            return f"{head}: [bold red]refused[/]. {plain(_sentence(answer.why))}"
        proof = "" if answer.proof is None else f", {answer.proof.status}"
        return f"{head}: [bold green]verified[/], smallest margin {answer.margin:.3f}{proof}."


def _files(task: GivenWay) -> str:
    return task_files(VerifyKind.table, task.section.name)


def _as_route(answer: Verification) -> Route:
    """The way as a route, for figures."""
    status: Literal["arrived", "refused"] = "arrived" if answer.verified else "refused"
    length = float(answer.path.length[-1])
    return Route(status, answer.why, [], answer.path, answer.margin, length, answer.schedule)


def _sentence(why: str) -> str:
    return f"{why[:1].upper()}{why[1:]}."


def _proof(proof: Proof) -> str:
    if proof.status != "proved":
        return f"<p>Not proved: {escape(proof.why)}.</p>"
    how = "" if proof.bounds == "structural" else " Bounds are estimated from samples."
    error = html.number(float(np.max(proof.error, initial=0.0)), 2)
    return (
        f"<p><strong>Proved</strong> on {len(proof.error)} segments: between the states, too, the "
        f"equilibrium exists, is the only one nearby and keeps a margin of "
        f"{html.number(proof.margin)}; it leaves the chords by {error} at most.{how}</p>"
    )

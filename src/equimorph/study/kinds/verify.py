"""Verification of schedules: ``[[verify]]``."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Literal

import numpy as np

from equimorph.manifold import EquilibriumSet
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.answers import as_route, figures_of_way, heading, pictures_of_way
from equimorph.study.names import schedule_table
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks import Proof, ProofStatus, Verification, verify

STANDINGS: Mapping[ProofStatus, tuple[str, str]] = {
    ProofStatus.PROVED: ("Proved", ""),
    ProofStatus.SUPPORTED: (
        "Supported by samples",
        " The second derivatives behind these bounds are estimated from samples, so this is "
        "evidence and no proof.",
    ),
}
"""What a page says first and last of a curve that keeps its bounds, by status."""


class VerifyKind(Kind[Verification]):
    """Whether a schedule can be executed without a snap, and whether that is proved."""

    table = "verify"
    tasks = (verify,)
    left_out = ("options", "structure")
    within_set = True

    def write_tables(self, question: Question, answer: Verification, folder: Path) -> None:
        """Write the schedule with its margins."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(question.files))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Verification
    ) -> Sequence[Figure]:
        """As for a route."""
        status: Literal["arrived", "refused"] = "arrived" if answer.verified else "refused"
        return figures_of_way(eset, question.files, as_route(answer, status))

    def report(self, question: Question, answer: Verification, folder: Path) -> list[str]:
        """Verdict, proof, schedule and figures."""
        head = heading(question)
        pictures = pictures_of_way(folder, question.files, "way")
        if not answer.verified:
            return [head, html.refusal_line(self.refusal(question, answer)), pictures]
        return [
            head,
            '<p class="verdict"><strong>Verified.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(answer.margin)}.</p>",
            *([] if answer.proof is None else [_proof(answer.proof)]),
            html.schedule_links(schedule_table(question.files)),
            pictures,
        ]

    def refusal(self, question: Question, answer: Verification) -> str:
        """Reason why it cannot be executed."""
        del question
        return "" if answer.verified else _sentence(answer.why)

    def verdict(self, question: Question, answer: Verification) -> str:
        """Say how near to instability it leads, and whether that is proved."""
        head = f"{question.title}"
        proof = "" if answer.proof is None else f", {answer.proof.status}"
        return f"{head}: [bold green]verified[/], smallest margin {answer.margin:.3f}{proof}."


def _sentence(why: str) -> str:
    return f"{why[:1].upper()}{why[1:]}."


def _proof(proof: Proof) -> str:
    """What is known between the states, in words that its status bears."""
    if proof.status == ProofStatus.UNPROVED:
        return f"<p>Not proved: {escape(proof.why)}.</p>"
    head, rest = STANDINGS[proof.status]
    error = html.number(float(np.max(proof.error, initial=0.0)), 2)
    return (
        f"<p><strong>{head}</strong> on {len(proof.error)} segments: between the states, too, the "
        f"equilibrium exists, is the only one nearby and keeps a margin of "
        f"{html.number(proof.margin)}; it leaves the chords by {error} at most.{rest}</p>"
    )

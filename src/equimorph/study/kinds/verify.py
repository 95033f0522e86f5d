"""Verification of schedules: ``[[verify]]``."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Literal

import numpy as np

from equimorph.manifold import EquilibriumSet
from equimorph.storage import write_certificate
from equimorph.study import html
from equimorph.study.answers import as_route, figures_of_way
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks.verification.evidence import ProofStatus
from equimorph.tasks.verification.proof import Proof
from equimorph.tasks.verification.schedule_check import Verification, verify

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

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Verification
    ) -> list[Figure]:
        """As for a route."""
        status: Literal["arrived", "refused"] = "arrived" if answer.verified else "refused"
        return figures_of_way(eset, question.files, as_route(answer, status), "way")

    def words(self, question: Question, answer: Verification) -> str:
        """Say how near to instability it leads, and whether that is proved."""
        proof = "" if answer.proof is None else f", {answer.proof.status}"
        return f"**verified**, smallest margin {html.number(answer.margin)}{proof}."

    def details(self, question: Question, answer: Verification) -> list[str]:
        """What is known between the states."""
        return [_proof(answer.proof)] if answer.verified and answer.proof is not None else []

    def write_files(self, question: Question, answer: Verification, folder: Path) -> None:
        """Write the schedule, and the certificate of what is proved."""
        super().write_files(question, answer, folder)
        proof = answer.proof
        if proof is None or proof.status is not ProofStatus.PROVED:
            return
        if proof.states.structure.plain_energy() is not None:
            write_certificate(proof, folder / f"{question.files}-certificate.json")

    def refusal(self, question: Question, answer: Verification) -> str:
        """Reason why it cannot be executed."""
        del question
        return "" if answer.verified else f"{answer.why[:1].upper()}{answer.why[1:]}."


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

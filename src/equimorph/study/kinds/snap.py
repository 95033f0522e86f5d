"""Least changes that lead to a snap: ``[[snap]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.structures import State, States
from equimorph.study import html
from equimorph.study.answers import (
    figures_of_states,
    heading,
    report_of_states,
)
from equimorph.study.question import Arguments, Figure, Kind, Question
from equimorph.tasks import LeastSnap, least_snap


class SnapKind(Kind[tuple[State, LeastSnap]]):
    """The least change of parameters that makes a state snap, and where it lands."""

    table = "snap"
    tasks = (least_snap,)

    def answer(self, question: Question, arguments: Arguments) -> tuple[State, LeastSnap]:
        """Find the least change."""
        return arguments["state"], least_snap(**arguments.of(least_snap))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: tuple[State, LeastSnap]
    ) -> Sequence[Figure]:
        """State, fold and landing on the plane."""
        return figures_of_states(question, eset, _stations(answer))

    def report(
        self, question: Question, answer: tuple[State, LeastSnap], folder: Path
    ) -> list[str]:
        """Change, landing, and a table of state, fold and landing."""
        _, snap = answer
        words = escape(_snap_in_words(snap))
        line = html.refusal_line(snap.why) if snap.landing is None else f"<p>{words}</p>"
        states = _stations(answer)
        more = {
            "": ["state", "edge of stability", "landing"][: len(states)],
            **{each: [html.number(value, 6) for value in states[each]] for each in snap.change},
        }
        shown = [states.structure.elevation]
        table = report_of_states(question, folder, states, shown, more)
        return [heading(question), line, *table]

    def verdict(self, question: Question, answer: tuple[State, LeastSnap]) -> str:
        """Change and landing."""
        snap, head = answer[1], f"{question.title}"
        if snap.landing is None:
            return f"{head}: [bold red]refused[/]. {plain(snap.why)}"
        return f"{head}: {plain(_snap_in_words(snap))}"


def _stations(answer: tuple[State, LeastSnap]) -> States:
    """State, fold and landing."""
    state, snap = answer
    if snap.states is None:
        return state.batch
    z, p = (np.vstack([getattr(each, name) for each in (state, snap.states)]) for name in "zp")
    return States(state.structure, z, p)


def _snap_in_words(snap: LeastSnap) -> str:
    assert snap.landing is not None
    moves = ", ".join(f"{name} by {value:+.6g}" for name, value in snap.change.items())
    end = snap.landing
    least = f" ({snap.why})" if snap.why else ""
    return f"the least way to a snap is {moves}; {end.status}, {end.released:.4g} released{least}."

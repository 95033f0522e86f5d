"""Least changes that lead to a snap: ``[[snap]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.structures import State, States
from equimorph.study import html
from equimorph.study.kinds.found import figures_of_states, heading, report_of_states
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.kinds.of_state import OfState, of_state
from equimorph.study.lookup import Ground, at_key
from equimorph.study.sections.robustness import SnapSection
from equimorph.tasks import LeastSnap, least_snap

SnapTask = OfState[SnapSection]


class SnapKind(Kind[SnapSection, SnapTask, tuple[State, LeastSnap]]):
    """The least change of parameters that makes a state snap, and where it lands."""

    table = "snap"

    def prepared(self, ground: Ground, section: SnapSection, key: str) -> SnapTask:
        """Look up the state."""
        return of_state(ground, section, key)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: SnapTask, sink: Progress
    ) -> tuple[State, LeastSnap]:
        """Find it."""
        assert eset is not None
        state = task.state(eset)
        with at_key(task.key):
            return state, least_snap(eset, state)

    def figures(
        self,
        ground: Ground,
        eset: EquilibriumSet | None,
        task: SnapTask,
        answer: tuple[State, LeastSnap],
    ) -> Sequence[Figure]:
        """State, fold and landing on the plane."""
        return figures_of_states(eset, self.table, task.section.name, _stations(answer))

    def report(self, task: SnapTask, answer: tuple[State, LeastSnap], folder: Path) -> list[str]:
        """Change, landing, and a table of state, fold and landing."""
        _, snap = answer
        name = task.section.name
        words = escape(_snap_in_words(snap))
        line = html.refused(snap.why) if snap.landing is None else f"<p>{words}</p>"
        states = _stations(answer)
        more = {
            "": ["state", "edge of stability", "landing"][: len(states)],
            **{each: [html.number(value, 6) for value in states[each]] for each in snap.change},
        }
        shown = [states.structure.elevation]
        table = report_of_states(folder, self.table, name, states, shown, more)
        return [heading(self.table, name), line, *table]

    def verdict(self, task: SnapTask, answer: tuple[State, LeastSnap]) -> str:
        """Change and landing."""
        snap, head = answer[1], f"Snap {task.section.name}"
        if snap.landing is None:
            return f"{head}: [bold red]refused[/]. {plain(snap.why)}"
        return f"{head}: {plain(_snap_in_words(snap))}"


def _stations(answer: tuple[State, LeastSnap]) -> States:
    """State, fold and landing."""
    state, snap = answer
    others = [] if snap.landing is None else [snap.distance.nearest, snap.landing.state]
    all_of_them = [state, *(each for each in others if each is not None)]
    z, p = (np.stack([getattr(each, name) for each in all_of_them]) for name in "zp")
    return States(state.structure, z, p)


def _snap_in_words(snap: LeastSnap) -> str:
    assert snap.landing is not None
    moves = ", ".join(f"{name} by {value:+.6g}" for name, value in snap.change.items())
    end = snap.landing
    return f"the least way to a snap is {moves}; {end.status}, {end.released:.4g} released."

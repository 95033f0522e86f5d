"""Snaps: the least change that leads to one, ``[[snap]]``, and all of them, ``[[snap_graph]]``."""

from dataclasses import replace
from functools import partial
from html import escape
from types import MappingProxyType

import numpy as np
from pydantic import Field

from equimorph import plotting
from equimorph.manifold import Snap, SnapGraph, snap_graph
from equimorph.model import Descriptor, names_of
from equimorph.structures import States, join_states
from equimorph.study import html
from equimorph.study.answers import count_of, figures_of_states, table_of_states
from equimorph.study.lookup import descriptor_at
from equimorph.study.question import Arguments, DataTable, Figure, Kind, Question, still
from equimorph.tables import Table, units_of
from equimorph.tasks.robustness.snaps import LeastSnap, least_snap

Snaps = tuple[tuple[int, ...], tuple[Snap, ...], tuple[States, ...]]
"""Stable strata, runs of their boundaries, and the states from which the snaps of each begin."""
HEAD = ("run", "from stratum", "to stratum", "status", "energy released")
"""Columns of the table before parameters and heights."""
CAPTION = (
    "The stability boundary in runs from which all snaps lead to the same stratum, numbered as in "
    "the table: over the parameters, and states before and after the snap along it."
)


class SnapKind(Kind[LeastSnap]):
    """The least change of parameters that makes a state snap, and where it lands."""

    table = "snap"
    tasks = (least_snap,)

    def figures(self, question: Question, answer: LeastSnap) -> list[Figure]:
        """State, fold and landing on the plane."""
        return figures_of_states(question, _stations(question, answer))

    def words(self, question: Question, answer: LeastSnap) -> str:
        """Change and landing."""
        assert answer.landing is not None
        moves = ", ".join(f"{name} by {value:+.6g}" for name, value in answer.change.items())
        end, least = answer.landing, f" ({answer.why})" if answer.why else ""
        released = f"{end.released:.4g} released{least}"
        return f"the least way to a snap is {moves}; {end.status}, {released}."

    def details(self, question: Question, answer: LeastSnap) -> list[str]:
        """A table of state, fold and landing."""
        states = _stations(question, answer)
        more = {
            "": ["state", "edge of stability", "landing"][: len(states)],
            **{each: [html.number(value, 6) for value in states[each]] for each in answer.change},
        }
        return table_of_states(states, [states.structure.elevation], more)

    def refusal(self, question: Question, answer: LeastSnap) -> str:
        """Reason why no snap was found."""
        return "" if answer.landing is not None else answer.why


def _stations(question: Question, answer: LeastSnap) -> States:
    """State, fold and landing."""
    further = () if answer.states is None else (answer.states,)
    return join_states(question.structure, (question["state"], *further))


class SnapGraphKind(Kind[Snaps]):
    """Runs of the stability boundary, where snaps from them land, and the energy released."""

    table = "snap_graph"
    tasks = (snap_graph,)
    own = MappingProxyType(
        {
            "descriptor": (
                str | None,
                Field(
                    default=None, description="Descriptor that distinguishes states in the figure."
                ),
            )
        }
    )

    def look_up_more(self, question: Question) -> Descriptor:
        """Look up the descriptor that distinguishes states."""
        text = question.section.descriptor
        if text is None:
            return question.structure.elevation
        return descriptor_at(question.ground, text, f"{question.key}.descriptor")

    def answer(self, question: Question, arguments: Arguments) -> Snaps:
        """Follow the snaps; only the ends of their ways are kept."""
        graph = snap_graph(**arguments.of(snap_graph))
        snaps = tuple(_lean(snap) for snap in graph.snaps)
        return graph.strata, snaps, tuple(arguments.eset.points[each.vertices] for each in snaps)

    def tables(self, question: Question, answer: Snaps) -> list[DataTable]:
        """Return every snap that was followed: from where, to where, and the energy released."""
        value = question.extra
        ends = [f"{value.name} {when}" for when in ("before", "after")]
        units = units_of(question.structure.parameters) | dict.fromkeys(ends, value.unit)
        units[HEAD[-1]] = question.structure.descriptor("energy").unit
        rows: list[list[object]] = []
        for number, (snap, states) in enumerate(zip(*answer[1:], strict=True), start=1):
            for state, landing in zip(states, snap.landings, strict=True):
                after = value(landing.state) if landing.landed else ""
                rows.append([
                    number, snap.source, snap.target, landing.status, landing.released,
                    *state.parameters.values(), value(state), after,
                ])  # fmt: skip
        names = [*HEAD, *names_of(question.structure.parameters), *ends]
        table = Table(dict(zip(names, zip(*rows, strict=True), strict=True)), units)
        told = DataTable(f"{question.files}.csv", "every snap that was followed", table)
        return [told] if answer[1] else []

    def figures(self, question: Question, answer: Snaps) -> list[Figure]:
        """Two panels, over two parameters."""
        if question.eset is None or len(question.eset.names) != 2 or not answer[1]:
            return []
        draw = partial(plotting.snap_panels, SnapGraph(question.eset, *answer[:2]), question.extra)
        return [still(question.files, draw, CAPTION, wide=True)]

    def words(self, question: Question, answer: Snaps) -> str:
        """Strata, runs, and the most energy that is released."""
        strata, snaps, _ = answer
        if not snaps:
            return "no stability boundary in the box: nothing snaps."
        most = max(snap.released[1] for snap in snaps)
        stable = "1 stable stratum" if len(strata) == 1 else f"{len(strata)} stable strata"
        runs = f"{count_of(len(snaps), 'run')} of the stability boundary"
        return f"{stable}, {runs}; a snap releases {most:.4g} at most."

    def details(self, question: Question, answer: Snaps) -> list[str]:
        """A table of the runs."""
        if not answer[1]:
            return []
        varied = [
            name
            for name in names_of(question.structure.parameters)
            if np.ptp(np.concatenate([states[name] for states in answer[2]])) > 0.0
        ]
        head = ["run", "from", "to", *map(escape, varied), "snaps followed", "energy released"]
        rows = [
            [
                str(number),
                f"stratum {snap.source}",
                escape(_goal(snap)),
                *(_between(states[name].min(), states[name].max()) for name in varied),
                str(len(snap.landings)),
                _between(*snap.released),
            ]
            for number, (snap, states) in enumerate(zip(*answer[1:], strict=True), start=1)
        ]
        return [html.table(head, rows)]


def _lean(snap: Snap) -> Snap:
    ends = np.array([0, -1])
    landings = (
        replace(each, way=each.way[ends], time=each.time[ends]) if len(each.way) else each
        for each in snap.landings
    )
    return replace(snap, landings=tuple(landings))


def _goal(snap: Snap) -> str:
    """Where the snaps of a run lead, in words."""
    if snap.status == "held":
        return "no snap: nothing moves"
    return f"stratum {snap.target}" if snap.target >= 0 else f"out of the set ({snap.status})"


def _between(low: float, high: float) -> str:
    one, other = html.number(low), html.number(high)
    return one if one == other else f"{one} … {other}"

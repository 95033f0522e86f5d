"""Energy that makes a state snap: transition networks, barriers over a set, and least shocks."""

from functools import partial
from html import escape
from pathlib import Path

import numpy as np

from equimorph import plotting
from equimorph.arrays import Float
from equimorph.dynamics.shock import LeastShock, least_shock
from equimorph.equilibria import EnergyBarrier, EnergyPath, TransitionNetwork, transition_network
from equimorph.manifold import barriers
from equimorph.structures import State
from equimorph.study import html
from equimorph.study.answers import count_of, place_of, table_of_states
from equimorph.study.question import Arguments, DataTable, Figure, Kind, Question, still
from equimorph.tables import Table, units_of

NOTHING = -1.0
"""Instead of the barrier of a state with nothing to snap to, or of an unknown one."""
Field = tuple[Float[np.ndarray, "rows columns"], State | None, EnergyBarrier]
"""Least barriers on a grid over two parameters, and the state with the largest one of all."""


class TransitionNetworkKind(Kind[TransitionNetwork]):
    """Stable states of one setting, and the saddles over which they reach each other."""

    table = "transition_network"
    tasks = (transition_network,)

    def figures(self, question: Question, answer: TransitionNetwork) -> list[Figure]:
        """The disconnectivity graph, and the way over the lowest pass, as a film, too."""
        if not len(answer.minima):
            return []
        tree = partial(plotting.disconnectivity, answer)
        path = _lowest_pass(answer)
        found = [still(f"{question.files}-tree", tree, "At which energies basins join.")]
        if path is None:
            return found
        film, caption = f"{question.files}-film.gif", "From state to state over the lowest pass."
        draw = partial(plotting.energy_path, path)
        found.append(still(f"{question.files}-path", draw, "Energy over the lowest pass."))
        return [*found, Figure((film,), partial(_film, path, film), caption, wide=True)]

    def words(self, question: Question, answer: TransitionNetwork) -> str:
        """Numbers of states and saddles, and the least barrier."""
        states = count_of(len(answer.minima), "stable state")
        saddles = count_of(len(answer.saddles), "saddle")
        known = [each.energy for each in _barriers(answer)]
        if not np.isfinite(known).any():
            return f"**{states}**, {saddles}; nothing to snap to."
        return f"**{states}**, {saddles}; the least barrier is {html.number(min(known), 6)}."

    def details(self, question: Question, answer: TransitionNetwork) -> list[str]:
        """A table of the stable states with their barriers, and what argues for completeness."""
        found = _barriers(answer)
        more = {
            "barrier": [html.number(each.energy, 6) for each in found],
            "released": [html.number(each.released, 6) for each in found],
            "beyond": [escape(each.status) for each in found],
        }
        minima = answer.states[answer.minima]
        told = "; ".join(escape(str(each)) for each in answer.arguments)
        return [*table_of_states(minima, [minima.structure.elevation], more), f"<p>{told}.</p>"]


class BarriersKind(Kind[Field]):
    """Barriers of all stable states of the set."""

    table = "barriers"
    tasks = (barriers,)

    def answer(self, question: Question, arguments: Arguments) -> Field:
        """Barriers over the box, and all that is known of the largest one at a vertex."""
        eset, field = arguments.eset, question.ground.field
        least = field.least() if len(eset.names) == 2 else np.zeros((0, 0))
        shown = np.where(np.isfinite(least), least, NOTHING)
        known = np.where(
            (eset.index == 0) & np.isfinite(field.at_vertices), field.at_vertices, NOTHING
        )
        most = int(known.argmax())
        if known[most] < 0.0:
            return shown, None, EnergyBarrier("nothing to snap to")
        return shown, eset.points[most], field.of(eset.points[[most]])[0]

    def tables(self, question: Question, answer: Field) -> list[DataTable]:
        """Parameters and barriers of the largest one."""
        _, state, most = answer
        if state is None:
            return []
        unit = state.structure.descriptor("energy").unit
        units = units_of(state.structure.parameters) | {"barrier": unit, "released": unit}
        row = {**state.parameters, "barrier": most.energy, "released": most.released}
        columns = {name: np.array([value]) for name, value in row.items()}
        return [DataTable(f"{question.files}.csv", "the largest barrier", Table(columns, units))]

    def figures(self, question: Question, answer: Field) -> list[Figure]:
        """Over two parameters, the least barrier of each point."""
        if question.eset is None or len(question.eset.names) != 2:
            return []
        draw = partial(plotting.least_barriers, question.eset, answer[0])
        caption = "The least barrier among the stable states at each setting."
        return [still(question.files, draw, caption)]

    def words(self, question: Question, answer: Field) -> str:
        """The largest one, and where."""
        _, state, most = answer
        if state is None:
            return "nothing to snap to from any stable state of the set."
        released = f", {html.number(most.released, 4)} released" if most.landing else ""
        where = place_of(state, question.free)
        return f"**{html.number(most.energy, 6)}** at most, at {where}: {most.status}{released}."


class LeastShockKind(Kind[LeastShock]):
    """The smallest disturbances that make a state snap."""

    table = "least_shock"
    tasks = (least_shock,)
    left_out = ("network",)

    def words(self, question: Question, answer: LeastShock) -> str:
        """The barrier, and the kind of shock that was looked for first."""
        if not answer.shocks:
            return f"{answer.barrier.status}: no shock is large enough."
        first = answer.shocks[0]
        unit = answer.state.structure.descriptor("energy").unit
        return (
            f"**{html.number(answer.barrier.energy, 6)}** {unit} at least; {first.kind}: "
            f"{html.number(first.value, 4)} {first.unit}, {first.status}."
        )

    def details(self, question: Question, answer: LeastShock) -> list[str]:
        """A table of the shocks."""
        rows = [
            [
                escape(each.kind), escape(each.status), html.number(each.value, 5),
                html.number(each.holds, 5), html.number(each.bound, 5), escape(each.unit),
            ]
            for each in answer.shocks
        ]  # fmt: skip
        head = ["shock", "status", "least found", "holds", "none below", "unit"]
        return [html.table(head, rows)] if rows else []


def _barriers(network: TransitionNetwork) -> list[EnergyBarrier]:
    """Barriers of the stable states."""
    return [network.barrier(each) for each in network.states[network.minima]]


def _lowest_pass(network: TransitionNetwork) -> EnergyPath | None:
    """Way over the lowest saddle that joins two basins."""
    if not network.merges:
        return None
    one, other = network.merges[0].between
    return network.path(network.states[one], network.states[other])


def _film(path: EnergyPath, name: str, folder: Path) -> None:
    plotting.film(path, folder / name)

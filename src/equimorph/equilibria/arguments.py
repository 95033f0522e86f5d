"""Arguments that no stable state is missing: which of them hold, and which do not apply.

See docs/decisions.md, "Completeness is argued".
"""

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from equimorph.equilibria.gradient_flow import Ending
from equimorph.equilibria.minima_graph import NONE, MinimaGraph
from equimorph.equilibria.random_search import PUSHED
from equimorph.structures import Growth


class Standing(StrEnum):
    """Whether an argument can be relied on; each member is equal to its text."""

    HOLDS = "holds"
    PROMISED = "holds if the promise does"
    OPEN = "open"
    NOT_APPLICABLE = "does not apply"


@dataclass(frozen=True)
class Argument:
    """One argument for completeness.

    Parameters
    ----------
    name
        "descents", "graph of minima", "sum of indices", or "pushes" where these were left out.
    standing
        Whether it holds, is left open, or does not apply.
    detail
        What was found, or why it does not apply; one line.
    """

    name: str
    standing: Standing
    detail: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.name}: {self.standing} ({self.detail})"


def arguments_of(graph: MinimaGraph, group: int) -> tuple[Argument, ...]:
    """All arguments for the states over one point."""
    arguments = (_descents(graph, group), _graph(graph, group), _sum(graph, group))
    states = int((graph.group == group).sum())
    if states <= PUSHED:
        return arguments
    detail = f"left out: {states} states are more than {PUSHED}; others may be missing"
    return (*arguments, Argument("pushes", Standing.OPEN, detail))


def contradicts(graph: MinimaGraph, group: int) -> bool:
    """Whether the sum of the indices applies and is not one: then states are missing."""
    return _growth(graph, group).applies and index_sum(graph, group) != 1


def _growth(graph: MinimaGraph, group: int) -> Growth:
    """Whether all states over a point count, and the energy grows beyond them."""
    if graph.ground.within:
        return Growth(False, "constraints cut states off")
    return graph.ground.structure.growth(graph.ground.p[group])


def index_sum(graph: MinimaGraph, group: int) -> int:
    """Σ (−1)^index of the states over one point."""
    return int(((-1) ** graph.index[graph.group == group]).sum())


def _descents(graph: MinimaGraph, group: int) -> Argument:
    """Every state of index one leads down to known states, or out of the box of guesses."""
    edges = [edge for edge in graph.edges if graph.group[edge.saddle] == group]
    told = Counter(_outcome(graph, edge.ending, edge.end, group) for edge in edges)
    failed = sum(edge.ending in (Ending.STUCK, Ending.SLOW, Ending.HELD) for edge in edges)
    saddles = int(((graph.group == group) & (graph.index == 1)).sum())
    ways = ", ".join(f"{count} {outcome}" for outcome, count in told.items())
    detail = f"{saddles} states of index one" + (f": {ways}" if ways else "")
    return Argument("descents", Standing.OPEN if failed else Standing.HOLDS, detail)


def _outcome(graph: MinimaGraph, ending: Ending, end: int, group: int) -> str:
    """How a descent ended, in the words of the report."""
    if ending in (Ending.LANDED, Ending.SADDLE) and end == NONE:
        return "landed where the discretisation does not resolve states"
    if ending in (Ending.LANDED, Ending.SADDLE):
        beyond = graph.ground.excess(graph.z[[end]], np.array([group]))[0] > 0.0
        return "landed beyond the constraints" if beyond else "landed"
    return {
        Ending.ESCAPED: "left the box of guesses",
        Ending.STUCK: "stuck",
        Ending.SLOW: "slow",
        Ending.HELD: "stuck",
    }[ending]


def _graph(graph: MinimaGraph, group: int) -> Argument:
    """The minima hang together by saddles, if the configurations do."""
    name = "graph of minima"
    minima, piece = graph.pieces(group)
    pieces, tries = int(piece.max(initial=-1)) + 1, len(graph.tried[group])
    searched = f" after {tries} searches between pieces" if tries else ""
    if pieces <= 1:
        return Argument(name, Standing.HOLDS, f"{len(minima)} minima in one piece{searched}")
    detail = f"{len(minima)} minima in {pieces} pieces{searched}: saddles, or states, are missing"
    return Argument(name, Standing.OPEN, detail)


def _sum(graph: MinimaGraph, group: int) -> Argument:
    """Σ (−1)^index = 1 on Rⁿ where the energy grows at infinity."""
    name, growth = "sum of indices", _growth(graph, group)
    if not growth.applies:
        return Argument(name, Standing.NOT_APPLICABLE, growth.reason)
    total = index_sum(graph, group)
    detail = f"Σ(−1)^index = {total}, must be 1; {growth.reason}"
    if total != 1:
        return Argument(name, Standing.OPEN, detail)
    return Argument(name, Standing.PROMISED if growth.promised else Standing.HOLDS, detail)

"""`word_graph_over`: words that motions of all free parameters of a set together lead to."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, SnapGraph, snap_graph
from equimorph.manifold.queries.snap_graph import NOWHERE
from equimorph.model import Constraint
from equimorph.structures import join_states
from equimorph.tasks.words.word_graph import WordGraph, WordMove, check_letters, words_of

DECIDED = ("landed", "escaped", "held")
"""How snaps end that are decided."""


@check_arguments
def word_graph_over(
    eset: EquilibriumSet,
    at: Mapping[str, float],
    letters: Sequence[Constraint],
    *,
    samples: int = 9,
) -> WordGraph:
    """Which words of a multistable structure motions of several parameters together lead to.

    Within a stable stratum of the set every state leads to every other one without a snap; over
    the folds around it the structure snaps to others (`snap_graph`). So words of the same stratum
    are reached without a snap, `plan` has the route; words of different strata are not, in the box
    of the set. This is as sure as the set is complete: without a clean audit nothing is
    "unreachable".

    Parameters
    ----------
    eset
        Equilibrium set over the parameters that move.
    at
        Free parameters at rest.
    letters
        For each unit a constraint that tells its two states apart.
    samples
        Vertices tried first on each piece of a fold.

    Returns
    -------
    The graph; stops beyond those at rest are the strata.

    Raises
    ------
    InputError
        If there are no letters, or a free parameter is missing, unknown or outside the box.
    """
    check_letters(letters)
    here = eset.over(**{name: np.array([value]) for name, value in at.items()})
    stable = np.flatnonzero(here.index == 0)
    if len(stable) == 0:
        raise InputError(f"`at` must have a stable state; there is none at {dict(at)}.")
    stable = stable[np.argsort(here.states.energy[stable], kind="stable")]
    graph = snap_graph(eset, samples=samples)
    count, number = len(stable), {k: len(stable) + i for i, k in enumerate(graph.strata)}
    tops = [eset.points[int(eset.cells[eset.stratum == k][0, 0])] for k in graph.strata]
    states = join_states(eset.structure, [here.states[stable], *tops])
    moves = [
        WordMove(*pair, "free")
        for k, stratum in enumerate(here.stratum[stable].tolist())
        for pair in ((k, number[stratum]), (number[stratum], k))
    ]
    moves += _snaps(graph, number)
    doubts = [""] * count + [_doubt(eset, graph, stratum) for stratum in graph.strata]
    words = (*words_of(states[:count], letters), *("" for _ in tops))
    return WordGraph(states, count, words, tuple(moves), tuple(doubts))


def _snaps(graph: SnapGraph, number: dict[int, int]) -> Iterator[WordMove]:
    for snap in graph.snaps:
        if snap.target != NOWHERE:
            released = snap.released[0]
            yield WordMove(number[snap.source], number[snap.target], "snap", released=released)


def _doubt(eset: EquilibriumSet, graph: SnapGraph, stratum: int) -> str:
    """Why not every motion in a stratum, or snap from it, can be followed; empty if all can."""
    if not eset.audit.clean:
        return f"the set may lack states: {', '.join(eset.audit.faults)}"
    for snap in graph.leaving(stratum):
        beyond = snap.status == "landed" and snap.target == NOWHERE
        if beyond or snap.status not in DECIDED:
            where = "beyond the set" if beyond else snap.status
            return f"a snap from stratum {stratum} ends {where}"
    return ""

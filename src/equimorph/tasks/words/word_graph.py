"""Words of stable states, and which of them motions lead to, by moves between stops.

A stop is a stable state from which moves begin; those at rest have the parameters of the question.
This is the transition graph of hysteretic elements [MunganTerzi2019]_.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise, product
from typing import Literal

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Int, Values
from equimorph.errors import InputError
from equimorph.linalg.graphs import graph_of, walk_back
from equimorph.manifold import EquilibriumSet, SnapGraph, snap_graph
from equimorph.manifold.queries.snap_graph import NOWHERE
from equimorph.model import Constraint
from equimorph.structures import States, join_states

MoveKind = Literal["free", "snap", "possible snap"]
RouteStatus = Literal["reached", "unreachable", "not found"]


@dataclass(frozen=True)
class WordMove:
    """A motion from one stop to another.

    Parameters
    ----------
    start, goal
        Numbers of the stops.
    kind
        "free": without a snap; "snap": it ends with one; "possible snap": with one that may also
        lead elsewhere, as from a branch point.
    stroke, value
        Parameter that moves alone, and where it ends; empty and NaN where all may move.
    work
        ``∫ |∂L/∂a da|`` of the parameter that moves, before the snap; zero where all may move.
    released
        Energy that the snap releases.
    """

    start: int
    goal: int
    kind: MoveKind
    stroke: str = ""
    value: float = np.nan
    work: float = 0.0
    released: float = 0.0


@dataclass(frozen=True)
class WordRoute:
    """How a word is reached from another one, or why not.

    Parameters
    ----------
    status
        "reached" by the moves; "unreachable": every motion of the kind that is asked for was
        followed, and none leads there; "not found": none was found, but some could not be followed
        to their ends.
    why
        Reason if it was not reached.
    words
        Those of the stops on the way, in order, without repetitions.
    moves
        Moves with the least work together; of two ways with the same work one.
    """

    status: RouteStatus
    why: str
    words: tuple[str, ...] = ()
    moves: tuple[WordMove, ...] = ()

    def __repr__(self) -> str:
        """Words on the way and the work, or why there is none."""
        if self.status != "reached":
            return f"WordRoute({self.status}: {self.why})"
        return f"WordRoute({' → '.join(self.words)}: {self.snaps} snaps, work {self.work:.4g})"

    @property
    def snaps(self) -> int:
        """Number of snaps."""
        return sum(each.kind != "free" for each in self.moves)

    @property
    def work(self) -> float:
        """Work of all moves."""
        return float(sum(each.work for each in self.moves))


@dataclass(frozen=True, eq=False)
class WordGraph:
    """Stable states with their words, and all moves between them.

    Parameters
    ----------
    states
        Stops: first those at rest, then others.
    resting
        Number of those at rest.
    words
        Word of each stop: a letter for each unit, 1 where its constraint holds, else 0.
    moves
        All moves that were found.
    doubts
        For each stop why not every motion from there could be followed to its end; empty if all
        were.
    """

    states: States
    resting: int
    words: tuple[str, ...]
    moves: tuple[WordMove, ...]
    doubts: tuple[str, ...]

    def __repr__(self) -> str:
        """Numbers of words, stops and moves."""
        snaps = sum(each.kind != "free" for each in self.moves)
        doubtful = sum(bool(each) for each in self.doubts)
        left = f", {doubtful} stops with doubts" if doubtful else ""
        return f"WordGraph({self.resting} states at rest: {snaps} snaps{left})"

    @check_arguments
    def route(self, start: str, goal: str, *, snaps: bool = True) -> WordRoute:
        """Moves with the least work that lead from the state with one word to one with another.

        Parameters
        ----------
        start, goal
            Words of states at rest.
        snaps
            Whether the motion may snap.

        Returns
        -------
        The moves, or whether the word is unreachable or was not found.

        Raises
        ------
        InputError
            If `start` is no word of exactly one state at rest, or `goal` has other letters.
        """
        first, goals = self._number(start), self._at_rest(goal)
        if len(goal) != len(start) or set(goal) - set("01"):
            raise InputError(f"`goal` must have {len(start)} letters 0 or 1; got {goal!r}.")
        if not goals:
            return WordRoute("not found", f"no stable state at rest with the word {goal} is known")
        lengths, before = self._ways(first, snaps)
        last = min(goals, key=lambda each: float(lengths[each]))
        if np.isfinite(lengths[last]):
            moves = tuple(self._back(before, first, last, snaps))
            words = [self.words[k] for k in (first, *(each.goal for each in moves))]
            return WordRoute("reached", "", tuple(word for word, _ in groupby(words)), moves)
        return self._refusal(first, goals, snaps)

    @check_arguments
    def reached(self, start: str, *, snaps: bool = True) -> dict[str, RouteStatus]:
        """For every word of a state at rest whether it is reached from another one."""
        first = self._number(start)
        lengths, _ = self._ways(first, snaps)
        status: dict[str, RouteStatus] = {}
        for number, word in enumerate(self.words[: self.resting]):
            if np.isfinite(lengths[number]):
                status[word] = "reached"
            elif word not in status:
                status[word] = self._refusal(first, self._at_rest(word), snaps).status
        return status

    def _refusal(self, first: int, goals: list[int], snaps: bool) -> WordRoute:
        met = self._met(first, snaps)
        if len(np.intersect1d(met, goals)):
            return WordRoute("not found", "a snap on every way may also lead to another state")
        doubts = [self.doubts[k] for k in met.tolist() if snaps and self.doubts[k]]
        if doubts:
            more = f" (and {len(doubts) - 1} more)" if len(doubts) > 1 else ""
            return WordRoute("not found", f"{doubts[0]}{more}")
        allowed = "with snaps" if snaps else "without a snap"
        words = sorted({self.words[k] for k in met.tolist() if k < self.resting})
        return WordRoute("unreachable", f"all motions {allowed} lead to {', '.join(words)}")

    def _ways(self, first: int, snaps: bool) -> tuple[Values, Int[np.ndarray, " stops"]]:
        """Least works to all stops by moves that are certain, and the stops before them."""
        graph = self._graphs[snaps, True]
        lengths, before = dijkstra(graph, indices=first, return_predecessors=True)
        return lengths, before

    def _met(self, first: int, snaps: bool) -> Int[np.ndarray, " met"]:
        """Stops that moves may lead to, certain or not."""
        graph = self._graphs[snaps, False]
        return np.asarray(breadth_first_order(graph, first, return_predecessors=False))

    def _number(self, word: str) -> int:
        found = self._at_rest(word)
        if len(found) != 1:
            known = ", ".join(sorted(set(self.words[: self.resting]))[:16])
            raise InputError(
                f"`start` must be the word of one state at rest ({known}); got {word!r}, of "
                f"{len(found)}."
            )
        return found[0]

    def _at_rest(self, word: str) -> list[int]:
        return [k for k in range(self.resting) if self.words[k] == word]

    @cached_property
    def _graphs(self) -> dict[tuple[bool, bool], csr_array]:
        """Sparse matrices of works: with snaps or not, moves that are certain only or all."""
        count, graphs = len(self.states), {}
        for snaps, certain in product((False, True), repeat=2):
            kinds = ("free", *(("snap",) if snaps else ()))
            kinds += ("possible snap",) if snaps and not certain else ()
            best = [min(own, key=_work) for own in self._between(kinds).values()]
            pairs = np.array([(each.start, each.goal) for each in best], int).reshape(-1, 2)
            graphs[snaps, certain] = graph_of(count, pairs, np.array([_work(e) for e in best]))
        return graphs

    def _between(self, kinds: tuple[str, ...]) -> dict[tuple[int, int], list[WordMove]]:
        """Moves of some kinds by the stops that they join."""
        found: dict[tuple[int, int], list[WordMove]] = {}
        for move in self.moves:
            if move.kind in kinds:
                found.setdefault((move.start, move.goal), []).append(move)
        return found

    def _back(
        self, before: Int[np.ndarray, " stops"], first: int, last: int, snaps: bool
    ) -> Iterator[WordMove]:
        """Moves of the way that Dijkstra found, in order."""
        between = self._between(("free", "snap") if snaps else ("free",))
        way = walk_back(before, first, last)
        assert way is not None
        for pair in pairwise(way.tolist()):
            yield min(between[pair], key=_work)


def _work(move: WordMove) -> float:
    return move.work


def words_of(states: States, letters: Sequence[Constraint]) -> tuple[str, ...]:
    """Words of states."""
    rows: list[Flags] = [each.holds(states) for each in letters]
    return tuple("".join("01"[int(flag)] for flag in column) for column in zip(*rows, strict=True))


def check_letters(letters: Sequence[Constraint]) -> None:
    """Refuse words without letters."""
    if len(letters) == 0:
        raise InputError("`letters` must have a constraint for each unit; got none.")


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
    """Find the words of a multistable structure that moving several parameters together reaches.

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

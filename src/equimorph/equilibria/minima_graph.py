"""Graph of minima, and the arguments that no stable state is missing.

Descents from saddles are its edges; saddles are searched between its pieces.

See docs/decisions.md, "Completeness is argued" and "States of one orbit are one piece of the graph
of minima".
"""

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from scipy.sparse.csgraph import csgraph_from_dense, dijkstra

from equimorph.arrays import Float, Int, Items, Lanes
from equimorph.equilibria.descents import descend
from equimorph.equilibria.gradient_flow import QUICK, Ending, Pace
from equimorph.equilibria.random_search import PUSHED, Ground, Groups
from equimorph.equilibria.saddles import Pairs, states_between
from equimorph.linalg.graphs import components, walk_back
from equimorph.structures import Growth
from equimorph.structures.metric import metric_coordinates, metric_length
from equimorph.tolerances import SAME_STATE

TRIES = 60
"""Pairs of minima over one point between which a saddle is searched, at most."""
AT_ONCE = 6
"""Of these at the same time: those that would be tried one after the other if all failed. One pair
at a time, as between two pieces, took half as many steps more for a frame in space."""
ROUNDS = 12
"""Rounds of descents from the saddles that the round before has found, at most."""
NONE = -1
"""Instead of the number of a state: the descent ended at none that is resolved."""

Numbers = Int[np.ndarray, " states"]
Pair = tuple[int, int]


@dataclass(frozen=True)
class Edge:
    """One way down: the saddle from which it leads, the state where it ends, and how it ended."""

    saddle: int
    end: int
    ending: Ending


class MinimaGraph:
    """States over points of the parameter space, and the minima that their saddles join.

    A group is a point. States keep their numbers when others are added.
    """

    def __init__(self, ground: Ground, z: Lanes, group: Groups, pace: Pace = QUICK) -> None:
        """Begin with known states; `pace` is that of the descents."""
        self.ground, self.pace = ground, pace
        self.z, self.group = np.zeros((0, ground.structure.size)), np.zeros(0, int)
        self.index, self._left = np.zeros(0, int), np.zeros(0, bool)
        self.edges: list[Edge] = []
        self._images: dict[tuple[int, str], int] = {}
        self._orbits: list[Pair] = []
        self.tried: dict[int, set[Pair]] = {each: set() for each in range(len(ground.p))}
        self.add(z, group)

    def __len__(self) -> int:
        """Return the number of states."""
        return len(self.z)

    # --- states and descents --------------------------------------------------------------------

    def add(self, z: Lanes, group: Groups) -> Numbers:
        """Numbers of states; those that are new are added, with their images under symmetries."""
        before, z = len(self), self.ground.pick(z, group)
        numbers = np.array(
            [self._number(*each) for each in zip(z, group.tolist(), strict=True)], int
        )
        number = before
        while number < len(self):  # images that are added have images, too
            self._add_images(number, int(self.group[number]))
            number += 1
        p = self.ground.p[self.group[before:]]
        self.index = np.append(self.index, self.ground.structure.index(self.z[before:], p))
        self._left = np.append(self._left, np.zeros(len(p), bool))
        return numbers

    def _add_images(self, number: int, group: int) -> None:
        """Images of a state; those on its orbit are joined with it as if by a saddle."""
        z, p = self.z[[number]], self.ground.p[[group]]
        for symmetry in self.ground.symmetries(group):
            turned = self.ground.pick(symmetry.apply(z, p)[0], np.array([group]))
            image = self._number(turned[0], group)
            self._images[number, symmetry.name] = image
            if symmetry.along_orbits and image != number:
                self._orbits.append((number, image))

    def _number(self, z: Float[np.ndarray, " size"], group: int) -> int:
        own = np.flatnonzero(self.group == group)
        gap = metric_length(self.ground.structure, self.z[own] - z)
        if gap.min(initial=np.inf) <= SAME_STATE:
            return int(own[gap.argmin()])
        self.z, self.group = np.append(self.z, z[None], axis=0), np.append(self.group, group)
        return len(self.z) - 1

    def descend(self) -> None:
        """Follow the energy down from saddles of index one, until that leads to nothing new.

        So it is from saddles of any index at which descents end, as those of symmetric states do.
        """
        structure = self.ground.structure
        for _ in range(ROUNDS):
            met = np.zeros(len(self), bool)
            met[[edge.end for edge in self.edges if edge.end != NONE]] = True
            saddles = np.flatnonzero(((self.index == 1) | met & (self.index > 1)) & ~self._left)
            if len(saddles) == 0:
                return
            self._left[saddles] = True
            p = self.ground.p[self.group[saddles]]
            led = descend(structure, self.z[saddles], p, self.pace)
            saddle, code = np.tile(saddles, 2), led.code.ravel()
            ends, group = led.z.reshape(-1, structure.size), self.group[saddle]
            good = np.isin(code, (Ending.LANDED, Ending.SADDLE))
            good[good] = structure.resolved(ends[good], self.ground.p[group[good]])
            number = np.full(len(code), NONE)
            number[good] = self.add(ends[good], group[good])
            rows = zip(saddle.tolist(), number.tolist(), code.tolist(), strict=True)
            self.edges += [Edge(top, end, Ending(how)) for top, end, how in rows]

    # --- pieces ---------------------------------------------------------------------------------

    def pieces(self, group: int) -> tuple[Numbers, Numbers]:
        """Stable states over a point, and the number of the piece of the graph of each."""
        joined = [(edge.saddle, edge.end) for edge in self.edges if edge.end != NONE]
        label = components(len(self), np.array(joined + self._orbits, int).reshape(-1, 2))
        minima = np.flatnonzero((self.group == group) & (self.index == 0))
        return minima, np.unique(label[minima], return_inverse=True)[1]

    def connect(self) -> None:
        """Search saddles between pieces, along the chains of minima with the shortest gaps.

        Dijkstra with weights 0 within a piece, d² between minima of different pieces, ∞ where no
        saddle was found [CarrTrygubenkoWales2005]_; the shortest gap of the best chain is tried.
        """
        while True:
            pairs = [
                (group, *pair)
                for group in range(len(self.ground.p))
                for pair in (*self._gaps(group), *self._opposite(group))
            ]
            if not pairs:
                return
            group, start, goal = np.array(pairs, int).T
            given = Pairs(self.z[start], self.z[goal], self.ground.p[group])
            met = states_between(self.ground.structure, given)
            good = self.ground.structure.resolved(met.z, given.p[met.pair])
            self.add(met.z[good], group[met.pair[good]])
            self.descend()

    def _note(self, group: int, start: int, goal: int) -> None:
        """Note that a pair is tried, and with it its images, between which images are met."""
        pairs = [(start, goal)]
        for symmetry in self.ground.symmetries(group):
            pairs += [(self._images[start, symmetry.name], self._images[goal, symmetry.name])]
        self.tried[group] |= {(min(pair), max(pair)) for pair in pairs}

    def _opposite(self, group: int) -> list[Pair]:
        """Pairs of minima of one orbit, not tried: other orbits lie between them."""
        tried, own = self.tried[group], (self.group == group) & (self.index == 0)
        pairs = {(min(pair), max(pair)) for pair in self._orbits if own[pair[0]]}
        chosen = sorted(pairs - tried)
        for pair in chosen:
            self._note(group, *pair)
        return chosen

    def _gaps(self, group: int) -> list[Pair]:
        """Pairs of minima of different pieces that are tried next."""
        chosen: list[Pair] = []
        while len(chosen) < AT_ONCE and (more := self._shortest_gaps(group)):
            for pair in more[: AT_ONCE - len(chosen)]:
                self._note(group, *pair)
                chosen.append(pair)
        return chosen

    def _shortest_gaps(self, group: int) -> list[Pair]:
        """Shortest gaps, not tried, of the best chains of minima from one piece to the others."""
        minima, piece = self.pieces(group)
        left = TRIES - len(self.tried[group])
        if piece.max(initial=0) == 0 or left <= 0:
            return []
        u = metric_coordinates(self.ground.structure, self.z[minima])
        gaps = ((u[:, None] - u[None]) ** 2).sum(axis=2)
        gaps[piece[:, None] == piece] = 0.0
        place = {number: k for k, number in enumerate(minima.tolist())}
        for pair in self.tried[group]:
            i, j = (place.get(number, NONE) for number in pair)
            if min(i, j) != NONE and piece[i] != piece[j]:
                gaps[i, j] = gaps[j, i] = np.inf
        graph = csgraph_from_dense(gaps, null_value=np.inf)
        length, before = dijkstra(graph, indices=0, return_predecessors=True)
        ends = [np.flatnonzero(piece == k)[0] for k in range(piece.max() + 1) if k != piece[0]]
        chosen = {_shortest(gaps, before, int(end)) for end in ends if np.isfinite(length[end])}
        return [(int(minima[i]), int(minima[j])) for i, j in sorted(chosen)][:left]


def _shortest(gaps: Float[np.ndarray, "n n"], before: Items, end: int) -> Pair:
    """Shortest gap on the chain that Dijkstra found to a minimum."""
    chain = walk_back(before, 0, end)
    assert chain is not None
    links = [(i, j) for i, j in pairwise(chain[::-1].tolist()) if gaps[i, j] > 0.0]
    return min(links, key=lambda link: float(gaps[link]))


class Standing(StrEnum):
    """Whether an argument can be relied on; each member is equal to its text."""

    HOLDS = "holds"
    PROMISED = "holds if the promise does"
    OPEN = "open"
    NOT_APPLICABLE = "does not apply"


@dataclass(frozen=True)
class Argument:
    """One argument for completeness."""

    name: str
    """One of "descents", "graph of minima", "sum of indices", or "pushes" where these were left
    out."""
    standing: Standing
    """Whether it holds, is left open, or does not apply."""
    detail: str
    """What was found, or why it does not apply; one line."""

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
    """Whether the sum of the indices applies and is another one: then states are missing."""
    growth = _growth(graph, group)
    return growth.applies and index_sum(graph, group) != growth.total


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
    """Σ (−1)^index is known where the energy grows at infinity."""
    name, growth = "sum of indices", _growth(graph, group)
    if not growth.applies:
        return Argument(name, Standing.NOT_APPLICABLE, growth.reason)
    total = index_sum(graph, group)
    detail = f"Σ(−1)^index = {total}, must be {growth.total}; {growth.reason}"
    if total != growth.total:
        return Argument(name, Standing.OPEN, detail)
    return Argument(name, Standing.PROMISED if growth.promised else Standing.HOLDS, detail)

"""`word_graph`: words that motions of one parameter at a time lead to, followed to their ends.

See docs/decisions.md, "Words are followed, not searched".
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Items, Place, Values
from equimorph.equilibria import EventKind, Lifts, TraceOptions, lift
from equimorph.equilibria.descents import Descents, descend
from equimorph.equilibria.gradient_flow import FAITHFUL, Ending
from equimorph.errors import InputError
from equimorph.model import Constraint, position, worst_excess
from equimorph.structures import State, States, join_states
from equimorph.structures.metric import metric_length
from equimorph.tasks.words.word_graph import MoveKind, WordGraph, WordMove, check_letters, words_of
from equimorph.tolerances import SAME_PLACE, SAME_SOLUTION

Vector = Float[np.ndarray, " n"]

MOST = 20000
"""Stops beyond which no more motions are followed."""
SNAPPING = (EventKind.FOLD, EventKind.BRANCH_POINT)
"""Ends of lifts from which the structure snaps in one mode."""
DECIDED = (EventKind.ARRIVED, EventKind.CONSTRAINT, EventKind.LATERAL_BRANCH_POINT)
"""Ends of lifts beyond which there is nothing: the stroke, or a constraint."""


@check_arguments
def word_graph(
    start: State | States,
    strokes: Mapping[str, tuple[float, float]],
    letters: Sequence[Constraint],
    *,
    within: Sequence[Constraint] = (),
) -> WordGraph:
    """Find the words of a multistable structure that moving one parameter at a time reaches.

    From each state every parameter is moved both ways to the ends of its stroke while the others
    stay as they are at rest; at any place it may turn back. Where stability is lost the structure
    snaps along the gradient flow (`snap_landing`), and goes on from where it lands. Each state from
    which this starts, or which is met, is followed in this way until nothing new comes, so that
    words that were not met cannot be reached by such motions.

    Parameters
    ----------
    start
        Stable states with the same parameters, those at rest: one from which words are to be
        reached, or all that are known, as from `find_equilibria` or `Row`.
    strokes
        Least and largest value of each parameter that moves.
    letters
        For each unit a constraint that tells its two states apart.
    within
        Constraints to obey; motions end there.

    Returns
    -------
    The graph; its `route` tells how a word is reached from another one, or that it is not.

    Raises
    ------
    InputError
        If a state is no stable equilibrium or has other parameters, a stroke does not hold the
        value at rest, or there are no letters or strokes.

    References
    ----------
    [MunganTerzi2019]_

    Examples
    --------
    >>> import equimorph as em
    >>> row = em.Row(["(u*(u - 2))**2/4", "(u*(u - 2))**2/3"])
    >>> graph = em.word_graph(row.rest().stable, {"F": (-1.0, 1.0)}, row.letters)
    >>> graph.route("00", "10").status, graph.route("10", "01").words[-1]
    ('reached', '01')
    """
    states = start.batch if isinstance(start, State) else start
    check_letters(letters)
    _check_states(states)
    _check_strokes(states, strokes)
    search = _Exploration(states, dict(strokes), tuple(within))
    search.run()
    return search.graph(letters)


def _check_states(states: States) -> None:
    if len(states) == 0:
        raise InputError("`start` must have at least one stable state; got none.")
    if (states.index > 0).any():
        raise InputError(f"`start` must be stable; got a state of index {states.index.max()}.")
    if np.ptp(states.p / states.structure.scales, axis=0).max() > SAME_PLACE:
        raise InputError("`start` must have states with the same parameters; got different ones.")


def _check_strokes(states: States, strokes: Mapping[str, tuple[float, float]]) -> None:
    if not strokes:
        raise InputError("`strokes` must name at least one parameter; got none.")
    for name, (low, high) in strokes.items():
        here = float(states.p[0, position(states.structure.parameters, name)])
        if not (low <= here <= high and low < high):
            raise InputError(
                f"`strokes` must hold {name} = {here:g} between its ends; got {(low, high)}."
            )


@dataclass
class _Exploration:
    """Stops that are known, and the moves from them.

    `lines`: the parameter that differs from its value at rest; empty at rest.
    """

    stops: States
    strokes: dict[str, tuple[float, float]]
    within: tuple[Constraint, ...]
    lines: list[str] = field(default_factory=list)
    moves: list[WordMove] = field(default_factory=list)
    doubts: dict[int, str] = field(default_factory=dict)

    def run(self) -> None:
        """Follow motions from all stops until there are no new ones."""
        self.lines = [""] * len(self.stops)
        self.rest, done = self.stops.p[0], 0
        while done < len(self.stops):
            todo = np.arange(done, len(self.stops))
            if done > MOST:
                self.doubts |= dict.fromkeys(todo.tolist(), f"more than {MOST} stops were met")
                return
            done = len(self.stops)
            fallen = []
            for name, ends in self.strokes.items():
                own = [k for k in todo.tolist() if self.lines[k] in ("", name)]
                back = [k for k in todo.tolist() if self.lines[k] == name]
                for end in ends:
                    fallen += self._follow(np.array(own, int), name, end)
                self._return(np.array(back, int), name)
            self._snap(fallen)

    def graph(self, letters: Sequence[Constraint]) -> WordGraph:
        """The graph, stops at rest first."""
        away = np.array([bool(line) for line in self.lines])
        order = np.argsort(away, kind="stable")
        place, stops = np.argsort(order).tolist(), self.stops[order]
        moves = [replace(m, start=place[m.start], goal=place[m.goal]) for m in self.moves]
        doubts = tuple(self.doubts.get(stop, "") for stop in order.tolist())
        return WordGraph(stops, int((~away).sum()), words_of(stops, letters), tuple(moves), doubts)

    def _follow(self, stops: Items, name: str, end: float) -> "list[_Fall]":
        """Move a parameter to the end of its stroke; where stability is lost before."""
        fallen = []
        for some, lifts, work in self._lifts(stops, name, end):
            for lane, kind in enumerate(lifts.kind.tolist()):
                stop, there = int(some[lane]), lifts.states[lane]
                if kind in SNAPPING:
                    fallen.append(_Fall(stop, name, there, float(work[lane])))
                elif kind not in DECIDED:
                    self._doubt(stop, name, there, kind)
        return fallen

    def _return(self, stops: Items, name: str) -> None:
        """Move a parameter back to its value at rest."""
        rest = float(self.rest[position(self.stops.structure.parameters, name)])
        for some, lifts, work in self._lifts(stops, name, rest):
            for lane in np.flatnonzero(lifts.kind == EventKind.ARRIVED).tolist():
                goal = self._add(lifts.states.z[lane], self.rest, "")
                move = WordMove(int(some[lane]), goal, "free", name, rest, float(work[lane]))
                self.moves.append(move)

    def _lifts(self, stops: Items, name: str, end: float) -> Iterator[tuple[Items, Lifts, Values]]:
        """Lifts of all stops that are not there already, with the work of each; none if all are."""
        states, structure = self.stops[stops], self.stops.structure
        scale = structure.scales[position(structure.parameters, name)]
        far = np.abs(states[name] - end) > SAME_PLACE * scale
        if far.any():
            options = TraceOptions(record=True)
            lifts = lift(states[far], {name: end}, within=self.within, options=options)
            yield stops[far], lifts, works(states[far], lifts)

    def _snap(self, fallen: "list[_Fall]") -> None:
        """Moves that end where the structure snaps, all of one round in one batch."""
        if not fallen:
            return
        structure = self.stops.structure
        states = join_states(structure, [each.there for each in fallen])
        led = descend(structure, states.z, states.p, FAITHFUL)
        for lane, fall in enumerate(fallen):
            ways = np.flatnonzero(led.code[:, lane] != Ending.HELD).tolist()
            ends = [self._landing(led, way, lane, fall) for way in ways] or ["nothing moves"]
            doubts = [each for each in ends if isinstance(each, str)]
            goals = sorted({each for each in ends if isinstance(each, int)})
            if doubts:
                self._doubt(fall.stop, fall.name, fall.there, doubts[0])
            kind: MoveKind = "snap" if len(set(ends)) == 1 else "possible snap"
            for goal in goals:
                released = fall.there.energy - self.stops[goal].energy
                value = fall.there[fall.name]
                move = WordMove(fall.stop, goal, kind, fall.name, value, fall.work, released)
                self.moves.append(move)

    def _landing(self, led: Descents, way: int, lane: int, fall: "_Fall") -> int | str | None:
        """Stop where a descent lands; why that is not known; None if it leaves what is allowed."""
        code, structure = Ending(int(led.code[way, lane])), self.stops.structure
        if code == Ending.ESCAPED:
            return None
        if code != Ending.LANDED:
            return code.reason
        z, p = led.z[way, lane], fall.there.p
        if not structure.resolved(z[None], p[None])[0]:
            return "the discretisation does not represent the landing"
        if worst_excess(self.within, z[None], p[None])[0] > 0.0:
            return None
        return self._add(z, p, fall.name)

    def _add(self, z: Vector, p: Place, line: str) -> int:
        """Number of a stop; one that is new is added."""
        structure = self.stops.structure
        same = (np.abs((self.stops.p - p) / structure.scales) <= SAME_PLACE).all(axis=1)
        own = np.flatnonzero(same)
        gap = metric_length(structure, self.stops.z[own] - z)
        if gap.min(initial=np.inf) <= SAME_SOLUTION:
            return int(own[gap.argmin()])
        self.stops = join_states(structure, [self.stops, State(structure, z, p)])
        self.lines.append(line)
        return len(self.lines) - 1

    def _doubt(self, stop: int, name: str, there: State, why: str) -> None:
        self.doubts[stop] = f"the motion to {name} = {there[name]:.6g} ends undecided: {why}"


@dataclass(frozen=True)
class _Fall:
    """A stop, the parameter that moved, where stability is lost, and the work up to there."""

    stop: int
    name: str
    there: State
    work: float


def works(states: States, lifts: Lifts) -> Values:
    """``∫ |∂L/∂a da|`` along lifts of one parameter.

    Between recorded points this is the difference of L, exact where the effort keeps its sign.
    """
    assert lifts.points is not None
    structure, lanes = states.structure, np.arange(len(states))
    lane = np.concatenate([lanes, lifts.points.lane, lanes])
    at = np.concatenate([np.zeros(len(lanes)), lifts.points.at, lifts.at])
    order = np.lexsort((at, lane))
    z, p = (
        np.concatenate(each)[order]
        for each in (
            (states.z, lifts.points.states.z, lifts.states.z),
            (states.p, lifts.points.states.p, lifts.states.p),
        )
    )
    step, own = np.abs(np.diff(structure.energy(z, p))), lane[order]
    same = own[1:] == own[:-1]
    return np.bincount(own[1:][same], step[same], len(lanes))

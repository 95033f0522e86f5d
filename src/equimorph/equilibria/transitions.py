"""Transition network of one setting: stable states, saddles, and which of them each saddle joins.

See docs/barriers.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Int, Values
from equimorph.equilibria.capture import Completeness
from equimorph.equilibria.descents import NUDGES, descend
from equimorph.equilibria.energy_barriers import EnergyBarrier, EnergyPath, Merge
from equimorph.equilibria.gradient_flow import FAITHFUL, SMOOTH
from equimorph.equilibria.minima_graph import NONE, Argument, arguments_of
from equimorph.equilibria.saddles import Nowhere, ways_over
from equimorph.equilibria.search import search_with_graph
from equimorph.errors import InputError
from equimorph.model import Constraint, are_feasible, parameter_vector
from equimorph.structures import State, States, Structure, join_states
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_PLACE, SAME_SOLUTION


def _way_in_tree(links: list[tuple[int, int]], start: int, goal: int) -> list[int] | None:
    """Nodes of the only way between two nodes of a forest, whose links are given both ways."""
    ways = [[start]]
    while ways:
        way = ways.pop()
        if way[-1] == goal:
            return way
        ways += [[*way, end] for node, end in links if node == way[-1] and end not in way]
    return None


@dataclass(frozen=True, eq=False)
class TransitionNetwork:
    """Stable states of one setting, its saddles, and the transitions over them.

    Parameters
    ----------
    states
        All equilibria that were found, sorted by energy, those beyond the constraints among them.
    saddles
        Numbers of the states from which the energy was followed down: those of index one, and those
        of higher index at which such a descent ends, as between symmetric states.
    ends
        Numbers of the states where the two descents of each end, along ± the unstable mode;
        negative where they end at none, see `Nowhere`.
    admissible
        Whether each state obeys the constraints, and those of `Structure.validity`.
    completeness, arguments
        What `find_equilibria` says of states that may be missing.
    """

    states: States
    saddles: Int[np.ndarray, " saddles"]
    ends: Int[np.ndarray, "saddles 2"]
    admissible: Flags
    completeness: Completeness
    arguments: tuple[Argument, ...]

    def __repr__(self) -> str:
        """Numbers of states, and the arguments that none is missing."""
        beyond = int((~self.admissible).sum())
        left = f", {beyond} states beyond the constraints" if beyond else ""
        told = "".join(f"; {each.name}: {each.standing}" for each in self.arguments)
        return (
            f"TransitionNetwork({self.states.structure.kind}: {len(self.minima)} minima, "
            f"{len(self.saddles)} saddles{left}{told})"
        )

    @property
    def minima(self) -> Int[np.ndarray, " minima"]:
        """Numbers of the stable states."""
        return np.flatnonzero(self.states.index == 0)

    @cached_property
    def ways(self) -> tuple[tuple[int, int, int], ...]:
        """Saddle, a minimum below it, and where it leads beyond, by the energy of the saddle.

        The last is negative where the descent ends at no state, see `Nowhere`. A descent that ends
        at a saddle leads to all minima below that one. Saddles that lead to the same minimum on
        both sides have no way over them.
        """
        rows = ways_over(self.saddles, self.ends, self.energy)
        return tuple((saddle, start, end) for saddle, start, end in rows.tolist())

    @cached_property
    def merges(self) -> tuple[Merge, ...]:
        """How the basins join as the energy grows: the disconnectivity graph [BeckerKarplus1997]_.

        Saddles in order of energy, as far as they join basins that were apart before.
        """
        group: dict[int, tuple[int, ...]] = {int(number): (int(number),) for number in self.minima}
        merges = []
        for saddle, start, end in self.ways:
            if end < 0 or group[start] == group[end]:
                continue
            one, other = group[start], group[end]
            merges.append(Merge(float(self.energy[saddle]), saddle, (start, end), one, other))
            joined = tuple(sorted(one + other))
            group.update(dict.fromkeys(joined, joined))
        return tuple(merges)

    @cached_property
    def energy(self) -> Values:
        """Energies of the states."""
        return self.states.energy

    @check_arguments
    def number_of(self, state: State) -> int:
        """Number of a stable state of the network.

        Raises
        ------
        InputError
            If it is none, or has other parameters.
        """
        structure, own = self.states.structure, self.minima
        if state.structure.signature != structure.signature or not np.allclose(
            (state.p - self.states.p[0]) / structure.scales, 0.0, atol=SAME_PLACE
        ):
            raise InputError(
                f"`state` must have the structure and the parameters of the network; got {state!r}."
            )
        gap = metric_length(structure, (self.states.z[own] - state.z)[:, : structure.unknowns])
        if gap.min(initial=np.inf) > SAME_SOLUTION:
            raise InputError(f"`state` must be a stable state of the network; got {state!r}.")
        return int(own[gap.argmin()])

    @check_arguments
    def barrier(self, state: State) -> EnergyBarrier:
        """The least energy with which a stable state leaves its basin, and where it goes.

        This is the energy of the lowest saddle one descent from which ends at the state and the
        other elsewhere, above that of the state.

        Raises
        ------
        InputError
            If `state` is no stable state of the network.
        """
        number = self.number_of(state)
        ways = [way for way in self.ways if way[1] == number]
        return self._barrier(*ways[0]) if ways else EnergyBarrier("nothing to snap to")

    @check_arguments
    def path(self, start: State, goal: State) -> EnergyPath | None:
        """Minimum-energy path between two stable states; None if no saddles lead from one there.

        Its highest saddle is as low as possible (the pass between the two), and so is the highest
        one of each part between saddles of the disconnectivity graph. From each saddle the path
        leads down both ways along the gradient flow in the structure's metric.

        Raises
        ------
        InputError
            If `start` or `goal` is no stable state of the network.
        """
        here, there = self.number_of(start), self.number_of(goal)
        steps = {
            pair: (merge.saddle, *pair)
            for merge in self.merges
            for pair in (merge.between, merge.between[::-1])
        }
        minima = _way_in_tree(list(steps), here, there)
        if minima is None:
            return None
        ways = [steps[pair] for pair in pairwise(minima)]
        parts: list[State | States] = [self.states[here]]
        for saddle, one, other in ways:
            both = (self._descent(saddle, one), self._descent(saddle, other))
            up, down = (each for each in both if each is not None)
            parts += [up[::-1], self.states[saddle], down, self.states[other]]
        saddles = np.array([saddle for saddle, _, _ in ways], int)
        whole = join_states(self.states.structure, parts)
        return EnergyPath(whole, self.states[minima], self.states[saddles])

    def _descent(self, saddle: int, goal: int) -> States | None:
        """Configurations on the way down from a saddle to a minimum, over saddles on the way.

        None if the minimum does not lie below the saddle.
        """
        row = int(np.flatnonzero(self.saddles == saddle)[0])
        structure, top = self.states.structure, self.states[[saddle]]
        led = descend(structure, top.z, top.p, SMOOTH, NUDGES[:-1])
        for end, lane in zip(self.ends[row].tolist(), led.lane[:, 0].tolist(), strict=True):
            onward = self._descent(end, goal) if end in self.saddles else None
            if end != goal and onward is None:
                continue
            points = led.flow.lane(lane).points
            way = States(structure, points, np.tile(top.p, (len(points), 1)))
            further = () if onward is None else (self.states[end], onward)
            return join_states(structure, (way, *further))
        return None

    def _barrier(self, saddle: int, start: int, end: int) -> EnergyBarrier:
        """Barrier of a way."""
        height = float(self.energy[saddle] - self.energy[start])
        top, good = self.states[saddle], bool(self.admissible[saddle])
        if end < 0:
            return EnergyBarrier(Nowhere(end).status, height, top, admissible=good)
        released = float(self.energy[saddle] - self.energy[end])
        good = good and bool(self.admissible[end])
        return EnergyBarrier("landed", height, top, self.states[end], released, good)


@check_arguments
def transition_network(
    structure: Structure,
    at: Mapping[str, float],
    *,
    within: Sequence[Constraint] = (),
    starts: int = 200,
    runs: int = 3,
    seed: int = 0,
) -> TransitionNetwork:
    """Stable states of one setting, and the saddles over which they reach each other.

    All equilibria are searched as by `find_equilibria`; from each saddle of index one the gradient
    flow in the structure's metric is followed both ways along the unstable mode, as `snap_landing`
    does. Where a descent ends at another saddle, as between symmetric states, it is followed on.

    Parameters
    ----------
    at
        All parameters without a default, by name.
    within
        Constraints. States beyond them, as far as the search meets them, stay in the network and
        are marked: a barrier over a saddle that is not admissible says so.
    starts, runs, seed
        Of the search, see `find_equilibria`.

    Raises
    ------
    InputError
        For unknown parameters or values without meaning, or less than one start or run.

    Examples
    --------
    >>> from equimorph import Spring, transition_network
    >>> network = transition_network(Spring(), {"x_l": 0.8, "F": 0.0})
    >>> round(network.barrier(network.states[0]).energy, 12)  # ½ (1 − 0.8)²
    0.02
    """
    point = parameter_vector(structure.parameters, at)[None]
    (found,), graph = search_with_graph(structure, point, within, starts, runs, seed, FAITHFUL)
    p = np.tile(point, (len(graph), 1))
    order = np.argsort(structure.energy(graph.z, p), kind="stable")
    place, ends = np.argsort(order), dict[int, list[int]]()
    for edge in graph.edges:
        nowhere = Nowhere.of(edge.ending)
        end = nowhere if edge.end == NONE else int(place[edge.end])
        ends.setdefault(int(place[edge.saddle]), []).append(end)
    saddles = np.array(sorted(ends), int)
    return TransitionNetwork(
        States(structure, graph.z[order], p),
        saddles,
        np.array([ends[saddle] for saddle in saddles.tolist()], int).reshape(-1, 2),
        are_feasible((*within, *structure.validity), graph.z[order], p),
        found.completeness,
        arguments_of(graph, 0),
    )

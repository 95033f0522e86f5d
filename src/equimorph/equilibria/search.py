"""All equilibria at given parameters, with an estimate of how many are missing.

See docs/decisions.md, "Searches follow lines through known equilibria".
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Numbers
from equimorph.equilibria.capture import Completeness
from equimorph.equilibria.gradient_flow import QUICK, Pace
from equimorph.equilibria.legs import check_isolated
from equimorph.equilibria.minima_graph import Argument, MinimaGraph, arguments_of, contradicts
from equimorph.equilibria.random_search import BEYOND, UNRESOLVED, Ground, Pools, distinct
from equimorph.errors import InputError
from equimorph.model import Constraint, are_feasible, parameter_vector
from equimorph.structures import States, Structure
from equimorph.structures.metric import metric_length

Points = Float[np.ndarray, "points parameters"]

COMPLETIONS = 8
"""Rounds in which what descents, searches between minima and pushes found serves them again."""
NO_RUN = -1
"""Instead of the number of a run: found by descents, or between minima."""
BETWEEN = 100
"""Guesses between known states, over each point in each of these rounds."""
ENOUGH = 180
"""Lines through known states over a point, from which on each state has the usual number of them:
where none of so many finds another one, fewer than 2 % of such lines do (at 95 % confidence)."""
REPEATS = 3
"""Times that the runs at a point are made, at most: again while an equilibrium was found once."""


@dataclass(frozen=True, eq=False, repr=False)
class FoundStates(States):
    """What a search found: equilibria over one point, sorted by energy.

    Parameters
    ----------
    completeness
        Capture and recapture over the independent runs of the search; see `Completeness`.
    failures
        Number of starts that led to no equilibrium, by reason.
    arguments
        Arguments that no stable state is missing, and whether they hold; see `Argument`. A state
        whose neighbours of index one are all missing with it escapes them.
    unresolved
        Different states, which may obey the constraints, that the discretisation does not resolve.
    invalid
        Different states that were met beyond `Structure.validity`, where the energy does not
        describe the structure. They are not counted.
    """

    completeness: Completeness
    failures: Mapping[str, int]
    arguments: tuple[Argument, ...] = ()
    unresolved: States | None = None
    invalid: States | None = None

    def __repr__(self) -> str:
        """How many, how many of them are stable, and how many there may be."""
        stable, kind = int((self.index == 0).sum()), self.structure.kind
        told = "".join(f"; {each.name}: {each.standing}" for each in self.arguments)
        if self.invalid:
            bounds = ", ".join(map(str, self.structure.validity))
            told = f"; {len(self.invalid)} more, not counted, violate {bounds}{told}"
        return (
            f"FoundStates({kind}: {len(self)}, {stable} of them stable; {self.completeness}{told})"
        )


@check_arguments
def find_equilibria(
    structure: Structure,
    at: Mapping[str, float],
    *,
    within: Sequence[Constraint] = (),
    starts: int = 200,
    runs: int = 3,
    seed: int = 0,
) -> FoundStates:
    """Equilibria at parameters `at`, sorted by energy, with an estimate of how many are missing.

    Several independent runs, together in one batch. In each: Newton from random guesses of the
    structure; Newton homotopy from some of the guesses where Newton failed; Newton deflated by the
    known ones. Then lines in random directions of the actuators and loads are laid through every
    equilibrium and followed both ways through folds: where they return to `at` they give further
    ones, through which lines are laid again, until nothing new comes. Images under symmetries that
    leave `at` unchanged belong to each run. States that the discretisation does not resolve, or
    that violate `within` or `Structure.validity`, are dropped. States that differ by whole turns of
    what nothing keeps from turning, like a rod between pins, are one. While only one run found some
    equilibrium, runs are added.

    Then the energy is followed downwards from every state of index one until that leads to nothing
    new, and saddles are searched between minima that no chain of saddles joins: so no stable state
    is missing unless every state of index one next to it is missing as well. Against that, states
    are pushed both ways by random forces on all unknowns, until the forces vanish; over points with
    more than 120 known states pushes are left out, and many others may be missing. New states serve
    lines again. Where the energy is known to grow at infinity the sum of (−1)^index must be 1, else
    deflation searches once more. `FoundStates.arguments` records the outcome.

    Parameters
    ----------
    at
        All parameters without a default, by name.
    within
        Constraints that states must obey, like ``[arch.max_curvature <= 20]``.
    starts
        Number of random guesses of the first runs together; `Structure.guesses_per_start` for each.
    runs
        Number of independent runs; at most three times as many are made.
    seed
        Seed of the random generator.

    Raises
    ------
    InputError
        For unknown parameters or values without meaning, or less than one start or run.
    """
    points = parameter_vector(structure.parameters, at)[None]
    return search_points(structure, points, within=within, starts=starts, runs=runs, seed=seed)[0]


@check_arguments
def search_points(
    structure: Structure,
    points: Points,
    *,
    within: Sequence[Constraint] = (),
    starts: int = 200,
    runs: int = 3,
    seed: int = 0,
    known: States | None = None,
) -> list[FoundStates]:
    """`find_equilibria` at many points of the parameter space together, in less time.

    Parameters
    ----------
    points
        All parameters of the structure, one point per row.
    known
        Equilibria over these points. They count as the first run, and lines begin at them in the
        others, too: runs need not find all of them before they meet what is missing.

    Raises
    ------
    InputError
        For less than one start or run, or known states that lie over none of the points.
    """
    if known is not None:
        over = (known.p[:, None] == points).all(axis=2).any(axis=1)
        if not over.all():
            raise InputError(
                f"`known` must lie over the points that are searched; {np.sum(~over)} do not."
            )
    return search_with_graph(structure, points, within, starts, runs, seed, known=known)[0]


def search_with_graph(
    structure: Structure,
    points: Points,
    within: Sequence[Constraint],
    starts: int,
    runs: int,
    seed: int,
    pace: Pace = QUICK,
    known: States | None = None,
) -> tuple[list[FoundStates], MinimaGraph]:
    """What `search_points` finds, and the graph of all states that served it.

    The graph has states beyond the constraints, too, as far as descents and lines met them.
    """
    if not structure.finds_orbits:
        check_isolated(structure, points)
    generator, guesses = np.random.default_rng(seed), -(-starts // runs)
    catches = [_Catch.before(structure, point, tuple(within), known) for point in points]
    todo = np.arange(len(points))
    for _ in range(REPEATS):
        ground = Ground(structure, np.repeat(points[todo], runs, axis=0), tuple(within))
        pools = Pools(ground, generator, *_begun([catches[point] for point in todo], runs))
        pools.start(guesses)
        pools.spread(enough=ENOUGH if known is not None else 0)
        for number, point in enumerate(todo):
            catches[point] = catches[point].with_runs(pools, number * runs, runs)
        todo = np.array([point for point in todo if catches[point].doubtful], dtype=int)
        if len(todo) == 0:
            break
    ground = Ground(structure, points, tuple(within))
    return _complete_by_arguments(ground, catches, generator, pace)


def _begun(catches: list["_Catch"], runs: int) -> tuple[Lanes, Numbers]:
    """States with which runs begin, and the runs."""
    none = np.zeros((0, catches[0].z.shape[1]))
    known = [none if each.known is None else each.known for each in catches for _ in range(runs)]
    return np.concatenate(known), np.arange(len(known)).repeat([len(each) for each in known])


def _complete_by_arguments(
    ground: Ground, catches: list["_Catch"], generator: np.random.Generator, pace: Pace
) -> tuple[list[FoundStates], MinimaGraph]:
    """What was found, with what the arguments add that no stable state is missing."""
    group = np.repeat(np.arange(len(catches)), [len(catch.z) for catch in catches])
    found = [np.zeros((0, ground.structure.size)), *(catch.z for catch in catches)]
    graph = MinimaGraph(ground, np.concatenate(found), group, pace)
    pushed = 0
    for _ in range(COMPLETIONS):
        known = len(graph)
        graph.descend()
        graph.connect()
        lacking = [number for number in range(len(catches)) if contradicts(graph, number)]
        pools = Pools(ground, generator, graph.z, graph.group)
        pools.push(pushed)
        pools.push_softly(pushed)
        pools.start_between(BETWEEN, pushed)
        pushed = len(graph)
        if len(pools.z) == known and not lacking:
            break
        if len(pools.z) == known:
            pools.deflate(np.array(lacking))
        pools.spread(known)
        graph.add(pools.z[len(graph) :], pools.group[len(graph) :])
    graph.descend()
    states = [
        catch.with_states(graph.z[graph.group == number]).states(arguments_of(graph, number))
        for number, catch in enumerate(catches)
    ]
    return states, graph


@dataclass(frozen=True)
class _Catch:
    """What all runs at one point found: every state with the number of its run."""

    ground: Ground
    z: Float[np.ndarray, "caught size"]
    run: Int[np.ndarray, " caught"]
    runs: int
    failures: Mapping[str, int]
    unresolved: Float[np.ndarray, "dropped size"]
    known: Float[np.ndarray, "known size"] | None
    starts: int = 0
    arrived: int = 0

    @classmethod
    def before(
        cls,
        structure: Structure,
        point: Float[np.ndarray, " parameters"],
        within: tuple[Constraint, ...],
        known: States | None,
    ) -> "_Catch":
        """Before the first run, or with states that are known as that."""
        ground = Ground(structure, point[None], within)
        none = np.zeros((0, structure.size))
        if known is None:
            return cls(ground, none, np.zeros(0, int), 0, {}, none, None)
        z = structure.whole_turns.taken_back(known.z[(known.p == point).all(axis=1)])
        z = z[distinct(structure, z)]
        return cls(ground, z, np.zeros(len(z), int), 1, {}, none, z)

    def with_runs(self, pools: Pools, first: int, runs: int) -> "_Catch":
        """With the groups `first`, `first` + 1, ... of pools as further runs."""
        z = [pools.caught(first + number) for number in range(runs)]
        run = np.repeat(np.arange(runs), [len(each) for each in z]) + self.runs
        counts = Counter(self.failures)
        for reason, group in pools.failures:
            counts[reason] += int(((group >= first) & (group < first + runs)).sum())
        return _Catch(
            self.ground,
            np.concatenate([self.z, *z]),
            np.concatenate([self.run, run]),
            self.runs + runs,
            {reason: count for reason, count in counts.items() if count},
            np.concatenate(
                [self.unresolved]
                + [
                    each[(first <= group) & (group < first + runs)]
                    for each, group in pools.unresolved
                ]
            ),
            self.known,
            self.starts + int(((pools.starts >= first) & (pools.starts < first + runs)).sum()),
            self.arrived + int(((pools.arrived >= first) & (pools.arrived < first + runs)).sum()),
        )

    def with_states(self, z: Float[np.ndarray, "more size"]) -> "_Catch":
        """With states that no run has found."""
        run = np.concatenate([self.run, np.full(len(z), NO_RUN)])
        return replace(self, z=np.concatenate([self.z, z]), run=run)

    @cached_property
    def valid(self) -> Int[np.ndarray, " valid"]:
        """What obeys the constraints, and is described by the energy."""
        return np.flatnonzero(self._obeying & self._described)

    @property
    def invalid(self) -> Int[np.ndarray, " beyond"]:
        """What obeys the constraints, but is not described by the energy."""
        return np.flatnonzero(self._obeying & ~self._described)

    @cached_property
    def _obeying(self) -> Flags:
        return np.asarray(self.ground.excess(self.z, np.zeros(len(self.z), int)) <= 0.0)

    @cached_property
    def _described(self) -> Flags:
        p = np.tile(self.ground.p, (len(self.z), 1))
        return are_feasible(self.ground.structure.validity, self.z, p)

    @property
    def kept(self) -> Int[np.ndarray, " found"]:
        """The different states, sorted by energy."""
        structure, valid = self.ground.structure, self.valid
        at = valid[distinct(structure, self.z[valid])]
        energy = structure.energy(self.z[at], np.tile(self.ground.p, (len(at), 1)))
        return np.asarray(at[np.argsort(energy, kind="stable")])

    @property
    def captured(self) -> Bool[np.ndarray, "runs found"]:
        """Whether each run found each of the different states."""
        kept = self.z[self.kept]
        captured = np.zeros((self.runs, len(kept)), bool)
        mine = self.valid[self.run[self.valid] != NO_RUN]
        if len(mine):
            gap = metric_length(self.ground.structure, self.z[mine, None] - kept)
            captured[self.run[mine], gap.argmin(axis=1)] = True
        return captured

    @property
    def doubtful(self) -> bool:
        """Whether a state was found only once in several runs: another one may be missing.

        Where some were known, those count alone: the others are what was sought.
        """
        captured = self.captured
        if self.known is not None:
            captured = captured[:, captured[0]]
        return self.runs > 1 and bool((captured.sum(axis=0) == 1).any())

    def states(self, arguments: tuple[Argument, ...]) -> FoundStates:
        """Return the result."""
        structure, z = self.ground.structure, self.z[self.kept]
        reasons = (UNRESOLVED,) if len(z) else (UNRESOLVED, BEYOND)
        unresolved = sum(self.failures.get(reason, 0) for reason in reasons)
        arrivals = self.starts, self.arrived
        completeness = Completeness(self.captured, unresolved, *arrivals, structure.unresolved)
        p = np.tile(self.ground.p, (len(z), 1))
        beside = (
            States(structure, each, np.tile(self.ground.p, (len(each), 1)))
            for every in (self.unresolved, self.z[self.invalid])
            for each in [every[distinct(structure, every)]]
        )
        return FoundStates(structure, z, p, completeness, self.failures, arguments, *beside)

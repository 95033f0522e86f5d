"""Pools of equilibria over points of the parameter space, filled by starts and by lines.

See docs/decisions.md, "Searches follow lines through known equilibria".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int, Items, Lanes, Numbers, Parameters, Values
from equimorph.equilibria.curves import ParameterLine, growing_force, newton_homotopy
from equimorph.equilibria.saddles import Pairs, steps_for, strongest_pushes
from equimorph.equilibria.settle import Guards, settle
from equimorph.equilibria.soft_modes import extent_of_guesses, soft_modes
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.linalg.apart import firsts_apart
from equimorph.model import Constraint, worst_relative_excess
from equimorph.structures import Structure
from equimorph.structures.contract import Symmetry
from equimorph.structures.metric import metric_coordinates, metric_length
from equimorph.tolerances import SAME_STATE

Groups = Numbers

UNRESOLVED = "not resolved by the discretisation"
"""Why a start led to no equilibrium, among the reasons in `failures`."""
BEYOND = "not resolved by the discretisation, beyond the constraints"
"""The same where the state violates a constraint, as far as it can be told."""
LINES = 3
"""Random lines through each equilibrium, followed both ways."""
REACH = 4.0
"""Length of a line to each side, in scaled parameters."""
ROUNDS = 8
"""Times that lines are laid through newly found equilibria, at most."""
PUSHED = 120
"""Most states over a point that are pushed: with more, what they lead to takes most of the time."""
PUSHES, OFTEN = 60, 20
"""Pushes over a point, shared among its states, and most of one state. Of a rod in space one push
in twenty leads to states that one random guess in thousands leads to, and lines do not."""
SYMMETRIC = 0.5
"""Share of pushes that are as symmetric as the state that they push."""
SHORT, STILL = 1e-4, 1e-2
"""Length of steps in the directions of pushes, and how much of one must move something."""
CROWDED = 0.01
"""Length of a soft mode, in extents of the guesses, below which a state may have neighbours that
random pushes step over."""
FIRM = 100.0
"""Force of a push along a soft mode, over stiffness times length of the mode."""
HOMOTOPIES, AS_WELL = 0.05, 0.25
"""Shares of the guesses from which Newton homotopy starts: where Newton found nothing, and in any
case, where a structure has several guesses for each start. It leads to other states: Newton's
method leaves what guesses are near."""
MEANS = 3
"""Known states of which guesses between them are means."""
ITERATIONS, WAY = 30, 7.0
"""Of Newton's method from random guesses, at most: so many, and those of a way of this length in
the metric. Where no state exists all of them are taken."""
NUDGE = 0.1
"""Part of the way from an equilibrium to a random guess, where deflated Newton starts."""
WIDE_STEPS = TraceOptions(
    through_folds=True,
    through_branch_points=True,
    first_step=0.1,
    largest_step=1.0,
    turning=0.5,
    steps=80,
    record=False,
    locate_passed=False,
    retries=0,
)
"""Coarse steps through everything: a lane that jumps to another branch does no harm here."""


def from_afar(structure: Structure) -> Guards:
    """Return the guards of Newton's method from random guesses."""
    longest = structure.longest_step
    return Guards(iterations=ITERATIONS + round(WAY / longest), longest=longest)


@dataclass(frozen=True)
class Ground:
    """Where is searched: points of the parameter space, one per group, and constraints."""

    structure: Structure
    p: Float[np.ndarray, "groups parameters"]
    within: tuple[Constraint, ...]

    def excess(self, z: Lanes, group: Groups) -> Values:
        """Largest violation in units of its bound."""
        return worst_relative_excess(self.within, z, self.p[group])

    def symmetries(self, group: int) -> list[Symmetry]:
        """Symmetries that leave the group's point unchanged."""
        point, every = self.p[group], self.structure.symmetries()
        return [each for each in every if np.array_equal(each.image(point), point)]

    def images(self, z: Lanes, group: int) -> list[Lanes]:
        """Images of states under these symmetries."""
        p = np.tile(self.p[group], (len(z), 1))
        same = np.full(len(z), group)
        return [self.pick(each.apply(z, p)[0], same) for each in self.symmetries(group)]

    def pick(self, z: Lanes, group: Groups) -> Lanes:
        """One state of each orbit on which there are some, and of those whole turns away."""
        p = self.p[group]
        return self.structure.pick_on_orbits(self.structure.whole_turns.taken_back(z), p, p)


class Pools:
    """Different equilibria by group, and the reasons of failed starts.

    A group is one independent run at one point; all groups advance together in one batch. What the
    discretisation does not resolve is kept apart. starts, arrived: groups of the random guesses of
    runs, and of those that led to a state, known or not. led: where all that was tried led to.
    """

    def __init__(
        self,
        ground: Ground,
        generator: np.random.Generator,
        z: Lanes | None = None,
        group: Groups | None = None,
    ) -> None:
        """Begin with nothing, or with known states."""
        self.ground, self.generator = ground, generator
        self.z = np.zeros((0, ground.structure.size)) if z is None else z
        self.group = np.zeros(0, int) if group is None else group
        self.failures: list[tuple[str, Groups]] = []
        self.starts = self.arrived = np.zeros(0, int)
        self.unresolved: list[tuple[Lanes, Groups]] = []
        self.led: list[tuple[Lanes, Groups]] = []
        self._begun = len(self.z)

    def caught(self, group: int) -> Lanes:
        """States of a group but those known before to which nothing has led."""
        own = np.flatnonzero(self.group == group)
        known = own[own < self._begun]
        met = np.concatenate([self.z[:0], *(z[of == group] for z, of in self.led)])
        met = np.concatenate([met, *self.ground.images(met, group), self.z[known]])
        some = len(met) - len(known)
        apart = distinct(self.ground.structure, met, some)[some:] - some
        return np.asarray(self.z[np.setdiff1d(own, known[apart])])

    def start(self, guesses: int) -> None:
        """Newton from random guesses, homotopy from some, deflation next to what was found."""
        structure = self.ground.structure
        groups = np.flatnonzero(structure.in_reach(self.ground.p))
        guesses = round(structure.guesses_per_start * guesses)
        group = np.repeat(groups, guesses)
        p = self.ground.p[group]
        guess = structure.sample(p, self.generator)
        number = np.arange(len(group)) % guesses
        for k, special in enumerate(structure.special_guesses(self.ground.p[groups])[:guesses]):
            good = structure.resolved(special, self.ground.p[groups])
            guess[np.flatnonzero(number == k)[good]] = special[good]
        near = settle(structure, guess, p, guards=from_afar(structure))
        found = near.found
        self.failures.append(("Newton did not converge", group[~found]))
        led = self._take(near.z[found], group[found])
        as_well = AS_WELL if structure.guesses_per_start > 1.0 else 0.0
        again = (number < np.ceil(HOMOTOPIES * guesses)) & ~found  # the first ones are special
        again |= number >= guesses - np.ceil(as_well * guesses)
        self._by_homotopy(guess[again & found], group[again & found])
        followed = self._by_homotopy(guess[again & ~found], group[again & ~found])
        self.starts, self.arrived = group, np.concatenate([led, followed])
        self._by_deflation(np.arange(len(self.z)), NUDGE)

    def deflate(self, groups: Groups) -> None:
        """Deflated Newton close to all known states of some groups, and from random guesses."""
        for share in (NUDGE, 1.0):
            self._by_deflation(np.flatnonzero(np.isin(self.group, groups)), share)

    def spread(self, begin: int = 0, enough: int = 0) -> None:
        """Lay lines through equilibria, those before `begin` left out, until nothing is new.

        Up to three times the usual number through each, where a point has not `enough` otherwise.
        """
        for _ in range(ROUNDS):
            new = np.arange(begin, len(self.z))
            begin = len(self.z)
            if len(new) == 0:
                return
            self._turn_over(new)
            group = self.group[new]
            states = np.bincount(self.group)[group]
            self.lay_lines(np.repeat(new, np.clip(enough // states, LINES, 3 * LINES)))

    def _turn_over(self, lanes: Numbers) -> None:
        """Newton homotopies from states turned by whole turns that springs alone resist."""
        turns = self.ground.structure.whole_turns.sprung
        if len(turns) == 0:
            return
        group = np.tile(self.group[lanes], 2 * len(turns))
        guess = np.concatenate([self.z[lanes] + turn for turn in (*turns, *-turns)])
        self._by_homotopy(guess, group)

    def push(self, begin: int = 0) -> None:
        """Push equilibria, those before `begin` left out, both ways by random forces through folds.

        The forces act on all unknowns, also where no load of the structure does; where they
        vanish again there are equilibria. Where few states are known each is pushed several times.
        Left out over points with more than `PUSHED` states.
        """
        states = np.bincount(self.group, minlength=1)[self.group]
        lanes = np.flatnonzero((states <= PUSHED) & (np.arange(len(self.z)) >= begin))
        lanes = np.repeat(lanes, np.clip(PUSHES // states[lanes], 1, OFTEN))
        if len(lanes) == 0:
            return
        structure, z, group = self.ground.structure, self.z[lanes], self.group[lanes]
        p = self.ground.p[group]
        pairs = Pairs(z, structure.sample(p, self.generator), p)
        apart = np.flatnonzero(pairs.distance(structure) > SAME_STATE)
        if len(apart) == 0:
            return
        force = self._forces(pairs.take(apart))
        moving = force.any(axis=1)
        apart, force = apart[moving], force[moving]
        both, ways = np.concatenate([force, -force]), pairs.take(np.tile(apart, 2))
        line = growing_force(structure, ways.p, both, ways.distance(structure))
        outcome = trace(line, ways.start, (), WIDE_STEPS)
        returned = outcome.code == EventCode.RETURNED
        self._polish(outcome.z[returned], np.tile(group[apart], 2)[returned])

    def push_softly(self, begin: int = 0) -> None:
        """Push equilibria along their softest modes, both ways, where neighbours may be close.

        The steps are as short as the modes: states of every size of these are pushed together.
        """
        structure = self.ground.structure
        new = np.arange(begin, len(self.z))
        if len(new) == 0:
            return
        soft = soft_modes(structure, self.z[new], self.ground.p[self.group[new]])
        wide = CROWDED * extent_of_guesses(structure, self.ground.p)
        size = np.floor(np.log10(np.maximum(soft.own_length, SAME_STATE)))
        for each in np.unique(size[soft.own_length < wide]):
            lanes = np.tile(np.flatnonzero(size == each), 2)
            length, group = FIRM * soft.own_length[lanes], self.group[new[lanes]]
            push = np.abs(soft.eigenvalue[lanes]) * length * np.repeat([1.0, -1.0], len(lanes) // 2)
            force = np.zeros((len(lanes), structure.size))
            force[:, : structure.unknowns] = push[:, None] * structure.mass * soft.mode[lanes]
            line = growing_force(structure, self.ground.p[group], force, length)
            outcome = trace(line, self.z[new[lanes]], (), steps_for(10.0**each))
            returned = outcome.code == EventCode.RETURNED
            self._polish(outcome.z[returned], group[returned])

    def start_between(self, count: int, begin: int = 0) -> None:
        """Newton homotopies from random means of known states, at most `count` over each point.

        Guesses of the structure may lie far apart where it has many unknowns; its states are
        where others are. Left out are points over which no state is new from `begin` on, and means
        that the discretisation does not resolve: curves from these arrive nowhere.
        """
        groups = len(self.ground.p)
        states, new = (
            np.bincount(each, minlength=groups) for each in (self.group, self.group[begin:])
        )
        group = np.repeat(np.flatnonzero((states > 1) & (new > 0)), count)
        if len(group) == 0:
            return
        order, first = np.argsort(self.group, kind="stable"), np.cumsum(states) - states
        number = self.generator.integers(states[group][:, None], size=(len(group), MEANS))
        weights = self.generator.dirichlet(np.ones(MEANS), len(group))
        chosen = self.z[order[first[group][:, None] + number]]
        guess = self.ground.structure.as_guess(np.einsum("nk,nki->ni", weights, chosen))
        good = self.ground.structure.resolved(guess, self.ground.p[group])
        self._by_homotopy(guess[good], group[good])

    def _forces(self, pairs: Pairs) -> Lanes:
        """Random forces, as strong as pushes from states to guesses; 0 where nothing can move."""
        structure, n = self.ground.structure, self.ground.structure.unknowns
        step = np.zeros_like(pairs.start)
        random = self.generator.normal(size=(len(step), n))
        step[:, :n] = random / (np.sqrt(structure.mass) * np.linalg.norm(random, axis=1)[:, None])
        self._make_symmetric(step, pairs)
        size = np.maximum(metric_length(structure, step), STILL)
        near = structure.as_guess(pairs.start + SHORT * step)  # rotations move, or are but scaled
        moves = metric_length(structure, near - pairs.start) > STILL * SHORT
        step[:, :n] *= structure.mass
        return np.asarray(step * (moves * strongest_pushes(structure, pairs) / size)[:, None])

    def _make_symmetric(self, step: Lanes, pairs: Pairs) -> None:
        """Leave of half of the steps what the symmetries of the states where they begin leave.

        What is symmetric stays so, and meets few states: a plane frame in space those in its plane.
        """
        structure = self.ground.structure
        half = self.generator.uniform(size=len(step)) < SYMMETRIC
        for each in structure.symmetries():
            same = half & (each.image(pairs.p) == pairs.p).all(axis=1)
            image = each.apply(pairs.start, pairs.p)[0]
            same &= metric_length(structure, image - pairs.start) <= SAME_STATE
            moved = each.apply(pairs.start + step, pairs.p)[0]
            step[same] = 0.5 * (step + moved - image)[same]

    def _by_homotopy(self, guess: Lanes, group: Groups) -> Items:
        """Groups of the guesses that lead to a state."""
        if len(guess) == 0:
            return group
        structure, p = self.ground.structure, self.ground.p[group]
        curve = newton_homotopy(structure, guess, p)
        outcome = trace(curve, guess, (), WIDE_STEPS)
        arrived = outcome.code == EventCode.ARRIVED
        self.failures.append(("the Newton homotopy did not arrive", group[~arrived]))
        return self._polish(outcome.z[arrived], group[arrived])

    def _by_deflation(self, lanes: Numbers, share: float) -> None:
        """From points on the way to random guesses."""
        if len(lanes) == 0:
            return
        structure, group = self.ground.structure, self.group[lanes]
        p = self.ground.p[group]
        guess = self.z[lanes] + share * (structure.sample(p, self.generator) - self.z[lanes])
        guards = Guards(iterations=30, known=self._known()[lanes])
        away = settle(structure, guess, p, guards=guards)
        found = away.found
        self.failures.append(("deflated Newton did not converge", group[~found]))
        self._take(away.z[found], group[found])

    def _known(self) -> Float[np.ndarray, "lanes roots unknowns"]:
        """The pool of its group for each state; rows of NaN fill up."""
        n, most = self.ground.structure.unknowns, int(np.bincount(self.group).max())
        known = np.full((len(self.z), most, n), np.nan)
        for group in np.unique(self.group):
            mine = np.flatnonzero(self.group == group)
            known[mine, : len(mine)] = self.z[mine, :n]
        return known

    def lay_lines(self, lanes: Numbers) -> None:
        """Follow a random line in actuators and loads both ways through each of these states."""
        group = np.tile(self.group[lanes], 2)
        direction = self._directions(len(lanes))
        velocity = np.concatenate([direction, -direction])
        line = ParameterLine(self.ground.structure, self.ground.p[group], velocity)
        outcome = trace(line, np.tile(self.z[lanes], (2, 1)), (), WIDE_STEPS)
        returned = outcome.code == EventCode.RETURNED
        lost = ~returned & (outcome.code != EventCode.ARRIVED)
        self.failures.append(("a line was not followed to its end", group[lost]))
        self._polish(outcome.z[returned], group[returned])

    def _directions(self, count: int) -> Parameters:
        """Random directions of length `REACH` among actuators and loads."""
        structure = self.ground.structure
        steered = np.array([parameter.role != "fixed" for parameter in structure.parameters])
        free = steered if steered.any() else ~steered
        direction = self.generator.normal(size=(count, len(free))) * free
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        return np.asarray(direction * structure.scales * (REACH / length))

    def _polish(self, z: Lanes, group: Groups) -> Items:
        guards = Guards(iterations=12)
        exact = settle(self.ground.structure, z, self.ground.p[group], guards=guards)
        return self._take(exact.z[exact.found], group[exact.found])

    def _take(self, z: Lanes, group: Groups) -> Items:
        """Add what is resolved, not far outside the constraints, and new in its group.

        Returned are the groups of what is not new as well.
        """
        structure = self.ground.structure
        good = structure.resolved(z, self.ground.p[group])
        beyond = ~good
        beyond[~good] = self.ground.excess(z[~good], group[~good]) > 0.0  # not a number is no sign
        self.failures.append((UNRESOLVED, group[~good & ~beyond]))
        self.unresolved.append((z[~good & ~beyond], group[~good & ~beyond]))
        self.failures.append((BEYOND, group[beyond]))
        z, group = self.ground.pick(z[good], group[good]), group[good]
        # a little outside, states still serve as stepping stones
        z, group = (part[self.ground.excess(z, group) < 1.0] for part in (z, group))
        self.led.append((z, group))
        for each in np.unique(group):
            mine, known = z[group == each], self.z[self.group == each]
            pool = np.concatenate([known, mine[distinct(structure, mine)]])
            pool = np.concatenate([pool, *self.ground.images(pool, int(each))])
            kept = distinct(structure, pool, len(known))
            new = pool[kept[kept >= len(known)]]
            self.z = np.concatenate([self.z, new])
            self.group = np.concatenate([self.group, np.full(len(new), each)])
        return group


def distinct(structure: Structure, z: Lanes, known: int = 0) -> Int[np.ndarray, " distinct"]:
    """Return the first of each group of points closer than `SAME_STATE` in the metric.

    The first `known` are taken to be different.
    """
    return firsts_apart(metric_coordinates(structure, z), SAME_STATE, known)

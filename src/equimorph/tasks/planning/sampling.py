"""`plan_sampled`: routes for many actuators, where no grid of the set is possible.

A corridor is a path around which all settings within half its width have one admissible state, so
that straight lifts between them stay on it. Lengths are shares of the ranges of the actuators.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, gamma, pi

import numpy as np
from scipy.special import bdtr

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int, Values
from equimorph.equilibria import way_points
from equimorph.errors import InputError
from equimorph.model import Box, Constraint, Descriptor, position
from equimorph.structures import State, States, Structure
from equimorph.tasks.planning.corner_moves import ActuatorBox
from equimorph.tasks.planning.network import Demands, Ends, connect, lift_straight
from equimorph.tasks.planning.objectives import Wish
from equimorph.tasks.planning.random_trees import (
    LoadCourse,
    Tree,
    TreePath,
    constraint_slopes,
    join_paths,
    project_onto_constraints,
)
from equimorph.tasks.planning.slices import Slices
from equimorph.tasks.planning.straightening import check_margin, relax_corners, straighten
from equimorph.tasks.route import Corners, Route, refusal, verify_route
from equimorph.tasks.start import check_equilibrium

RESERVES = (1.0, 1.1)
"""Factors on the demanded margin that are tried in turn."""
INSIDE = 0.02
"""How far inside a bound settings are pushed, as a share of it."""
CONNECTIONS = 4
"""Nodes of the other tree that are tried for each new one."""


@check_arguments
@dataclass(frozen=True)
class SamplingOptions:
    """Knobs of the sampling planner.

    lifts: most straight lifts; batch: lanes side by side; reach: longest extension, in scaled
    parameters; seed: of the random numbers; slices: most sets over two of the actuators.
    """

    lifts: int = 40000
    batch: int = 128
    reach: float = 0.5
    seed: int = 0
    slices: int = 12


@check_arguments
def plan_sampled(  # noqa: PLR0913  # the knobs of the public face, most by keyword
    start: State,
    goal: State | None,
    actuators: Box,
    *,
    loads: Sequence[Mapping[str, float]] = (),
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
    objective: Wish = "length",
    monitor: Sequence[Descriptor] = (),
    options: SamplingOptions | None = None,
) -> Route:
    """Plan a route for up to about eight actuators by random trees of lifted edges.

    RRT-Connect [KuffnerLaValle2000]_ on the equilibrium set: trees of exact states grow from start
    and goal towards random settings, many straight lifts at a time, until a lift joins them. Where
    none does, slices are computed: equilibrium sets over two of the actuators each, through start
    and goal, then through the states that were reached nearest to the other end. On a slice every
    way is found, however narrow it is; parallel slices are joined by straight lifts. The path is
    straightened and drawn to where it costs least, and lifted again finely.

    Parameters
    ----------
    start
        A stable equilibrium.
    goal
        Another one; None with `loads`: any admissible state under the last load.
    actuators
        Box of the parameters that may be moved.
    loads
        Way-points of the environment, in order: loads move along straight legs from one to the
        next, never back, while the actuators do what they like.
    within
        Constraints to obey on the way.
    margin
        Smallest stability margin allowed.
    objective
        As of `plan`.
    monitor
        Further descriptors for the schedule.
    options
        Knobs; see `SamplingOptions`.

    Returns
    -------
    A verified route. A refusal does not prove that no route exists; without loads and constraints
    it says how wide corridors are that the trees would have missed with a probability of 0.05 at
    most: ways around which all settings within half the width have one admissible state.

    Raises
    ------
    InputError
        If an end is no equilibrium, lies outside the box or does not fit the loads, names are
        unknown or both actuator and load, or `margin` is negative.
    """
    options = options or SamplingOptions()
    demands = Demands.of(start.structure, objective, within, margin)
    course = _course(start, actuators, loads)
    ends = _check_ends(start, goal, course)
    for name, state in ends.items():
        if not state.stable:
            return refusal(f"the {name} is unstable (index {state.index})")
        if not demands.admissible(state.batch)[0]:
            return refusal(f"the {name} violates the constraints or the margin")
    route = refusal("")
    for reserve in RESERVES:
        tightened = replace(demands, margin=margin * reserve)
        path = _Search(course, start, goal, tightened, options).path()
        if path is None and goal is not None and course.legs == 0:
            path = _path_over_slices((start, goal), actuators, tightened, within, options.slices)
        if path is None:
            return refusal(_meaning_of_no(course, demands, goal, options))
        route = _straighten_route(course, path, demands, tightened, monitor)
        if route.arrived:
            break
    return route


def _path_over_slices(
    ends: Ends, actuators: Box, demands: Demands, within: Sequence[Constraint], most: int
) -> TreePath | None:
    states = Slices(ends, actuators, demands, within).path(most)
    return None if states is None else TreePath(states, np.zeros(len(states)))


def _meaning_of_no(
    course: LoadCourse, demands: Demands, goal: State | None, options: SamplingOptions
) -> str:
    """What is known if no route was found."""
    why = f"no route was found with {options.lifts} lifts"
    if goal is not None and course.legs == 0 and options.slices:
        why += f" and up to {options.slices} slices over two actuators"
    why += ", which is no proof that none exists"
    if demands.constraints or course.legs:
        return why
    rounds, reach = options.lifts // options.batch, 0.5 * options.reach
    width = narrowest_excluded(len(course.free), rounds, options.batch, reach)
    if width is None:
        return f"{why}: the lifts exclude no corridor as long as a range, not even the widest"
    return (
        f"{why}; corridors as long as a range and {width:g} of it wide would have been missed "
        f"with a probability of {CHANCE:g} at most"
    )


def _straighten_route(
    course: LoadCourse,
    path: TreePath,
    demands: Demands,
    tightened: Demands,
    monitor: Sequence[Descriptor],
) -> Route:
    """Route along a straightened path, by fine lifts where coarse ones step over a corner.

    Searched with tightened demands, verified with those of the caller.
    """
    rules, route = demands.constraints, refusal("")
    first, last = path.states[0], path.states[len(path.states) - 1]
    for closely in (False, True) if rules else (False,):
        corners = _corners(course, path, replace(tightened, closely=closely))
        route = check_margin(verify_route(first, last, corners, rules, monitor), demands)
        if route.arrived:
            break
    return route


def _course(start: State, actuators: Box, loads: Sequence[Mapping[str, float]]) -> LoadCourse:
    structure = start.structure
    free = np.array([position(structure.parameters, name) for name in actuators.names])
    for leg in loads:
        both = [name for name in leg if name in actuators.names]
        if both:
            raise InputError(f"`loads` must not move actuators; got {both[0]!r}.")
    corners = way_points(structure, start.p, list(loads)) if loads else [start.p]
    return LoadCourse(actuators, free, np.array(corners))


def _check_ends(start: State, goal: State | None, course: LoadCourse) -> dict[str, State]:
    """Both ends, by name."""
    if goal is None and course.legs == 0:
        raise InputError("`goal` must be given, unless loads move; got none.")
    ends = {"start": start} if goal is None else {"start": start, "goal": goal}
    for name, state in ends.items():
        check_equilibrium(name, state)
        if not course.box.holds(state.p[course.free], slack=1e-9):
            raise InputError(f"`{name}` must lie in {course.box}; got {state.parameters}.")
        last = course.corners[-1 if name == "goal" else 0].copy()
        last[course.free] = state.p[course.free]
        if not np.allclose(last, state.p, rtol=0, atol=1e-9):
            raise InputError(
                f"`{name}` must have the loads and fixed parameters of its end of the way; "
                f"got {state.parameters}."
            )
    return ends


class _Search:
    """Two trees that grow towards random settings and each other; one if there is no goal."""

    def __init__(
        self,
        course: LoadCourse,
        start: State,
        goal: State | None,
        demands: Demands,
        options: SamplingOptions,
    ) -> None:
        self.course, self.demands, self.options = course, demands, options
        self.structure: Structure = start.structure
        self.trees = [Tree(start, 0.0, 1.0)]
        if goal is not None:
            self.trees.append(Tree(goal, float(course.legs), -1.0))
        self.generator = np.random.default_rng(options.seed)
        self.lifts = 0

    def path(self) -> TreePath | None:
        """States from start to goal with their places along the course, or None."""
        if len(self.trees) == 2 and (found := self._join(0, np.zeros(1, int))):
            return found
        turn = 0
        while self.lifts < self.options.lifts:
            own = turn % len(self.trees)
            new = self._grow(own)
            if len(self.trees) == 1:
                done = new[self.trees[0].s[new] == self.course.legs]
                if len(done):
                    return join_paths(self.trees[0], int(done[0]), None, 0)
            elif len(new) and (found := self._join(own, new)):
                return found
            turn += 1
        return None

    def _grow(self, which: int) -> Int[np.ndarray, " new"]:
        """Extend a tree towards random settings; numbers of the new nodes."""
        tree, course = self.trees[which], self.course
        a, s = course.sample(self.options.batch, self.generator)
        near = tree.nearest(course, a, s)
        near, a, s = near[near >= 0], a[near >= 0], s[near >= 0]
        a, s = course.towards(tree, near, a, s, self.options.reach)
        states = States(self.structure, tree.z[near], tree.p[near])
        if self.demands.constraints:
            a = self._push_inside(states, tree.s[near], a, s)
        p = course.parameters(a, s)
        z, there, _ = lift_straight(states, p, self.demands)
        there &= np.abs(p - states.p).max(axis=1, initial=0.0) > 0.0
        self.lifts += len(near)
        return tree.add(z[there], p[there], s[there], near[there])

    def _push_inside(
        self,
        states: States,
        now: Values,
        a: Float[np.ndarray, "lanes d"],
        s: Values,
    ) -> Float[np.ndarray, "lanes d"]:
        """Settings near the given ones that the constraints, linearised at nodes, allow."""
        course, within = self.course, self.demands.constraints
        half = 0.5 * (course.box.upper - course.box.lower)
        here = states.p[:, course.free]
        directions = np.zeros((len(states), len(half) + 1, states.p.shape[1]))
        directions[:, np.arange(len(half)), course.free] = half
        directions[:, -1] = course.parameters(here, s) - course.parameters(here, now)
        excess, slopes = constraint_slopes(states, directions, within)
        # loads move by the whole of the last direction, actuators by shares of the other directions
        excess = excess + slopes[:, :, -1]
        low, high = (course.box.lower - here) / half, (course.box.upper - here) / half
        inside = np.array([INSIDE * abs(constraint.bound) for constraint in within])
        change = project_onto_constraints(
            (a - here) / half, excess, slopes[:, :, :-1], low, high, inside
        )
        return np.asarray(here + change * half)

    def _join(self, which: int, new: Int[np.ndarray, " new"]) -> TreePath | None:
        """Path through the first of new nodes that a straight lift joins with the other tree."""
        own, other = self.trees[which], self.trees[1 - which]
        mine, theirs = other.candidates(self.course, own, new, CONNECTIONS)
        if len(mine) == 0:
            return None
        first = States(self.structure, own.z[mine], own.p[mine])
        second = States(self.structure, other.z[theirs], other.p[theirs])
        linked, _ = connect(first, second, self.demands)
        self.lifts += len(mine)
        good: Bool[np.ndarray, " n"] = np.flatnonzero(linked)
        if len(good) == 0:
            return None
        pair = int(mine[good[0]]), int(theirs[good[0]])
        here, there = pair if which == 0 else pair[::-1]
        return join_paths(self.trees[0], here, self.trees[1], there)


def _corners(course: LoadCourse, path: TreePath, demands: Demands) -> Corners:
    """Way-points of a path, straightened leg by leg of the loads."""
    states, s = path.states, path.places
    names = [parameter.name for parameter in states.structure.parameters]
    corners: Corners = []
    for leg in range(max(course.legs, 1)):
        inside = np.flatnonzero((s >= leg) & (s <= leg + 1)) if course.legs else np.arange(len(s))
        section = states[inside]
        if course.legs == 0:
            section = relax_corners(
                straighten(section, demands), demands, ActuatorBox(course.box, course.free)
            )
        else:
            section = straighten(section, demands)
        moving = np.ptp(np.concatenate([states.p, course.corners]), axis=0) > 0.0
        corners += [
            {name: corner[name] for name, moves in zip(names, moving, strict=True) if moves}
            for corner in list(section)[1:]
        ]
    return corners


CHANCE = 0.05
"""Probability of being missed from which on a corridor counts as excluded."""
PARTS = 100
"""Widths that are tried."""


def chance_of_missing(
    width: float, length: float, actuators: int, rounds: int, batch: int, reach: float
) -> float:
    """Largest probability with which trees miss a corridor; exact for the chain of balls behind it.

    Balls of a radius ρ stand along the corridor, ρ apart. If a node of a tree lies in one of them
    and a sample falls into the next, the node nearest to the sample is at most 3ρ from it, so that
    a half width of 4ρ holds the straight lift to the sample, which a reach of 3ρ does not cut short
    [KleinbortEtAl2019]_. In each round of uniform samples, between which trees do not grow, the
    next of K balls is met with the probability b = 1 − (1 − V_d ρ^d)^batch, in all of them after n
    rounds with P(Bin(n, b) ≥ K); d counts the actuators. Two trees that grow from both ends share
    the balls.
    """
    radius = min(width / 8.0, reach / 3.0)
    ball = min(1.0, pi ** (0.5 * actuators) / gamma(0.5 * actuators + 1.0) * radius**actuators)
    meets = 1.0 - (1.0 - ball) ** batch
    return float(bdtr(ceil(length / radius) - 1, rounds, meets))


def narrowest_excluded(actuators: int, rounds: int, batch: int, reach: float) -> float | None:
    """Least width of corridors of length 1 missed with a chance of 5 % at most; None if none."""
    for part in range(1, PARTS + 1):
        if chance_of_missing(part / PARTS, 1.0, actuators, rounds, batch, reach) <= CHANCE:
            return part / PARTS
    return None

"""`Controller`: steps from measured values to commands for actuators, none beyond what is safe."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Values
from equimorph.control.estimate import Belief, ControlStatus, Estimate, Measurement, fit_loads
from equimorph.control.likely_loads import Bundles, LikelyLoads, move_states, positions
from equimorph.control.safe_routes import route_is_safe, safe_route
from equimorph.control.strides import MovingTarget, Step, Strides, ahead_of, setting_of
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, States
from equimorph.structures.metric import metric_length
from equimorph.tasks.motion.tracking import Tracking
from equimorph.tasks.planning.network import Demands
from equimorph.tasks.route import Route
from equimorph.tasks.start import check_equilibrium, check_fixed_parameters, check_stable
from equimorph.tolerances import SAME_STATE

SURPRISING = 1e-4
"""Probability of a measurement below which the structure is looked for on other sheets."""

Command = Mapping[str, float]


class Controller:
    """Controller that leads a structure to a goal by measured values, under unknown loads.

    In each step the state and the unknown loads are estimated from the measurement and the belief
    before it. The next stride is lifted under the estimated loads and under those that are likely,
    `deviations` standard deviations and a jump away; only one that keeps the constraints and the
    margin in all of these is commanded. Where the rest of the route is not safe under these loads,
    one that is is searched over the set as it is under the estimated loads; where the present place
    is not, it is left. What cannot be done safely is refused by name. Nothing is hidden in the
    controller: the same belief and measurement give the same answer.

    Motions are taken as quasi-static; see `speed_limit` for how fast strides may follow each other.

    Parameters
    ----------
    eset
        Equilibrium set over the actuators, at nominal loads.
    goal
        State over the set at nominal loads; a route that arrived, which is followed as long as it
        is safe; or a motion of `track` that arrived, whose targets are met under the estimated
        loads, one leg after the other.
    errors
        Standard error of each descriptor that is measured.
    unknown
        Unknown loads and the standard deviation of their change from step to step.
    margin
        Smallest stability margin that is kept.
    within
        Constraints to keep, in addition to those of the set.
    stride
        Longest change of the actuators in a step, in their scales.
    deviations
        Standard deviations of the loads that every commanded state must bear.
    jumps
        Largest sudden change of each load, by name, that every commanded state must bear as well.
    pace
        Legs of a moving target that are followed in a step.

    Raises
    ------
    InputError
        If nothing is measured, an unknown is an actuator of the set, or a number is out of range.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> eset = em.equilibrium_set(spring, em.Box(x_l=(0.6, 1.2)), fixed={"F": 0.1}, intervals=(9,))
    >>> start, goal = (max(eset.at(x_l=x).stable, key=spring.angle) for x in (1.1, 0.8))
    >>> noise, drift = {spring.angle: 0.01}, {"F": 0.01}
    >>> controller = em.Controller(eset, goal, noise, drift, margin=0.05)
    >>> belief = controller.start(start)
    >>> while belief.status == "following":
    ...     belief = controller.step(belief, {spring.angle: spring.angle(belief.state)})
    >>> belief.status.value, round(controller.command(belief)["x_l"], 3)
    ('arrived', 0.8)
    """

    @check_arguments
    def __init__(  # noqa: PLR0913  # the knobs of the public face, most by keyword
        self,
        eset: EquilibriumSet,
        goal: State | Route | Tracking,
        errors: Mapping[Descriptor, float],
        unknown: Mapping[str, float],
        *,
        margin: float = 0.0,
        within: tuple[Constraint, ...] = (),
        stride: float = 0.05,
        deviations: float = 2.0,
        jumps: Mapping[str, float] | None = None,
        pace: float = 1.0,
    ) -> None:
        self.eset, self.structure = eset, eset.structure
        self.goal, self.errors, self.unknown = goal, dict(errors), dict(unknown)
        self.margin, self.within = margin, (*eset.constraints, *within)
        self.stride, self.deviations, self.jumps = stride, deviations, dict(jumps or {})
        self.pace = pace
        self._check()
        self._actuators = positions(self.structure, eset.names)
        self._loads = positions(self.structure, unknown)
        self._goal = _end_of(goal)
        self._target = (
            MovingTarget.of(goal, self._actuators) if isinstance(goal, Tracking) else None
        )
        self._strides = Strides(eset.box, self._actuators, stride)
        self._jumps = np.array([self.jumps.get(name, 0.0) for name in unknown])
        self._drift = np.diag(np.array(list(unknown.values()), float) ** 2)
        self._demands = Demands.of(self.structure, "length", self.within, margin)

    def _check(self) -> None:
        if not self.errors:
            raise InputError("`errors` must name what is measured; got nothing.")
        for name in self.unknown:
            if name not in self.eset.fixed:
                raise InputError(
                    "`unknown` must name parameters that the set fixes "
                    f"({', '.join(self.eset.fixed)}); got {name!r}."
                )
        for name in self.jumps:
            if name not in self.unknown:
                raise InputError(
                    f"`jumps` must name unknown loads ({', '.join(self.unknown)}); got {name!r}."
                )
        errors = {what.name: error for what, error in self.errors.items()}
        for argument, named in (
            ("errors", errors), ("unknown", self.unknown), ("jumps", self.jumps),
        ):  # fmt: skip
            _check_sizes(argument, named)
        _check_sizes("stride", {"the stride": self.stride})
        _check_sizes("pace", {"the pace": self.pace})
        if not isinstance(self.goal, State) and not self.goal.arrived:
            raise InputError(f"`goal` must be a motion that arrived; got {self.goal!r}.")
        self._check_end("goal", _end_of(self.goal))

    def _check_end(self, name: str, state: State) -> None:
        check_equilibrium(name, state)
        check_stable(name, state)
        check_fixed_parameters(name, state, self.eset)

    def command(self, belief: Belief) -> Command:
        """Actuators that are to be applied, by name."""
        return {name: belief.state[name] for name in self.eset.names}

    @check_arguments
    def start(self, state: State) -> Belief:
        """Belief at a known state at nominal loads, with a route to the goal.

        Parameters
        ----------
        state
            Stable state over the set.

        Raises
        ------
        InputError
            If `state` is no stable state of the set's problem.
        """
        self._check_end("state", state)
        here = Belief(state, self._drift, (), state.p[self._loads], ControlStatus.FOLLOWING)
        if self._target is not None:
            return here
        likely = self._likely(here)
        place = likely.under(state.batch)
        if isinstance(self.goal, Route):
            followed = replace(here, way_points=tuple(self.goal.way_points))
            if self._follows_safely(followed, likely, place):
                return followed
        planned = self._replan(here, likely, place)
        is_found = planned.status == ControlStatus.REPLANNED
        return replace(planned, status=ControlStatus.FOLLOWING) if is_found else planned

    @check_arguments
    def step(self, belief: Belief, measured: Mapping[Descriptor, float]) -> Belief:
        """Next belief, with the next command, after a measurement at the last command.

        Parameters
        ----------
        belief
            What the step before returned, or `start`.
        measured
            Values of some or all of the descriptors in `errors`; {} if nothing was measured.

        Raises
        ------
        InputError
            If a descriptor has no standard error, or a value is not a number.
        """
        belief = self._estimate(belief, Measurement.of(measured, self.errors))
        if belief.status == ControlStatus.NOT_EXPLAINED:
            return belief
        here = belief.state.p[self._actuators]
        belief = replace(belief, way_points=ahead_of(belief.way_points, self.eset.names, here))
        likely = self._likely(belief)
        place, ahead = self._strides.begin(belief.state, self._next_place(belief), likely)
        if not place.safe[0]:
            return self._retreat(belief, likely)
        if self._target is not None:
            return self._track(belief, likely, place, ahead)
        if self._is_stale(belief):
            if self._follows_safely(belief, likely, place):
                belief = replace(belief, checked=belief.state.p[self._loads])
            else:
                return self._replan(belief, likely, place)
        return self._strode(belief, likely, place, ahead)

    @check_arguments
    def run(
        self,
        belief: Belief,
        read: Callable[[], Mapping[Descriptor, float]],
        write: Callable[[Command], None],
        steps: int,
    ) -> Belief:
        """Loop on hardware: write the command, read the sensors, step.

        Parameters
        ----------
        belief
            Where to begin.
        read
            Returns measured values, once the structure has settled.
        write
            Sends a command to the actuators.
        steps
            Most steps; it ends earlier where the goal is reached.
        """
        for _ in range(steps):
            write(self.command(belief))
            belief = self.step(belief, read())
            if belief.status == ControlStatus.ARRIVED:
                break
        return belief

    # what is estimated

    def _estimate(self, belief: Belief, measured: Measurement) -> Belief:
        """Belief with the measurement; on another sheet if this one does not explain it."""
        prior = belief.covariance + self._drift
        if len(measured.values) == 0:
            return replace(belief, covariance=prior, status=ControlStatus.FOLLOWING, why="")
        best = self._fit(belief.state, prior, measured)
        if best.chance < SURPRISING:  # a load jumped, or the structure did
            wide = prior + np.diag(self._jumps**2)
            fits = [self._fit(each, wide, measured) for each in self._sheets(belief)]
            best = min((best, *fits), key=lambda each: each.misfit)
        if best.chance < SURPRISING:
            why = f"chi-squared {best.misfit:.3g} of {len(measured.values)} measured values"
            return replace(
                belief, status=ControlStatus.NOT_EXPLAINED, why=why, surprise=best.chance,
                covariance=prior,
            )  # fmt: skip
        return replace(
            belief, state=best.state, covariance=best.covariance, surprise=best.chance,
            status=ControlStatus.FOLLOWING, why="",
        )  # fmt: skip

    def _fit(self, state: State, prior: np.ndarray, measured: Measurement) -> Estimate:
        return fit_loads(state, self._loads, prior, measured)

    def _sheets(self, belief: Belief) -> list[State]:
        """The state, and the others at the command under the loads that were estimated last."""
        over = self.eset.at(**self.command(belief)).stable
        if len(over) == 0:
            return [belief.state]
        loads = belief.state.p[self._loads][None].repeat(len(over), 0)
        states, arrived = move_states(over, self._loads, loads)
        return [belief.state, *states[np.flatnonzero(arrived)]]

    def _likely(self, belief: Belief) -> LikelyLoads:
        """Loads about the estimated ones, without and with jumps."""
        loads, spread = belief.state.p[self._loads], self._spread(belief)
        return LikelyLoads.around(self._loads, loads, spread, self._jumps, self._demands)

    # what is done

    def _is_stale(self, belief: Belief) -> bool:
        """Whether the loads have left those, jumps apart, for which the whole route was checked."""
        change = belief.state.p[self._loads] - belief.checked
        return bool((np.abs(change) > self._spread(belief)).any())

    def _spread(self, belief: Belief) -> Values:
        """How far likely loads are from the estimated ones, jumps apart."""
        return np.asarray(self.deviations * np.sqrt(np.diag(belief.covariance + self._drift)))

    def _follows_safely(self, belief: Belief, likely: LikelyLoads, place: Bundles) -> bool:
        return route_is_safe(place, belief.way_points, self._goal.batch, likely)

    def _is_goal(self, states: States) -> Flags:
        """Which states are the goal under their loads."""
        loads = states.p[:, self._loads]
        z, p = (each[None].repeat(len(states), 0) for each in (self._goal.z, self._goal.p))
        there, arrived = move_states(States(self.structure, z, p), self._loads, loads)
        gap = metric_length(self.structure, there.z - states.z)
        return np.asarray(arrived & (gap < SAME_STATE))

    def _replan(self, belief: Belief, likely: LikelyLoads, place: Bundles) -> Belief:
        """Another route over the set, safe under all likely loads."""
        goal, route = likely.under(self._goal.batch), None
        if not place.safe[0]:
            why = "the present place does not bear the likely loads"
        elif not goal.safe[0]:
            why = "the goal does not bear the likely loads, or does not exist under them"
        else:
            route = safe_route(self.eset, place, goal, likely)
            why = "no route over the set leads to the goal safely under the likely loads"
        if route is None:
            return replace(belief, status=ControlStatus.NO_SAFE_WAY, why=why)
        names = self.eset.names
        return replace(
            belief,
            way_points=tuple({name: state[name] for name in names} for state in list(route)[1:]),
            checked=belief.state.p[self._loads],
            status=ControlStatus.REPLANNED,
            why="",
        )

    def _next_place(self, belief: Belief) -> Values | None:
        """Actuators to go to: the next way-point, or what meets the moving target; None if none."""
        if self._target is None:
            here, ahead = belief.state.p[self._actuators], belief.way_points
            return setting_of(ahead[0], self.eset.names, here) if ahead else None
        there = self._target.place(belief.state, self._leg(belief))
        return there if there is not None and self.eset.box.holds(there, slack=0.0) else None

    def _leg(self, belief: Belief) -> float:
        """Where the moving target is next."""
        assert self._target is not None
        return min(belief.at + self.pace, self._target.duration)

    def _strode(self, belief: Belief, likely: LikelyLoads, place: Bundles, ahead: Step) -> Belief:
        """Belief after the longest safe stride towards the next way-point."""
        if ahead.there is None and self._is_goal(belief.state.batch)[0]:
            return replace(belief, status=ControlStatus.ARRIVED)
        if ahead.there is None:
            return self._replan(belief, likely, place)
        stride = self._strides.towards(place, ahead, likely)
        if stride.state is not None:
            return replace(belief, state=stride.state)
        changed = self._replan(belief, likely, place)
        if changed.status == ControlStatus.REPLANNED:
            return changed
        words = ", ".join(f"{name} = {value:.6g}" for name, value in belief.way_points[0].items())
        return replace(changed, why=f"no stride towards {words} is safe; {changed.why}")

    def _track(self, belief: Belief, likely: LikelyLoads, place: Bundles, ahead: Step) -> Belief:
        """Belief after the longest safe stride towards the next values of the moving target."""
        at, refused = self._leg(belief), replace(belief, status=ControlStatus.NO_SAFE_WAY)
        if ahead.there is None:
            why = f"no setting of the actuators in the box meets the target at leg {at:.6g}"
            return replace(refused, why=why)
        stride = self._strides.towards(place, ahead, likely)
        if stride.state is None:
            return replace(refused, why=f"no stride towards the target at leg {at:.6g} is safe")
        if not stride.whole:
            return replace(belief, state=stride.state)
        assert self._target is not None
        ended = belief.at == self._target.duration
        status = ControlStatus.ARRIVED if ended else ControlStatus.FOLLOWING
        return replace(belief, state=stride.state, at=at, status=status)

    def _retreat(self, belief: Belief, likely: LikelyLoads) -> Belief:
        """Belief after the move to the place nearby that bears the loads best."""
        there = self._strides.away(belief.state, likely)
        if there is None:
            why = "the present place does not bear the likely loads, and no place nearby does"
            return replace(belief, status=ControlStatus.NO_SAFE_WAY, why=why)
        unchecked = np.full(len(self._loads), np.inf)
        return replace(belief, state=there, status=ControlStatus.RETREATING, checked=unchecked)


def _check_sizes(argument: str, named: Mapping[str, float]) -> None:
    for name, value in named.items():
        if not 0.0 < float(value) < np.inf:
            raise InputError(f"`{argument}` must be positive; got {name}: {value!r}.")


def _end_of(goal: State | Route | Tracking) -> State:
    if isinstance(goal, State):
        return goal
    assert goal.states is not None
    return goal.states[-1]

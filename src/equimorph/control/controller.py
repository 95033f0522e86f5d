"""`Controller`: steps from measured values to commands for actuators, none beyond what is safe."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Values
from equimorph.control.belief import (
    Belief,
    ControlStatus,
    Estimate,
    Measurement,
    Moved,
    extremes,
    fitted,
    moved,
    positions,
)
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, States
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.route import Route
from equimorph.tasks.start import check_equilibrium, check_fixed_parameters, check_stable
from equimorph.tolerances import SAME_STATE, SAME_TO_ROUNDING

SURPRISING = 1e-4
"""Probability of a measurement below which the structure is looked for on other sheets."""
SHARES = (1.0, 0.5, 0.25)
"""Parts of a stride that are tried, the longest first."""
RESERVES = (0.0, 0.25, 0.45)
"""Margins with which routes are planned: shares of what the ends leave above the one that is kept.
The longer way around folds bears more loads."""
STALE = 1.0
"""Change of the loads, in standard deviations, after which the whole route is checked again."""

Command = Mapping[str, float]


class Controller:
    """Lead a structure to a goal by measured values, under loads that are not known.

    In each step the state and the unknown loads are estimated from the measurement and the belief
    before it. The next stride is lifted under the estimated loads and under those that are likely,
    `deviations` standard deviations and a jump away; only one that keeps the constraints and the
    margin in all of these is commanded. Where the rest of the route is not safe under the loads as
    they are now, another one is planned; where the present place is not, it is left. What cannot be
    done safely is refused by name. Nothing is hidden in the controller: the same belief and
    measurement give the same answer.

    Motions are taken as quasi-static; see `speed_limit` for how fast strides may follow each other.

    Parameters
    ----------
    eset
        Equilibrium set over the actuators, at nominal loads.
    goal
        State over the set at nominal loads, or a route that arrived, which is followed.
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
        goal: State | Route,
        errors: Mapping[Descriptor, float],
        unknown: Mapping[str, float],
        *,
        margin: float = 0.0,
        within: tuple[Constraint, ...] = (),
        stride: float = 0.05,
        deviations: float = 2.0,
        jumps: Mapping[str, float] | None = None,
    ) -> None:
        self.eset, self.structure = eset, eset.structure
        self.goal, self.errors, self.unknown = goal, dict(errors), dict(unknown)
        self.margin, self.within = margin, (*eset.constraints, *within)
        self.stride, self.deviations, self.jumps = stride, deviations, dict(jumps or {})
        self._check()
        self._actuators = positions(self.structure, eset.names)
        self._loads = positions(self.structure, unknown)
        self._goal = goal if isinstance(goal, State) else _end_of(goal)
        self._jumps = np.array([self.jumps.get(name, 0.0) for name in unknown])
        self._drift = np.diag(np.array(list(unknown.values()), float) ** 2)

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
        if isinstance(self.goal, Route) and not self.goal.arrived:
            raise InputError("`goal` must be a state or a route that arrived; got a refused route.")
        self._check_end("goal", self.goal if isinstance(self.goal, State) else _end_of(self.goal))

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
        likely = self._under(state, self._loads_of(here))
        if isinstance(self.goal, Route) and self._route_is_safe(likely, self.goal.way_points):
            return replace(here, way_points=tuple(self.goal.way_points))
        planned = self._replanned(here, likely)
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
        belief = self._estimated(belief, self._measurement(measured))
        if belief.status == ControlStatus.NOT_EXPLAINED:
            return belief
        likely = self._under(belief.state, self._loads_of(belief))
        if not likely.keep(self.margin).all():
            return self._retreat(belief)
        if self._is_stale(belief):
            if self._route_is_safe(likely, belief.way_points):
                belief = replace(belief, checked=belief.state.p[self._loads])
            else:
                belief = self._replanned(belief, likely)
        if belief.status == ControlStatus.NO_SAFE_WAY:
            return belief
        return self._strode(belief, likely)

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

    def _measurement(self, measured: Mapping[Descriptor, float]) -> Measurement:
        for each, value in measured.items():
            if each not in self.errors:
                raise InputError(f"`measured` must have standard errors; got {each.name}.")
            if not np.isfinite(value):
                raise InputError(f"`measured` must have numbers; got {each.name}: {value!r}.")
        values = np.array(list(measured.values()), float)
        return Measurement(tuple(measured), values, np.array([self.errors[d] for d in measured]))

    def _estimated(self, belief: Belief, measured: Measurement) -> Belief:
        """Belief with the measurement; on another sheet if this one does not explain it."""
        prior = belief.covariance + self._drift
        if len(measured.values) == 0:
            return replace(belief, covariance=prior, status=ControlStatus.FOLLOWING, why="")
        best = self._fit(belief.state, prior, measured)
        if self._is_surprising(best, measured):  # a load jumped, or the structure did
            wide = prior + np.diag(self._jumps**2)
            fits = [self._fit(each, wide, measured) for each in self._sheets(belief)]
            best = min((best, *fits), key=lambda each: each.misfit)
        likely = float(chi2.sf(best.misfit, len(measured.values)))
        if self._is_surprising(best, measured):
            why = f"chi-squared {best.misfit:.3g} of {len(measured.values)} measured values"
            return replace(
                belief, status=ControlStatus.NOT_EXPLAINED, why=why, surprise=likely,
                covariance=prior,
            )  # fmt: skip
        return replace(
            belief, state=best.state, covariance=best.covariance, surprise=likely,
            status=ControlStatus.FOLLOWING, why="",
        )  # fmt: skip

    def _fit(self, state: State, prior: np.ndarray, measured: Measurement) -> Estimate:
        return fitted(state, list(self.unknown), prior, measured)

    def _is_surprising(self, estimate: Estimate, measured: Measurement) -> bool:
        return bool(chi2.sf(estimate.misfit, len(measured.values)) < SURPRISING)

    def _sheets(self, belief: Belief) -> list[State]:
        """The state, and the others at the command under the loads that were estimated last."""
        over = self.eset.at(**self.command(belief)).stable
        if len(over) == 0:
            return [belief.state]
        loads = belief.state.p[self._loads][None].repeat(len(over), 0)
        found = moved(over, list(self.unknown), loads)
        return [belief.state, *found.states[np.flatnonzero(found.arrived)]]

    # what is safe

    def _loads_of(self, belief: Belief) -> Float[np.ndarray, "m k"]:
        loads = belief.state.p[self._loads]
        spread = np.sqrt(np.diag(belief.covariance + self._drift))
        usual = extremes(loads, self.deviations * spread)
        return np.concatenate([usual, extremes(loads, self.deviations * spread + self._jumps)[1:]])

    def _under(self, state: State, loads: Float[np.ndarray, "m k"]) -> Moved:
        """The state under each of some loads."""
        count = len(loads)
        z, p = state.z[None].repeat(count, 0), state.p[None].repeat(count, 0)
        return moved(States(self.structure, z, p), list(self.unknown), loads, self.within)

    def _driven(self, likely: Moved, target: Float[np.ndarray, " d"]) -> Moved:
        """The states under likely loads after a move of the actuators."""
        goals = target[None].repeat(len(likely.states), 0)
        return moved(likely.states, self.eset.names, goals, self.within)

    def _borne(self, belief: Belief, target: Float[np.ndarray, " d"]) -> float:
        """Smallest margin under likely loads after a move under the estimated ones."""
        found = moved(belief.state.batch, self.eset.names, target[None], self.within)
        if not found.arrived[0]:
            return -np.inf
        likely = self._under(found.states[0], self._loads_of(belief))
        return float(likely.states.margin.min()) if likely.arrived.all() else -np.inf

    # what is done

    def _is_stale(self, belief: Belief) -> bool:
        change = belief.state.p[self._loads] - belief.checked
        spread = np.sqrt(np.diag(belief.covariance + self._drift))
        return bool((np.abs(change) > STALE * spread).any())

    def _route_is_safe(self, likely: Moved, way_points: Sequence[Command]) -> bool:
        """Whether the whole rest of a route is safe under all likely loads, without jumps.

        After a jump another route may be taken; the place at which it happens must bear it.
        """
        likely = likely.first(2 * len(self._loads) + 1)
        for point in way_points:
            if not likely.keep(self.margin).all():
                return False
            here = likely.states.p[0, self._actuators]  # the actuators are the same in all
            likely = self._driven(likely, _towards(point, self.eset.names, here))
        return bool(likely.keep(self.margin).all() and self._is_goal(likely.states).all())

    def _is_goal(self, states: States) -> Flags:
        """Which states are the goal under their loads."""
        there = self._under(self._goal, states.p[:, self._loads])
        gap = (there.states.z - states.z)[:, : self.structure.unknowns]
        return np.asarray(there.arrived & (gap**2 @ self.structure.mass < SAME_STATE**2))

    def _replanned(self, belief: Belief, likely: Moved) -> Belief:
        """Another route over the set, found at nominal loads and safe under the present ones."""
        loads = np.array([[self.eset.fixed[name] for name in self.unknown]])
        nominal = moved(belief.state.batch, list(self.unknown), loads)
        usual = likely.first(2 * len(self._loads) + 1).states.p[:, self._loads]
        if not self._under(self._goal, usual).arrived.all():
            why = "the goal does not exist under all likely loads"
            return replace(belief, status=ControlStatus.NO_SAFE_WAY, why=why)
        why = "the state does not follow the loads back to those of the set"
        most = min(nominal.states.margin[0], self._goal.margin) if nominal.arrived[0] else -np.inf
        for reserve in RESERVES if most >= self.margin else ():
            margin = self.margin + reserve * (most - self.margin)
            route = plan(
                self.eset, nominal.states[0], self._goal, margin=margin, within=self.within
            )
            if not route.arrived:
                why = route.why if reserve == 0.0 else why
                break
            why = "routes of the set do not lead to the goal safely under the likely loads"
            if self._route_is_safe(likely, route.way_points):
                return replace(
                    belief,
                    way_points=tuple(route.way_points),
                    checked=belief.state.p[self._loads],
                    status=ControlStatus.REPLANNED,
                )
        return replace(belief, status=ControlStatus.NO_SAFE_WAY, why=why)

    def _strode(self, belief: Belief, likely: Moved) -> Belief:
        """Belief after the longest safe stride towards the next way-point."""
        names, scales = self.eset.names, self.structure.scales[self._actuators]
        here = belief.state.p[self._actuators]
        ahead = list(belief.way_points)
        while ahead and np.allclose(
            _towards(ahead[0], names, here), here, rtol=0, atol=SAME_TO_ROUNDING
        ):
            ahead.pop(0)
        if not ahead and self._is_goal(belief.state.batch)[0]:
            return replace(belief, way_points=(), status=ControlStatus.ARRIVED)
        if not ahead:
            return self._replanned(belief, likely)
        there = _towards(ahead[0], names, here)
        whole = min(1.0, self.stride / float(np.linalg.norm((there - here) / scales)))
        for share in SHARES:
            target = there if share * whole == 1.0 else here + share * whole * (there - here)
            after = self._driven(likely, target)
            if after.keep(self.margin).all():
                return replace(belief, state=after.states[0], way_points=tuple(ahead))
        changed = self._replanned(belief, likely)
        if changed.status == ControlStatus.REPLANNED:
            return changed
        place = ", ".join(f"{name} = {value:.6g}" for name, value in ahead[0].items())
        return replace(changed, why=f"no stride towards {place} is safe; {changed.why}")

    def _retreat(self, belief: Belief) -> Belief:
        """Belief after the move to the place nearby that bears the loads best."""
        here, scales = belief.state.p[self._actuators], self.structure.scales[self._actuators]
        steps = self.stride * np.concatenate([np.diag(scales), -np.diag(scales)])
        places = [row for row in here + steps if self.eset.box.holds(row, slack=0.0)]
        borne = [self._borne(belief, place) for place in places]
        if not borne or max(borne) == -np.inf:
            why = "the present place does not bear the likely loads, and no place nearby does"
            return replace(belief, status=ControlStatus.NO_SAFE_WAY, why=why)
        place = places[int(np.argmax(borne))]
        found = moved(belief.state.batch, self.eset.names, place[None])
        unchecked = np.full(len(self._loads), np.inf)
        status = ControlStatus.RETREATING
        return replace(belief, state=found.states[0], status=status, checked=unchecked)


def _check_sizes(argument: str, named: Mapping[str, float]) -> None:
    for name, value in named.items():
        if not 0.0 < float(value) < np.inf:
            raise InputError(f"`{argument}` must be positive; got {name}: {value!r}.")


def _end_of(route: Route) -> State:
    assert route.states is not None
    return route.states[-1]


def _towards(point: Command, names: tuple[str, ...], here: Values) -> Values:
    """A way-point as an array; actuators that it does not name stay."""
    return np.array([point.get(name, value) for name, value in zip(names, here, strict=True)])

"""`track`: actuators that lead descriptors along given targets while loads move."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float

from equimorph.equilibria import Event, Leg, Path, Waypoint, lift
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Schedule, position
from equimorph.structures import State, Structure
from equimorph.tasks.route import FINE, place, scheduled

Failure = Literal["", "snap-through", "singular Jacobian", "actuator limit", "constraint", "lost"]
CRITICAL = ("critical", "branch point", "index")
"""Ends at which a stable state loses its stability."""


@dataclass(frozen=True)
class Tracking:
    """Answer to "can the structure follow this motion".

    Parameters
    ----------
    status
        "arrived", or "refused" with the reason in `why` and its class in `failure`.
    failure
        "snap-through": stability is lost. "singular Jacobian": the actuators cannot move the
        descriptors on (det S_a = 0). "actuator limit", "constraint": a bound is met. "lost": a
        numerical failure.
    path
        Exact states, as far as it went; `path.at` counts legs, so that 1.5 is half-way through the
        second one.
    margin
        Smallest stability margin on the way.
    schedule
        Parameters along the whole motion; None if it was refused.
    """

    status: Literal["arrived", "refused"]
    failure: Failure
    why: str
    path: Path
    targets: tuple[Descriptor, ...]
    schedule: Schedule | None = None

    def __repr__(self) -> str:
        """Margin, or why and where it fails."""
        if self.arrived:
            return f"Tracking(arrived: margin {self.margin:.4g})"
        return f"Tracking(refused at {self.last_good:.6g}: {self.why})"

    @property
    def arrived(self) -> bool:
        """Whether the whole motion can be followed on stable states."""
        return self.status == "arrived"

    @property
    def last_good(self) -> float:
        """Where the motion ends: the number of legs that were done."""
        return float(self.path.at[-1])

    @cached_property
    def margin(self) -> float:
        """Smallest stability margin on the way."""
        return float(self.path.states.margin.min())

    @property
    def states(self) -> Mapping[str, Float[np.ndarray, " steps"]]:
        """Values of the targets along the path, by name."""
        return {each.name: each(self.path.states) for each in self.targets}


def track(
    start: State,
    targets: Leg | Sequence[Leg],
    *,
    actuators: Sequence[str] | Mapping[str, tuple[float, float]],
    within: Sequence[Constraint] = (),
    monitor: Sequence[Descriptor] = (),
) -> Tracking:
    """Follow targets S*(t) with as many actuators; loads may be prescribed at the same time.

    ``S_a ȧ = Ṡ* − S_l l̇``, corrected onto the set at every step: an error-controlled continuation
    in pseudo-arclength. The motion is followed once coarsely, and again finely before it is called
    good.

    Parameters
    ----------
    start
        A stable equilibrium.
    targets
        One leg or several: ``{descriptor: value, "q": value}``, approached at a constant rate, or
        functions of t from 0 to 1 that return such mappings and begin at the start's values.
    actuators
        Parameters to solve for, as many as descriptors; with limits: ``{"Theta": (0.2, 2.5)}``.
    within
        Constraints to obey on the way.
    monitor
        Further descriptors for the schedule.

    Returns
    -------
    The motion with its schedule, or where and why it cannot be followed. Of a motion that comes
    back to its first targets the actuators need not come back: compare the ends.

    Raises
    ------
    InputError
        If `start` is no stable equilibrium or violates a bound, or for targets and actuators
        without meaning.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.02}).end.state
    >>> turned = em.track(start, {spring.descriptor("angle"): 0.8}, actuators=["x_l"])
    >>> turned.arrived, float(turned.schedule.values[-1, 0].round(6))
    (True, 0.677282)
    """
    structure = start.structure
    limits = dict(actuators) if isinstance(actuators, Mapping) else {}
    bounds = [bound for name, ends in limits.items() for bound in _limits(structure, name, ends)]
    if not start.stable:
        raise InputError(f"`start` must be stable; got a state of index {start.index}.")
    legs = [_freed(leg, tuple(actuators)) for leg in _listed(targets)]
    asked = _descriptors(legs)
    constraints = (*within, *bounds)
    path = lift(start, legs, within=constraints)
    if path.arrived:
        path = lift(start, legs, within=constraints, options=FINE)
    end = path.end
    failure = _failure(end, bounds)
    if failure:
        return Tracking("refused", failure, _why(end, failure, tuple(actuators)), path, asked)
    monitored = tuple(dict.fromkeys((*asked, *(c.descriptor for c in within), *monitor)))
    schedule = scheduled(path, path.states.margin, monitored)
    return Tracking("arrived", "", "", path, asked, schedule)


def _listed(targets: Leg | Sequence[Leg]) -> list[Leg]:
    return [targets] if isinstance(targets, Mapping) or callable(targets) else list(targets)


def _freed(leg: Leg, actuators: tuple[str, ...]) -> Leg:
    """Leg with the actuators left unknown.

    Raises
    ------
    InputError
        If it prescribes an actuator, or as many descriptors as there are no actuators.
    """
    if callable(leg):
        return lambda t: _checked(leg(t), actuators)
    return _checked(leg, actuators)


def _checked(values: Waypoint, actuators: tuple[str, ...]) -> Waypoint:
    if not isinstance(values, Mapping):
        raise InputError(f"`targets` must give {{descriptor: value}}; got {values!r}.")
    asked = [key for key in values if isinstance(key, Descriptor)]
    if len(asked) != len(actuators):
        raise InputError(
            f"`targets` must prescribe as many descriptors as there are actuators "
            f"({len(actuators)}); got {len(asked)}."
        )
    for name in actuators:
        if name in values:
            raise InputError(
                f"`targets` must leave the actuator {name} free; got {values[name]!r}."
            )
    return {**values, **dict.fromkeys(actuators)}


def _descriptors(legs: Sequence[Leg]) -> tuple[Descriptor, ...]:
    first = [leg(0.0) if callable(leg) else leg for leg in legs]
    keys = (key for leg in first for key in leg)
    return tuple(dict.fromkeys(key for key in keys if isinstance(key, Descriptor)))


def _limits(structure: Structure, name: str, ends: tuple[float, float]) -> list[Constraint]:
    """Both limits of an actuator, as constraints."""
    at, (low, high) = position(structure.parameters, name), ends
    if not low < high:
        raise InputError(f"`actuators` must give limits in order; got {name} = {ends}.")
    unit = structure.parameters[at].unit
    itself = Descriptor(name, unit, lambda _, p: p[:, at].copy(), name, structure.signature)
    return [itself >= low, itself <= high]


def _failure(end: Event, bounds: Sequence[Constraint]) -> Failure:
    if end.kind == "arrived":
        return ""
    if end.kind in CRITICAL:
        return "snap-through"
    if end.kind == "fold":
        return "singular Jacobian"
    if end.kind == "constraint":
        limits = {str(bound) for bound in bounds}
        return "actuator limit" if end.detail in limits else "constraint"
    return "lost"


def _why(end: Event, failure: Failure, actuators: tuple[str, ...]) -> str:
    what = {
        "snap-through": "stability is lost: the structure would snap",
        "singular Jacobian": "the actuators cannot move the targets on (singular Jacobian)",
        "actuator limit": f"an actuator is at its limit ({end.detail})",
        "constraint": f"the constraint {end.detail} is met",
    }.get(failure, f"numerical failure: {end.detail}")
    return f"{what}, at {place(end.state, actuators)}"

"""Motions to follow: targets and prescribed parameters over time, linearised and corrected."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Parameters
from equimorph.equilibria import Leg
from equimorph.equilibria.legs import ON_BOUND, replace_parameters
from equimorph.equilibria.point_conditions import Values as TargetValues
from equimorph.equilibria.sensitivity import answers, slopes_along
from equimorph.equilibria.settle import Guards, Held, Settled, free_directions, settle
from equimorph.errors import InputError
from equimorph.manifold.lookup.exact_states import exact_states
from equimorph.model import Constraint, Descriptor, position
from equimorph.structures import State, States, Structure, join_states, value_of
from equimorph.tasks.distances import step_lengths

RATE = 1e-4
"""Share of a leg over which the rates of curves are measured."""

EXACT = 1e-10
"""Last correction, in the metric and scaled parameters, of a point that counts as found."""
TINY = 1e-300
"""Keeps quotients finite where two states are one."""
GUARDS = Guards(iterations=12, longest=0.3, converged=EXACT)
"""Limits of corrections onto targets."""

Times = Float[np.ndarray, " n"]
Prescribed = Float[np.ndarray, "n columns"]


@dataclass(frozen=True)
class Course:
    """Prescribed parameters and targets S* along legs, as functions of time.

    Time counts legs: 1.5 is half-way through the second. Columns are all parameters (those of the
    actuators do not count) and then the targets.
    """

    structure: Structure
    """What moves."""
    descriptors: tuple[Descriptor, ...]
    """What has targets, the same on all legs."""
    free: Int[np.ndarray, " k"]
    """Places of the actuators."""
    corners: Float[np.ndarray, "corners columns"]
    """Columns at the ends of the legs, the start first."""
    curves: dict[int, Any]
    """Legs that are curves, by number."""

    @classmethod
    def of(cls, start: State, legs: Sequence[Leg], actuators: Sequence[str]) -> "Course":
        """Course of legs that prescribe the same descriptors, each from the end of the last."""
        structure, p = start.structure, start.p[None]
        free = np.array([position(structure.parameters, name) for name in actuators])
        first = legs[0](0.0) if callable(legs[0]) else legs[0]
        descriptors = tuple(key for key in first if isinstance(key, Descriptor))
        here = np.concatenate([start.p, [each(start) for each in descriptors]])
        corners, curves = [here], {}
        for number, leg in enumerate(legs):
            if callable(leg):
                curves[number] = leg
                begin = _columns(structure, p, leg(0.0), descriptors)
                _check_beginning(structure, free, here, begin)
            values = leg(1.0) if callable(leg) else leg
            _check_free(values, actuators)
            here = _columns(structure, p, values, descriptors)
            here[free] = start.p[free]
            p = here[None, : len(start.p)]
            corners.append(here)
        return cls(structure, descriptors, free, np.array(corners), curves)

    @property
    def legs(self) -> int:
        """Number of legs."""
        return len(self.corners) - 1

    def at(self, times: Times) -> Prescribed:
        """Columns at times; those of the actuators have no meaning."""
        leg = np.clip(times.astype(int), 0, self.legs - 1)
        share = (times - leg)[:, None]
        out = np.asarray((1.0 - share) * self.corners[leg] + share * self.corners[leg + 1])
        for number, curve in self.curves.items():
            base = self.corners[number][None, : len(self.structure.parameters)]
            for k in np.flatnonzero(leg == number):
                out[k] = _columns(self.structure, base, curve(float(share[k, 0])), self.descriptors)
        return out

    def rate(self, time: float) -> Float[np.ndarray, " columns"]:
        """Change of the columns per leg, within the leg of a time."""
        leg = min(int(time), self.legs - 1)
        if leg not in self.curves:
            return np.asarray(self.corners[leg + 1] - self.corners[leg])
        ends = np.clip([time - RATE, time + RATE], leg, leg + 1)
        values = self.at(np.minimum(ends, np.nextafter(leg + 1.0, leg)))
        return np.asarray((values[1] - values[0]) / (ends[1] - ends[0]))

    def split(
        self, columns: Prescribed
    ) -> tuple[Float[np.ndarray, "n parameters"], Float[np.ndarray, "n m"]]:
        """Parameters and targets."""
        count = len(self.structure.parameters)
        return columns[:, :count].copy(), columns[:, count:]


def actuator_bounds(
    structure: Structure, limits: Mapping[str, tuple[float, float]]
) -> tuple[Constraint, ...]:
    """Limits of actuators as constraints; limits that are not in order are refused."""
    bounds: list[Constraint] = []
    for name, (low, high) in limits.items():
        if not low < high:
            raise InputError(f"`actuators` must give limits in order; got {name} = {low, high}.")
        itself = value_of(structure, name)
        bounds += [itself >= low, itself <= high]
    return tuple(bounds)


def _columns(
    structure: Structure,
    p: Float[np.ndarray, "1 parameters"],
    values: Any,
    descriptors: tuple[Descriptor, ...],
) -> Float[np.ndarray, " columns"]:
    asked = {key for key in values if isinstance(key, Descriptor)}
    if asked != set(descriptors):
        raise InputError(
            f"`targets` must prescribe the same descriptors on all legs "
            f"({', '.join(each.name for each in descriptors)}); got "
            f"{', '.join(sorted(each.name for each in asked))}."
        )
    targets = np.array([float(values[each]) for each in descriptors])
    if not np.isfinite(targets).all():
        raise InputError(f"`targets` must be finite; got {targets.tolist()}.")
    return np.concatenate([replace_parameters(structure, p, values)[0], targets])


def _check_free(values: Any, actuators: Sequence[str]) -> None:
    for name in actuators:
        if values.get(name) is not None:
            raise InputError(
                f"`targets` must leave the actuator {name} free; got {values[name]!r}."
            )


def _check_beginning(
    structure: Structure,
    free: Int[np.ndarray, " k"],
    here: Float[np.ndarray, " columns"],
    begin: Float[np.ndarray, " columns"],
) -> None:
    gap = np.abs(begin - here)
    gap[free] = 0.0
    if (gap > 1e-8 * (1.0 + np.abs(here))).any():
        raise InputError(
            f"`targets` must begin where the leg before ends, at {here.tolist()} "
            f"(parameters, descriptors); got {begin.tolist()}."
        )


@dataclass(frozen=True)
class Linearisation:
    """Linearisation of the set and of descriptors at regular states, by some parameters.

    dz, dp: changes per scale of each of the parameters; slope: those of the descriptors.
    """

    dz: Float[np.ndarray, "lanes k size"]
    dp: Float[np.ndarray, "lanes k parameters"]
    slope: Float[np.ndarray, "lanes m k"]


def linearise(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    which: Int[np.ndarray, " k"],
    descriptors: tuple[Descriptor, ...],
) -> Linearisation:
    """Linearise at states."""
    along = answers(structure, z, p, which)
    functions = [each.function for each in descriptors]
    return Linearisation(*along, slopes_along(structure, z, p, *along, functions))


def shortest_change(
    slope: Float[np.ndarray, "lanes m k"], wanted: Float[np.ndarray, "lanes m"]
) -> Float[np.ndarray, "lanes k"]:
    """Shortest changes of the actuators, in their scales, for given changes of descriptors."""
    if slope.shape[1] == slope.shape[2]:
        size = np.abs(slope).max(axis=(1, 2))
        regular = np.abs(np.linalg.det(slope)) > 1e-14 * size ** slope.shape[1]
        safe = np.where(regular[:, None, None], slope, np.eye(slope.shape[1]))
        found = np.linalg.solve(safe, wanted[:, :, None])[:, :, 0]
        return np.where(regular[:, None], found, np.nan)
    return np.asarray(np.einsum("lkm,lm->lk", np.linalg.pinv(slope), wanted))


def correct_onto_targets(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    free: Int[np.ndarray, " k"],
    descriptors: tuple[Descriptor, ...],
    targets: Float[np.ndarray, "lanes m"],
) -> Settled:
    """Newton for regular states with given descriptors; with actuators to spare, the nearest."""
    values = TargetValues(tuple(each.function for each in descriptors), targets)
    directions = free_directions(structure, free, len(targets))
    return settle(structure, z, p, directions, [values], GUARDS, Held())


def may_graze(within: Sequence[Constraint], states: States) -> Flags:
    """Whether constraints may be violated inside the steps of a motion, by curvature of its values.

    Between two values the curve bulges by an eighth of its curvature times the squared step; four
    times as much is doubted. A single step shows its curvature by the state half-way.
    """
    if len(states) == 1:
        return np.zeros(0, bool)
    if len(states) == 2:
        structure, mean = states.structure, [0.5 * (a[:1] + a[1:]) for a in (states.z, states.p)]
        z, good, _ = exact_states(structure, *mean)
        middle = States(structure, z, mean[1])
        both = may_graze(within, join_states(structure, (states[:1], middle, states[1:])))
        return np.array([both.any() or not good[0]])
    steps = step_lengths(states)
    doubt, lengths = np.zeros(len(steps), bool), np.maximum(steps, TINY)
    for constraint in within:
        excess = constraint.excess(states.z, states.p)
        room, slope = -np.maximum(excess[:-1], excess[1:]), np.diff(excess) / lengths
        bend = 2.0 * np.abs(np.diff(slope)) / (lengths[:-1] + lengths[1:])
        bend = np.maximum(np.append(bend, bend[-1]), np.insert(bend, 0, bend[0]))
        doubt |= (room > ON_BOUND * constraint.size) & (room < 0.5 * bend * lengths**2)
    return doubt

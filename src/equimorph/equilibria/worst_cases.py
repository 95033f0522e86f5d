"""Constraints that must hold for all values of parameters: over ranges and in corners of boxes."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Lanes, Parameters, Values
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.settle import Guards, settle
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, position, worst_relative_excess
from equimorph.structures import Structure
from equimorph.structures.quantities import find_descriptor

TWICE = 2.0
"""Length of the path through a corner of the box, relative to that to the corner."""
SAME_SHEET = 1e-3
"""Distance in the structure's metric over which a given state is corrected at most: at a fold a
longer correction leads to another sheet."""

_WORST = re.compile(r"\s*(worst|lowest)\((.*) for (.*)\)\s*", re.DOTALL)
_OFFSET = re.compile(r"\s*(\w+)\s*(?:±|\+-)\s*([\d.eE+-]+)\s*")


@check_arguments
def worst_over(
    structure: Structure,
    descriptor: Descriptor,
    offsets: Mapping[str, float],
    sense: Literal["max", "min"] = "max",
) -> Descriptor:
    """Largest value of a descriptor over a box of imperfections around a state, or the smallest.

    The state is lifted along straight lines to the corners of the box. The result is the largest
    value at the corners and at the state itself, ∞ where stability is lost on the way; or the
    smallest, and −∞. The single values are its branches, so that `optimise` finds its minima, kinks
    included, exactly.

    Parameters
    ----------
    offsets
        Largest errors of parameters, by name: actuators, loads or others.
    sense
        "max" for what must stay below a bound, "min" for what must stay above one.

    Raises
    ------
    InputError
        If a name is unknown, there is none, or a size is not positive.
    """
    sign = 1.0 if sense == "max" else -1.0
    box = _Corners(structure, descriptor, _corners(structure, offsets), sign)
    sizes = ", ".join(f"{name} ± {float(size)!r}" for name, size in offsets.items())
    word = "worst" if sense == "max" else "lowest"
    name = f"{word}({descriptor.name} for {sizes})"
    symbol = f"{word} {descriptor.symbol or descriptor.name}"
    unit, origin = descriptor.unit, structure.signature
    return Descriptor(name, unit, box.worst, symbol, origin, branches=box.branches)


@dataclass(frozen=True)
class Corner:
    """A corner of a box of imperfections, and where stability is lost on the way to it and beyond.

    Parameters
    ----------
    offsets
        Errors of the parameters, by name.
    room
        Share of the straight way at which stability is lost: 1 where the corner itself is critical,
        at most 2. Unlike the values at the corner it goes on smoothly where these end.
    limit
        The descriptor where stability is lost: its one-sided limit at the corner where `room` is 1.
    """

    offsets: Mapping[str, float]
    room: Descriptor
    limit: Descriptor


@check_arguments
def corners_of(
    structure: Structure, descriptor: Descriptor, offsets: Mapping[str, float]
) -> tuple[Corner, ...]:
    """Corners of a box of imperfections, in the order of the branches of `worst_over`.

    Raises
    ------
    InputError
        As for `worst_over`.
    """
    corners = _corners(structure, offsets)[1:]
    rays, found = _Rays(structure, corners), []
    for number, corner in enumerate(corners):
        ray = _Ray(rays, number, descriptor)
        own = {name: float(corner[position(structure.parameters, name)]) for name in offsets}
        text = ", ".join(f"{name} {size:+.9g}" for name, size in own.items())
        room = Descriptor(f"room({text})", "1", ray.room, "room", structure.signature)
        name = f"limit({descriptor.name} for {text})"
        limit = Descriptor(name, descriptor.unit, ray.limit, "limit", structure.signature)
        found.append(Corner(own, room, limit))
    return tuple(found)


def _stable_states(structure: Structure, z: Lanes, p: Parameters) -> tuple[Lanes, Flags]:
    """States polished to round-off, and which of them are stable and on the sheet of the guess."""
    near = settle(structure, z, p, guards=Guards(trust=np.full(len(z), SAME_SHEET)))
    return near.z, np.asarray(near.found & (near.index == 0))


def _corners(
    structure: Structure, offsets: Mapping[str, float]
) -> Float[np.ndarray, "corners parameters"]:
    """Errors of all parameters: none, then those at the corners of the box."""
    if not offsets:
        raise InputError("`offsets` must name at least one parameter; got none.")
    places = [position(structure.parameters, name) for name in offsets]
    corners = np.zeros((1 + 2 ** len(places), len(structure.parameters)))
    signs = np.array(list(product((-1.0, 1.0), repeat=len(places))))
    corners[1:, places] = signs * np.array(list(offsets.values()))
    return corners


@dataclass(frozen=True)
class _RayEnds:
    """Where stability is lost on the straight ways from states to corners and as far again."""

    share: Float[np.ndarray, "lanes corners"]
    z: Float[np.ndarray, "lanes corners size"]
    p: Float[np.ndarray, "lanes corners parameters"]


@dataclass
class _Rays:
    """The straight ways from states to all corners of a box and as far again.

    Those from the last states are remembered: constraints of all corners ask for the same ones, and
    few paths take nearly as long as many.
    """

    structure: Structure
    corners: Float[np.ndarray, "corners parameters"]
    last: tuple[Lanes, Parameters, _RayEnds] | None = None

    def ends(self, z: Lanes, p: Parameters) -> _RayEnds:
        """Shares of the ways, −1 from unstable states, with the states there."""
        last = self.last
        if last is not None and np.array_equal(last[0], z) and np.array_equal(last[1], p):
            return last[2]
        found = self._ends(z, p)
        self.last = z.copy(), p.copy(), found
        return found

    def _ends(self, z: Lanes, p: Parameters) -> _RayEnds:
        many = len(self.corners)
        polished, stable = _stable_states(self.structure, z, p)
        share, lanes = np.full((len(z), many), -1.0), np.flatnonzero(stable)
        end, at = (np.repeat(each[:, None], many, axis=1) for each in (polished, p))
        if len(lanes):
            velocity = np.tile(TWICE * self.corners, (len(lanes), 1))
            start, begin = (np.repeat(each[lanes], many, axis=0) for each in (polished, p))
            line = ParameterLine(self.structure, begin, velocity)
            ended = trace(line, start, (), TraceOptions(record=False))
            moved = ended.t[:, None] * velocity
            share[lanes] = TWICE * ended.t.reshape(-1, many)
            end[lanes] = ended.z.reshape(len(lanes), many, -1)
            at[lanes] += moved.reshape(len(lanes), many, -1)
        return _RayEnds(share, end, at)


@dataclass(frozen=True)
class _Ray:
    """One of these ways, and a descriptor of the states on it."""

    rays: _Rays
    corner: int
    descriptor: Descriptor

    def room(self, z: Lanes, p: Parameters) -> Values:
        """Share of the way at which stability is lost; −1 for unstable states."""
        return self.rays.ends(z, p).share[:, self.corner]

    def limit(self, z: Lanes, p: Parameters) -> Values:
        """The descriptor there."""
        ends, k = self.rays.ends(z, p), self.corner
        states = (np.ascontiguousarray(each[:, k]) for each in (ends.z, ends.p))
        return np.where(ends.share[:, k] >= 0.0, self.descriptor.function(*states), np.inf)


@check_arguments
def worst_named(
    structure: Structure, text: str, known: Mapping[str, Descriptor] | None = None
) -> Descriptor:
    """Descriptor that a text means: as `find_descriptor`, or the worst of one over a box.

    ``worst(max_curvature for Theta ± 0.01, Delta ± 0.02)``, with ``+-`` for ``±`` where that cannot
    be typed, is the largest value, ``lowest(…)`` the smallest one; see `worst_over`.

    Parameters
    ----------
    known
        Descriptors by name that come before those of the structure.

    Raises
    ------
    InputError
        If it means nothing here.
    """
    found = _WORST.fullmatch(text)
    if found is None:
        return (known or {}).get(text.strip()) or find_descriptor(structure, text)
    parts = [_OFFSET.fullmatch(part) for part in found[3].split(",")]
    try:
        offsets = {each[1]: float(each[2]) for each in parts if each}
    except ValueError:
        offsets = {}
    if len(offsets) < len(parts):
        raise InputError(
            f"`worst` must read like worst(energy for Theta ± 0.01, Delta ± 0.02); got {text!r}."
        )
    inner = worst_named(structure, found[2], known)
    return worst_over(structure, inner, offsets, sense="max" if found[1] == "worst" else "min")


@dataclass(frozen=True)
class _Corners:
    """A descriptor, and offsets of all parameters at which it is evaluated; the first is zero.

    With the sign −1 its smallest value is the worst.
    """

    structure: Structure
    descriptor: Descriptor
    corners: Float[np.ndarray, "corners parameters"]
    sign: float

    def worst(self, z: Lanes, p: Parameters) -> Values:
        """Largest value, or smallest."""
        return np.asarray(self.sign * (self.sign * self._values(z, p)).max(axis=1))

    def branches(
        self, z: Lanes, p: Parameters
    ) -> tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]:
        """Values at the corners, and their numbers."""
        return self._values(z, p), np.tile(np.arange(float(len(self.corners))), (len(z), 1))

    def _values(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes m"]:
        out = np.full((len(z), len(self.corners)), self.sign * np.inf)
        here, stable = _stable_states(self.structure, z, p)
        lanes = np.flatnonzero(stable)
        if len(lanes) == 0:
            return out
        out[lanes, 0] = self.descriptor.function(here[lanes], p[lanes])
        many = np.repeat(lanes, len(self.corners) - 1)
        velocity = np.tile(self.corners[1:], (len(lanes), 1))
        line = ParameterLine(self.structure, p[many], velocity)
        ended = trace(line, here[many], (), TraceOptions(record=False))
        good = np.flatnonzero(ended.code == EventCode.ARRIVED)
        values = np.full(len(many), self.sign * np.inf)
        values[good] = self.descriptor.function(ended.z[good], p[many[good]] + velocity[good])
        out[lanes, 1:] = values.reshape(len(lanes), -1)
        return out


SAMPLES = 9
"""Number of samples of a range; between them parabolas give the extremum."""


@check_arguments
def stable_over(
    structure: Structure, name: str, ends: tuple[float, float], within: Sequence[Constraint] = ()
) -> Constraint:
    """Constraint that a state stays stable, and obeys others, for all values of a load in a range.

    From the state the load is moved to both ends of the range on stable states. The descriptor is
    the worst relative excess ``(S − bound)/max(1, |bound|)`` on the way, or, where stability is
    lost, 1 plus the share of the range that cannot be reached.

    Parameters
    ----------
    name, ends
        The load and its range.
    within
        Constraints that hold over the range; without any, only stability is required.

    Raises
    ------
    InputError
        If the name is unknown, or the ends are not finite and in order.
    """
    at = position(structure.parameters, name)
    low, high = float(ends[0]), float(ends[1])
    if not (np.isfinite((low, high)).all() and low < high):
        raise InputError(f"`ends` must be finite and in order; got {name}: {ends!r}.")
    ray = _Range(structure, at, np.linspace(low, high, SAMPLES), tuple(within))
    asked = ", ".join(str(each) for each in within) or "stable"
    written = f"worst({asked} for {name} {low:.9g} to {high:.9g})"
    return Descriptor(written, "1", ray.worst, "worst", structure.signature) <= 0.0


@dataclass(frozen=True)
class _Range:
    """Values of one parameter at which constraints are evaluated."""

    structure: Structure
    at: int
    values: Values
    within: tuple[Constraint, ...]

    def worst(self, z: Lanes, p: Parameters) -> Values:
        """Worst relative excess over the range; see `stable_over`."""
        out = np.full(len(z), -1.0)
        near, stable = _stable_states(self.structure, z, p)
        out[~stable] = 2.0
        lanes = np.flatnonzero(stable)
        here, p = near[lanes], p[lanes]
        excesses: list[Values] = []
        for number, value in enumerate(self.values):
            here, p, arrived = self._move(here, p, value)
            left = 1.0 - (number - 1) / (len(self.values) - 1)
            out[lanes[~arrived]] = 1.0 + min(left, 1.0)
            lanes, here, p = lanes[arrived], here[arrived], p[arrived]
            more = worst_relative_excess(self.within, here, p)
            excesses = [*(each[arrived] for each in excesses), more]
        out[lanes] = _highest(np.stack(excesses, axis=1)) if self.within else -1.0
        return out

    def _move(self, z: Lanes, p: Parameters, value: float) -> tuple[Lanes, Parameters, Flags]:
        velocity = np.zeros_like(p)
        velocity[:, self.at] = value - p[:, self.at]
        moving = np.flatnonzero(velocity[:, self.at] != 0.0)
        arrived, end = np.ones(len(z), bool), z.copy()
        if len(moving):
            line = ParameterLine(self.structure, p[moving], velocity[moving])
            outcome = trace(line, z[moving], (), TraceOptions(record=False))
            arrived[moving], end[moving] = outcome.code == EventCode.ARRIVED, outcome.z
        return end, p + velocity, arrived


def _highest(values: Float[np.ndarray, "lanes samples"]) -> Values:
    """Largest value of the parabolas through each three neighbours, or of the samples."""
    left, middle, right = values[:, :-2], values[:, 1:-1], values[:, 2:]
    bend = left - 2.0 * middle + right
    with np.errstate(divide="ignore", invalid="ignore"):
        top = middle - (right - left) ** 2 / (8.0 * bend)
        inside = (bend < 0.0) & (np.abs(right - left) <= -2.0 * bend)
    peaks = np.where(inside, np.nan_to_num(top), middle)
    return np.asarray(np.maximum(values.max(axis=1), peaks.max(axis=1)))

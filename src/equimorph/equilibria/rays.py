"""Straight ways from states through the sides of boxes of parameters: where stability is lost."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Int, Lanes, Parameters, Values
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.settle import Guards, settle
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.errors import InputError
from equimorph.model import Descriptor, position
from equimorph.structures import State, Structure

TWICE = 2.0
"""Length of the path through a side of the box, relative to that to the side."""
SAME_SHEET = 1e-3
"""Distance in the structure's metric over which a given state is corrected at most: at a fold a
longer correction leads to another sheet."""
LEVELS = 9
"""Points along each axis of the sides at which ways end that are tried first."""
CLOSEST = 4
"""Points around which is searched."""
FINEST = 1e-6
"""Last step of the search over the sides, in half widths of the box."""

Offsets = Float[np.ndarray, "n k"]


@dataclass(frozen=True)
class Ray:
    """A way through a point on the side of a box, and where stability is lost on it.

    Parameters
    ----------
    offsets
        Errors of the parameters at the point, by name.
    room
        Share of the straight way at which stability is lost: 1 where the point itself is critical,
        at most 2. Unlike the values at the point it goes on smoothly where these end.
    limit
        The descriptor where stability is lost: its one-sided limit at the point where `room` is 1.
    """

    offsets: Mapping[str, float]
    room: Descriptor
    limit: Descriptor


@check_arguments
def rays_of(
    structure: Structure,
    descriptor: Descriptor,
    offsets: Mapping[str, float],
    further: tuple[Float[np.ndarray, " k"], ...] = (),
) -> tuple[Ray, ...]:
    """Ways to the corners of a box of imperfections, in the order of the branches of `worst_over`.

    Parameters
    ----------
    further
        Other points on its sides, in half widths, to which there are ways, too.

    Raises
    ------
    InputError
        As for `worst_over`.
    """
    places, widths = half_widths(structure, offsets)
    corners = np.array(list(product((-1.0, 1.0), repeat=len(places))))
    ends = np.concatenate([corners, np.reshape(further, (-1, len(places)))]) * widths
    ways, found = _Ways(structure, places, ends), []
    for number, end in enumerate(ends):
        way = _Way(ways, number, descriptor)
        own = dict(zip(offsets, end.tolist(), strict=True))
        text = ", ".join(f"{name} {size:+.9g}" for name, size in own.items())
        room = Descriptor(f"room({text})", "1", way.room, "room", structure.signature)
        name = f"limit({descriptor.name} for {text})"
        limit = Descriptor(name, descriptor.unit, way.limit, "limit", structure.signature)
        found.append(Ray(own, room, limit))
    return tuple(found)


@check_arguments
def least_room(state: State, offsets: Mapping[str, float]) -> tuple[float, Float[np.ndarray, " k"]]:
    """Way through the sides of a box on which stability is lost first: its share, and its end.

    Ways to a lattice of the sides are followed; around those with the least shares the least one is
    searched for by steps along the sides. The end is a point of a side, in half widths.

    Raises
    ------
    InputError
        As for `worst_over`.
    """
    structure = state.structure
    places, widths = half_widths(structure, offsets)

    def shares(ends: Offsets) -> Values:
        ways = _Ways(structure, places, ends * widths)
        return np.asarray(ways.ends(state.z[None], state.p[None]).share[0])

    k = len(places)
    levels = LEVELS if k < 3 else 5
    lattice = np.array(list(product(np.linspace(-1.0, 1.0, levels), repeat=k)))
    ends = lattice[np.abs(lattice).max(axis=1) == 1.0]
    share = shares(ends)
    few = np.argsort(share, kind="stable")[:CLOSEST]
    ends, share = ends[few], share[few]
    radius = np.full(len(ends), 1.0 / (levels - 1))
    steps = np.concatenate([np.eye(k), -np.eye(k)])
    while k > 1 and (radius > FINEST).any():
        tried = np.clip(ends[:, None] + radius[:, None, None] * steps, -1.0, 1.0)
        tried /= np.abs(tried).max(axis=2, keepdims=True)
        found = shares(tried.reshape(-1, k)).reshape(len(ends), -1)
        best = found.argmin(axis=1)
        row = np.arange(len(ends))
        better = found[row, best] < share
        ends = np.where(better[:, None], tried[row, best], ends)
        share = np.where(better, found[row, best], share)
        radius = np.where(better, radius, 0.5 * radius)
    least = int(share.argmin())
    return float(share[least]), ends[least]


def stable_states(structure: Structure, z: Lanes, p: Parameters) -> tuple[Lanes, Flags]:
    """States polished to round-off, and which of them are stable and on the sheet of the guess."""
    near = settle(structure, z, p, guards=Guards(trust=np.full(len(z), SAME_SHEET)))
    return near.z, np.asarray(near.found & (near.index == 0))


def half_widths(
    structure: Structure, offsets: Mapping[str, float]
) -> tuple[Int[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Numbers of the parameters of a box, and its half widths."""
    if not offsets:
        raise InputError("`offsets` must name at least one parameter; got none.")
    places = [position(structure.parameters, name) for name in offsets]
    return np.array(places), np.array(list(offsets.values()), float)


@dataclass(frozen=True)
class _Ends:
    """Where stability is lost on the straight ways from states to points and as far again."""

    share: Float[np.ndarray, "lanes ways"]
    z: Float[np.ndarray, "lanes ways size"]
    p: Float[np.ndarray, "lanes ways parameters"]


@dataclass
class _Ways:
    """The straight ways from states to all ends and as far again.

    Those from the last states are remembered: constraints of all ways ask for the same ones, and
    few paths take nearly as long as many.
    """

    structure: Structure
    places: Int[np.ndarray, " k"]
    goals: Float[np.ndarray, "ways k"]
    last: tuple[Lanes, Parameters, _Ends] | None = None

    def ends(self, z: Lanes, p: Parameters) -> _Ends:
        """Shares of the ways, −1 from unstable states, with the states there."""
        last = self.last
        if last is not None and np.array_equal(last[0], z) and np.array_equal(last[1], p):
            return last[2]
        found = self._ends(z, p)
        self.last = z.copy(), p.copy(), found
        return found

    def _ends(self, z: Lanes, p: Parameters) -> _Ends:
        many = len(self.goals)
        polished, stable = stable_states(self.structure, z, p)
        share, lanes = np.full((len(z), many), -1.0), np.flatnonzero(stable)
        end, at = (np.repeat(each[:, None], many, axis=1) for each in (polished, p))
        if len(lanes):
            velocity = np.zeros((many, p.shape[1]))
            velocity[:, self.places] = TWICE * self.goals
            velocity = np.tile(velocity, (len(lanes), 1))
            start, begin = (np.repeat(each[lanes], many, axis=0) for each in (polished, p))
            line = ParameterLine(self.structure, begin, velocity)
            ended = trace(line, start, (), TraceOptions(record=False))
            moved = ended.t[:, None] * velocity
            share[lanes] = TWICE * ended.t.reshape(-1, many)
            end[lanes] = ended.z.reshape(len(lanes), many, -1)
            at[lanes] += moved.reshape(len(lanes), many, -1)
        return _Ends(share, end, at)


@dataclass(frozen=True)
class _Way:
    """One of these ways, and a descriptor of the states on it."""

    ways: _Ways
    number: int
    descriptor: Descriptor

    def room(self, z: Lanes, p: Parameters) -> Values:
        """Share of the way at which stability is lost; −1 for unstable states."""
        return self.ways.ends(z, p).share[:, self.number]

    def limit(self, z: Lanes, p: Parameters) -> Values:
        """The descriptor there."""
        ends, k = self.ways.ends(z, p), self.number
        states = (np.ascontiguousarray(each[:, k]) for each in (ends.z, ends.p))
        return np.where(ends.share[:, k] >= 0.0, self.descriptor.function(*states), np.inf)

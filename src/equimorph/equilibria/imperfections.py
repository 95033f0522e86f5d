"""Worst values of descriptors over a box of imperfections."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.settle import settle
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Descriptor, position
from equimorph.structures import Structure
from equimorph.structures.quantities import descriptor_named

TWICE = 2.0
"""Ways to a corner that are gone beyond it."""

_WORST = re.compile(r"\s*worst\((.*) for (.*)\)\s*", re.DOTALL)
_OFFSET = re.compile(r"\s*(\w+)\s*(?:±|\+-)\s*([\d.eE+-]+)\s*")


def worst_over(
    structure: Structure, descriptor: Descriptor, offsets: Mapping[str, float]
) -> Descriptor:
    """Largest value of a descriptor over a box of imperfections around a state.

    The state is led straight to the corners of the box; the largest value there and in the state
    itself counts, ∞ where stability is lost on the way. The values are its branches, so that its
    minima, kinks among them, are found exactly: a robust optimum.

    Parameters
    ----------
    offsets
        Largest errors of parameters, by name: actuators, loads, any others.

    Raises
    ------
    InputError
        For unknown names, none, or sizes that are not positive.
    """
    box = _Corners(structure, descriptor, _corners(structure, offsets))
    sizes = ", ".join(f"{name} ± {float(size)!r}" for name, size in offsets.items())
    name = f"worst({descriptor.name} for {sizes})"
    symbol = f"worst {descriptor.symbol or descriptor.name}"
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


def corners_of(
    structure: Structure, descriptor: Descriptor, offsets: Mapping[str, float]
) -> tuple[Corner, ...]:
    """Corners of a box of imperfections, in the order of the branches of `worst_over`.

    Raises
    ------
    InputError
        As for `worst_over`.
    """
    found = []
    for corner in _corners(structure, offsets)[1:]:
        ray = _Ray(structure, descriptor, corner)
        own = {name: float(corner[position(structure.parameters, name)]) for name in offsets}
        text = ", ".join(f"{name} {size:+.9g}" for name, size in own.items())
        room = Descriptor(f"room({text})", "1", ray.room, "room", structure.signature)
        name = f"limit({descriptor.name} for {text})"
        limit = Descriptor(name, descriptor.unit, ray.limit, "limit", structure.signature)
        found.append(Corner(own, room, limit))
    return tuple(found)


def _corners(
    structure: Structure, offsets: Mapping[str, float]
) -> Float[np.ndarray, "corners parameters"]:
    """Errors of all parameters: none, then those at the corners of the box."""
    if not offsets:
        raise InputError("`offsets` must name at least one parameter; got none.")
    for name, size in offsets.items():
        if not (np.isfinite(size) and size > 0.0):
            raise InputError(f"`offsets` must be positive; got {name}: {size!r}.")
    places = [position(structure.parameters, name) for name in offsets]
    corners = np.zeros((1 + 2 ** len(places), len(structure.parameters)))
    signs = np.array(list(product((-1.0, 1.0), repeat=len(places))))
    corners[1:, places] = signs * np.array(list(offsets.values()))
    return corners


@dataclass(frozen=True)
class _Ray:
    """The straight way from states to a corner and as far again."""

    structure: Structure
    descriptor: Descriptor
    corner: Float[np.ndarray, " parameters"]

    def room(self, z: Lanes, p: Parameters) -> Values:
        """Share of the way at which stability is lost; −1 where there is none to lose."""
        return self._ended(z, p)[0]

    def limit(self, z: Lanes, p: Parameters) -> Values:
        """The descriptor there."""
        share, end, at = self._ended(z, p)
        return np.where(share >= 0.0, self.descriptor.function(end, at), np.inf)

    def _ended(self, z: Lanes, p: Parameters) -> tuple[Values, Lanes, Parameters]:
        share = np.full(len(z), -1.0)
        near = settle(self.structure, z, p)
        end, at = near.z, p.copy()
        lanes = np.flatnonzero(near.found & (near.index == 0))
        if len(lanes):
            velocity = np.tile(TWICE * self.corner, (len(lanes), 1))
            line = ParameterLine(self.structure, p[lanes], velocity)
            ended = trace(line, end[lanes], (), TraceOptions(record=False))
            share[lanes], end[lanes] = TWICE * ended.t, ended.z
            at[lanes] += ended.t[:, None] * velocity
        return share, end, at


def worst_named(structure: Structure, text: str) -> Descriptor:
    """Descriptor that a text means: as `descriptor_named`, or the worst of one over a box.

    ``worst(max_curvature for Theta ± 0.01, Delta ± 0.02)``, with ``+-`` for ``±`` where that cannot
    be typed; see `worst_over`.

    Raises
    ------
    InputError
        If it means nothing here.
    """
    found = _WORST.fullmatch(text)
    if found is None:
        return descriptor_named(structure, text)
    parts = [_OFFSET.fullmatch(part) for part in found[2].split(",")]
    try:
        offsets = {each[1]: float(each[2]) for each in parts if each}
    except ValueError:
        offsets = {}
    if len(offsets) < len(parts):
        raise InputError(
            f"`worst` must read like worst(energy for Theta ± 0.01, Delta ± 0.02); got {text!r}."
        )
    return worst_over(structure, worst_named(structure, found[1]), offsets)


@dataclass(frozen=True)
class _Corners:
    """A descriptor, and offsets of all parameters at which it is looked at; the first is zero."""

    structure: Structure
    descriptor: Descriptor
    corners: Float[np.ndarray, "corners parameters"]

    def worst(self, z: Lanes, p: Parameters) -> Values:
        """Largest value."""
        return np.asarray(self._values(z, p).max(axis=1))

    def branches(
        self, z: Lanes, p: Parameters
    ) -> tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]:
        """Values at the corners, and their numbers."""
        return self._values(z, p), np.tile(np.arange(float(len(self.corners))), (len(z), 1))

    def _values(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes m"]:
        out = np.full((len(z), len(self.corners)), np.inf)
        near = settle(self.structure, z, p)
        here, lanes = near.z, np.flatnonzero(near.found & (near.index == 0))
        if len(lanes) == 0:
            return out
        out[lanes, 0] = self.descriptor.function(here[lanes], p[lanes])
        many = np.repeat(lanes, len(self.corners) - 1)
        velocity = np.tile(self.corners[1:], (len(lanes), 1))
        line = ParameterLine(self.structure, p[many], velocity)
        ended = trace(line, here[many], (), TraceOptions(record=False))
        good = np.flatnonzero(ended.code == EventCode.ARRIVED)
        values = np.full(len(many), np.inf)
        values[good] = self.descriptor.function(ended.z[good], p[many[good]] + velocity[good])
        out[lanes, 1:] = values.reshape(len(lanes), -1)
        return out

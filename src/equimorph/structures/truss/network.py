"""The network of a truss: joints, bars with their energy, supports, and what can move."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from scipy.sparse.csgraph import csgraph_from_dense, dijkstra

from equimorph.argument_checks import check_arguments
from equimorph.argument_notes import TWO_NAMES
from equimorph.arrays import Bool, Float, Int
from equimorph.errors import InputError
from equimorph.linalg.intervals import Interval, inverse, rising, square
from equimorph.structures.network import (
    Edge,
    Joints,
    Network,
    edges_between,
    places_of_joints,
    supported_joints,
    vector,
)
from equimorph.structures.unit_system import Quantity, UnitSystem


@check_arguments
@dataclass(frozen=True)
class Bar(Edge):
    """A straight bar between two joints, which it does not bend.

    Numbers are in the units of the truss; texts like "12 kN" are converted to these.

    Parameters
    ----------
    ends
        Names of its two joints.
    EA
        Axial stiffness, in units of force; positive.
    EI
        Bending stiffness, for the Euler load of the bar; None if its buckling is of no interest.
    rest
        Length at which it is free of stress; None for the distance of its joints.
    mass
        In kg, or as a text, half of it at each joint; None: without. In a truss without units it is
        a number in any system to which the units of force, length and time belong.
    """

    edge: ClassVar[str] = "bar"
    quantities: ClassVar[Mapping[str, str]] = {
        "EA": "force",
        "EI": "force·length²",
        "rest": "length",
    }
    ends: Annotated[Sequence[str], TWO_NAMES]
    EA: Quantity = 1.0
    EI: Quantity | None = None
    rest: Quantity | None = None
    mass: Quantity | None = None


BarSpec = Annotated[
    Bar | Annotated[Sequence[str], TWO_NAMES] | Mapping[str, Any],
    "bars, pairs of different joints, or data of bars",
]

Strain = Literal["engineering", "green"]
Values = Float[np.ndarray, "lanes bars"]


@dataclass(frozen=True)
class Energies:
    """W(g, l₀) of bars, g the square of the length, l₀ the rest length.

    Engineering strain ε = l/l₀ − 1, Green strain ε = (g/l₀² − 1)/2; W = ½ EA l₀ ε².
    """

    green: bool
    stiffness: Float[np.ndarray, " bars"]

    def value(self, g: Values, l0: Values) -> Values:
        """W."""
        strain = 0.5 * (g / l0**2 - 1.0) if self.green else np.sqrt(g) / l0 - 1.0
        return np.asarray(0.5 * self.stiffness * l0 * strain**2)

    def force(self, g: Values, l0: Values) -> Values:
        """Force in the bar, dW/dl, positive in tension."""
        length = np.sqrt(g)
        if self.green:
            return np.asarray(0.5 * self.stiffness * length / l0 * (g / l0**2 - 1.0))
        return np.asarray(self.stiffness * (length / l0 - 1.0))

    def by_rest(self, g: Values, l0: Values) -> Values:
        """∂W/∂l₀."""
        share = g / l0**2
        if self.green:
            return np.asarray(self.stiffness / 8.0 * (1.0 + 2.0 * share - 3.0 * share**2))
        return np.asarray(0.5 * self.stiffness * (1.0 - share))

    def second(self, g: Values, l0: Values) -> tuple[Values, Values]:
        """∂²W/∂g² and ∂²W/∂g∂l₀."""
        if self.green:
            mixed = 0.25 * self.stiffness / l0**2 * (1.0 - 3.0 * g / l0**2)
            return np.asarray(0.25 * self.stiffness / l0**3), np.asarray(mixed)
        return np.asarray(0.25 * self.stiffness / g**1.5), np.asarray(-0.5 * self.stiffness / l0**2)

    def enclosures(self, g: Interval, l0: Interval) -> tuple[Interval, Interval, Interval]:
        """∂W/∂g, ∂²W/∂g² and ∂²W/∂g∂l₀ over boxes."""
        k, squared = self.stiffness, square(l0)
        if self.green:
            share = g / squared
            mixed = 0.25 * k * ((1.0 - 3.0 * share) / squared)
            return 0.25 * k * ((share - 1.0) / l0), 0.25 * k / (l0 * squared), mixed
        length = rising(np.sqrt, g)
        slope = 0.5 * k * (inverse(l0) - inverse(length))
        return slope, 0.25 * k / (g * length), -0.5 * k / squared

    def third(self, g: Values, l0: Values) -> tuple[Values, Values, Values]:
        """∂³W/∂g³, ∂³W/∂g²∂l₀ and ∂³W/∂g∂l₀²."""
        nothing = np.zeros_like(g)
        if self.green:
            twice = 0.25 * self.stiffness * (12.0 * g / l0**5 - 2.0 / l0**3)
            return nothing, np.asarray(-0.75 * self.stiffness / l0**4), np.asarray(twice)
        by_square = -0.375 * self.stiffness / g**2.5
        return np.asarray(by_square), nothing, np.asarray(self.stiffness / l0**3)


AXES = "xyz"


@dataclass(frozen=True, eq=False)
class TrussNetwork(Network):
    """Joints in their places, which bars join them, and which of their moves are held."""

    members: tuple[Bar, ...]
    held: Bool[np.ndarray, "joints space"]
    edge: ClassVar[str] = "bar"
    whole: ClassVar[str] = "trusses"

    @cached_property
    def unknowns(self) -> Int[np.ndarray, "joints space"]:
        """Number of the unknown of each move of a joint; −1 where it is held."""
        numbers = np.cumsum(~self.held.ravel()).reshape(self.held.shape) - 1
        return np.where(self.held, -1, numbers)

    @cached_property
    def moves(self) -> tuple[str, ...]:
        """Names of the unknowns: joint and axis, like ``B.y``."""
        return tuple(
            f"{joint}.{axis}"
            for joint, free in zip(self.joints, ~self.held, strict=True)
            for axis, moves in zip(AXES, free, strict=False)
            if moves
        )

    @cached_property
    def lengths(self) -> Float[np.ndarray, " bars"]:
        """Lengths of the bars at which they are free of stress."""
        drawn = np.linalg.norm(self.chords, axis=1).tolist()
        pairs = zip(self.members, drawn, strict=True)
        return np.array([chord if bar.rest is None else float(bar.rest) for bar, chord in pairs])

    @cached_property
    def region(self) -> tuple[Float[np.ndarray, "joints space"], Float[np.ndarray, "joints space"]]:
        """Where bars without stress let joints be: the middle and half width along each axis.

        As far from the nearest support that holds the axis as the bars on the way are long.
        """
        bars = np.full((len(self.joints), len(self.joints)), np.inf)
        np.minimum.at(bars, tuple(self.ends.T), self.lengths)
        graph = csgraph_from_dense(bars, null_value=np.inf)
        middle, width = self.places.copy(), np.zeros(self.held.shape)
        for axis, held in enumerate(self.held.T):
            far, _, support = dijkstra(graph, False, np.flatnonzero(held), True, min_only=True)
            middle[:, axis], width[:, axis] = self.places[support, axis], far
        return middle, width

    def supports_data(self) -> list[str]:
        """Held axes of the joints."""
        rows = self.held.tolist()
        return ["".join(x for x, fast in zip(AXES, row, strict=False) if fast) for row in rows]

    def bar(self, name: str) -> int:
        """Place of a bar in the list, whichever end is named first."""
        return self.place_of_edge(name)[0]

    def move(self, joint: str, axis: str) -> int:
        """Number of the unknown of a joint along an axis."""
        unknown = int(self.unknowns[self.joint(joint), self._axis(axis)])
        if unknown < 0:
            raise InputError(f"`{joint}.{axis}` must be free to move; it is held by a support.")
        return unknown

    def held_move(self, joint: str, axis: str) -> tuple[int, int]:
        """Joint and axis that a support holds."""
        at, along = self.joint(joint), self._axis(axis)
        if not self.held[at, along]:
            raise InputError(f"`{joint}.{axis}` must be held by a support; it is free.")
        return at, along

    def _axis(self, axis: str) -> int:
        axes = AXES[: self.space]
        if not (len(axis) == 1 and axis in axes):
            raise InputError(f"`axis` must be one of {', '.join(axes)}; got {axis!r}.")
        return axes.index(axis)

    def vector(
        self, forces: Mapping[str, Sequence[float]], what: str
    ) -> Float[np.ndarray, " unknowns"]:
        """Nodal vectors by joint as one vector of the unknowns."""
        total = np.zeros(self.held.shape)
        for joint, given in forces.items():
            total[self.joint(joint)] = vector(given, [self.space], f"{what} on {joint}")
        free = total[~self.held]
        if not free.any():
            raise InputError(f"`{what}` must act on a joint that is free to move; got {forces!r}.")
        return np.asarray(free)


def truss_network(
    joints: Joints, bars: Iterable[BarSpec], supports: Mapping[str, str], system: UnitSystem
) -> TrussNetwork:
    """Network from what a user gives, checked.

    Refused for joints without place or bars, bars between unknown, equal or held joints, unknown
    supports, or if nothing can move.
    """
    names, places = places_of_joints(joints, system, (2, 3))
    made = tuple(Bar.read(each).measured(system) for each in bars)
    ends, _ = edges_between(made, names)
    held = np.zeros(places.shape, bool)
    for at, joint, axes in supported_joints(supports, names):
        held[at, _held_axes(joint, axes, places.shape[1])] = True
    result = TrussNetwork(names, places, ends, made, held)
    result.check()
    _check_supports(result)
    return result


def _held_axes(joint: str, axes: str, space: int) -> list[int]:
    known = AXES[:space]
    if not axes or not set(axes) <= set(known) or len(set(axes)) < len(axes):
        raise InputError(
            f"`supports.{joint}` must hold axes among {known}, each once; got {axes!r}."
        )
    return [known.index(axis) for axis in axes]


def _check_supports(made: TrussNetwork) -> None:
    if made.held.all():
        raise InputError("`supports` must leave a joint free to move; got all of them held.")
    fast = np.asarray(made.held.all(axis=1))
    for bar, (i, j) in zip(made.members, made.ends, strict=True):
        if fast[i] and fast[j]:
            raise InputError(
                f"`supports` must leave an end of every bar free; got bar {bar.name} with both "
                "held, so that nothing depends on it. Leave it out."
            )

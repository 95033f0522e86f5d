"""Bars of a truss, and their energy by strain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_notes import TWO_NAMES
from equimorph.array_types import Float
from equimorph.linalg.intervals import Interval, inverse, rising, square
from equimorph.structures.network import Edge
from equimorph.structures.unit_system import Quantity


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

"""What a map knows at settings, and how far two neighbouring settings differ."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, Shaped

from equimorph.arrays import Lanes, Parameters, Settings, Values
from equimorph.structures import Structure


@dataclass(frozen=True)
class Samples:
    """Values of a map at settings, with the states that they were read from.

    Attributes
    ----------
    setting
        Where.
    value
        What the map shows; not a number where it is not defined.
    kind
        Number of the status.
    place
        Which constraint, and where on the structure it is met; zero where it says nothing.
    z, p
        State and all parameters; not numbers where there is no state.
    passed
        Critical states on the way, a tuple of `Passed` for each lane; none in maps that do not ask.
    """

    setting: Settings
    value: Values
    kind: Int[np.ndarray, " lanes"]
    place: Values
    z: Lanes
    p: Parameters
    passed: Shaped[np.ndarray, " lanes"]

    def take(self, lanes: Int[np.ndarray, " some"]) -> "Samples":
        """Return some of the lanes."""
        return Samples(*(column[lanes] for column in vars(self).values()))

    def where(self, left: np.ndarray, other: "Samples") -> "Samples":
        """Return these lanes where `left` and those of `other` elsewhere."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Samples(*(np.where(left[:, None] if a.ndim > 1 else left, a, b) for a, b in pairs))


Sampler = Callable[[Settings], Samples]


def joined(parts: Sequence[Samples]) -> Samples:
    """All lanes one after the other."""
    columns = zip(*(vars(part).values() for part in parts), strict=True)
    return Samples(*(np.concatenate(column) for column in columns))


def difference(structure: Structure, a: Samples, b: Samples) -> Values:
    """Distance of states, values and places of two settings per lane; ∞ where kinds differ.

    Zero where kinds are the same and the map shows nothing on both sides.
    """
    n, columns = structure.unknowns, structure.scales
    gap = np.sqrt((a.z - b.z)[:, :n] ** 2 @ structure.mass) + np.abs(a.place - b.place)
    gap = gap + np.linalg.norm((a.p - b.p) / columns, axis=1)
    shown = np.isfinite(gap) & (np.isfinite(a.value) | np.isfinite(b.value))
    return np.where(a.kind != b.kind, np.inf, np.where(shown, gap, 0.0))

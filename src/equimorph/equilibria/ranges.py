"""Constraints that must hold for all values of a parameter in a range."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.settle import settle
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, position
from equimorph.structures import Structure

SAMPLES = 9
"""Values at which a range is looked at; between them parabolas tell the extremum."""


def held_over(
    structure: Structure,
    name: str,
    ends: tuple[float, float],
    within: Sequence[Constraint] = (),
) -> Constraint:
    """Constraint that a state stays stable, and others hold, for all values of a load in a range.

    From the state the load is moved to both ends of the range on stable states. The descriptor is
    the worst relative excess ``(S − bound)/max(1, |bound|)`` on the way, or, where stability is
    lost, 1 plus the share of the range that cannot be reached.

    Parameters
    ----------
    name, ends
        The load and its range.
    within
        Constraints that hold over the range; none: stability alone.

    Raises
    ------
    InputError
        For an unknown name, or ends that are not finite and in order.
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
    """Values of one parameter at which constraints are looked at."""

    structure: Structure
    at: int
    values: Values
    within: tuple[Constraint, ...]

    def worst(self, z: Lanes, p: Parameters) -> Values:
        """Worst relative excess over the range; see `held_over`."""
        out = np.full(len(z), -1.0)
        near = settle(self.structure, z, p)
        alive = near.found & (near.index == 0)
        out[~alive] = 2.0
        lanes = np.flatnonzero(alive)
        here, p = near.z[lanes], p[lanes]
        excesses: list[Values] = []
        for number, value in enumerate(self.values):
            here, p, arrived = self._moved(here, p, value)
            left = 1.0 - (number - 1) / (len(self.values) - 1)
            out[lanes[~arrived]] = 1.0 + min(left, 1.0)
            lanes, here, p = lanes[arrived], here[arrived], p[arrived]
            excesses = [each[arrived] for each in excesses] + [self._excess(here, p)]
        out[lanes] = _highest(np.stack(excesses, axis=1)) if self.within else -1.0
        return out

    def _moved(self, z: Lanes, p: Parameters, value: float) -> tuple[Lanes, Parameters, Flags]:
        velocity = np.zeros_like(p)
        velocity[:, self.at] = value - p[:, self.at]
        moving = np.flatnonzero(velocity[:, self.at] != 0.0)
        arrived, end = np.ones(len(z), bool), z.copy()
        if len(moving):
            line = ParameterLine(self.structure, p[moving], velocity[moving])
            outcome = trace(line, z[moving], (), TraceOptions(record=False))
            arrived[moving], end[moving] = outcome.code == EventCode.ARRIVED, outcome.z
        return end, p + velocity, arrived

    def _excess(self, z: Lanes, p: Parameters) -> Values:
        """Worst relative excess of states."""
        each = [c.excess(z, p) / max(1.0, abs(c.bound)) for c in self.within]
        return np.max(each, axis=0) if each else np.full(len(z), -1.0)


def _highest(values: Float[np.ndarray, "lanes samples"]) -> Values:
    """Largest value of the parabolas through each three neighbours, or of the samples."""
    left, middle, right = values[:, :-2], values[:, 1:-1], values[:, 2:]
    bend = left - 2.0 * middle + right
    with np.errstate(divide="ignore", invalid="ignore"):
        top = middle - (right - left) ** 2 / (8.0 * bend)
        inside = (bend < 0.0) & (np.abs(right - left) <= -2.0 * bend)
    peaks = np.where(inside, np.nan_to_num(top), middle)
    return np.asarray(np.maximum(values.max(axis=1), peaks.max(axis=1)))

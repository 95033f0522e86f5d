"""Constraints that must hold for all values of parameters: over boxes of errors and over ranges."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.equilibria.box_peaks import BoxPeaks
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.rays import half_widths, stable_states
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, position, worst_relative_excess
from equimorph.structures import Structure
from equimorph.structures.quantities import find_descriptor

Branches = tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]

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

    The sheet of the state is followed along straight lines to a lattice of the box, of 3 points
    along each axis, which is refined where slopes do not predict the differences of its values.
    From where these show a peak, it is climbed, inside the box and on its sides (`BoxPeaks`). The
    result is the largest value found, ∞ where stability is lost on the way to a point of the
    lattice; or the smallest, and −∞. The middle, the corners and the peaks are the branches of a
    largest value, so that `optimise` finds its minima, kinks included, exactly.

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
    return worst_on_lattice(structure, descriptor, offsets, sense)


def worst_on_lattice(
    structure: Structure,
    descriptor: Descriptor,
    offsets: Mapping[str, float],
    sense: Literal["max", "min"],
    finer: int = 1,
) -> Descriptor:
    """As `worst_over`, from a lattice of `finer` times as many intervals; 0: of the corners."""
    sign = 1.0 if sense == "max" else -1.0
    places, widths = half_widths(structure, offsets)
    box = _WorstCase(BoxPeaks(structure, descriptor, places, widths, sign, finer))
    sizes = ", ".join(f"{name} ± {float(size)!r}" for name, size in offsets.items())
    word = "worst" if sense == "max" else "lowest"
    name = f"{word}({descriptor.name} for {sizes})" + (f" / {finer}" if finer != 1 else "")
    symbol = f"{word} {descriptor.symbol or descriptor.name}"
    branches = box.branches if sense == "max" else None
    unit, origin = descriptor.unit, structure.signature
    return Descriptor(name, unit, box.worst, symbol, origin, branches=branches)


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
class _WorstCase:
    """The worst value of a descriptor over a box, and the local ones among which it is."""

    peaks: BoxPeaks

    def worst(self, z: Lanes, p: Parameters) -> Values:
        """Largest value, or smallest; infinite where stability is lost."""
        return np.asarray(self.peaks.sign * self.branches(z, p)[0].max(axis=1))

    def branches(self, z: Lanes, p: Parameters) -> Branches:
        """Values in the middle, at the corners and at peaks, and what tells offsets apart."""
        here, stable = stable_states(self.peaks.structure, z, p)
        lanes, few = np.flatnonzero(stable), 1 + 2 ** len(self.peaks.sizes)
        if len(lanes) == 0:
            return np.full((len(z), few), np.inf), np.zeros((len(z), few))
        some, offsets = self.peaks.over(here[lanes], p[lanes])
        values, places = np.full((len(z), some.shape[1]), np.inf), np.zeros((len(z), some.shape[1]))
        # a peak that reaches a corner gets the name of the corner
        places[lanes] = offsets @ 3.0 ** np.arange(offsets.shape[2])
        values[lanes] = some
        return values, places


RANGE = 2
"""Factor on the number of lattice intervals of a box, for ranges."""


@check_arguments
def stable_over(
    structure: Structure, name: str, ends: tuple[float, float], within: Sequence[Constraint] = ()
) -> Constraint:
    """Constraint that a state stays stable, and obeys others, for all values of a load in a range.

    From the state the load is moved to the lower end of the range and from there to the upper one
    on stable states. The descriptor is the worst relative excess ``(S − bound)/max(1, |bound|)``
    over the range, searched for as in `worst_over`, or, where stability is lost, 1 plus the share
    of the range that cannot be reached.

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
    span = _Range(structure, at, (low, high), tuple(within))
    asked = ", ".join(str(each) for each in within) or "stable"
    written = f"worst({asked} for {name} {low:.9g} to {high:.9g})"
    return Descriptor(written, "1", span.worst, "worst", structure.signature) <= 0.0


@dataclass(frozen=True)
class _Range:
    """A range of one parameter over which constraints must hold."""

    structure: Structure
    at: int
    ends: tuple[float, float]
    within: tuple[Constraint, ...]

    def worst(self, z: Lanes, p: Parameters) -> Values:
        """Worst relative excess over the range; see `stable_over`."""
        out = np.full(len(z), 2.0)
        near, stable = stable_states(self.structure, z, p)
        lanes = np.flatnonzero(stable)
        here, p = near[lanes], p[lanes]
        low, high = self.ends
        for value, loss in ((low, 0.0), (high, 1.0), (0.5 * (low + high), 0.0)):
            here, p, share = self._move(here, p, value)
            out[lanes] = 2.0 - loss * share
            arrived = share == 1.0
            lanes, here, p = lanes[arrived], here[arrived], p[arrived]
        out[lanes] = self._excess(here, p) if self.within and len(lanes) else -1.0
        return out

    def _excess(self, z: Lanes, p: Parameters) -> Values:
        """Largest relative excess around states in the middle of the range."""

        def excess(z: Lanes, p: Parameters) -> Values:
            return worst_relative_excess(self.within, z, p)

        descriptor = Descriptor("excess", "1", excess, "excess", self.structure.signature)
        half = np.array([0.5 * (self.ends[1] - self.ends[0])])
        peaks = BoxPeaks(self.structure, descriptor, np.array([self.at]), half, 1.0, RANGE)
        values = peaks.over(z, p)[0].max(axis=1)
        return np.where(np.isfinite(values), values, 1.0)

    def _move(self, z: Lanes, p: Parameters, value: float) -> tuple[Lanes, Parameters, Values]:
        """Follow the states to a value; shares of the way that are stable, 1 if all of it is."""
        velocity = np.zeros_like(p)
        velocity[:, self.at] = value - p[:, self.at]
        moving = np.flatnonzero(velocity[:, self.at] != 0.0)
        share, end = np.ones(len(z)), z.copy()
        if len(moving):
            line = ParameterLine(self.structure, p[moving], velocity[moving])
            outcome = trace(line, z[moving], (), TraceOptions(record=False))
            short = np.minimum(outcome.t, np.nextafter(1.0, 0.0))
            share[moving] = np.where(outcome.code == EventCode.ARRIVED, 1.0, short)
            end[moving] = outcome.z
        return end, p + velocity, share

"""Lanes that march together, one a row of arrays."""

import numpy as np

from equimorph.arrays import Lanes, Numbers, Some
from equimorph.equilibria.steps import Bracket, EventFile, Front, PointFile, new_scalars
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.linalg.simd import LANES
from equimorph.marching import kernels, step_kernels, tick_kernels as ticks
from equimorph.marching.constraint_kernels import VALUES
from equimorph.structures import Advance


class Rows:
    """Arrays of the lanes of a block, and files of what happens to them.

    Parameters
    ----------
    capacity
        Most lanes that march together.
    size
        Unknowns and multipliers of the curves.
    constraints
        How many there are.
    events
        Steps with events that may wait until they are located.
    """

    def __init__(
        self, capacity: int, size: int, constraints: int, events: int, options: TraceOptions
    ) -> None:
        rows = max(capacity, LANES)
        shapes = (2 * [(rows, step_kernels.MEMORY, size)]) + (2 * [(rows, size)])
        self.places = tuple(np.zeros(shape) for shape in shapes)
        self.flat = tuple(place.reshape(rows, -1) for place in self.places)
        self.numbers, self.counts = new_scalars(_apart(rows))
        self.values = np.zeros((VALUES * constraints, rows))
        self.grazing = np.zeros((constraints, rows), bool)
        self.state = np.zeros(6, np.int64)
        self.events = EventFile(size, events + rows, self.state)
        self.points = PointFile(size, rows if options.record else 0, self.state)

    @property
    def capacity(self) -> int:
        """Most lanes that march together."""
        return len(self.places[2])

    @property
    def active(self) -> int:
        """Lanes on their way."""
        return int(self.state[ticks.ACTIVE])

    @property
    def lanes(self) -> Numbers:
        """Their numbers."""
        return np.asarray(self.counts[kernels.LANE, : self.active])

    @property
    def stage(self) -> Numbers:
        """Their stages."""
        return np.asarray(self.counts[kernels.STAGE, : self.active])

    @property
    def what(self) -> Numbers:
        """Bits of what happened in their steps."""
        return np.asarray(self.counts[kernels.WHAT, : self.active])

    def close(self) -> None:
        """Close the gaps of lanes that are finished."""
        scalars = self.numbers, self.counts, self.values
        self.state[ticks.ACTIVE] = kernels.close_gaps(self.flat, *scalars, self.active)

    def front(self, at: Some, back: int = 0) -> Front:
        """Where lanes are, or were one step before."""
        head = (self.counts[kernels.HEAD, at] - back) % step_kernels.MEMORY
        z, tangent = self.places[0][at, head], self.places[1][at, head]
        t = self.numbers[kernels.T + 2 * back, at]
        slope = self.numbers[kernels.SLOPE + 2 * back, at]
        return Front(z, t, tangent, slope, self.counts[kernels.INDEX, at])

    def ahead(self, at: Some, move: Advance) -> Front:
        """Ends of steps that converged."""
        numbers, counts = self.numbers[:, at], self.counts[:, at]
        tangent: Lanes = move.tangent_z[at] / numbers[kernels.NORM][:, None]
        t, slope = numbers[kernels.TRIAL], numbers[kernels.NEW_SLOPE]
        return Front(self.places[2][at], t, tangent, slope, counts[kernels.NEW_INDEX])

    def bracket(self, at: Some, move: Advance) -> Bracket:
        """Steps that converged."""
        numbers, counts = self.numbers[:, at], self.counts[:, at]
        ends = self.front(at), self.ahead(at, move)
        length, travelled = numbers[kernels.LENGTH], numbers[kernels.TRAVELLED]
        return Bracket(counts[kernels.LANE], *ends, length, travelled, counts[kernels.WHAT])


def _apart(lanes: int) -> int:
    """Padded length of rows of lanes: rows an even number of cache lines apart share cache sets."""
    return 8 * (-(-lanes // 8) | 1)

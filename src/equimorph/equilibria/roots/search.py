"""Roots of a scalar inside steps: every trial point is corrected onto its curve.

[Chandrupatla1997]_: inverse quadratic interpolation where the last three points allow it, else
bisection. The curve between the ends of the bracket is predicted by the cubic through them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Lanes, Some, Values
from equimorph.equilibria import kernels as march
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.fronts import Bracket, Front, new_scalars
from equimorph.equilibria.roots import kernels
from equimorph.structures import Advance

Scalar = Callable[[Some, Front], Float[np.ndarray, " some"]]

VALUE = 1e-13
"""Value of the scalar over that at the ends of the step that counts as zero."""


@dataclass(frozen=True)
class Root:
    """Points where the scalar vanishes, their lengths from the start of the step, and success."""

    z: Lanes
    t: Values
    at: Values
    found: Flags


def root_inside(
    curve: Curve, bracket: Bracket, scalar: Scalar, ends: tuple[Values, Values], guess: Values
) -> Root:
    """Zero of a scalar with values of opposite signs at the ends of a step.

    Parameters
    ----------
    scalar
        Values at points on some of the lanes, whose numbers come first.
    ends
        Values at both ends of the step; a zero at the start is the root.
    guess
        Share of the step that is tried first.
    """
    search = _Search(curve, bracket, ends, guess)
    while search.active:
        search.round(scalar)
    return search.root


class _Search:
    """All lanes of one search, each somewhere in an iteration of its own."""

    def __init__(
        self, curve: Curve, bracket: Bracket, ends: tuple[Values, Values], guess: Values
    ) -> None:
        lanes, (old, new) = len(guess), (bracket.before, bracket.after)
        self.curve, self.active = curve, lanes
        ends_of_steps = (old.z, new.z, new.tangent_z, old.z, old.tangent_z)
        work = (np.empty_like(old.z), np.empty_like(old.z))
        self._places = (*(each.copy() for each in ends_of_steps), *work)
        self._scalars, self._ends = new_scalars(lanes), np.empty((kernels.ENDS, lanes))
        self._scalars[1][march.LANE] = np.arange(lanes)
        for row_number, column in (
            (kernels.X1, bracket.step), (kernels.F1, ends[1]), (kernels.T1, new.t),
            (kernels.SLOPE1, new.tangent_t), (kernels.X2, 0.0), (kernels.F2, ends[0]),
            (kernels.T2, old.t), (kernels.SLOPE2, old.tangent_t), (kernels.T0, old.t),
            (kernels.SHARE, 1.0 - guess),
            (kernels.SMALL, VALUE * (np.abs(ends[0]) + np.abs(ends[1]))),
        ):  # fmt: skip
            self._ends[row_number] = column
        self.root = Root(old.z.copy(), np.empty(lanes), np.empty(lanes), np.zeros(lanes, bool))
        mass = curve.metric.mass
        kernels.begin(curve.weight, mass, self._places, *self._scalars, self._ends, lanes)
        self._here = curve
        self._close()

    def round(self, scalar: Scalar) -> None:
        """One Newton step of every lane, and all that follows from it."""
        active, (numbers, counts) = self.active, self._scalars
        trial, row = (place[:active] for place in self._places[5:])
        closing = numbers[march.CORNER, :active], numbers[march.DEFECT, :active]
        move = self._here.advance(trial, numbers[march.TRIAL, :active], row, *closing)
        mass, steps = self.curve.metric.mass, (move.dz, move.dt, move.tangent_z, move.tangent_t)
        march.correct(*steps, mass, trial, numbers, counts, active, march.EXACT, 0.0)
        values = np.zeros(active)
        there = np.flatnonzero(counts[march.STAGE, :active] == march.CONVERGED)
        if len(there):
            values[there] = scalar(counts[march.LANE, there], self._front(there, move))
            state = (self._places, numbers, counts, self._ends, active)
            kernels.shrink(values, move.tangent_z, mass, *state)
        if (counts[march.STAGE, :active] != march.CORRECTING).any():
            self._close()

    def _front(self, at: Some, move: Advance) -> Front:
        """Trial points that converged, with unit tangents."""
        numbers = self._scalars[0][:, at]
        tangent = move.tangent_z[at] / numbers[march.NORM][:, None]
        t, slope = numbers[march.TRIAL], numbers[march.NEW_SLOPE]
        return Front(self._places[5][at], t, tangent, slope, move.index[at])

    def _close(self) -> None:
        """Write down what is finished and close the gaps."""
        root, counts = self.root, self._scalars[1]
        state = (self._places, counts, self._ends, self.active)
        kernels.hand_out(*state, root.z, root.t, root.at, root.found)
        left = (self._places, *self._scalars, self._ends, self.active)
        self.active = march.close_gaps(*left)
        self._here = self.curve.take(counts[march.LANE, : self.active])

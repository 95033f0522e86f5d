"""Polylines run through at constant rates, averaged over time: limited accelerations and jerks.

A moving average over a time a₁ of a motion with rates v has accelerations of at most |Δv|/a₁, a
second one over a₂ limits the jerks, and no rate grows: on one straight leg from rest to rest this
is the motion with trapezoidal accelerations. Corners are rounded, or met exactly after a pause as
long as both averages.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import factorial

import numpy as np

from equimorph.array_types import Float

Instants = Float[np.ndarray, " instants"]
Rows = Float[np.ndarray, "corners parameters"]

NEGLIGIBLE = 1e-12
"""Relative change of rates that is round-off."""


@dataclass(frozen=True, eq=False)
class FilteredMotion:
    """A polyline in time, averaged over windows of time.

    Parameters
    ----------
    corners
        Parameters at the corners.
    durations
        Time of each leg, without the averages.
    pauses
        Time at rest at each corner, 0 at the first and last.
    windows
        Times of the moving averages: none, one (accelerations) or two (jerks).
    """

    corners: Rows
    durations: Float[np.ndarray, " legs"]
    pauses: Float[np.ndarray, " corners"]
    windows: tuple[float, ...]

    @cached_property
    def _rates(self) -> tuple[Instants, Float[np.ndarray, "changes parameters"]]:
        """When rates change, and by how much."""
        legs = len(self.durations)
        rates = np.zeros((2 * legs + 1, self.corners.shape[1]))
        rates[1::2] = np.diff(self.corners, axis=0) / self.durations[:, None]
        spans = np.zeros(2 * legs + 1)
        spans[1::2], spans[2:-1:2] = self.durations, self.pauses[1:-1]
        times = self.lead + np.concatenate([[0.0], np.cumsum(spans[1:])])
        changes = np.diff(np.concatenate([rates, np.zeros((1, rates.shape[1]))]), axis=0)
        # at the same instant changes add up; those of collinear legs vanish
        instants, number = np.unique(np.round(times / times[-1], 14), return_inverse=True)
        total = np.zeros((len(instants), rates.shape[1]))
        np.add.at(total, number, changes)
        where = np.zeros(len(instants))
        where[number] = times
        keep = np.abs(total).max(axis=1) > NEGLIGIBLE * np.abs(rates).max()
        return where[keep], total[keep]

    @property
    def lead(self) -> float:
        """Half the sum of the windows: what the averages need before the first change."""
        return 0.5 * sum(self.windows)

    @property
    def duration(self) -> float:
        """Time from rest to rest."""
        return float(self.durations.sum() + self.pauses.sum() + 2.0 * self.lead)

    @property
    def corner_times(self) -> Float[np.ndarray, " corners"]:
        """When each corner is met, or nearly so: in the middle of its pause."""
        before = np.concatenate([[0.0], np.cumsum(self.durations)])
        return np.asarray(self.lead + before + np.cumsum(self.pauses) - 0.5 * self.pauses)

    def at(self, t: Instants, order: int = 0) -> Float[np.ndarray, "instants parameters"]:
        """Parameters, or their derivatives of an order up to one more than there are windows."""
        where, changes = self._rates
        weights = _ramp(t[:, None] - where, self.windows, order)
        return np.asarray(weights @ changes + (self.corners[0] if order == 0 else 0.0))

    def largest(self, order: int) -> Float[np.ndarray, " parameters"]:
        """Largest derivative of an order, exactly: they are extreme where their pieces end."""
        where, _ = self._rates
        signs = np.array(list(product((-0.5, 0.5), repeat=len(self.windows)))).reshape(
            -1, len(self.windows)
        )
        ends = np.sort((where[:, None] + signs @ np.array(self.windows)).ravel())
        middles = 0.5 * (ends[1:] + ends[:-1])
        return np.asarray(np.abs(self.at(np.concatenate([ends, middles]), order)).max(axis=0))


def _ramp(
    t: Float[np.ndarray, "instants changes"], windows: tuple[float, ...], order: int
) -> Float[np.ndarray, "instants changes"]:
    """Derivatives of max(t, 0), averaged over windows: what a unit change of a rate adds."""
    half, power = 0.5 * sum(windows), len(windows) + 1 - order
    inside = np.zeros_like(t)
    for signs in product((1.0, -1.0), repeat=len(windows)):
        shifted = t + 0.5 * sum(s * w for s, w in zip(signs, windows, strict=True))
        term = np.maximum(shifted, 0.0) ** power if power else (shifted >= 0.0).astype(float)
        inside += np.prod(signs) * term
    inside /= factorial(power) * np.prod(windows)
    beyond = {0: t, 1: np.ones_like(t)}.get(order, np.zeros_like(t))
    return np.where(t >= half, beyond, np.where(t <= -half, 0.0, inside))

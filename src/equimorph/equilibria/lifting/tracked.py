"""Curves on which descriptors are prescribed and as many parameters are unknown."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.lifting.pieces import Pieces
from equimorph.model import Descriptor
from equimorph.structures import Advance, Structure

Extended = Float[np.ndarray, "lanes extended"]
Rows = Float[np.ndarray, "lanes k size"]

DIFFERENCE = 1e-5
"""Step of central differences: their error and that of round-off are about 1e-11."""


@dataclass(frozen=True)
class TrackedMetric:
    """Metric of (u, a, λ): that of the structure, and the scales of the unknown parameters a."""

    size: int
    unknowns: int
    mass: Float[np.ndarray, " unknowns"]


@dataclass(frozen=True)
class TrackedCurve:
    """Equilibria with ``S(z, p) = S*(t)``, part of the parameters given and part of them unknown.

    Unknowns (u, a, λ): those of the structure with the free parameters a between u and λ. The
    gradients of descriptors are taken by central differences.

    Parameters
    ----------
    prescribed
        All parameters (those of the free ones do not count) and then S*, as functions of t.
    free
        Places of the unknown parameters, as many as descriptors.
    weight
        Scaled length of what is prescribed.
    """

    structure: Structure
    prescribed: Pieces
    free: Int[np.ndarray, " k"]
    descriptors: tuple[Descriptor, ...]
    weight: Values

    @cached_property
    def metric(self) -> TrackedMetric:
        """Mass of u and of a."""
        structure, k = self.structure, len(self.free)
        mass = np.concatenate([structure.mass, structure.scales[self.free] ** -2.0])
        return TrackedMetric(structure.size + k, structure.unknowns + k, mass)

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return False

    def take(self, lanes: Int[np.ndarray, " some"]) -> "TrackedCurve":
        """Return some of the lanes."""
        given, weight = self.prescribed.take(lanes), self.weight[lanes]
        return TrackedCurve(self.structure, given, self.free, self.descriptors, weight)

    def begin(self, z: Lanes, p: Parameters) -> Extended:
        """(u, a, λ) of states."""
        return self._joined(z, p[:, self.free])

    def _joined(self, z: Lanes, a: Float[np.ndarray, "lanes k"]) -> Extended:
        n = self.structure.unknowns
        return np.concatenate([z[:, :n], a, z[:, n:]], axis=1)

    def parameters(self, t: Values) -> Parameters:
        """Return what is given of p; the free ones as they were."""
        return self.prescribed.value(t)[:, : len(self.structure.parameters)]

    def states(self, z: Extended, t: Values) -> tuple[Lanes, Parameters]:
        """Unknowns and multipliers of the structure, and all parameters."""
        n, k, p = self.structure.unknowns, len(self.free), self.parameters(t)
        p[:, self.free] = z[:, n : n + k]
        return np.concatenate([z[:, :n], z[:, n + k :]], axis=1), p

    def rate(self, t: Values) -> Parameters:
        """Rate of what is given of p."""
        rate = self.prescribed.rate(t)[:, : len(self.structure.parameters)]
        rate[:, self.free] = 0.0
        return rate

    def bend(self, t: Values) -> Parameters:
        """Second derivative of what is given of p."""
        bend = self.prescribed.bend(t)[:, : len(self.structure.parameters)]
        bend[:, self.free] = 0.0
        return bend

    def advance(
        self, z: Extended, t: Values, row: Extended, corner: Values, defect: Values
    ) -> Advance:
        """Newton step and tangent by the bordered solve with k + 1 more rows and columns."""
        structure, k, n = self.structure, len(self.free), self.structure.unknowns
        count = len(structure.parameters)
        x, p = self.states(z, t)
        residual = structure.residual(x, p)
        missed = self._values(x, p) - self.prescribed.value(t)[:, count:]
        changes = self._changes(self.rate(t))
        columns = np.stack([structure.parameter_derivative(x, p, dp) for dp in changes], 1)
        rows, slopes = self._gradients(x, p, changes)
        slopes[:, :, k] -= self.prescribed.rate(t)[:, count:]
        corners = np.zeros((len(z), k + 1, k + 1))
        corners[:, :k], corners[:, k, :k], corners[:, k, k] = slopes, row[:, n : n + k], corner
        last = np.concatenate([row[:, :n], row[:, n + k :]], axis=1)
        rhs = np.zeros((len(z), 2, structure.size + k + 1))
        rhs[:, 0] = -np.concatenate([residual, missed, defect[:, None]], axis=1)
        rhs[:, 1, -1] = 1.0
        border = (columns, np.concatenate([rows, last[:, None]], axis=1), corners)
        solved = structure.solve(x, p, rhs, border)
        step, tangent = (
            self._joined(each[:, : structure.size], each[:, structure.size : -1])
            for each in (solved.x[:, 0], solved.x[:, 1])
        )
        return Advance(
            step,
            solved.x[:, 0, -1].copy(),
            tangent,
            solved.x[:, 1, -1].copy(),
            np.abs(np.concatenate([residual, missed], axis=1)).max(axis=1),
            solved.negative - structure.constraints,
            np.full(len(z), np.nan),
        )

    def _values(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes k"]:
        return np.stack([descriptor.function(z, p) for descriptor in self.descriptors], 1)

    def _changes(self, rate: Parameters) -> list[Parameters]:
        """Directions in parameter space: each free parameter, and the given rate."""
        units = np.zeros((len(self.free), *rate.shape))
        for unit, place in zip(units, self.free, strict=True):
            unit[:, place] = 1.0
        return [*units, rate]

    def _gradients(
        self, z: Lanes, p: Parameters, changes: list[Parameters]
    ) -> tuple[Rows, Float[np.ndarray, "lanes k directions"]]:
        """∂S/∂z, and ∂S/∂p along directions."""
        lanes, size = z.shape
        steps = DIFFERENCE * np.eye(size)
        here = np.repeat(p, size, axis=0)
        ahead, behind = (
            self._values((z[:, None] + sign * steps).reshape(-1, size), here)
            for sign in (1.0, -1.0)
        )
        rows = ((ahead - behind) / (2.0 * DIFFERENCE)).reshape(lanes, size, -1)
        slopes = [self._along(z, p, dp) for dp in changes]
        return np.ascontiguousarray(rows.transpose(0, 2, 1)), np.stack(slopes, 2)

    def _along(self, z: Lanes, p: Parameters, dp: Parameters) -> Float[np.ndarray, "lanes k"]:
        longest = np.abs(dp / self.structure.scales).max(axis=1)
        h = (DIFFERENCE / np.maximum(longest, 1e-300))[:, None]
        h = np.where(longest[:, None] > 0.0, h, 1.0)
        change = self._values(z, p + h * dp) - self._values(z, p - h * dp)
        return np.asarray(change / (2.0 * h))

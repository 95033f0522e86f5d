"""The point at which two sheets of a set are nearest, or hang together: by Newton's method.

Near a fold two sheets are the solutions of one scalar equation r(ξ, π) = 0 in the amplitude ξ of
the null vector and in the parameters π (Lyapunov–Schmidt reduction [Govaerts2000]_, where the
residual is r b). Where r is stationary the sheets are nearest to each other, or pass from one side
of a neck to the other. Such points are regular solutions of ∇r = 0, also where r ≠ 0 and no state
exists.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Lanes, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import null_border
from equimorph.manifold.geometry.crossings import Reduction, reduction
from equimorph.manifold.geometry.setting import Setting
from equimorph.tolerances import SAME_STATE

ITERATIONS = 20
"""Of Newton's method, at most."""
LONGEST = 0.5
"""Length of a step in barycentric coordinates to which it is shortened."""
CONVERGED = 1e-7
"""Length of the last step in barycentric coordinates."""
FLAT = 1e-4
"""Curvature of the squared distance, relative to the largest one, below which a direction is a
valley, along which no stationary point is sought."""
OUTSIDE = -0.02
"""Barycentric coordinate down to which a point counts as inside its cell."""
FARTHEST = 2.0
"""Barycentric coordinate beyond which Newton's method is given up: the point is elsewhere."""


@dataclass(frozen=True)
class Starts(Columns):
    """Guesses in grid cells.

    cell: grid cells; corners: of these, in free parameters; shares: barycentric coordinates of the
    guesses; z: states there, between the two sheets.
    """

    cell: Some
    corners: Float[np.ndarray, "n corners d"]
    shares: Float[np.ndarray, "n corners"]
    z: Lanes


@dataclass(frozen=True)
class Stationary:
    """Stationary points: free parameters, squared distance of the two states in the metric there.

    The squared distance is negative where there are none. inside: whether they were found, in
    their cells; lost: whether Newton's method did not end, but stayed in the cell; pointed: whether
    the squared distance is curved in all directions there, as it is not where sheets cross.
    """

    place: Float[np.ndarray, "n d"]
    squared: Values
    inside: Flags
    lost: Flags
    pointed: Flags

    @property
    def touching(self) -> Flags:
        """Where the two states are one, as far as states can be told apart, in one point only."""
        small = np.abs(self.squared) <= SAME_STATE**2
        return np.asarray(self.inside & small & self.pointed)

    @property
    def parted(self) -> Flags:
        """Where there are two states."""
        return np.asarray(self.inside & (self.squared > SAME_STATE**2))

    @property
    def none(self) -> Flags:
        """Where there are no states."""
        return np.asarray(self.inside & (self.squared < -(SAME_STATE**2)))


@np.errstate(over="ignore", invalid="ignore")  # lanes that diverge are given up
def stationary_points(setting: Setting, starts: Starts, *, saddles: bool) -> Stationary:
    """Stationary points of the squared distance: its minima, or saddles as well."""
    structure, count = setting.structure, len(starts.cell)
    edges = np.zeros((count, len(setting.free), len(setting.base)))
    edges[:, :, setting.free] = starts.corners[:, 1:] - starts.corners[:, :1]
    z, shares = starts.z.copy(), starts.shares.copy()
    p = setting.parameters(np.einsum("nc,ncd->nd", shares, starts.corners))
    b = null_border(structure, z, p)
    squared, lanes = np.full(count, np.nan), np.arange(count)
    ended, lost, pointed = np.zeros((3, count), bool)
    for _ in range(ITERATIONS):
        known = reduction(structure, z[lanes], p[lanes], b[lanes], edges[lanes])
        newton = _newton_step(structure.mass, known, saddles=saddles)
        squared[lanes], pointed[lanes], step = newton.squared, newton.pointed, newton.step
        _move(known, step, edges[lanes], (z, p, b), lanes)
        shares[lanes, 1:] += step[:, 1:]
        shares[lanes, 0] -= step[:, 1:].sum(axis=1)
        length = np.linalg.norm(step[:, 1:], axis=1)
        ended[lanes] = length < CONVERGED
        going = (length >= CONVERGED) & (np.abs(shares[lanes]).max(axis=1) < FARTHEST)
        lanes = lanes[going & np.isfinite(squared[lanes])]
        if len(lanes) == 0:
            break
    within = (shares >= OUTSIDE).all(axis=1)
    lost[lanes] = True
    return Stationary(p[:, setting.free], squared, ended & within, lost & within, pointed)


def _move(
    known: Reduction,
    step: Float[np.ndarray, "some k1"],
    edges: Float[np.ndarray, "some d parameters"],
    state: tuple[Lanes, Parameters, Lanes],
    lanes: Some,
) -> None:
    """Take steps: of states, parameters and borders, in place."""
    z, p, b = state
    z[lanes] += known.remainder + np.einsum("nk,nki->ni", step, known.along_z)
    p[lanes] += np.einsum("nk,nki->ni", step[:, 1:], edges)
    null = known.along_z[:, 0]
    b[lanes] = null / np.linalg.norm(null, axis=1, keepdims=True)


@dataclass(frozen=True)
class _Newton:
    """Squared distances, whether they are curved in all directions, and Newton steps (ξ, π)."""

    squared: Values
    pointed: Flags
    step: Float[np.ndarray, "lanes k1"]


@np.errstate(
    divide="ignore", over="ignore", invalid="ignore"
)  # no second derivative along the null vector
def _newton_step(
    mass: Float[np.ndarray, " unknowns"], known: Reduction, *, saddles: bool
) -> _Newton:
    """Newton steps to where the squared distance is stationary in the parameters.

    With the reduced equation r(ξ, π) = 0 of two sheets, r = ρ(π) + ½ a (ξ − ξ₀(π))² up to higher
    order, so that their amplitudes differ by 2 √(−2ρ/a).
    """
    gradient, hessian = known.gradient, known.hessian
    bend, mixed = hessian[:, 0, 0], hessian[:, 0, 1:]
    level = known.value - 0.5 * gradient[:, 0] ** 2 / bend
    null = known.along_z[:, 0, : len(mass)]
    factor = -8.0 * (null**2 @ mass) / bend
    slope = factor[:, None] * (gradient[:, 1:] - mixed * (gradient[:, 0] / bend)[:, None])
    curvature = hessian[:, 1:, 1:] - mixed[:, :, None] * mixed[:, None] / bend[:, None, None]
    values, vectors = np.linalg.eigh(np.nan_to_num(factor[:, None, None] * curvature))
    curved = np.abs(values) > FLAT * np.abs(values).max(axis=1, keepdims=True)
    large = curved if saddles else curved & (values > 0.0)
    along = np.einsum("nji,nj->ni", vectors, slope)
    amount = np.where(large, -along / np.where(large, values, 1.0), 0.0)
    move = np.einsum("nij,nj->ni", vectors, amount)
    length = np.linalg.norm(move, axis=1, keepdims=True)
    move *= np.minimum(1.0, LONGEST / np.maximum(length, 1e-300))
    amplitude = -(gradient[:, 0] + (mixed * move).sum(axis=1)) / bend
    step = np.concatenate([amplitude[:, None], move], axis=1)
    return _Newton(factor * level, curved.all(axis=1), step)

"""Lagrangians of planar rods and frames as tables: bounds over boxes, and numbers for others."""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.linalg.intervals import Interval, cosine, join, product, sine, square, symmetric
from equimorph.structures.equations import Enclosed
from equimorph.structures.rod.pressure import EnclosedArea

Points = Float[np.ndarray, "scalars points"]


@dataclass(frozen=True, eq=False)
class PlanarEnergy:
    """A Lagrangian in the angles θ of nodes and *scalars* y = (multipliers, parameters, 1).

    ``L = ½ θᵀKθ − θ·(slope y) + Σ ((1 + e) N − ½ γ (N + T)²) + ½ yᵀ Q y − Σ p V`` with the sum over
    points, ``N = a sin θ + b cos θ`` at the node of each, and a, b, e, T combinations of y.
    """

    place: Int[np.ndarray, " nodes"]
    """Unknown of each node; −1 where its angle is prescribed: ``turned y``."""
    turned: Float[np.ndarray, "nodes scalars"]
    elements: Int[np.ndarray, "elements order"]
    stiffness: Float[np.ndarray, "elements order order"]
    springs: Float[np.ndarray, " nodes"]
    """Nodes and matrices of the elements, and springs at the nodes: K."""
    slope: Float[np.ndarray, "scalars nodes"]
    points: Int[np.ndarray, " points"]
    """Node of each point."""
    sine: Points
    cosine: Points
    stretch: Points
    tension: Points
    """a, b, e, T by scalar."""
    softness: Float[np.ndarray, " points"]
    """γ."""
    quadratic: Float[np.ndarray, "scalars scalars"]
    """Q."""
    pressure: Float[np.ndarray, "areas scalars"]
    areas: tuple[EnclosedArea, ...] = ()
    """p by scalar, and V, of each pressure."""

    def numbers(self) -> dict[str, Any]:
        """The tables in plain numbers; see `Equations.plain_energy`."""
        tables = {each.name: getattr(self, each.name) for each in fields(self)}
        areas = tables.pop("areas")
        if areas:
            parts = [
                {"area": each.matrix, "even": each.even, "weights": each.weights.real,
                 "across": each.weights.imag, "closing": each.closing} for each in areas
            ]  # fmt: skip
            tables |= {name: np.stack([each[name] for each in parts]) for name in parts[0]}
        return {"kind": "planar", **{name: each.tolist() for name, each in tables.items()}}

    @cached_property
    def assembled(self) -> Float[np.ndarray, "nodes nodes"]:
        """K."""
        total = np.diag(self.springs)
        for nodes, element in zip(self.elements, self.stiffness, strict=True):
            total[np.ix_(nodes, nodes)] += element
        return np.asarray(total)

    def bounds(self, z: Interval, p: Interval) -> Enclosed:
        """F and its first derivatives over boxes, by interval arithmetic.

        Gradient and Hessian of L by the angles of all nodes and the scalars; then those by p with
        the turns of the prescribed nodes, which depend on no multiplier.
        """
        nodes, (lanes, size) = len(self.place), z.shape
        free = np.argsort(self.place)[np.count_nonzero(self.place < 0) :]
        held, given = np.flatnonzero(self.place < 0), slice(nodes + size - len(free), -1)
        y = join([z[:, len(free) :], p, Interval.at(np.ones((lanes, 1)))], 1)
        theta = product(self.turned, y[..., None])[..., 0]
        theta[:, free] = z[:, : len(free)]
        gradient, hessian = self._derivatives(theta, y)
        own = np.concatenate([free, np.arange(nodes, given.start)])
        rows = hessian[:, own]
        turns = self.turned[held][:, size - len(free) : -1]
        moved = product(turns.T, rows[:, :, held].transpose(0, 2, 1)).transpose(0, 2, 1)
        columns = rows[:, :, given] + moved
        return Enclosed(gradient[:, own], symmetric(rows[:, :, own]), columns)

    def _derivatives(self, theta: Interval, y: Interval) -> tuple[Interval, Interval]:
        """Gradient and Hessian of L by the angles of all nodes and the scalars.

        At a point N' = a cos θ − b sin θ. With t = 1 + e − γ (N + T) the sum has the derivatives
        t N' by θ, and t ∂N + N ∂e − γ (N + T) ∂T by y.
        """
        (lanes, nodes), scalars, soft = theta.shape, len(self.slope), self.softness
        a, b, e, pull = (
            product(each.T, y[..., None])[..., 0]
            for each in (self.sine, self.cosine, self.stretch, self.tension)
        )
        s, c = (function(theta[:, self.points]) for function in (sine, cosine))
        normal, shear = a * s + b * c, a * c - b * s
        strain = soft * (normal + pull)
        stretch = 1.0 + e - strain
        straight = self.sine * s[:, None] + self.cosine * c[:, None]
        turned = self.sine * c[:, None] - self.cosine * s[:, None]
        rate = self.stretch - soft * (straight + self.tension)
        mixed = stretch[:, None] * turned + shear[:, None] * rate
        sums = np.zeros((nodes, len(self.points)))
        sums[self.points, range(len(self.points))] = 1.0
        force = product(sums, (stretch * shear)[..., None])[..., 0]
        curved = product(sums, (-(stretch * normal) - soft * square(shear))[..., None])[..., 0]
        closing = stretch[:, None] * straight + normal[:, None] * self.stretch
        closing = (closing - strain[:, None] * self.tension).sum(2)
        twice = Interval.at(np.broadcast_to(self.quadratic, (lanes, *self.quadratic.shape)))
        if self.stretch.any():
            both = (straight[:, :, None] * self.stretch).sum(3)
            twice = twice + both + both.transpose(0, 2, 1)
        if soft.any():
            whole = straight + self.tension
            twice = twice - (whole[:, :, None] * (soft * whole)[:, None]).sum(3)
        gradient = Interval.zeros(lanes, nodes + scalars)
        hessian = Interval.zeros(lanes, nodes + scalars, nodes + scalars)
        bent = product(self.assembled, theta[..., None])[..., 0]
        gradient[:, :nodes] = force + bent - product(self.slope.T, y[..., None])[..., 0]
        closing = closing - product(self.slope, theta[..., None])[..., 0]
        gradient[:, nodes:] = closing + product(self.quadratic, y[..., None])[..., 0]
        hessian[:, :nodes, :nodes] = self.assembled
        at = np.arange(nodes)
        hessian[:, at, at] = hessian[:, at, at] + curved
        cross = product(sums, mixed.transpose(0, 2, 1)) - self.slope.T
        hessian[:, :nodes, nodes:], hessian[:, nodes:, nodes:] = cross, twice
        for area, pressure in zip(self.areas, self.pressure, strict=True):
            _press(area, pressure, (theta, y), (gradient, hessian))
        hessian[:, nodes:, :nodes] = hessian[:, :nodes, nodes:].transpose(0, 2, 1)
        return gradient, hessian


def _press(
    area: EnclosedArea,
    pressure: Float[np.ndarray, " scalars"],
    at: tuple[Interval, Interval],
    out: tuple[Interval, Interval],
) -> None:
    """Add the part −p V to gradient and Hessian.

    With d = Σ m u, ``V = cos θ·(W sin θ) + ½ (cos θ·(E cos θ) + sin θ·(E sin θ) + d·(Q d))``.
    """
    (theta, y), (gradient, hessian) = at, out
    nodes, (force, bend) = theta.shape[1], _derivatives_of_area(area, theta)
    pull = product(pressure[None], y[..., None])
    gradient[:, :nodes] = gradient[:, :nodes] - pull[:, 0] * force
    hessian[:, :nodes, :nodes] = hessian[:, :nodes, :nodes] - pull * bend
    cross = hessian[:, :nodes, nodes:] - force[..., None] * pressure
    hessian[:, :nodes, nodes:] = cross


def _derivatives_of_area(area: EnclosedArea, theta: Interval) -> tuple[Interval, Interval]:
    """∂V/∂θ and ∂²V/∂θ∂θ; parts that are zero on rods are left out there."""
    m, k = area.weights.real, area.weights.imag
    slanted, diagonal = bool(area.even.any() or k.any()), np.arange(theta.shape[1])
    s, c = sine(theta), cosine(theta)
    slopes, chord = [-(m * s), m * c], [m * c, m * s]
    if slanted:
        slopes = [slopes[0] - k * c, slopes[1] - k * s]
        chord = [chord[0] - k * s, chord[1] + k * c]
    closed = product(area.closing, join([each.sum(1)[:, None] for each in chord], 1)[..., None])
    by_cosine = product(area.matrix, s[..., None])[..., 0] + m * closed[:, 0]
    by_sine = product(area.matrix.T, c[..., None])[..., 0] + m * closed[:, 1]
    bend = area.matrix * (c[:, :, None] * s[:, None] - s[:, :, None] * c[:, None])
    if slanted:
        by_cosine = by_cosine + product(area.even, c[..., None])[..., 0] + k * closed[:, 1]
        by_sine = by_sine + product(area.even, s[..., None])[..., 0] - k * closed[:, 0]
        bend = bend + area.even * (c[:, :, None] * c[:, None] + s[:, :, None] * s[:, None])
    for one, row in zip(slopes, area.closing, strict=True):
        for other, factor in zip(slopes, row, strict=True):
            bend = bend + factor * (one[:, :, None] * other[:, None])
    bend[:, diagonal, diagonal] = bend[:, diagonal, diagonal] - c * by_cosine - s * by_sine
    return c * by_sine - s * by_cosine, bend

"""Lifted edges on which an eigenvalue vanishes twice, although their ends do not show it.

A strip between two pitchforks that is narrower than the grid is crossed by edges whose ends lie on
both sides of it. The determinant of F_z shows it: the cubic through its values at both ends, with
the slopes from the next vertices on the same line, falls between them. There it is computed.

See docs/decisions.md, "Edges across narrow strips are recognised by the determinant".
"""

import numpy as np

from equimorph.arrays import Flags, Items, Numbers, Values
from equimorph.equilibria.determinants import hides_two_zeros
from equimorph.equilibria.steps import Bracket, Front, least_inside
from equimorph.manifold.lifting.pairing import Pairing, RayMark, Rays
from equimorph.marching.kernels import EARLY_DIP

STEEP = 1.0
"""Change of the determinant along an edge, relative to the smaller value, from which on a cubic may
fall to half of it on the edges around: with values 1 and slopes ∓r it falls to 1 − r/4."""
STRAIGHT = 0.98
"""Cosine of the angle between two edges from which on they lie on one line of the grid."""

BothEnds = tuple[Rays, Rays]
"""Lifted edges, seen from their starts and from their ends."""


def take_back_hiding(pairing: Pairing) -> None:
    """Forget curves that hide two zeros, of those that are new; their edges need more effort."""
    curves, rays = _new(pairing)
    for hint in (_are_steep, _dip, _hide):
        if len(curves) == 0:
            return
        some = np.flatnonzero(hint(pairing, rays))
        curves, rays = curves[some], (rays[0].take(some), rays[1].take(some))
    pairing.effort[rays[0].edges] = 1
    for curve in curves.tolist():
        pairing.forget(curve, RayMark.HARD)


def _new(pairing: Pairing) -> tuple[Numbers, BothEnds]:
    """Curves that were lifted at once and have not been looked at, as rays from both ends."""
    known, pairing.looked_at = pairing.looked_at, pairing.curves.count
    curves = np.arange(known, pairing.looked_at)
    start, end, edges, plain = (
        each[known:]
        for each in (
            pairing.curves.start,
            pairing.curves.end,
            pairing.curves.edge,
            pairing.curves.plain,
        )
    )
    sides = (pairing.mesh.edges[edges, 1] == pairing.points.vertex[start]).astype(int)
    alive = pairing.rays[start, pairing.slots[edges, sides]] == curves
    own = np.flatnonzero(alive & plain & (end >= 0) & (pairing.effort[edges] == 0))
    rays = Rays(start, edges, sides), Rays(end, edges, 1 - sides)
    return curves[own], (rays[0].take(own), rays[1].take(own))


def _determinants(pairing: Pairing, points: Items) -> Values:
    """Determinants of F_z at points, nan for the number −1."""
    pairing.slopes.fit(pairing.setting, pairing.points)
    return np.where(points < 0, np.nan, pairing.slopes.determinant[points])


def _are_steep(pairing: Pairing, rays: BothEnds) -> Flags:
    """Edges at an end of which the determinant changes much along some edge."""
    one, other = (_determinants(pairing, each.points) for each in rays)
    much = np.abs(other - one) > STEEP * np.fmin(np.abs(one), np.abs(other))
    steep = np.zeros(pairing.points.count, bool)
    for each in rays:
        steep[each.points[much]] = True
    return np.asarray(steep[rays[0].points] | steep[rays[1].points])


def _dip(pairing: Pairing, rays: BothEnds) -> Flags:
    """Where the cubic through determinants falls below half the smaller one at both ends."""
    ends = np.stack([_determinants(pairing, each.points) for each in rays])
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.copysign(np.abs(ends).min(axis=0), ends[0])
        start, end = ends / scale
        before, after = (_slope(pairing, *each) / scale for each in zip(rays, ends, strict=True))
        rise = 2.0 * (end - start)
        slopes = (
            np.where(np.isnan(before), rise + after, before),
            np.where(np.isnan(after), rise - before, -after),
        )
        least = least_inside((start, end), slopes, np.ones(len(rise)))[1]
    return np.asarray((least < EARLY_DIP) | (np.isnan(slopes[0]) & ~np.isnan(rise)))


def _slope(pairing: Pairing, rays: Rays, here: Values) -> Values:
    """Slope of the determinant, for an edge, from the next point behind its start.

    It lies on the same line of the grid and on the same sheet; nan where there is none.
    """
    mesh = pairing.mesh
    vertex = mesh.edges[rays.edges, rays.sides]
    around = pairing.incident[vertex]
    outward = np.where(mesh.edges[around, 0] == vertex[:, None], 1.0, -1.0)
    directions = outward[..., None] * mesh.spans(around)
    own = np.where(rays.sides == 0, 1.0, -1.0)[:, None] * mesh.spans(rays.edges)
    lengths, length = np.linalg.norm(directions, axis=2), np.linalg.norm(own, axis=1)
    cosine = -(directions @ own[:, :, None])[..., 0] / (lengths * length[:, None])
    cosine[(around < 0) | ~mesh.edges_in_use[around]] = -1.0
    slot, every = cosine.argmax(axis=1), np.arange(len(cosine))
    behind = np.full(len(cosine), -1)
    curves = pairing.rays[rays.points, slot]
    lanes = np.flatnonzero((cosine[every, slot] > STRAIGHT) & (curves >= 0))
    lanes = lanes[pairing.curves.plain[curves[lanes]]]
    start, end = pairing.curves.start[curves[lanes]], pairing.curves.end[curves[lanes]]
    behind[lanes] = np.where(start == rays.points[lanes], end, start)
    return np.asarray((here - _determinants(pairing, behind)) * length / lengths[every, slot])


def _hide(pairing: Pairing, rays: BothEnds) -> Flags:
    """Whether the determinant vanishes inside edges, by its values there."""
    line, one, fronts = pairing.line(rays[0]), np.ones(len(rays[0].points)), []
    for t, side in zip((0.0 * one, one), rays, strict=True):
        z = pairing.points.z[side.points]
        tangent = line.advance(z, t, np.zeros_like(z), one, 0.0 * one).tangent_z
        fronts.append(Front(z, t, tangent, one, pairing.points.index[side.points]))
    lanes = np.arange(len(one))
    return hides_two_zeros(line, Bracket(lanes, fronts[0], fronts[1], one, 0.0 * one, lanes))

"""Which folds of a polygon belong together, where they could be joined in several ways.

A fold curve is smooth in the configurations and the parameters, so that the sheets stay on one side
of it, but for cusps, at which it turns back in the parameters.

See docs/decisions.md, "Folds are paired by the normals of the surface".
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Float, Places
from equimorph.equilibria.critical_tests import correct_singular_states, gap, quadratic
from equimorph.manifold.geometry.exact_points import middles
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.geometry.tangents import fold_forms
from equimorph.manifold.lifting.crossing_discs import Ways
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import TURN, Chord, Plan, planes
from equimorph.tolerances import SAME_STATE

SAME_SIDE = 0.3
"""Least cosine between the sides of two folds that can belong to one fold curve in a triangle."""
DETOUR = 1.2
"""Way from one end of a chord to the cusp and on to the other end, relative to the chord."""


class PlanChord(NamedTuple):
    """A chord of a polygon, and the number of its plan."""

    plan: int
    chord: Chord


def continuous_ways(pairing: Pairing, plans: list[Plan], choices: list[Ways]) -> list[Ways]:
    """Ways in which every chord joins folds whose sheets lie on the same side.

    In the narrow wedge behind a cusp two fold curves run side by side at every scale: there only
    the side on which the sheets exist distinguishes them.
    """
    at = [
        (number, fold)
        for number, (plan, ways) in enumerate(zip(plans, choices, strict=True))
        for fold in sorted({fold for way in ways for chord in way for fold in chord})
        if plan.singular(fold) == TURN
    ]
    if not at:
        return choices
    folds = np.array([fold for _, fold in at])
    points = pairing.points
    normals = fold_forms(pairing.setting, points.z[folds], points.p[folds]).existence
    flat = _along_sides(pairing, [plans[number].polygon.triangle for number, _ in at], normals)
    flat = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    normal = dict(zip(at, flat, strict=True))

    def facing(number: int, chord: Chord) -> float:
        """Cosine of the angle between the sides of the folds of a chord; 1 for crossings."""
        if plans[number].singular(chord[0]) != TURN:
            return 1.0
        return float(normal[number, chord[0]] @ normal[number, chord[1]])

    chords = {
        PlanChord(number, chord): facing(number, chord)
        for number, ways in enumerate(choices)
        for chord in sorted({chord for way in ways for chord in way})
    }
    smooth = {each for each, cosine in chords.items() if cosine > SAME_SIDE}
    left = _ways_of(choices, smooth)
    # where no way is smooth, a cusp lies in the triangle
    turning = [
        each for each, cosine in chords.items() if not left[each.plan] and cosine < -SAME_SIDE
    ]
    triangles = [plans[number].polygon.triangle for number, _ in turning]
    found = _cusps_between(pairing, triangles, [chord for _, chord in turning])
    cusps = dict(zip(turning, found, strict=True))
    cusped = {each for each, cusp in cusps.items() if cusp is not None}
    more = [
        [way for way in ways if _are_apart([cusps.get(PlanChord(number, each)) for each in way])]
        for number, ways in enumerate(_ways_of(choices, smooth | cusped))
    ]
    return [own or others for own, others in zip(left, more, strict=True)]


def _ways_of(choices: list[Ways], good: set[PlanChord]) -> list[Ways]:
    """Ways all of whose chords are among the good ones, which have the numbers of their plans."""
    return [
        [way for way in ways if all(PlanChord(number, chord) in good for chord in way)]
        for number, ways in enumerate(choices)
    ]


def _are_apart(cusps: Sequence[Float[np.ndarray, " coordinates"] | None]) -> bool:
    """Whether no two chords lead through one cusp: it lies on one fold only."""
    known = [cusp for cusp in cusps if cusp is not None]
    return all(np.linalg.norm(a - b) > SAME_STATE for a, b in combinations(known, 2))


def _along_sides(
    pairing: Pairing, triangles: list[int], normals: Places
) -> Float[np.ndarray, "n 2"]:
    """Components of normals to curves in coordinates in which their grid triangles are equilateral.

    So angles between them do not depend on the scales of the parameters.
    """
    mesh = pairing.mesh
    corners = mesh.vertices[mesh.triangles[triangles]] / pairing.setting.scales
    sides = corners[:, 1:] - corners[:, :1]
    first, second = np.einsum("nkd,nd->kn", sides, normals)
    return np.stack([first, (2.0 * second - first) / np.sqrt(3.0)], axis=1)


def _cusps_between(
    pairing: Pairing, triangles: list[int], ends: list[Chord]
) -> list[Float[np.ndarray, " coordinates"] | None]:
    """Place of the cusp in the triangle of each chord on the fold between both its ends, if any."""
    if not ends:
        return []
    setting, mesh, points = pairing.setting, pairing.mesh, pairing.points
    z, p, _ = middles(setting, points, ends)
    directions = np.zeros((len(ends), 2, p.shape[1]))
    directions[:, :, setting.free] = planes(pairing, triangles) * setting.scales
    found = correct_singular_states(setting.structure, z, p, directions, lambda _: (gap, quadratic))
    one, other = (embed(setting, points.z[k], points.p[k]) for k in np.array(ends).T)
    cusp = embed(setting, found.z, found.p)
    way = np.linalg.norm(cusp - one, axis=1) + np.linalg.norm(cusp - other, axis=1)
    corners = mesh.vertices[mesh.triangles[triangles]]
    inside = (shares_in(corners, found.p[:, setting.free]) > 0.0).all(axis=1)
    between = found.found & inside & (way < DETOUR * np.linalg.norm(other - one, axis=1))
    return [place if there else None for place, there in zip(cusp, between.tolist(), strict=True)]

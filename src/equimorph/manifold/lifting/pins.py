"""Exact points between pairs of points of polygons: on folds, on constraints, and on both."""

import numpy as np

from equimorph.arrays import Bool, Float
from equimorph.manifold.geometry.exact_points import pin
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.lifting.crossing_discs import Group
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import Chord, Plan, planes

LEAST: dict[int, float] = {VertexKind.CORNER: -0.2, VertexKind.CAP: 0.0}
"""Barycentric coordinates of points in their grid triangle, at least, by kind. On coarse grids
folds bulge beyond sides, and corners with them; tips of strips lie further away. A constraint
between two points of one side runs inside: it is followed where Newton's method meets it elsewhere,
before or behind a kink."""


def groups_of(plans: list[Plan], pairs: list[Chord]) -> list[Group]:
    """Pairs of points of polygons, with their triangles."""
    return [Group(plan.polygon.triangle, pair) for plan, pair in zip(plans, pairs, strict=True)]


def pin_groups(pairing: Pairing, pairs: list[Group], kinds: list[int]) -> list[int | None]:
    """Numbers of new exact points of given kinds between pairs; None where none was found."""
    out: list[int | None] = [None] * len(pairs)
    for kind in (VertexKind.FOLD, VertexKind.CAP, VertexKind.CORNER):
        own = [k for k, each in enumerate(kinds) if each == kind]
        if not own:
            continue
        ends = [pairs[k].points for k in own]
        span = planes(pairing, [pairs[k].triangle for k in own])
        pinned = pin(pairing.setting, pairing.points, ends, kind, span)
        good = pinned.found & _are_inside(pairing, [pairs[k].triangle for k in own], kind, pinned.p)
        lows = pairing.points.index[np.array(ends)].min(axis=1)
        for lane, low in zip(np.flatnonzero(good).tolist(), lows[good].tolist(), strict=True):
            out[own[lane]] = pairing.points.add(pinned.z[lane], pinned.p[lane], low, kind)
    return out


def _are_inside(
    pairing: Pairing, triangles: list[int], kind: int, p: Float[np.ndarray, "n P"]
) -> Bool[np.ndarray, " n"]:
    """Which points are in the box, and those on constraints over their own triangles or near.

    Folds and constraints bulge beyond sides. But where a strip between them leads on to a corner
    further away, it may pass other vertices before.
    """
    mesh, places = pairing.mesh, p[:, pairing.setting.free]
    inside = mesh.covers(places)
    if kind in LEAST:
        corners = mesh.vertices[mesh.triangles[triangles]]
        inside &= shares_in(corners, places).min(axis=1) > LEAST[kind]
    return inside

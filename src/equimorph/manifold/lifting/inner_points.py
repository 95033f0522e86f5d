"""Exact points inside grid tetrahedra between others: on folds, constraints, or where sheets cross.

See docs/decisions.md, "Folds and constraints are built into the cells".
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from equimorph.arrays import Float, Int, Items
from equimorph.manifold.geometry.exact_points import Pinned, Span, middles, pin, pin_crossings
from equimorph.manifold.geometry.points import Points, VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.geometry.topology import distinct
from equimorph.manifold.lifting.pairing import Pairing

SHARES = (0.25, 0.5, 0.8, 0.95)
"""Fractions between centroid and member used as retry starting points. Of 10 600 points inside
cells they gave 336, 157, 129 and 59."""
TRIED = 6
"""Points of a group towards which is tried at most: further ones gave none of these."""
ON_FACE = 1e-9
"""Barycentric coordinate below which a point lies on a face of a grid cell."""

SHEETS = 2
"""Number of sheets that meet at a crossing."""

Frames = Float[np.ndarray, "lanes corners d"]


def pin_in_cells(
    setting: Setting,
    points: Points,
    groups: Sequence[Sequence[int]],
    kind: int,
    span: Span,
    frames: Frames,
) -> Pinned:
    """Exact points between groups of points, inside grid cells.

    Where the one in the normal space through the middle is not, those through points between the
    middle and one of the group are tried: near its own points a constraint with kinks is smooth,
    and a fold does not leave the cell. Folds may bulge beyond a face between edges that they do not
    meet, and behind cusps: if none of their points is inside, the one least far outside is taken.

    `groups`, `kind`, `span`: as in `pin`. `frames`: corners of the grid cells, in free parameters.
    """
    sizes = np.array([len(group) for group in groups], int)
    z, p, _ = middles(setting, points, groups)
    best = np.full(len(groups), -np.inf if kind == VertexKind.FOLD else ON_FACE)
    found = np.zeros(len(groups), bool)
    for share in (0.0, *SHARES):
        left = np.flatnonzero(best <= ON_FACE)
        if len(left) == 0:
            break
        few = np.minimum(sizes[left], TRIED if share else 1)
        row, member = np.nonzero(np.arange(TRIED) < few[:, None])
        lane = left[row]
        # towards all members at once: each call takes long, be it for few lanes
        own = [groups[each] for each in lane.tolist()]
        pinned = pin(setting, points, own, kind, span[lane], member, share)
        inside = shares_in(frames[lane], pinned.p[:, setting.free]).min(axis=1)
        depth = np.where(pinned.found, inside, -np.inf)
        for number in range(int(few.max())):
            tried = np.flatnonzero(member == number)
            at = lane[tried]
            better = (best[at] <= ON_FACE) & (depth[tried] > best[at])
            at, tried = at[better], tried[better]
            z[at], p[at], best[at] = pinned.z[tried], pinned.p[tried], depth[tried]
            found[at] = True
    return Pinned(z, p, found)


def pin_inside(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    kind: int,
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool = False,
) -> list[int]:
    """Numbers of new exact points of a kind near groups over grid tetrahedra; −1 where none is.

    Crossings belong to two surfaces, whose groups are the same; `cap`: on a constraint.
    """
    if kind == VertexKind.CROSSING:
        return _pin_shared(pairing, groups, owner, cap=cap)
    return _new(pairing, groups, kind, owner, cap=cap)


def _pin_shared(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool,
) -> list[int]:
    """Numbers of new crossings near groups that are given twice."""
    keys = [tuple(group) for group in groups]
    once = Counter(keys)
    over = dict(zip(keys, owner.tolist(), strict=True))
    own = np.array([over[key] for key in once], int)
    found = dict(
        zip(once, _new(pairing, list(once), VertexKind.CROSSING, own, cap=cap), strict=True)
    )
    return [found[key] if once[key] == SHEETS else -1 for key in keys]


def _new(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    kind: int,
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool,
) -> list[int]:
    """Numbers of new exact points of a kind near groups; −1 where none was found."""
    out = [-1] * len(groups)
    if not groups:
        return out
    store = pairing.points
    pinned = _pinned_inside(pairing, groups, kind, owner, cap=cap)
    for lane in np.flatnonzero(pinned.found).tolist():
        # on folds and crossings that of the lower side, elsewhere that of all
        low = int(store.index[list(groups[lane])].min())
        out[lane] = store.add(pinned.z[lane], pinned.p[lane], low, kind)
    return out


def _pinned_inside(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    kind: int,
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool,
) -> Pinned:
    """Pin points inside their grid tetrahedra; crossings, and folds if need be, in the box."""
    setting, mesh = pairing.setting, pairing.mesh
    span = np.tile(np.eye(len(setting.free)), (len(groups), 1, 1))
    if kind == VertexKind.CROSSING:
        pinned = pin_crossings(setting, pairing.points, groups, span, cap)
    else:
        frames = mesh.vertices[mesh.tetrahedra[owner]]
        pinned = pin_in_cells(setting, pairing.points, groups, kind, span, frames)
    pinned.found[:] &= mesh.covers(pinned.p[:, setting.free])
    if kind == VertexKind.FOLD:
        _pin_beside_sides(pairing, groups, owner, pinned)
    return pinned


def _pin_beside_sides(
    pairing: Pairing, groups: Sequence[Sequence[int]], owner: Int[np.ndarray, " groups"], at: Pinned
) -> None:
    """Pin folds in place that were beyond a side, in the plane parallel to it through the middle.

    Behind a cusp in a side folds bulge beyond it, in cells of every size.
    """
    setting, mesh = pairing.setting, pairing.mesh
    for axis in range(len(setting.free)):
        lanes = np.flatnonzero(~at.found)
        if len(lanes) == 0:
            return
        own = [groups[lane] for lane in lanes.tolist()]
        span = np.tile(np.delete(np.eye(len(setting.free)), axis, axis=0), (len(lanes), 1, 1))
        frames = mesh.vertices[mesh.tetrahedra[owner[lanes]]]
        held = pin_in_cells(setting, pairing.points, own, VertexKind.FOLD, span, frames)
        good = held.found & mesh.covers(held.p[:, setting.free])
        at.z[lanes[good]], at.p[lanes[good]] = held.z[good], held.p[good]
        at.found[lanes[good]] = True


def grouped(
    group: Items, points: Int[np.ndarray, "n k"], marks: Float[np.ndarray, " points"]
) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Distinct points of each group, in the order of their marks: their groups and their numbers.

    So what is computed from them does not depend on the order in which they were found.
    """
    base = int(points.max(initial=0)) + 1
    at, own = np.divmod(distinct((group[:, None] * base + points).ravel()), base)
    return at, own[np.lexsort([marks[own], at])]


def groups_of(
    at: Int[np.ndarray, " m"], points: Int[np.ndarray, " m"], numbers: Int[np.ndarray, " k"]
) -> list[list[int]]:
    """Points of the groups with these numbers."""
    first, last = np.searchsorted(at, numbers), np.searchsorted(at, numbers, side="right")
    every = points.tolist()
    return [every[a:b] for a, b in zip(first.tolist(), last.tolist(), strict=True)]


def marks_of(points: Points) -> Float[np.ndarray, " points"]:
    """A number for each point that hardly any other one has."""
    z = points.z[: points.count]
    return np.asarray(z @ np.cos(np.arange(z.shape[1])))

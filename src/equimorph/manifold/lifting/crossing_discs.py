"""Polygons of two sheets that cross over one grid triangle share the chords of their crossing.

Each crossing point lies on two polygons. Where a fold of one of the sheets crosses that chord, too,
all meet in a hub: an exact crossing point at which a test function of the fold vanishes.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from equimorph.arrays import Float, ItemValues
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.settle import lower_index
from equimorph.manifold.geometry.exact_points import Aim, Pinned, correct_points, pin_crossings
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import MEETING, Chord, Plan, crossed_chords, planes
from equimorph.structures.margin import count_below
from equimorph.structures.metric import metric_length

Ways = list[list[Chord]]

COMBINATIONS = 256
"""Ways to cut all polygons over a triangle beyond which it is undecided at once."""
SHEETS = 2
"""Number of sheets that meet at a crossing."""
HUB = 1e-13
"""Precision of the place of a hub, relative to its chord."""
NEAR, FAR = 1e-6, 1e-3
"""The same where a second eigenvalue vanishes: target, and largest value that is accepted."""
VANISHING = 1e-10
"""Size of an eigenvalue that vanishes at exact crossings; they are below 1e-13 there."""
SKEW = 1e-4
"""Quadratic over cubic coefficient, a length in the metric, below which it counts as zero."""


class Group(NamedTuple):
    """Points over a grid triangle between which an exact point is computed."""

    triangle: int
    points: tuple[int, ...]


def join_crossings(plans: list[Plan], ways: list[Ways]) -> list[Ways]:
    """Ways to cut polygons that agree on the chords along which their sheets cross."""
    ways, groups = list(ways), _by_triangle(plans)
    for own in groups.values():
        choices = [ways[k] for k in own]
        size = int(np.prod([len(each) for each in choices]))
        fitting = [
            combination
            for combination in (product(*choices) if size <= COMBINATIONS else [])
            if _agree([plans[k] for k in own], combination)
        ]
        for place, k in enumerate(own):
            ways[k] = [fitting[0][place]] if len(fitting) == 1 else []
    return ways


def _by_triangle(plans: list[Plan]) -> dict[int, list[int]]:
    """Numbers of the plans with crossings, by grid triangle."""
    groups: dict[int, list[int]] = {}
    for k, plan in enumerate(plans):
        if plan.those(MEETING):
            groups.setdefault(plan.polygon.triangle, []).append(k)
    return groups


def _agree(plans: list[Plan], ways: Iterable[list[Chord]]) -> bool:
    """Whether each chord between crossings is that of two polygons."""
    count: dict[Chord, int] = {}
    for plan, way in zip(plans, ways, strict=True):
        for chord in way:
            if plan.singular(chord[0]) == MEETING:
                count[chord] = count.get(chord, 0) + 1
    return all(number == SHEETS for number in count.values())


def put_hubs(pairing: Pairing, plans: list[Plan]) -> set[int]:
    """Lead folds that cross a chord of a crossing through a hub; return triangles without one."""
    lost: set[int] = set()
    plans = [plan for plan in plans if VertexKind.CROSSING in plan.kinds.values()]
    for hub in plans:
        crossed = crossed_chords(hub)
        if crossed is None:
            continue
        (chord, fold), triangle = crossed, hub.polygon.triangle
        point = _hub(pairing, triangle, chord)
        if point is None:
            lost.add(triangle)
            continue
        for plan in plans:
            if plan.polygon.triangle == triangle and chord in plan.chords:
                plan.middle[chord] = point
        others = [each for each in hub.chords if each not in crossed]
        hub.chords = [chord, *((end, point) for end in fold), *others]
    return lost


def split_crossings(pairing: Pairing, plans: list[Plan], chords: set[Group]) -> list[int]:
    """Put exact points on chords of crossings, for both sheets; return triangles without one."""
    known = {Group(plan.polygon.triangle, chord) for plan in plans for chord in plan.middle}
    todo = sorted(chords - known)
    points = _pin(pairing, todo, cap=False)
    at = dict(zip(todo, points, strict=True))
    for plan in plans:
        for chord in plan.chords:
            point = at.get(Group(plan.polygon.triangle, chord))
            if point is not None:
                plan.middle[chord] = point
    return [group.triangle for group, point in at.items() if point is None]


def pin_ends(pairing: Pairing, plans: list[Plan]) -> list[int | None]:
    """Where crossings leave through a constraint, the same point for both sheets."""
    keys = [Group(plan.polygon.triangle, tuple(sorted(plan.those(MEETING)))) for plan in plans]
    groups = {
        Group(key.triangle, (plan.points[0], plan.points[-1], *key.points)): key
        for key, plan in zip(keys, plans, strict=True)
        if keys.count(key) == SHEETS
    }
    first = {key: group for group, key in reversed(groups.items())}
    points = _pin(pairing, list(first.values()), cap=True)
    at = dict(zip(first, points, strict=True))
    return [at.get(key) for key in keys]


def _pin(pairing: Pairing, groups: Sequence[Group], *, cap: bool) -> list[int | None]:
    """Numbers of new crossing points near points over triangles; None where none was found."""
    if not groups:
        return []
    setting, store = pairing.setting, pairing.points
    span = planes(pairing, [group.triangle for group in groups])
    pinned = pin_crossings(setting, store, [group.points for group in groups], span, cap)
    good = pinned.found & pairing.mesh.covers(pinned.p[:, setting.free])
    low = lower_index(setting.structure, pinned.z, pinned.p)
    return [
        store.add(pinned.z[k], pinned.p[k], int(low[k]), VertexKind.CROSSING) if good[k] else None
        for k in range(len(groups))
    ]


def _hub(pairing: Pairing, triangle: int, chord: Chord) -> int | None:
    """Crossing between two crossings at which a fold of a sheet crosses, too.

    There the quadratic coefficient of the reduced equation changes its sign; at pitchforks, where
    it is zero all along, the cubic one does. If another eigenvalue vanishes, the index does; the
    cubic coefficient has a pole there. It may have a zero beside it, where a fold of the side
    branch ends: that is the same point if it is as near as hubs are precise.
    """
    if chord in pairing.hubs:
        return pairing.hubs[chord]
    setting, store, ends = pairing.setting, pairing.points, list(chord)
    z, p = store.z[ends], store.p[ends]
    place = embed(setting, z, p)
    way = place[1] - place[0]
    length = float(np.linalg.norm(way))
    span, rows = planes(pairing, [triangle]), (way / length)[None, None]
    sense = null_border(setting.structure, z[:1], p[:1])[0]
    quadratic, cubic = _coefficients(pairing, z, p, sense)
    low, high = count_below(setting.structure, z, p, -VANISHING).tolist()
    skew = (np.abs(quadratic) > SKEW * np.abs(cubic)).any()
    found: list[Pinned] = []
    known = {0.0: (z[0], p[0]), 1.0: (z[1], p[1])}

    def test(share: float) -> float:
        middle = (place[0] + share * way)[None]
        aim = Aim(setting, False, False, span, middle, rows, crossing=True, border=sense[None])
        pinned = correct_points(aim, *_guess(known, share), np.array([length]))
        if not pinned.found[0]:
            raise _NoCrossingError
        found.append(pinned)
        known[share] = pinned.z[0], pinned.p[0]
        if low != high:
            return float(count_below(setting.structure, pinned.z, pinned.p, -VANISHING)[0] - low)
        return float(_coefficients(pairing, pinned.z, pinned.p, sense)[1 - skew][0])

    def cubic_at(share: float) -> float:
        test(min(max(share, 0.0), 1.0))
        return float(_coefficients(pairing, found[-1].z, found[-1].p, sense)[1][0])

    try:
        if low == high:
            test(brentq(test, 0.0, 1.0, xtol=HUB))
            hub = found[-1]
        else:
            share = _halve(test)
            hub = found[-1]
            _refuse_two(cubic, (cubic_at(share - FAR), cubic_at(share + FAR)))
    except (_NoCrossingError, ValueError):
        return None
    index = int(store.index[ends].min())
    pairing.hubs[chord] = store.add(hub.z[0], hub.p[0], index, VertexKind.CROSSING)
    return pairing.hubs[chord]


def _guess(
    known: dict[float, tuple[np.ndarray, np.ndarray]], share: float
) -> tuple[Float[np.ndarray, "1 size"], Float[np.ndarray, "1 P"]]:
    """State and parameters between the nearest known points on both sides.

    Near a hub Newton's method converges from nearby only.
    """
    before = max(each for each in known if each <= share < 1.0 or each < share)
    after = min(each for each in known if each > before)
    part = (share - before) / (after - before)
    # in this form what both have in common stays what it is, to the last digit
    one, other = known[before], known[after]
    z, p = ((a + part * (b - a))[None] for a, b in zip(one, other, strict=True))
    return z, p


def _halve(test: Callable[[float], float]) -> float:
    """Go near where a test begins to differ from zero, at which it may fail: a hub; its share."""
    low, high = 0.0, 1.0
    while high - low > NEAR:
        middle = 0.5 * (low + high)
        try:
            same = test(middle) == 0.0
        except _NoCrossingError:
            if high - low > FAR:
                raise
            break
        low, high = (middle, high) if same else (low, middle)
    return 0.5 * (low + high)


def _refuse_two(ends: ItemValues, around: tuple[float, float]) -> None:
    """Refuse a hub with a zero of the cubic coefficient on the chord, but not near it.

    `ends`, `around`: the coefficient at both ends, and on both sides of the hub.
    """
    if ends[0] * ends[1] > 0.0 > around[0] * around[1]:
        raise _NoCrossingError


class _NoCrossingError(Exception):
    """Raised where the search for a hub leaves the crossing, or meets more than a hub."""


def _coefficients(
    pairing: Pairing,
    z: Float[np.ndarray, "n size"],
    p: Float[np.ndarray, "n P"],
    sense: Float[np.ndarray, " size"],
) -> tuple[ItemValues, ItemValues]:
    """Quadratic and cubic coefficient with the null vectors that belong to `sense`.

    Near a hub another one is as good a null vector.
    """
    structure = pairing.setting.structure
    v = Critical(structure, z, p, np.tile(sense, (len(z), 1))).v
    norm = metric_length(structure, v) / (v**2).sum(axis=1)
    at = Critical(structure, z, p, np.ascontiguousarray(v * norm[:, None]))
    return at.quadratic, at.cubic

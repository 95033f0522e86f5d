"""Polygons of two sheets that cross over one grid triangle share the chords of their crossing.

Each crossing point lies on two polygons. Where a fold of one of the sheets crosses that chord, too,
all meet in a hub: an exact crossing point at which a test function of the fold vanishes. Folds of
both sheets have one hub each, which may be the same.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from equimorph.arrays import Float, ItemValues
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.settle import lower_index
from equimorph.manifold.geometry.exact_points import Aim, correct_points, pin_crossings
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import (
    MEETING,
    Chord,
    Plan,
    chord_of,
    crossed_chords,
    planes,
)
from equimorph.structures import Structure
from equimorph.structures.margin import count_below
from equimorph.structures.metric import metric_length

Ways = list[list[Chord]]
State = tuple[np.ndarray, np.ndarray]
"""Unknowns with multipliers, and parameters."""

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
        points = _hubs(pairing, triangle, chord)
        if points is None:
            lost.add(triangle)
            continue
        for plan in plans:
            if plan.polygon.triangle == triangle and chord in plan.chords:
                plan.middle.update(_between(pairing, chord))
        point = points[0 if _is_parted(pairing, hub, chord) else -1]
        others = [each for each in hub.chords if each not in crossed]
        hub.chords = [chord, *((end, point) for end in fold), *others]
    return lost


def _is_parted(pairing: Pairing, plan: Plan, chord: Chord) -> bool:
    """Whether the index of a sheet changes across the crossing, which ends at a chord's end."""
    at, index = plan.points.index(chord[0]), pairing.points.index
    return bool(index[plan.points[at - 1]] != index[plan.points[(at + 1) % len(plan.points)]])


def _between(pairing: Pairing, chord: Chord) -> dict[Chord, int]:
    """Hubs on a chord: the first between its ends, another between the first and an end."""
    hub = pairing.hubs[chord]
    pairs = [chord, *(chord_of(end, hub) for end in chord)]
    return {pair: pairing.hubs[pair] for pair in pairs if pair in pairing.hubs}


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


def _hubs(pairing: Pairing, triangle: int, chord: Chord) -> tuple[int, ...] | None:
    """Crossings between two crossings at which folds of their sheets cross, too: one or two.

    There the quadratic coefficient of the reduced equation changes its sign; at pitchforks, where
    it is zero all along, the cubic one does. If another eigenvalue vanishes, the index does, and a
    fold of the sheet whose index changes across the crossing passes; the cubic coefficient has a
    pole there. It may have a zero beside it, where a fold of the side branch passes: the second
    hub, or the same one if it is as near as hubs are precise.
    """
    if chord not in pairing.hubs:
        try:
            hubs, end = _sought(_Crossing(pairing, triangle, chord))
        except (_NoCrossingError, ValueError):
            return None
        store, pair = pairing.points, chord
        index = int(store.index[list(chord)].min())
        for z, p in hubs:
            point = pairing.hubs[pair] = store.add(z, p, index, VertexKind.CROSSING)
            pair = chord_of(chord[end], point)
    return tuple(_between(pairing, chord).values())


class _Crossing:
    """Where two sheets cross near a chord, by the share of the chord."""

    def __init__(self, pairing: Pairing, triangle: int, chord: Chord) -> None:
        setting, ends = pairing.setting, list(chord)
        self._structure = setting.structure
        z, p = pairing.points.z[ends], pairing.points.p[ends]
        self._place = embed(setting, z, p)
        self._way = self._place[1] - self._place[0]
        self._length = float(np.linalg.norm(self._way))
        self._sense = null_border(self._structure, z[:1], p[:1])[0]
        span, rows = planes(pairing, [triangle]), (self._way / self._length)[None, None]
        self._aim = Aim(
            setting, False, False, span, self._place[:1], rows, crossing=True,
            border=self._sense[None],
        )  # fmt: skip
        self._known = {0.0: (z[0], p[0]), 1.0: (z[1], p[1])}
        self.last = z[0], p[0]
        """State and parameters of the point that was computed last."""

    def _go(self, share: float) -> None:
        if share in self._known:
            self.last = self._known[share]
            return
        middle = (self._place[0] + share * self._way)[None]
        guess, length = _guess(self._known, share), np.array([self._length])
        pinned = correct_points(replace(self._aim, middle=middle), *guess, length)
        if not pinned.found[0]:
            raise _NoCrossingError
        self.last = self._known[share] = pinned.z[0], pinned.p[0]

    def index(self, share: float) -> int:
        """Number of other eigenvalues below zero."""
        self._go(share)
        z, p = self.last
        return int(count_below(self._structure, z[None], p[None], -VANISHING)[0])

    def coefficients(self, share: float) -> tuple[float, float]:
        """Quadratic and cubic coefficient of the reduced equation."""
        self._go(share)
        z, p = self.last
        quadratic, cubic = _coefficients(self._structure, z[None], p[None], self._sense)
        return float(quadratic[0]), float(cubic[0])

    def quadratic(self, share: float) -> float:
        """Quadratic coefficient."""
        return self.coefficients(share)[0]

    def cubic(self, share: float) -> float:
        """Cubic coefficient."""
        return self.coefficients(share)[1]


def _sought(crossing: _Crossing) -> tuple[list[State], int]:
    """Hubs on a crossing, and the end of its chord between which and the first the second lies."""
    ends = crossing.coefficients(0.0), crossing.coefficients(1.0)
    low, high = crossing.index(0.0), crossing.index(1.0)
    if low == high:
        skew = any(abs(quadratic) > SKEW * abs(cubic) for quadratic, cubic in ends)
        test = crossing.quadratic if skew else crossing.cubic
        test(brentq(test, 0.0, 1.0, xtol=HUB))
        return [crossing.last], 0
    share = _halve(lambda share: crossing.index(share) == low)
    hub, (before, behind) = crossing.last, (share - FAR, share + FAR)
    start, end = (crossing.cubic(min(max(each, 0.0), 1.0)) for each in (before, behind))
    if not ends[0][1] * ends[1][1] > 0.0 > start * end:
        return [hub], 0
    side = 0 if ends[0][1] * start < 0.0 else 1
    crossing.cubic(brentq(crossing.cubic, *((0.0, before), (behind, 1.0))[side], xtol=HUB))
    return [hub, crossing.last], side


def _guess(
    known: dict[float, State], share: float
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


def _halve(is_before: Callable[[float], bool]) -> float:
    """Go near a hub, at which a test changes that may fail beside it; the hub's share."""
    low, high = 0.0, 1.0
    while high - low > NEAR:
        middle = 0.5 * (low + high)
        try:
            before = is_before(middle)
        except _NoCrossingError:
            if high - low > FAR:
                raise
            break
        low, high = (middle, high) if before else (low, middle)
    return 0.5 * (low + high)


class _NoCrossingError(Exception):
    """Raised where the search for a hub leaves the crossing."""


def _coefficients(
    structure: Structure,
    z: Float[np.ndarray, "n size"],
    p: Float[np.ndarray, "n P"],
    sense: Float[np.ndarray, " size"],
) -> tuple[ItemValues, ItemValues]:
    """Quadratic and cubic coefficient with the null vectors that belong to `sense`.

    Near a hub another one is as good a null vector.
    """
    v = Critical(structure, z, p, np.tile(sense, (len(z), 1))).v
    norm = metric_length(structure, v) / (v**2).sum(axis=1)
    at = Critical(structure, z, p, np.ascontiguousarray(v * norm[:, None]))
    return at.quadratic, at.cubic

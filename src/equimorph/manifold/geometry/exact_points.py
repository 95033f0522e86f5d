"""Exact points of the set near places: on folds, on constraints, at crossings, or just on the set.

All are found by `equilibria.settle`; this module says what is sought in the terms of the set: its
metric, spans of the free parameters, and planes through places.

See docs/decisions.md, "A fold point must part the right indices".
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from equimorph.arrays import Flags, Float, Frames, Lanes, Numbers, Parameters, Rows, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import null_border
from equimorph.equilibria.point_conditions import (
    Condition,
    Crossing,
    Fold,
    Plane,
    Values as TakesValues,
)
from equimorph.equilibria.settle import Guards, Planes, Settled, Tangents, settle
from equimorph.linalg.lanes import results_of
from equimorph.manifold.geometry.crossings import reduction
from equimorph.manifold.geometry.points import Points, VertexKind
from equimorph.manifold.geometry.setting import Setting, embed, principal_directions
from equimorph.model import worst_excess
from equimorph.structures.metric import products_with
from equimorph.structures.newton import Limits

Span = Float[np.ndarray, "lanes k d"]

LED = (3, 12)
"""Steps from a known fold to the middle between several: few, else many. Of 645 points that one
step missed, few led to 473, many to 2 more. Towards members only few: many found none of 3 200
that were lost there, in half of the time of all."""
REACH = 3.0
"""How far a point may lie from the middle, relative to the farthest one around it."""
LONGEST = 0.5
"""Length in the metric to which steps are shortened."""
LAST = 1e-9
"""Length of a step after which there is none: its error is its square."""
FOLLOWING = 1e-13
"""Length of the following step, as the last two tell, that is not worth taking."""
STEPS = Limits(longest=LONGEST, converged=LAST, following=FOLLOWING)
"""Those of Newton's method, unless others are given."""
AT_ONCE = 512
"""Groups of points that are computed together, while other threads compute other ones."""
RESIDUAL = 1e-9
"""Residual of points at which sheets cross, where the equations are singular."""


@dataclass(frozen=True)
class Pinned(Columns):
    """Points with their parameters, and which of them can be trusted."""

    z: Lanes
    p: Parameters
    found: Flags


@dataclass(frozen=True)
class Corrected(Columns):
    """Points of the set, which of them can be trusted, and what is known there."""

    z: Lanes
    p: Parameters
    frames: Frames
    index: Numbers
    found: Flags


@dataclass(frozen=True)
class Aim(Columns):
    """What is sought: points on a fold, on a constraint, at a crossing, in planes through middles.

    Parameters
    ----------
    setting
        The structure and its free parameters.
    fold, cap, crossing
        Whether det F_z = 0, whether a constraint is active, and whether sheets cross there.
    span
        Orthonormal directions, in scaled free parameters, in which the parameters may move.
    middle
        Places near which points are sought.
    rows
        Directions in which points may not leave the middles. Those without further conditions are
        sought from the middles on.
    tangents
        Bases of spaces near the tangent spaces, where they are known.
    border
        Unit vectors near the null vectors at crossings, where they are known. At a guess another
        eigenvalue may be the smallest one.
    """

    setting: Setting
    fold: bool
    cap: bool
    span: Span
    middle: Float[np.ndarray, "lanes coordinates"]
    rows: Float[np.ndarray, "lanes m coordinates"]
    crossing: bool = False
    tangents: Rows | None = None
    border: Lanes | None = None

    @property
    def plain(self) -> bool:
        """Whether any point of the set in the normal spaces of the planes will do."""
        return not (self.fold or self.cap or self.crossing)

    @property
    def directions(self) -> Float[np.ndarray, "lanes k parameters"]:
        """Changes of the parameters along the span."""
        return self._changes(self.span * self.setting.scales)

    def centre(self, p: Parameters) -> tuple[Lanes, Parameters]:
        """States at the middles, with multipliers zero and other parameters as given."""
        setting, n = self.setting, self.setting.structure.unknowns
        z, p = np.zeros((len(self.middle), setting.structure.size)), p.copy()
        z[:, :n] = self.middle[:, :n] / np.sqrt(setting.structure.mass)
        p[:, setting.free] = self.middle[:, n:] * setting.scales
        return z, p

    def products(
        self, rows: Float[np.ndarray, "lanes m coordinates"]
    ) -> tuple[Float[np.ndarray, "lanes m size"], Float[np.ndarray, "lanes m parameters"]]:
        """What changes of z and p are multiplied by to give their products with rows."""
        structure, scales = self.setting.structure, self.setting.scales
        by_p = self._changes(rows[:, :, structure.unknowns :] / scales)
        return products_with(structure, rows), by_p

    def conditions(self, z: Lanes, p: Parameters) -> tuple[Condition, ...]:
        """As many scalars as directions; none for plain points: no step leaves their planes."""
        if self.plain:
            return ()
        directions, constraints = self.directions, self.setting.constraints

        def excess(z: Lanes, p: Parameters) -> Values:
            return worst_excess(constraints, z, p)

        return (
            *([Fold()] if self.fold else []),
            *([Crossing(directions)] if self.crossing else []),
            *([TakesValues((excess,), np.zeros((len(self.span), 1)))] if self.cap else []),
            *([Plane(z, p, *self.products(self.rows))] if self.rows.shape[1] else []),
        )

    def _changes(
        self, free: Float[np.ndarray, "lanes m d"]
    ) -> Float[np.ndarray, "lanes m parameters"]:
        out = np.zeros((*free.shape[:2], len(self.setting.base)))
        out[:, :, self.setting.free] = free
        return out


def correct_points(
    aim: Aim,
    z: Lanes,
    p: Parameters,
    around: Values,
    lower: Numbers | None = None,
    index: Numbers | None = None,
    limits: Limits = STEPS,
) -> Pinned:
    """Points that are sought, from guesses.

    Parameters
    ----------
    around
        How far neighbours are: points farther from the middle than `REACH` times that are not
        trusted.
    lower
        Index on the lower side of folds, if it is known: where two eigenvalues nearly vanish,
        another fold may be met.
    index
        Index of the sheet, if it is known: far from the guess, that of another may be met.
    limits
        Of steps: a guess that is close needs few, and across a kink of a constraint they are as
        long as the ones before.
    """
    found = _settle_guarded(aim, z, p, around, lower, index, limits)
    good = found.found
    if aim.crossing:
        good[good] = _crosses(aim.take(np.flatnonzero(good)), found.z[good], found.p[good])
    return Pinned(found.z, found.p, good)


def correct_between(
    setting: Setting,
    z: Lanes,
    p: Parameters,
    middle: Float[np.ndarray, "lanes coordinates"],
    rows: Rows,
    around: Values,
    following: float = FOLLOWING,
) -> Corrected:
    """Points of the set in the normal spaces of planes through middles, from states nearby.

    Their tangent spaces and index are those at the start of the last step; no step is taken that
    would be shorter than `following`.
    """
    span = np.tile(np.eye(len(setting.free)), (len(middle), 1, 1))
    aim = Aim(setting, False, False, span, middle, rows)
    limits = replace(STEPS, following=following)
    found = _settle_guarded(aim, z, p, around, None, None, limits)
    frames, good = np.zeros_like(found.frames), found.found
    frames[good] = found.frames[good]
    return Corrected(found.z, found.p, frames, found.index, good)


def _settle_guarded(
    aim: Aim,
    z: Lanes,
    p: Parameters,
    around: Values,
    lower: Numbers | None,
    index: Numbers | None,
    limits: Limits,
) -> Settled:
    """Newton's method with the guards of the set."""
    setting, centre = aim.setting, aim.centre(p)
    tangents = aim.rows if aim.plain else aim.tangents
    guards = Guards(
        **vars(limits),
        trust=REACH * around + 1e-3,
        middle=centre,
        lower_index=lower,
        index=index,
        within=setting.constraints,
    )
    frame: Planes | Tangents = Tangents(unfolded=aim.crossing, border=aim.border)
    if tangents is not None and not aim.crossing:
        frame = Planes(*aim.products(tangents))
    return settle(setting.structure, z, p, aim.directions, aim.conditions(*centre), guards, frame)


def _crosses(aim: Aim, z: Lanes, p: Parameters) -> Flags:
    """Whether sheets cross at points, rather than touch, and these are equilibria."""
    structure = aim.setting.structure
    border = null_border(structure, z, p) if aim.border is None else aim.border
    known = reduction(structure, z, p, border, aim.directions)
    small = np.abs(structure.residual(z, p)).max(axis=1, initial=0.0) < RESIDUAL
    return np.asarray(known.crosses & small)


def pin(
    setting: Setting,
    points: Points,
    groups: Sequence[Sequence[int]],
    kind: int,
    span: Span,
    member: Numbers | None = None,
    share: float = 0.0,
) -> Pinned:
    """Exact points in the middle of each group of points, on the same sheet.

    Points on no fold have the index of their group: Newton's method may reach another sheet in less
    than the distance within which points are believed.

    Parameters
    ----------
    groups
        Numbers of the points around the requested one.
    kind
        `FOLD` (det F_z = 0), `CAP` (a constraint is active), `CORNER` (both), others: neither.
    span
        The k orthonormal directions, in scaled free parameters, in which the parameters may move.
        As many conditions as are left put the point into the normal space of the group through
        its middle, so that it lies between the points of the group.
    member, share
        A member of each group, the first by default, and the share of the way towards it at which
        the middle is taken.
    """
    member = np.zeros(len(groups), int) if member is None else member
    parts = [slice(at, at + AT_ONCE) for at in range(0, max(len(groups), 1), AT_ONCE)]
    tasks = [
        partial(_pin_some, setting, points, groups[part], kind, span[part], member[part], share)
        for part in parts
    ]
    return Pinned.concatenate(list(results_of(tasks)))


def _pin_some(
    setting: Setting,
    points: Points,
    groups: Sequence[Sequence[int]],
    kind: int,
    span: Span,
    member: Numbers,
    share: float,
) -> Pinned:
    """Exact points in the middle of some groups."""
    z, p, deviations = middles(setting, points, groups)
    chosen = zip(groups, member.tolist(), strict=True)
    towards = np.array([group[number] for group, number in chosen], int)
    z += share * (points.z[towards] - z)
    p += share * (points.p[towards] - p)
    fold = kind in {VertexKind.FOLD, VertexKind.CORNER}
    cap = kind in {VertexKind.CAP, VertexKind.CORNER}
    rows = principal_directions(deviations, span.shape[1] - fold - cap)
    around = np.linalg.norm(deviations, axis=2).max(axis=1, initial=0.0)
    aim = Aim(setting, fold, cap, span, embed(setting, z, p), rows)
    low = np.array([points.index[list(group)].min() for group in groups], int)
    if not fold:
        return correct_points(aim, z, p, around, index=low)
    pinned = correct_points(aim, z, p, around, low)
    for steps, end in product(LED if share == 0.0 else LED[:1], (0, -1)) if not cap else ():
        lanes = np.flatnonzero(~pinned.found)
        if len(lanes) == 0:
            break
        start = np.array([groups[lane][end] for lane in lanes.tolist()], int)
        z, p = points.z[start], points.p[start]
        led = _lead(aim.take(lanes), steps, z, p, around[lanes], low[lanes])
        pinned.z[lanes], pinned.p[lanes], pinned.found[lanes] = led.z, led.p, led.found
    return pinned


def _lead(aim: Aim, steps: int, z: Lanes, p: Parameters, around: Values, low: Numbers) -> Pinned:
    """Compute folds in small steps from known ones to the middle, where a single step diverges."""
    z, p = z.copy(), p.copy()
    found = np.ones(len(z), bool)
    start = embed(aim.setting, z, p)
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        lanes = np.flatnonzero(found)
        if len(lanes) == 0:
            break
        middle = (1.0 - share) * start + share * aim.middle
        own = replace(aim, middle=middle).take(lanes)
        right = low[lanes] if share == 1.0 else None
        pinned = correct_points(own, z[lanes], p[lanes], 2.0 * around[lanes] / steps, right)
        z[lanes], p[lanes], found[lanes] = pinned.z, pinned.p, pinned.found
    return Pinned(z, p, found)


def pin_crossings(
    setting: Setting, points: Points, groups: Sequence[Sequence[int]], span: Span, cap: bool = False
) -> Pinned:
    """Crossing points between groups of points, with parameters in a span; see `pin`.

    With k directions, k − 1 conditions place the point between those of its group; `cap`: a
    constraint is active in place of one of them.
    """
    z, p, deviations = middles(setting, points, groups)
    rows = principal_directions(deviations, span.shape[1] - 1 - cap)
    around = np.linalg.norm(deviations, axis=2).max(axis=1, initial=0.0)
    aim = Aim(setting, False, cap, span, embed(setting, z, p), rows, crossing=True)
    return correct_points(aim, z, p, around)


def middles(
    setting: Setting, points: Points, groups: Sequence[Sequence[int]]
) -> tuple[Lanes, Parameters, Float[np.ndarray, "lanes points coordinates"]]:
    """Middles of groups, and where their points lie relative to them."""
    sizes = np.array([len(group) for group in groups])
    inside = np.arange(sizes.max(initial=0)) < sizes[:, None]
    members = np.zeros(inside.shape, int)
    members[inside] = [point for group in groups for point in group]
    share = inside / sizes[:, None]
    z = np.einsum("lm,lmi->li", share, points.z[members])
    # relative to the first, what all have in common stays what it is, to the last digit
    first = points.p[members[:, 0]]
    p = first + np.einsum("lm,lmi->li", share, points.p[members] - first[:, None])
    flat = members.ravel()
    places = embed(setting, points.z[flat], points.p[flat]).reshape(*members.shape, -1)
    middle = embed(setting, z, p)
    return z, p, (places - middle[:, None]) * inside[:, :, None]

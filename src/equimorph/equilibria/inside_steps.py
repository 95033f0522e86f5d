"""What the eigenvalue of F_z nearest to zero does between two points of a path.

It is the cubic through its values and slopes (``dσ/ds = vᵀ D²F[v, T]`` with the unit eigenvector
v). Points are added until it is known that it does not reach zero, or where.

See docs/decisions.md, "Hidden events".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Numbers, Some
from equimorph.columns import Columns
from equimorph.equilibria.critical import nearly_singular
from equimorph.equilibria.curves import Curve, squared_length
from equimorph.equilibria.determinants import determinant, may_vanish
from equimorph.equilibria.events import Events, locate_all
from equimorph.equilibria.locate import hermite
from equimorph.equilibria.steps import Bracket, Front, least_inside, step_along
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.linalg.determinants import in_units

Values = Float[np.ndarray, " points"]
CLOSE = 0.1
"""Least value inside a step, as a share of those at its ends, that asks for more points."""
AT_EVENT = 1e-6
"""Value at one end of a step over that at the other below which the end is itself an event."""
NARROW = 1.5e-4
"""Length in the metric on which the cubic is exact to round-off."""
TOUCH = 1e-9
"""Least value over those at the ends of a step that counts as zero."""
SHARP = 1e-6
"""Distance between two zeros of an eigenvalue, in the metric, below which they count as one that
touches zero: round-off, relative to the largest eigenvalues, hides what lies between."""
TRIALS = 30
"""Largest number of points inside a step at which the eigenvalue nearest to zero is computed."""


@dataclass(frozen=True)
class Probe(Columns):
    """Points with tangents, the eigenvalue nearest to zero and its slope, lengths on the way."""

    front: Front
    value: Values
    slope: Values
    length: Values


def probe_at(curve: Curve, front: Front, length: Values) -> Probe:
    """Eigenvalue nearest to zero, and its slope along the curve, at one point of each lane.

    By the solution of ``F_z v = −g b``: the eigenvalue is −g, and v = b, where b is an eigenvector.
    Between eigenvalues ±σ, b is none of either, and g has a pole; ``g/|v|`` is ±σ there, too.
    """
    p = curve.parameters(front.t)
    at = nearly_singular(curve.structure, front.z, p)
    slope = at.second(front.tangent_z, front.tangent_t[:, None] * curve.rate(front.t))
    size = np.linalg.norm(at.v, axis=1)
    return Probe(front, -at.g / size, slope / size**2, length)


@dataclass(frozen=True)
class Span(Columns):
    """Steps of lanes that may hide events: their ends, and where these lie on the way.

    first: a place between them at which F_z is nearly singular; NaN where none is known.
    """

    lane: Some
    before: Front
    after: Front
    start: Values
    stop: Values
    first: Values


def inside_spans(curve: Curve, span: Span, options: TraceOptions) -> Events:
    """Events between two points of lanes that neither the index nor the direction shows."""
    if len(span.lane) == 0:
        return Events.join([], curve.metric.size)
    # both ends at once: calls cost more than lanes
    count, length = len(span.lane), np.concatenate([span.start, span.stop])
    here = curve.take(np.tile(span.lane, 2))
    both = probe_at(here, Front.concatenate([span.before, span.after]), length)
    low, high = both.take(slice(count)), both.take(slice(count, None))
    smaller, larger = np.sort(np.abs([low.value, high.value]), axis=0)
    # a path may start or arrive right at an event: that is no hidden one
    open_ = np.flatnonzero(~(smaller <= AT_EVENT * larger))
    ends = low.take(open_), high.take(open_)
    return look_inside(curve, span.lane[open_], ends, span.first[open_], options)


def within_ends(hidden: Events) -> Events:
    """Hidden events, those beyond an end of the curve not found.

    Two turns there mean that the step ran through the end more than once, so that its arrival may
    be another than the first.
    """
    return replace(hidden, found=hidden.found & (hidden.t >= 0.0) & (hidden.t <= 1.0))


def inside_last_steps(
    curve: Curve,
    bracket: Bracket,
    determinants: Float[np.ndarray, "3 lanes"],
    options: TraceOptions,
) -> list[Events]:
    """Events inside the last steps of lanes, which no later determinant shows.

    The determinant at the middle of the step tells whether it has to be searched. `determinants`:
    those at both ends, and their power of two.
    """
    ends = bracket.before.index == bracket.after.index
    ends &= bracket.what & options.stops != 0
    if not (curve.folds_change_index and options.look_inside and ends.any()):
        return []
    last = np.flatnonzero(ends)
    step, (first, second, power) = bracket.take(last), determinants[:, last]
    here, middle = curve.take(step.lanes), hermite(step, np.full(len(last), 0.5))
    between = in_units(determinant(here, *middle), power)
    some = np.flatnonzero(may_vanish(np.stack([first, between, second])))
    step, unknown = step.take(some), np.full(len(some), np.nan)
    start, stop = step.travelled, step.travelled + step.step
    span = Span(step.lanes, step.before, step.after, start, stop, unknown)
    return [inside_spans(curve, span, options)]


@dataclass(frozen=True)
class _Piece(Columns):
    """Parts of steps in which an eigenvalue may reach zero: their ends, and what is known.

    sign, zero: of the eigenvalue at the start of the step, and the size that counts as none; doubt:
    error of the cubic at the last point.
    """

    lane: Some
    start: Front
    begun: Values
    low: Probe
    high: Probe
    first: Values
    sign: Values
    zero: Values
    doubt: Values

    @property
    def width(self) -> Values:
        """Length of the parts."""
        return np.asarray(self.high.length - self.low.length)

    def divided(self, middle: Probe, doubt: Values) -> "_Piece":
        """The side of a point inside on which the eigenvalue falls towards it."""
        falls = middle.slope < 0.0
        low, high = middle.where(falls, self.low), self.high.where(falls, middle)
        return replace(self, low=low, high=high, first=np.full(len(doubt), np.nan), doubt=doubt)


def look_inside(
    curve: Curve, lane: Some, ends: tuple[Probe, Probe], first: Values, options: TraceOptions
) -> Events:
    """What eigenvalues do between two points of lanes where they seem to come close to zero.

    `first` is a length at which one is known to be small, or NaN.
    """
    if len(lane) == 0:
        return Events.join([], curve.metric.size)
    sign, zero = np.sign(ends[0].value), _zero(curve.take(lane), ends)
    low, high = (_upright(end, sign, zero) for end in ends)
    front, begun = ends[0].front, ends[0].length
    piece = _Piece(lane, front, begun, low, high, first, sign, zero, np.zeros(len(lane)))
    found = list[Events]()
    for _ in range(TRIALS):
        narrow = piece.width < NARROW
        if narrow.any():
            found.append(_at_the_least(curve, piece.take(narrow), options))
            piece = piece.take(~narrow)
        share, least = _least(curve, piece)
        size = np.minimum(piece.low.value, piece.high.value)
        safe = least > np.max([CLOSE * size, piece.zero, piece.doubt], axis=0)
        left = ~(safe & np.isnan(piece.first))
        piece, share = piece.take(left), share[left]
        if len(share) == 0:
            break
        known = (piece.first - piece.low.length) / piece.width
        middle, good = _between(curve, piece, np.where(np.isnan(known), share, known))
        if not good.all():
            found.append(_doubtful(piece.take(~good)))
            piece = piece.take(good)
        parted = (np.abs(middle.value) > piece.zero) & (middle.front.index != piece.start.index)
        if parted.any():
            found.append(_both(curve, piece.take(parted), middle.take(parted), options))
            piece, middle = piece.take(~parted), middle.take(~parted)
        middle = _upright(middle, piece.sign, piece.zero)
        piece = piece.divided(middle, _surprise(curve, piece, middle))
    found.append(_doubtful(piece))
    return Events.join(found, curve.metric.size)


def _zero(curve: Curve, ends: tuple[Probe, Probe]) -> Values:
    """Size of an eigenvalue that counts as zero between two points."""
    low, high = ends
    bow = np.abs(np.sign(high.value) * high.slope - np.sign(low.value) * low.slope)
    bow = 0.125 * bow * SHARP**2 / (high.length - low.length)
    return np.asarray(np.maximum(TOUCH * np.minimum(np.abs(low.value), np.abs(high.value)), bow))


def _upright(probe: Probe, sign: Values, zero: Values) -> Probe:
    """The size of the eigenvalue; one that is zero within round-off has the sign of the ends."""
    turned = np.where(np.abs(probe.value) > zero, np.sign(probe.value), sign)
    return replace(probe, value=turned * probe.value, slope=turned * probe.slope)


def _surprise(curve: Curve, piece: _Piece, middle: Probe) -> Values:
    """Error of the cubic through two points at a point between them."""
    low, high = piece.low, piece.high
    s, width = (middle.length - low.length) / piece.width, _chord(curve, piece)
    cubic = (1 - s) ** 2 * ((1 + 2 * s) * low.value + s * width * low.slope)
    cubic = cubic + s**2 * ((3 - 2 * s) * high.value - (1 - s) * width * high.slope)
    return np.asarray(np.abs(middle.value - cubic))


def _between(curve: Curve, piece: _Piece, share: Values) -> tuple[Probe, Flags]:
    """Points of steps at shares of parts, or elsewhere in these if the curve is singular there.

    Only of those lanes that have such a point.
    """
    length, good = np.zeros(len(share)), np.zeros(len(share), bool)
    front = piece.start
    for place in (np.clip(share, 0.1, 0.9), 0.37, 0.71):
        open_ = np.flatnonzero(~good)
        here = piece.take(open_)
        length[open_] = here.low.length + np.broadcast_to(place, share.shape)[open_] * here.width
        there, good[open_] = step_along(
            curve.take(here.lane), here.start, length[open_] - here.begun
        )
        front = front.with_rows(open_, there)
        if good.all():
            break
    return probe_at(curve.take(piece.lane[good]), front.take(good), length[good]), good


def _events(piece: _Piece, code: int | Numbers, z: Lanes, t: Values, *, located: bool) -> Events:
    """Events inside pieces that leave the index as it is."""
    index = np.stack([piece.low.front.index] * 2, 1)
    kind, sure = np.full(len(t), code), np.full(len(t), located)
    return Events(piece.lane, kind, z, t, piece.low.length, index, sure)


def _doubtful(piece: _Piece) -> Events:
    """Branch points that are not located, at the low ends of pieces."""
    low = piece.low.front
    return _events(piece, EventCode.BRANCH_POINT, low.z, low.t, located=False)


def _chord(curve: Curve, piece: _Piece) -> Values:
    """Distance between the ends of parts: for narrow ones their arclength."""
    a, b, here = piece.low.front, piece.high.front, curve.take(piece.lane)
    return np.asarray(np.sqrt(squared_length(here.metric, here.weight, b.z - a.z, b.t - a.t)))


def _least(curve: Curve, piece: _Piece) -> tuple[Values, Values]:
    """Shares and least values of the cubics between the ends of parts."""
    values, slopes = (piece.low.value, piece.high.value), (piece.low.slope, piece.high.slope)
    return least_inside(values, slopes, _chord(curve, piece))


def _at_the_least(curve: Curve, piece: _Piece, options: TraceOptions) -> Events:
    """Decide on narrow parts: nothing, one event that touches, or two."""
    share, least = _least(curve, piece)
    down = least <= piece.zero
    piece, share, least = piece.take(down), share[down], least[down]
    if len(share) == 0:
        return Events.join([], curve.metric.size)
    length = piece.low.length + share * piece.width
    front, good = step_along(curve.take(piece.lane), piece.start, length - piece.begun)
    parted = good & (least < -piece.zero) & (front.index != piece.start.index)
    between = Probe(front, length, length, length)
    both = _both(curve, piece.take(parted), between.take(parted), options)
    part = replace(step_between(piece.lane, (piece.low, piece.high)), step=_chord(curve, piece))
    low = replace(piece.low, length=length)
    z, t = (each[~parted] for each in hermite(part, share))
    alone = replace(piece, low=low).take(~parted)
    turns = _turns(curve.take(alone.lane), z, t)
    code = np.where(turns, EventCode.FOLD, EventCode.BRANCH_POINT)
    touching = _events(alone, code, z, t, located=True)
    return Events.join([both, touching], curve.metric.size)


def _turns(curve: Curve, z: Lanes, t: Values) -> Flags:
    """Whether vᵀF_t is not zero at singular points: folds in which the path does not turn."""
    p = curve.parameters(t)
    at = nearly_singular(curve.structure, z, p)
    column = curve.structure.parameter_derivative(z, p, curve.rate(t))
    size, along = np.linalg.norm(column, axis=1), np.abs(at.along(curve.rate(t)))
    return np.asarray((along > 1e-6 * size) & (size > 1e-6))


def _both(curve: Curve, piece: _Piece, middle: Probe, options: TraceOptions) -> Events:
    """Locate the events on both sides of points with another index than that around."""
    # at a point that is itself singular the index is one of round-off
    low, high = (
        replace(each, front=replace(each.front, index=piece.start.index))
        for each in (piece.low, piece.high)
    )
    brackets = [step_between(piece.lane, pair) for pair in ((low, middle), (middle, high))]
    return locate_all(curve, brackets, (), replace(options, locate_passed=True))


def step_between(lane: Some, pair: tuple[Probe, Probe]) -> Bracket:
    """Steps of lanes between two points, with the data of their ends."""
    low, high = pair
    flipped = np.sign(low.front.tangent_t) != np.sign(high.front.tangent_t)
    code = np.where(flipped, EventCode.FOLD, EventCode.BRANCH_POINT)
    return Bracket(lane, low.front, high.front, high.length - low.length, low.length, code)

"""Largest values of a descriptor on the sheets around states, over boxes of parameters.

See docs/decisions.md, "Worst cases over boxes are searched for, not sampled".
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from equimorph.arrays import Bool, Float, Int, Lanes, Parameters, Some, Values
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.sensitivity import answers, slopes_along
from equimorph.equilibria.settle import Guards, settle
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.model import Descriptor
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length

Offsets = Float[np.ndarray, "n k"]

FINEST_LATTICE = {1: 8, 2: 4, 3: 2}
"""Largest factor on the two intervals of the lattice along each axis, by the number of axes."""
LAWFUL = 0.02
"""Deviation from differences that the slopes at both ends predict, relative to the range of the
values, above which the lattice is refined."""
COMPETING = 1e-3
"""Gap to the largest value, relative to their range, within which peaks are climbed."""
FLAT = 1e-9
"""Slope over the box, relative to the values, that is none."""
ROUNDS = 40
"""Most steps of an ascent."""
SHARES = (0.5, 0.2, 0.05)
"""Shares of a step of Newton's method that are tried if all of it leads down."""
RADIUS, FINEST = 0.25, 1e-6
"""First and last length of the steps along the axes, in half widths of the box."""
BESIDE = 1e-3
"""Distance, in half widths, of the slopes from which second derivatives follow."""
ROUND_OFF = 4e-16
"""Relative gain that is none."""
LOOSE = 10.0
"""Factor on the predicted change of a state within which the one beside it is believed."""


@dataclass(frozen=True)
class OnSheets:
    """States at offsets, in half widths of the box; the value is −∞ where stability is lost."""

    q: Offsets
    z: Lanes
    p: Parameters
    value: Values

    def take(self, some: Some) -> "OnSheets":
        """Some of them."""
        return OnSheets(self.q[some], self.z[some], self.p[some], self.value[some])

    def put(self, some: Some, others: "OnSheets") -> "OnSheets":
        """The same with some of them replaced."""
        out = []
        for mine, theirs in zip(vars(self).values(), vars(others).values(), strict=True):
            changed = mine.copy()
            changed[some] = theirs
            out.append(changed)
        return OnSheets(*out)


@dataclass(frozen=True, eq=False)
class BoxPeaks:
    """Search for the largest value of ``sign·descriptor`` over boxes around stable states.

    The sheet is followed along straight lines to a lattice of the box, which is refined where its
    values are not what the slopes predict. Between two neighbours whose slopes point towards each
    other there is a peak, as there is beside a point that no neighbour beats and whose slope points
    into the box: from there the value is raised to its maximum over the box, inside, on a face or
    on an edge, by Newton's method and steps along the axes, unless tangents show that it stays
    below another one. Only peaks between lattice points that leave no trace in values and slopes
    are overlooked.
    """

    structure: Structure
    descriptor: Descriptor
    places: Int[np.ndarray, " k"]
    sizes: Float[np.ndarray, " k"]
    """Numbers of the parameters, and half widths of the box."""
    sign: float
    finer: int = 1
    """Factor on the number of lattice intervals; with 0 there are only the middle and the corners,
    and no peaks are searched for."""

    @property
    def levels(self) -> int:
        """Points of the lattice along each axis."""
        return 1 + 2 * self.finer

    @cached_property
    def lattice(self) -> Offsets:
        """Offsets in half widths: none, the corners, then the other ones."""
        k = len(self.places)
        if self.finer == 0:
            return np.concatenate([np.zeros((1, k)), list(product((-1.0, 1.0), repeat=k))])
        points = np.array(list(product(np.linspace(-1.0, 1.0, self.levels), repeat=k)))
        rank = np.where((points == 0.0).all(axis=1), 0, 2)
        rank[(np.abs(points) == 1.0).all(axis=1)] = 1
        return np.asarray(points[np.argsort(rank, kind="stable")])

    @cached_property
    def links(self) -> Int[np.ndarray, "links 3"]:
        """Neighbours along an axis, in growing order of the offset, and the axis."""
        step = 2.0 / (self.levels - 1)
        gap = self.lattice[None] - self.lattice[:, None]
        one = np.isclose(gap, step) & np.isclose(np.abs(gap).sum(axis=2), step)[:, :, None]
        return np.argwhere(one)

    @cached_property
    def around(self) -> Bool[np.ndarray, "n n"]:
        """Which points of the lattice are neighbours, diagonally or not."""
        step = 2.0 / (self.levels - 1)
        gap = np.abs(self.lattice[None] - self.lattice[:, None]).max(axis=2)
        return np.asarray((gap < 1.5 * step) & (gap > 0.0))

    @cached_property
    def _refined(self) -> "BoxPeaks":
        """The same with a lattice twice as fine, whose tables are kept."""
        return replace(self, finer=2 * self.finer)

    def over(
        self, z: Lanes, p: Parameters
    ) -> tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m k"]]:
        """Values on the lattice and at peaks, and their offsets in half widths of the box.

        The value is ∞ where stability is lost on the way; −∞ where a state has no further peak, and
        at points of the lattice that cannot compete: neither middle nor corner, and beaten.
        """
        samples = self._samples(z, p)
        if self.finer == 0:
            value = samples.value.reshape(len(z), -1)
            offsets = np.broadcast_to(self.lattice, (*value.shape, len(self.sizes)))
            return np.where(np.isneginf(value), np.inf, value), offsets
        value, slope = self._on_lattice(samples, len(z))
        values, offsets = self._with_peaks(samples, value, slope)
        doubtful = np.flatnonzero(self._deviates(value, slope))
        if len(doubtful) and 2 * self.finer <= FINEST_LATTICE.get(len(self.sizes), 1):
            better = self._refined.over(z[doubtful], p[doubtful])
            more = max(better[0].shape[1] - values.shape[1], 0)
            values = np.pad(values, ((0, 0), (0, more)), constant_values=-np.inf)
            offsets = np.pad(offsets, ((0, 0), (0, more), (0, 0)))
            values[doubtful], offsets[doubtful] = -np.inf, 0.0
            width = better[0].shape[1]
            values[doubtful, :width], offsets[doubtful, :width] = better
        return values, offsets

    def _samples(self, z: Lanes, p: Parameters) -> OnSheets:
        """States on the lattice, state by state."""
        lanes = len(z)
        at_rest = OnSheets(np.zeros((lanes, len(self.sizes))), z, p, self._values(z, p))
        goals = np.tile(self.lattice, (lanes, 1))
        samples = at_rest.take(np.repeat(np.arange(lanes), len(self.lattice)))
        moving = np.flatnonzero(goals.any(axis=1))
        return samples.put(moving, self._move(samples.take(moving), goals[moving]))

    def _on_lattice(
        self, samples: OnSheets, lanes: int
    ) -> tuple[Float[np.ndarray, "lanes n"], Float[np.ndarray, "lanes n k"]]:
        """Values and slopes; no numbers where stability is lost."""
        slope = np.full(samples.q.shape, np.nan)
        good = np.flatnonzero(np.isfinite(samples.value))
        if len(good):
            slope[good] = self._slopes(samples.take(good))[0]
        return samples.value.reshape(lanes, -1), slope.reshape(lanes, -1, len(self.sizes))

    def _deviates(
        self, value: Float[np.ndarray, "lanes n"], slope: Float[np.ndarray, "lanes n k"]
    ) -> Bool[np.ndarray, " lanes"]:
        """Whether differences are others than slopes predict."""
        low, high, axis = self.links.T
        with np.errstate(invalid="ignore"):
            change = value[:, high] - value[:, low]
            law = (slope[:, low, axis] + slope[:, high, axis]) / (2.0 * self.finer)
            gap = np.abs(change - law)
        return np.asarray(np.nan_to_num(gap).max(axis=1) > LAWFUL * _range(value))

    def _with_peaks(
        self,
        samples: OnSheets,
        value: Float[np.ndarray, "lanes n"],
        slope: Float[np.ndarray, "lanes n k"],
    ) -> tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m k"]]:
        (lanes, n), k = value.shape, len(self.sizes)
        lane, point = self._starts(value, slope)
        peaks = self._raise(samples.take(lane * n + point))
        out = np.where(self._unbeaten(value), value, -np.inf)
        out[:, : 1 + 2**k] = value[:, : 1 + 2**k]
        out[np.isneginf(value)] = np.inf
        count = np.bincount(lane, minlength=lanes)
        rank = np.arange(len(lane)) - np.repeat(np.cumsum(count) - count, count)
        values = np.full((lanes, n + count.max(initial=0)), -np.inf)
        offsets = np.zeros((*values.shape, k))
        values[:, :n], offsets[:, :n] = out, self.lattice
        values[lane, n + rank], offsets[lane, n + rank] = peaks.value, peaks.q
        return values, offsets

    def _values(self, z: Lanes, p: Parameters) -> Values:
        return np.asarray(self.sign * self.descriptor.function(z, p))

    def _move(self, start: OnSheets, goals: Offsets) -> OnSheets:
        """Follow the sheet along straight lines to other offsets."""
        velocity = np.zeros_like(start.p)
        velocity[:, self.places] = (goals - start.q) * self.sizes
        line = ParameterLine(self.structure, start.p, velocity)
        ended = trace(line, start.z, (), TraceOptions(record=False))
        p, value = start.p + velocity, np.full(len(goals), -np.inf)
        good = np.flatnonzero(ended.code == EventCode.ARRIVED)
        value[good] = self._values(ended.z[good], p[good])
        return OnSheets(goals, ended.z, p, value)

    def _slopes(self, at: OnSheets) -> tuple[Offsets, Float[np.ndarray, "n k size"]]:
        """Slopes of the value, and changes of the state, per half width of the box."""
        scale = self.sizes / self.structure.scales[self.places]
        dz, dp = answers(self.structure, at.z, at.p, self.places)
        slope = slopes_along(self.structure, at.z, at.p, dz, dp, [self._values])[:, 0]
        return slope * scale, dz * scale[:, None]

    def _starts(
        self, value: Float[np.ndarray, "lanes n"], slope: Float[np.ndarray, "lanes n k"]
    ) -> tuple[Some, Some]:
        """States and points of the lattice beside peaks that are no points of it."""
        size = np.abs(np.where(np.isfinite(value), value, 0.0)).max(axis=1, initial=0.0)
        least, step = FLAT * np.maximum(size, 1e-300), 1.0 / self.finer
        level = value.max(axis=1) - COMPETING * _range(value)
        steep = np.nan_to_num(np.abs(slope))
        chosen = np.zeros(value.shape, bool)
        for low, high, axis in self.links.tolist():
            rise, fall = slope[:, low, axis], -slope[:, high, axis]
            better = value[:, low] >= value[:, high]
            # where the tangents meet, and how far the other axes may lead up
            with np.errstate(invalid="ignore", divide="ignore"):
                share = (value[:, high] - value[:, low] + fall * step) / (rise + fall)
                top = value[:, low] + rise * share
            others = np.where(better[:, None], steep[:, low], steep[:, high])
            top = top + step * (others.sum(axis=1) - others[:, axis])
            up = (rise > least) & (fall > least) & (top > level)
            chosen[:, low] |= up & better
            chosen[:, high] |= up & ~better
        inward = np.where(np.abs(self.lattice) == 1.0, -self.lattice * slope, steep)
        inward = np.maximum(np.nan_to_num(inward), 0.0)
        top = value + step * inward.sum(axis=2)
        leads = (inward.max(axis=2) > least[:, None]) & (top > level[:, None])
        state, point = np.nonzero(chosen | (self._unbeaten(value) & leads))
        return state, point

    def _unbeaten(self, value: Float[np.ndarray, "lanes n"]) -> Bool[np.ndarray, "lanes n"]:
        near = np.stack([value[:, row].max(axis=1, initial=-np.inf) for row in self.around], axis=1)
        return np.asarray((value >= near) & np.isfinite(value))

    def _raise(self, at: OnSheets) -> OnSheets:
        """Raise values to maxima over the box."""
        radius = np.full(len(at.q), RADIUS)
        for _ in range(ROUNDS):
            todo = np.flatnonzero(radius > FINEST)
            if not len(todo):
                break
            here = at.take(todo)
            step, slow = self._newton(here), radius[todo]
            there = self._move(here, np.clip(here.q + step, -1.0, 1.0))
            short = np.abs(step).max(axis=1) <= FINEST
            left = np.flatnonzero(~(there.value > here.value) & ~short)
            if len(left):
                ways = step[left, None] * np.array(SHARES)[:, None], self._axes(slow[left])
                there = there.put(left, self._best(here.take(left), np.concatenate(ways, axis=1)))
            better = there.value > here.value + ROUND_OFF * np.abs(here.value)
            at = at.put(todo[better], there.take(np.flatnonzero(better)))
            radius[todo] = np.where(better, slow, np.where(short, 0.0, 0.25 * slow))
        return at

    def _best(self, here: OnSheets, ways: Float[np.ndarray, "n ways k"]) -> OnSheets:
        """The best of several points of the box around each state."""
        (n, count, k), owner = ways.shape, np.repeat(np.arange(len(ways)), ways.shape[1])
        goals = np.clip(here.q[:, None] + ways, -1.0, 1.0).reshape(-1, k)
        many = self._move(here.take(owner), goals)
        return many.take(np.arange(n) * count + many.value.reshape(n, count).argmax(axis=1))

    def _axes(self, radius: Values) -> Float[np.ndarray, "n ways k"]:
        unit = np.eye(len(self.sizes))
        return np.asarray(radius[:, None, None] * np.concatenate([unit, -unit]))

    def _newton(self, at: OnSheets) -> Offsets:
        """Steps of Newton's method towards maxima within the sides of the box."""
        slope, dz = self._slopes(at)
        k = slope.shape[1]
        bend = np.zeros((len(slope), k, k))
        for axis in range(k):
            way = np.where(at.q[:, axis] > 0.0, -BESIDE, BESIDE)
            bend[:, axis] = (self._slopes_beside(at, dz[:, axis], axis, way) - slope) / way[:, None]
        held = (np.abs(at.q) >= 1.0) & (at.q * slope >= 0.0)
        bend = np.nan_to_num(0.5 * (bend + bend.swapaxes(1, 2)))
        bend[held[:, :, None] | held[:, None, :]] = 0.0
        slope = np.where(held, 0.0, slope)
        values, vectors = np.linalg.eigh(bend)
        along = np.einsum("nij,ni->nj", vectors, slope)
        steep = np.maximum(np.abs(values), np.maximum(0.5 * np.abs(along), 1e-300))
        return np.asarray(np.einsum("nij,nj->ni", vectors, along / steep))

    def _slopes_beside(self, at: OnSheets, dz: Lanes, axis: int, way: Values) -> Offsets:
        """Slopes a short way along an axis; not numbers where there is no state."""
        p = at.p.copy()
        p[:, self.places[axis]] += way * self.sizes[axis]
        change = way[:, None] * dz
        size = metric_length(self.structure, change)
        guards = Guards(trust=LOOSE * np.maximum(size, 1e-12))
        near = settle(self.structure, at.z + change, p, guards=guards)
        slope = np.full(at.q.shape, np.nan)
        good = np.flatnonzero(near.found)
        if len(good):
            there = replace(at.take(good), z=near.z[good], p=p[good])
            slope[good] = self._slopes(there)[0]
        return slope


def _range(value: Float[np.ndarray, "lanes n"]) -> Values:
    """Difference of the largest and the least value of each state, without those that are lost."""
    finite = np.isfinite(value)
    high = np.where(finite, value, -np.inf).max(axis=1)
    return np.asarray(high - np.where(finite, value, np.inf).min(axis=1))

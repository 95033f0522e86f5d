"""Compiled kernels of queries: cells near points, guesses on them, and what was found."""

import numpy as np

from equimorph.linalg.compiled import njit

ACCURATE = {"nogil": True, "error_model": "numpy"}
"""Flags: no sum is reordered, so that what is found of a point does not depend on its batch."""


@njit(**ACCURATE)
def cells_by_bin(first, last, counts):
    """Where the cells of each bin begin, and these, in the order of their numbers.

    first, last (C, d): ranges of bins along each parameter that a cell reaches; counts (d,): bins
    along each. Bins are numbered with the last parameter the fastest.
    """
    cells, d = first.shape
    stride, bins = np.ones(d, np.int64), 1
    for k in range(d - 1, -1, -1):
        stride[k] = bins
        bins *= counts[k]
    starts, place = np.zeros(bins + 1, np.int64), np.empty(d, np.int64)
    for fill in range(2):
        if fill:
            for number in range(bins):
                starts[number + 1] += starts[number]
            found, free = np.empty(starts[bins], np.int64), starts[:-1].copy()
        for c in range(cells):
            number = 0
            for k in range(d):
                place[k] = first[c, k]
                number += place[k] * stride[k]
            while True:
                if fill:
                    found[free[number]] = c
                    free[number] += 1
                else:
                    starts[number + 1] += 1
                k = d - 1
                while k >= 0 and place[k] == last[c, k]:
                    number -= (place[k] - first[c, k]) * stride[k]
                    place[k] = first[c, k]
                    k -= 1
                if k < 0:
                    break
                place[k] += 1
                number += stride[k]
    return starts, found


@njit(**ACCURATE)
def pairs_in_bins(low, high, first, counts, starts, cells):
    """Pairs of cells whose boxes meet, each in the first bin that lists both.

    low, high (d, C): the boxes; first (C, d): first bins that they reach; counts (d,), starts,
    cells: see `cells_by_bin`.
    """
    found, count = np.empty((len(cells), 2), np.int64), 0
    for number in range(len(starts) - 1):
        for i in range(starts[number], starts[number + 1]):
            for j in range(i + 1, starts[number + 1]):
                one, other, common = cells[i], cells[j], 0
                for k in range(len(counts)):
                    if low[k, one] > high[k, other] or low[k, other] > high[k, one]:
                        common = -1
                        break
                    common = common * counts[k] + max(first[one, k], first[other, k])
                if common != number:
                    continue
                if count == len(found):
                    found = np.concatenate((found, np.empty_like(found)))
                found[count, 0], found[count, 1] = one, other
                count += 1
    return found[:count]


@njit(**ACCURATE)
def cells_near(points, bins, maps, overhang, nudge):
    """Pairs of a point and a cell near it; see `CellIndex.near`.

    points (n, d); bins: lower, width (d,), counts (d,), starts and cells of the bins.
    Returns point, cell, weights (hits, d + 1), inside. Points are inside, and in bins, after a
    shift towards the middle of the box in a direction that no grid line has.
    """
    lower, width, counts, starts, cells = bins
    n, d = points.shape
    unit, shift, own, most = np.empty((n, d)), np.empty((n, d)), np.empty(n, np.int64), 0
    for i in range(n):
        number = 0
        for k in range(d):
            unit[i, k] = (points[i, k] - lower[k]) / width[k]
            shift[i, k] = nudge * (0.5 + 0.1 * np.cos(1.0 + k) - unit[i, k])
            place = int((unit[i, k] + shift[i, k]) * counts[k])
            number = number * counts[k] + min(max(place, 0), counts[k] - 1)
        own[i] = number
        most += starts[number + 1] - starts[number]
    point, cell = np.empty(most, np.int64), np.empty(most, np.int64)
    weights, inside = np.empty((most, d + 1)), np.empty(most, np.bool_)
    count = 0
    for i in range(n):
        for entry in range(starts[own[i]], starts[own[i] + 1]):
            c = cells[entry]
            near, within = True, True
            for r in range(d + 1):
                weight, push = maps[c, r, d], 0.0
                for k in range(d):
                    weight += maps[c, r, k] * unit[i, k]
                    push += maps[c, r, k] * shift[i, k]
                weights[count, r] = weight
                if not max(weight, weight + push) > -overhang[c, r] - nudge:
                    near = False
                    break
                if not weight + push >= 0.0:
                    within = False
            if near:
                point[count], cell[count], inside[count] = i, c, within
                count += 1
    return point[:count], cell[:count], weights[:count], inside[:count]


@njit(**ACCURATE)
def root_shares(weights, folded, closest):
    """Give corners off a fold the root of their share as their share, if there are both kinds.

    weights (n, corners), changed in place; `closest` is the least share that counts.
    """
    n, corners = weights.shape
    for i in range(n):
        number = 0
        for k in range(corners):
            number += folded[i, k]
        if not 0 < number < corners:
            continue
        on, off = 0.0, 0.0
        for k in range(corners):
            weights[i, k] += 1e-12  # all corners count where the share is zero
            if folded[i, k]:
                on += weights[i, k]
            else:
                off += weights[i, k]
        root = np.sqrt(max(off, closest))
        for k in range(corners):
            weights[i, k] *= (1.0 - root) / on if folded[i, k] else root / off


@njit(**ACCURATE)
def guesses(hits, cells, folded, z, closest):
    """Interpolation between the corners of cells, at their points nearest to those of hits.

    Beyond a facet on folds, at the mirror images of points, which may lie beyond the corner across
    from it: folds of slivers bulge by many of their heights. hits: cell, weights.
    """
    cell, weights = hits
    count, corners, size = len(cell), cells.shape[1], z.shape[1]
    out = np.empty((count, size))
    share, at_fold = np.empty((1, corners)), np.empty((1, corners), np.bool_)
    for i in range(count):
        own, total = cells[cell[i]], 0.0
        regular, beyond = 0, 0.0
        for k in range(corners):
            at_fold[0, k] = folded[own[k]]
            share[0, k] = max(weights[i, k], 0.0)
            total += share[0, k]
            if not at_fold[0, k]:
                regular += 1
                beyond = -weights[i, k]
        if regular == 1 and beyond > 0.0:
            root = np.sqrt(max(beyond, closest))
            for k in range(corners):
                share[0, k] = share[0, k] / total * (1.0 - root) if at_fold[0, k] else root
        else:
            for k in range(corners):
                share[0, k] /= total
            root_shares(share, at_fold, closest)
        first = own[0]
        for j in range(size):
            out[i, j] = share[0, 0] * z[first, j]
        for k in range(1, corners):  # rows in turn fill vectors; sums keep their order
            corner, weight = own[k], share[0, k]
            for j in range(size):
                out[i, j] += weight * z[corner, j]
    return out


@njit(**ACCURATE)
def worth_trying(hits, inside, brims, maps, nudge):
    """Hits on cells that contain their point, or across whose brim, within a nudge, it lies."""
    cell, weights = hits
    out, count = np.empty(len(cell), np.int64), 0
    for i in range(len(cell)):
        good, c = inside[i], cell[i]
        for r in range(weights.shape[1]):
            if good or not brims[c, r]:
                continue
            slack = 0.0
            for k in range(weights.shape[1] - 1):
                slack += nudge * abs(maps[c, r, k])
            good = weights[i, r] < slack
        if good:
            out[count] = i
            count += 1
    return out[:count]


@njit(**ACCURATE)
def longest_sides(cells, z, mass, out):
    """Length in the metric of the longest side from the first corner of each cell."""
    for c in range(len(cells)):
        first, longest = cells[c, 0], 0.0
        for k in range(1, cells.shape[1]):
            other, total = cells[c, k], 0.0
            for j in range(len(mass)):
                total += (z[other, j] - z[first, j]) ** 2 * mass[j]
            longest = max(longest, total)
        out[c] = np.sqrt(longest)


@njit(**ACCURATE)
def one_of_each(hits, states, guess, room, mass, same):
    """Hits that found a state that no other one of the same point found, sorted.

    Of several the one on a cell that contains the point. States farther from their guess than
    there is room are not good: changes `good`. hits: point (sorted), inside; states: z, good.
    """
    point, inside = hits
    z, good = states
    kept, count, first = np.empty(len(point), np.int64), 0, 0
    for i in range(len(point)):
        if i > 0 and point[i] != point[i - 1]:
            first = count
        if not good[i]:
            continue
        good[i] = _distance(z[i], guess[i], mass, room[i]) <= room[i]
        if not good[i]:
            continue
        twin = first
        while twin < count and _distance(z[i], z[kept[twin]], mass, same) > same:
            twin += 1
        if twin == count:
            kept[count] = i
            count += 1
        elif inside[i] and not inside[kept[twin]]:
            for m in range(twin, count - 1):
                kept[m] = kept[m + 1]
            kept[count - 1] = i
    return kept[:count]


@njit(**ACCURATE)
def _distance(one, other, mass, limit):
    """Distance in the metric, or a part of it that is beyond the limit."""
    total = 0.0
    for j in range(mass.shape[0]):
        total += mass[j] * (one[j] - other[j]) ** 2
        if total > limit * limit:
            break
    return np.sqrt(total)


@njit(**ACCURATE)
def balanced(hits, good, kept, sheets, count):
    """Points over which states and cells have the same sum of (−1)^index, and no cell failed.

    hits: point, cell, inside; kept: hits whose states are different; sheets, one entry a cell: sign
    of its index, whether it is overturned, at an edge, at a constraint, and there at no fold.
    """
    point, cell, inside = hits
    sign, overturned, edge, capped, ended = sheets
    surplus, sure = np.zeros(count, np.int64), np.ones(count, np.bool_)
    for i in range(len(point)):
        c = cell[i]
        if inside[i]:
            surplus[point[i]] -= -sign[c] if overturned[c] else sign[c]
        if not good[i] and (capped[c] or (inside[i] and not edge[c])):
            sure[point[i]] = False
    for i in kept:
        # a state just beyond the straight edge of a constraint has no cell above the point; in
        # strips from a constraint to a fold it may lie beyond the fold, where it has a partner
        if inside[i] or not ended[cell[i]]:
            surplus[point[i]] += sign[cell[i]]
    for i in range(count):
        sure[i] = sure[i] and surplus[i] == 0
    return sure

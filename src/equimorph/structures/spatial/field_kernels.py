"""Compiled kernels of fields along rods in space: places, strains, largest curvature.

Eight lanes at a time; see `fields` for what is computed.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, write_lanes
from equimorph.linalg.simd import (
    LANES,
    lanes_less,
    larger,
    load,
    smaller,
    spread,
    square_root,
    store,
    where_less,
    work_rows,
)
from equimorph.structures.spatial.derivative_kernels import (
    combine_jet,
    copy_node,
    moments_of,
    read_units,
    stretches_of,
)
from equimorph.structures.spatial.force_kernels import turn_axes
from equimorph.structures.spatial.jet_kernels import (
    ONE,
    add,
    clear,
    in_space,
    multiply_vector,
    on_axes,
    vector_multiply,
)

POLISHING = np.int64(4)
"""Newton iterations towards the largest curvature of an element."""
LOWEST = 0.8
"""Least share of the largest κ² of all stations that one next to the extremum has: with five
stations a degree cos(π/5), by the inequality in `largest_norms` of `rod.extrema`."""


@njit(**INNER)
def _cross(a, b, out, to):
    """a × b of vectors in three rows, written from `to` on."""
    a0, a1, a2 = load(a, 0), load(a, 1), load(a, 2)
    b0, b1, b2 = load(b, 0), load(b, 1), load(b, 2)
    store(out, to, a1 * b2 - a2 * b1)
    store(out, to + 1, a2 * b0 - a0 * b2)
    store(out, to + 2, a0 * b1 - a1 * b0)


@njit(**INNER)
def _local_strains(
    e, order, sums, stiffness, torsion, torsion_picks, first, turning, frames, tied, y, strains
):
    """Strains at the nodes of an element from the couple on its left end, by M' = r' × f.

    first: gradient of its energy by the left quaternion, on the axes of the cross-section; tied:
    moments that do not come from strains.
    """
    half = spread(-0.5)
    for i in range(order):
        for c in range(3):
            value = spread(0.0)
            for k in range(3):
                value = value + half * load(first, k) * load(frames, 3 * k + c)
            for j in range(order):
                value = value + spread(sums[e, i, j]) * load(turning, 3 * j + c)
            store(strains, 3 * (e * order + i) + c, value)
    for i in range(order):
        at = 3 * (e * order + i)
        m0, m1, m2 = load(strains, at), load(strains, at + 1), load(strains, at + 2)
        for k in range(3):
            axis = 9 * i + 3 * k
            value = m0 * load(frames, axis) + m1 * load(frames, axis + 1)
            value = value + m2 * load(frames, axis + 2) + load(tied, 3 * i + k)
            stiff = spread(stiffness[e, i, k])
            if k == 0:
                for n in range(len(torsion_picks)):
                    stiff = stiff + load(y, torsion_picks[n]) * spread(torsion[n, e, i])
            store(strains, at + k, value / stiff)


@njit(**INNER)
def _find_places(elements, order, sums, steps, begins, origin, scalars, y, places):
    """Places at the nodes of all elements from r' in `steps`."""
    for c in range(3):
        total = spread(0.0)
        for e in range(elements):
            for i in range(order):
                value = total
                for j in range(order):
                    value = value + spread(sums[e, i, j]) * load(steps, 3 * (e * order + j) + c)
                store(places, 3 * (e * order + i) + c, value)
            total = load(places, 3 * (e * order + order - 1) + c)
        start = spread(0.0)
        for s in range(scalars):
            start = start + spread(origin[c, s]) * load(y, s)
        start = start if begins[c] else start - total
        for n in range(elements * order):
            add(places, 3 * n + c, start)


@njit(**INNER)
def _largest(elements, order, table, to_legendre, strains, sizes, square, where, chosen, series):
    """Largest κ_n² + κ_b² of all elements into square; element and share of it into `where`.

    table: values at stations, after the stations themselves; every station that is a peak among
    these, in a lane, and not much lower than the highest one starts Newton's method on the series.
    """
    zero, stations = spread(0.0), table.shape[0]
    most, element, share = spread(-1.0), zero, zero
    for e in range(elements):
        for s in range(stations):
            a, b = zero, zero
            for i in range(order):
                at, by = 3 * (e * order + i), spread(table[s, 1 + i])
                a, b = a + by * load(strains, at + 1), b + by * load(strains, at + 2)
            value = a * a + b * b
            value = where_less(value, spread(1e300), value, spread(-1.0))
            store(sizes, e * stations + s, value)
            element = where_less(most, value, spread(e), element)
            share = where_less(most, value, spread(table[s, 0]), share)
            most = where_less(most, value, value, most)
    store(square, 0, most)
    store(where, 0, element)
    store(where, 1, share)
    lowest = spread(LOWEST) * most
    for e in range(elements):
        ready = False
        for s in range(stations):
            value = load(sizes, e * stations + s)
            peak = where_less(lowest, value, spread(1.0), zero)
            if s > 0:
                peak = where_less(value, load(sizes, e * stations + s - 1), zero, peak)
            if s < stations - 1:
                peak = where_less(load(sizes, e * stations + s + 1), value, peak, zero)
            if lanes_less(zero, peak) == 0:
                continue
            if not ready:
                _series(e, order, to_legendre, strains, chosen, series)
                ready = True
            _polish(e, order, table[s, 0], stations, peak, series, square, where)
    most = load(square, 0)
    store(square, 0, where_less(most, zero, spread(np.nan), square_root(larger(most, zero))))


@njit(**INNER)
def _series(e, order, to_legendre, strains, chosen, series):
    """Legendre coefficients of κ_n and κ_b in an element."""
    for i in range(order):
        for k in range(2):
            store(chosen, 2 * i + k, load(strains, 3 * (e * order + i) + 1 + k))
    for c in range(order):
        for k in range(2):
            value = spread(0.0)
            for i in range(order):
                value = value + spread(to_legendre[c, i]) * load(chosen, 2 * i + k)
            store(series, 2 * c + k, value)


@njit(**INNER)
def _polish(e, order, station, stations, peak, series, square, where):
    """Newton's method from a station in lanes in which it is a peak; larger values replace best."""
    zero, one, two = spread(0.0), spread(1.0), spread(2.0)
    most, element, place = load(square, 0), load(where, 0), load(where, 1)
    width, t = spread(np.pi / stations), spread(station)
    for step in range(POLISHING + 1):
        x = two * t - one
        before, now, d_before, d_now, dd_before, dd_now = one, x, zero, one, zero, zero
        a, b = load(series, 0) + load(series, 2) * x, load(series, 1) + load(series, 3) * x
        da, db, dda, ddb = load(series, 2), load(series, 3), zero, zero
        for c in range(2, order):
            up, down = spread((2.0 * c - 1.0) / c), spread((c - 1.0) / c)
            ddn = up * (two * d_now + x * dd_now) - down * dd_before
            dn = up * (now + x * d_now) - down * d_before
            value = up * x * now - down * before
            before, d_before, dd_before = now, d_now, dd_now
            now, d_now, dd_now = value, dn, ddn
            u, v = load(series, 2 * c), load(series, 2 * c + 1)
            a, b, da, db = a + u * now, b + v * now, da + u * d_now, db + v * d_now
            dda, ddb = dda + u * dd_now, ddb + v * dd_now
        value = where_less(zero, peak, a * a + b * b, zero)
        if step > 0:
            element = where_less(most, value, spread(e), element)
            place = where_less(most, value, t, place)
            most = where_less(most, value, value, most)
        slope, bend = a * da + b * db, a * dda + b * ddb + da * da + db * db
        move = where_less(bend, zero, zero - slope / (two * bend), zero)
        move = smaller(larger(move, zero - width), width)
        t = smaller(larger(t + move, zero), one)
    store(square, 0, most)
    store(where, 0, element)
    store(where, 1, place)


@njit(**FLAGS)
def fields_lanes(
    pairs, slopes, weights, stiffness, moments, moment_picks, torsion, torsion_picks, forces,
    force_picks, tension, tension_picks, softness, turned, held, sums, origin, begins, table,
    to_legendre, breaks, z, p, rotations, places, strains, largest, place,
):  # fmt: skip
    """Fields at the nodes of all elements: rotations (lanes, nodes, 4), places, strains.

    begins: whether x, y, z begin at end A; table: see `_largest`; breaks: ends of elements;
    largest: √(κ_n² + κ_b²), and its place.
    """
    elements, order, scalars = slopes.shape[0], slopes.shape[1], origin.shape[1]
    degree, soft, many = order - 1, softness.shape[0] > 0, elements * order
    nodes = elements * degree + 1
    given, unit, y = work_rows(4 * nodes), work_rows(4 * nodes), work_rows(scalars)
    square, inverse, number = work_rows(nodes), work_rows(nodes), work_rows(1)
    here, moved, other, own = work_rows(4), work_rows(4), work_rows(4), work_rows(4)
    strain, moment, stretch, force = work_rows(3), work_rows(3), work_rows(3), work_rows(3)
    point, first_couple, corner = work_rows(3), work_rows(3), work_rows(4)
    turning, tied = work_rows(3 * order), work_rows(3 * order)
    frames, steps = work_rows(9 * order), work_rows(3 * many)
    bends, sites, axes = work_rows(3 * many), work_rows(3 * many), work_rows(9)
    best, where = work_rows(1), work_rows(2)
    chosen, series = work_rows(2 * order), work_rows(2 * order)
    sizes = work_rows(elements * table.shape[0])
    no_z, no_p = np.empty((z.shape[0], 0, z.shape[1])), np.empty((z.shape[0], 0, p.shape[1]))
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_units(
            pairs, ONE, z, p, no_z, no_p, start, scalars, nodes, held, turned, given, y, square,
            inverse, number, here, other, own, unit,
        )  # fmt: skip
        for e in range(elements):
            base = e * degree
            clear(corner, 0, 4)
            for i in range(order):
                weight = weights[e, i]
                copy_node(ONE, nodes, base + i, unit, here)
                for c in range(4):
                    value = spread(0.0)
                    for j in range(order):
                        value = value + spread(slopes[e, i, j]) * load(unit, 4 * (base + j) + c)
                    store(moved, c, value)
                clear(strain, 0, 3)
                on_axes(pairs, here, moved, strain)
                moments_of(
                    pairs, ONE, scalars, e, i, stiffness, moments, moment_picks, torsion,
                    torsion_picks, y, strain, number, moment,
                )  # fmt: skip
                clear(point, 0, 3)
                combine_jet(ONE, scalars, e, i, moments, moment_picks, 1.0, y, point)
                for k in range(3):
                    store(tied, 3 * i + k, load(point, k))
                by = spread(2.0 * weight * slopes[e, i, 0])
                multiply_vector(pairs, here, moment, by, corner)
                clear(force, 0, 3)
                combine_jet(ONE, scalars, e, i, forces, force_picks, 1.0, y, force)
                clear(own, 0, 4)
                vector_multiply(pairs, force, here, own)
                clear(stretch, 0, 3)
                store(stretch, 0, spread(1.0))
                if soft:
                    clear(point, 0, 3)
                    on_axes(pairs, here, own, point)
                    stretches_of(
                        ONE, scalars, e, i, softness, tension, tension_picks, y, point, stretch
                    )
                if i == 0:
                    multiply_vector(pairs, moved, moment, spread(-2.0 * weight), corner)
                    multiply_vector(pairs, own, stretch, spread(-2.0 * weight), corner)
                clear(other, 0, 4)
                multiply_vector(pairs, here, stretch, spread(1.0), other)
                clear(point, 0, 3)
                in_space(pairs, here, other, point)
                for c in range(3):
                    store(steps, 3 * (e * order + i) + c, load(point, c))
                _cross(point, force, turning, 3 * i)
                turn_axes(here, 0, axes)
                for k in range(9):
                    store(frames, 9 * i + k, load(axes, k))
            copy_node(ONE, nodes, base, unit, here)
            clear(first_couple, 0, 3)
            on_axes(pairs, here, corner, first_couple)
            _local_strains(
                e, order, sums, stiffness, torsion, torsion_picks, first_couple, turning, frames,
                tied, y, bends,
            )  # fmt: skip
        _find_places(elements, order, sums, steps, begins, origin, scalars, y, sites)
        _largest(elements, order, table, to_legendre, bends, sizes, best, where, chosen, series)
        write_lanes(unit, 0, 1, rotations, start * 4 * nodes, 4 * nodes, 4 * nodes)
        write_lanes(sites, 0, 1, places, start * 3 * many, 3 * many, 3 * many)
        write_lanes(bends, 0, 1, strains, start * 3 * many, 3 * many, 3 * many)
        for lane in range(LANES):
            e = np.int64(where[0, lane])
            share = where[1, lane]
            largest[start + lane] = best[0, lane]
            place[start + lane] = breaks[e] + (breaks[e + 1] - breaks[e]) * share

"""Compiled kernel of the moments in the cross-sections of a frame in space.

Ends of elements carry what the element's gradient says; inside ``m' = f × r'`` is integrated, and
the remaining difference is distributed in proportion.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, write_lanes
from equimorph.linalg.simd import LANES, load, spread, store, work_rows
from equimorph.structures.space_frame.derivative_kernels import element_slopes, read_units
from equimorph.structures.spatial.derivative_kernels import copy_node
from equimorph.structures.spatial.force_kernels import turn_axes
from equimorph.structures.spatial.jet_kernels import ONE, clear, on_axes


@njit(**INNER)
def _end_moment(pairs, i, axes, here, own, slope, on_own, out):
    """Moment, in space, by the slope at a point of an element; axes: nine rows a point."""
    for c in range(4):
        store(own, c, load(slope, 4 * i + c))
    clear(on_own, 0, 3)
    on_axes(pairs, here, own, on_own)
    for c in range(3):
        value = spread(0.0)
        for k in range(3):
            value = value + spread(0.5) * load(axes, 9 * i + 3 * k + c) * load(on_own, k)
        store(out, c, value)


@njit(**INNER)
def _turning(order, e, weights, forces, chords, out):
    """f × r' at the points of an element, three rows a point."""
    for i in range(order):
        by, at = spread(1.0 / weights[e, i]), 3 * i
        f0, f1, f2 = load(forces, at), load(forces, at + 1), load(forces, at + 2)
        r0, r1, r2 = load(chords, at), load(chords, at + 1), load(chords, at + 2)
        store(out, at, by * (f1 * r2 - f2 * r1))
        store(out, at + 1, by * (f2 * r0 - f0 * r2))
        store(out, at + 2, by * (f0 * r1 - f1 * r0))


@njit(**INNER)
def _integrate(order, e, sums, shares, turning, first, last, out):
    """Moments at the points of an element, in space, from those at its ends."""
    for i in range(order - 1, -1, -1):
        for c in range(3):
            value = spread(0.0)
            for j in range(order):
                value = value + spread(sums[e, i, j]) * load(turning, 3 * j + c)
            if i == order - 1:  # from here on the gap
                store(last, c, load(last, c) + load(first, c) - value)
            gap = spread(shares[i]) * load(last, c)
            store(out, 3 * i + c, value - load(first, c) + gap)


@njit(**INNER)
def _on_sections(e, i, axes, drawn, moments, on_own, to, out):
    """Moment at a point on the axes of its cross-section, written from `to` on."""
    for k in range(3):
        value = spread(0.0)
        for c in range(3):
            value = value + load(axes, 9 * i + 3 * k + c) * load(moments, 3 * i + c)
        store(on_own, k, value)
    for a in range(3):
        value = spread(0.0)
        for k in range(3):
            value = value + spread(drawn[e, i, k, a]) * load(on_own, k)
        store(out, to + a, value)


@njit(**FLAGS)
def moments_lanes(
    pairs, plain, turns_of_held, nodes, owner, slopes, weights, tangents, arclengths, stiff,
    moment_of_strain, soft, counts, numbers, start, drop, strains, elongation, free, held, hinged,
    parents, hinge_axes, sums, shares, drawn, z, p, out,
):  # fmt: skip
    """Moments on the axes t, n, b at the points: out (lanes, elements · order · 3).

    sums: integrals from the beginning of each element; shares: of its length; drawn: axes.
    """
    elements, order, hinges = len(nodes), nodes.shape[1], len(hinged)
    m = z.shape[1] - 4 * len(free) - hinges
    scalars, total, width = m + p.shape[1] + 1, len(free) + len(held) + hinges, out.shape[1]
    given, y = work_rows(z.shape[1] + 8), work_rows(scalars + 8)
    quaternions, unit, turned = (
        work_rows(4 * total),
        work_rows(4 * total),
        work_rows(4 * hinges + 4),
    )
    square, inverse = work_rows(total), work_rows(total)
    here, moved, other, own = work_rows(4), work_rows(4), work_rows(4), work_rows(4)
    pull, turn, strain, moment = work_rows(4), work_rows(4), work_rows(3), work_rows(3)
    actuated, force, point, tangent = work_rows(3), work_rows(3), work_rows(3), work_rows(3)
    stretch, angle, axis = work_rows(1), work_rows(1), work_rows(1)[0]
    local, chords, forces = work_rows(4 * order), work_rows(3 * order), work_rows(3 * order)
    axes, turning, inside = work_rows(9 * order), work_rows(3 * order), work_rows(3 * order)
    first, last, rows, turned_back = work_rows(3), work_rows(3), work_rows(width + 8), work_rows(9)
    no_z, no_p = np.empty((len(z), 0, z.shape[1])), np.empty((len(z), 0, p.shape[1]))
    for block in range(0, len(z), LANES):
        lane = min(block, len(z) - LANES)
        read_units(
            pairs, ONE, z, p, no_z, no_p, lane, m, free, held, hinged, parents, hinge_axes,
            turns_of_held, given, y, quaternions, square, inverse, axis, angle, turn, here, other,
            turned, unit,
        )  # fmt: skip
        for e in range(elements):
            k = owner[e]
            element_slopes(
                pairs, plain, ONE, e, scalars, m, nodes, slopes, weights, tangents, arclengths,
                stiff, moment_of_strain, soft[k], counts[k], numbers[k], start[k], drop[k],
                strains[k], elongation[k], total, y, unit, here, moved, other, own, strain, moment,
                actuated, force, tangent, point, pull, stretch, local, chords, forces,
            )  # fmt: skip
            for i in range(order):
                turn_axes(unit, 4 * nodes[e, i], turned_back)
                for c in range(9):
                    store(axes, 9 * i + c, load(turned_back, c))
            _turning(order, e, weights, forces, chords, turning)
            copy_node(ONE, total, nodes[e, 0], unit, here)
            _end_moment(pairs, 0, axes, here, own, local, point, first)
            copy_node(ONE, total, nodes[e, order - 1], unit, here)
            _end_moment(pairs, order - 1, axes, here, own, local, point, last)
            _integrate(order, e, sums, shares, turning, first, last, inside)
            for i in range(order):
                _on_sections(e, i, axes, drawn, inside, point, 3 * (e * order + i), rows)
        write_lanes(rows, 0, 1, out, lane * width, width, width)

"""Compiled energy of frames in space, a vector of lanes at a time.

With y all scalars and λ the multipliers among them, L is quadratic in y through the tension N and
through ½ yᵀ Q y; what is left of L without the multipliers' part is L − λ·∂L/∂λ.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes
from equimorph.linalg.simd import LANES, load, spread, store, work_rows
from equimorph.structures.space_frame.element_kernels import relate
from equimorph.structures.space_frame.node_kernels import (
    hinge_turns,
    set_turns,
    turn_held,
    vector_sums,
)


@njit(**INNER)
def _bending(e, order, weights, stiff, moment_of_strain, strain, free):
    """Energy of the strains v of an element: ½ v·S v − v·B ε, ε those that are free of stress."""
    total = spread(0.0)
    for i in range(order):
        for a in range(3):
            value = spread(0.0)
            for b in range(3):
                value = value + spread(0.5 * stiff[e, i, a, b]) * load(strain, 3 * i + b)
                value = value - spread(moment_of_strain[e, i, a, b]) * load(free, b)
            total = total + spread(weights[e, i]) * load(strain, 3 * i + a) * value
    return total


@njit(**INNER)
def _pulling(
    e, order, nodes, weights, tangents, arclengths, soft, count, ties, numbers, start, drop,
    scalars, w, stretch,
):  # fmt: skip
    """−(1 + e + ½ c N) N of the forces in an element, less the multipliers' part of it."""
    compliance, zero, half, two = spread(soft), spread(0.0), spread(0.5), spread(2.0)
    total = zero
    for i in range(order):
        f1, f2, f3, c1, c2, c3 = zero, zero, zero, zero, zero, zero
        for r in range(count):
            y, s = load(scalars, numbers[r]), arclengths[e, i]
            x1 = spread(start[r, 0] - s * drop[r, 0]) * y
            x2 = spread(start[r, 1] - s * drop[r, 1]) * y
            x3 = spread(start[r, 2] - s * drop[r, 2]) * y
            f1, f2, f3 = f1 + x1, f2 + x2, f3 + x3
            if r < ties:
                c1, c2, c3 = c1 + x1, c2 + x2, c3 + x3
        at = 4 * nodes[e, i]
        q0, q1, q2, q3 = load(w, at), load(w, at + 1), load(w, at + 2), load(w, at + 3)
        a1, a2 = spread(tangents[e, i, 0]), spread(tangents[e, i, 1])
        a3 = spread(tangents[e, i, 2])
        # turned: a + 2 q₀ (q × a) + 2 q × (q × a)
        b1, b2, b3 = two * (q2 * a3 - q3 * a2), two * (q3 * a1 - q1 * a3), two * (q1 * a2 - q2 * a1)
        t1 = a1 + q0 * b1 + q2 * b3 - q3 * b2
        t2 = a2 + q0 * b2 + q3 * b1 - q1 * b3
        t3 = a3 + q0 * b3 + q1 * b2 - q2 * b1
        tension = f1 * t1 + f2 * t2 + f3 * t3
        tied = c1 * t1 + c2 * t2 + c3 * t3
        value = (stretch + compliance * tension) * tied
        value = value - (stretch + half * compliance * tension) * tension
        total = total + spread(weights[e, i]) * value
    return total


@njit(**FLAGS)
def energies_lanes(
    turns_of_held, nodes, owner, derivative, inverse, weights, tangents, arclengths, stiff,
    moment_of_strain, soft, counts, ties, numbers, start, drop, strains, elongation, free, place,
    held, hinged, parents, hinge_axes, lengths, quadratic, z, p, energies,
):  # fmt: skip
    """Energy of every lane; tables as in `kernels.linearise_lanes`."""
    size, order, given, unknown = z.shape[1], nodes.shape[1], p.shape[1], len(free)
    many = len(quadratic)
    multipliers = many - given - 1
    y, still, rows, one = work_rows(many), work_rows(many), work_rows(size), spread(1.0)
    w, radii, turned = (
        work_rows(4 * len(place)),
        work_rows(2 * unknown + 2),
        work_rows(4 * len(hinged) + 4),
    )
    held_q, held_v = work_rows(4 * len(held) + 4), work_rows(3 * len(held) + 3)
    relative, sums = work_rows(4 * order * order), work_rows(4 * order)
    strain, own, rate, longer = work_rows(3 * order), work_rows(4), work_rows(4), work_rows(1)
    still[:] = 0.0
    for block in range(0, len(z), LANES):
        lane = min(block, len(z) - LANES)
        read_lanes(z, lane * size, size, size, rows, 0, 1)
        read_lanes(p, lane * given, given, given, y, multipliers, 1)
        for c in range(multipliers):
            store(y, c, load(rows, size - multipliers + c))
        store(y, many - 1, one)
        turn_held(turns_of_held, multipliers, y, still, held_q, held_v)
        set_turns(free, held, rows, held_q, w, radii)
        hinge_turns(hinged, parents, hinge_axes, 4 * unknown, rows, w, turned)
        total = spread(0.0)
        for e in range(len(nodes)):
            k = owner[e]
            vector_sums(strains[k], multipliers, y, still, own, rate)
            vector_sums(elongation[k], multipliers, y, still, longer, rate)
            relate(e, nodes, derivative, inverse[e], w, relative, sums, strain)
            total = total + _bending(e, order, weights, stiff, moment_of_strain, strain, own)
            total = total + _pulling(
                e, order, nodes, weights, tangents, arclengths, soft[k], counts[k], ties[k],
                numbers[k], start[k], drop[k], y, w, one + load(longer, 0),
            )  # fmt: skip
        for i in range(many):
            row = spread(0.0)
            for j in range(many):
                if quadratic[i, j] != 0.0:
                    row = row + spread(quadratic[i, j]) * load(y, j)
            share = spread(-0.5 if i < multipliers else 0.5)
            total = total + share * load(y, i) * row
        for i in range(unknown):
            radius = load(radii, 2 * i)
            excess = radius * radius - one
            total = total + spread(0.125 * lengths[i]) * excess * excess
        store(longer, 0, total)
        for one_lane in range(LANES):
            energies[lane + one_lane] = longer[0, one_lane]

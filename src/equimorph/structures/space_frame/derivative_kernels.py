"""Compiled kernel of F of a frame in space and its derivatives along directions, by jets.

See `lagrangian` for the equations, `spatial.jet_kernels` for jets. Rows lie part by part.
"""

import math

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import LANES, load, sincos, spread, store, work_rows
from equimorph.structures.spatial.derivative_kernels import (
    copy_node,
    normalise_node,
    slope_by_quaternion,
)
from equimorph.structures.spatial.jet_kernels import (
    add,
    clear,
    dot,
    in_space,
    multiply,
    multiply_vector,
    on_axes,
    scale,
    vector_multiply,
)


@njit(**INNER)
def _turn_about(parts, axis, angle, out):
    """Rotation exp(a angle/2) about a unit axis a, from a row a part of the angle."""
    half, zero = spread(0.5), spread(0.0)
    s, c = sincos(half * load(angle, 0))
    clear(out, 0, 4 * parts)
    store(out, 0, c)
    for k in range(3):
        store(out, 1 + k, spread(axis[k]) * s)
    for part in range(1, parts):
        rate = half * load(angle, part)
        store(out, 4 * part, zero - rate * s)
        for k in range(3):
            store(out, 4 * part + 1 + k, spread(axis[k]) * rate * c)
    if parts == 4:
        both = half * load(angle, 1) * half * load(angle, 2)
        add(out, 12, zero - both * c)
        for k in range(3):
            add(out, 13 + k, zero - spread(axis[k]) * both * s)


@njit(**INNER)
def _store_node(parts, nodes, node, here, target):
    """Write the jet of one node to rows that lie part by part."""
    for part in range(parts):
        for c in range(4):
            store(target, 4 * (part * nodes + node) + c, load(here, 4 * part + c))


@njit(**INNER)
def _read(z, p, moves_z, moves_p, start, m, given, y):
    """Unknowns and multipliers of a block of lanes, and multipliers, parameters and 1, as jets."""
    size, parameters, k = z.shape[1], p.shape[1], moves_z.shape[1]
    scalars = m + parameters + 1
    clear(given, 0, len(given))
    clear(y, 0, len(y))
    read_lanes(z, start * size, size, size, given, 0, 1)
    read_lanes(p, start * parameters, parameters, parameters, y, m, 1)
    for d in range(k):
        read_lanes(moves_z, (start * k + d) * size, k * size, size, given, (1 + d) * size, 1)
        at, to = (start * k + d) * parameters, (1 + d) * scalars + m
        read_lanes(moves_p, at, k * parameters, parameters, y, to, 1)
    for part in range(1 + k):
        for j in range(m):
            store(y, part * scalars + j, load(given, (part + 1) * size - m + j))
    store(y, scalars - 1, spread(1.0))


@njit(**INNER)
def _turn_held(
    pairs, parts, h, node, nodes, m, scalars, turns_of_held, y, axis, angle, turn, whole, product,
    unit,
):  # fmt: skip
    """Unit quaternion of a held node: turns about the axes of parameters, one after the other."""
    clear(whole, 0, 4 * parts)
    store(whole, 0, spread(1.0))
    for k in range(len(turns_of_held)):
        a, b, c = turns_of_held[k, h, 0], turns_of_held[k, h, 1], turns_of_held[k, h, 2]
        size = math.sqrt(a * a + b * b + c * c)
        if size == 0.0:
            continue
        axis[0], axis[1], axis[2] = a / size, b / size, c / size
        for part in range(parts):
            store(angle, part, spread(size) * load(y, part * scalars + m + k))
        _turn_about(parts, axis, angle, turn)
        clear(product, 0, 4 * parts)
        multiply(pairs, whole, turn, product)
        for i in range(4 * parts):
            store(whole, i, load(product, i))
    _store_node(parts, nodes, node, whole, unit)


@njit(**INNER)
def _turn_hinged(
    pairs, parts, h, node, parent, nodes, size, first, axis, given, angle, turn, here, product,
    turned, hinges, unit,
):  # fmt: skip
    """Unit quaternion of a hinged node, and its turn on its parent."""
    for part in range(parts):
        store(angle, part, load(given, part * size + first + h))
    _turn_about(parts, axis, angle, turn)
    _store_node(parts, hinges, h, turn, turned)
    copy_node(parts, nodes, parent, unit, here)
    clear(product, 0, 4 * parts)
    multiply(pairs, here, turn, product)
    _store_node(parts, nodes, node, product, unit)


@njit(**INNER, forceinline=True)
def read_units(
    pairs, parts, z, p, moves_z, moves_p, start, m, free, held, hinged, parents, hinge_axes,
    turns_of_held, given, y, quaternions, square, inverse, axis, angle, turn, here, other, turned,
    unit,
):  # fmt: skip
    """Unit quaternions of all nodes, turns of hinges, and multipliers, parameters and 1."""
    size, scalars = z.shape[1], m + p.shape[1] + 1
    nodes = len(free) + len(held) + len(hinged)
    _read(z, p, moves_z, moves_p, start, m, given, y)
    for i in range(len(free)):
        for part in range(parts):
            for c in range(4):
                value = load(given, part * size + 4 * i + c)
                store(quaternions, 4 * (part * nodes + free[i]) + c, value)
        normalise_node(
            pairs, parts, nodes, free[i], quaternions, square, inverse, here, other, unit
        )
    for h in range(len(held)):
        _turn_held(
            pairs, parts, h, held[h], nodes, m, scalars, turns_of_held, y, axis, angle, turn, here,
            other, unit,
        )  # fmt: skip
    for h in range(len(hinged)):
        _turn_hinged(
            pairs, parts, h, hinged[h], parents[h], nodes, size, 4 * len(free), hinge_axes[h],
            given, angle, turn, here, other, turned, len(hinged), unit,
        )  # fmt: skip


@njit(**INNER)
def _combine(parts, scalars, first, table, y, out):
    """Σ y · rows of a table, from the scalar `first` on; a row a part for each column."""
    width = table.shape[1]
    for part in range(parts):
        for a in range(width):
            value = spread(0.0)
            for c in range(len(table)):
                value = value + spread(table[c, a]) * load(y, part * scalars + first + c)
            store(out, part * width + a, value)


@njit(**INNER)
def _force(parts, scalars, count, numbers, start, drop, s, y, out):
    """Force in the cross-section at an arclength, three rows a part."""
    clear(out, 0, 3 * parts)
    for r in range(count):
        for c in range(3):
            by = spread(start[r, c] - s * drop[r, c])
            for part in range(parts):
                add(out, 3 * part + c, by * load(y, part * scalars + numbers[r]))


@njit(**INNER, forceinline=True)
def element_slopes(
    pairs, plain, parts, e, scalars, m, nodes, slopes, weights, tangents, arclengths, stiff,
    moment_of_strain, soft, count, numbers, start, drop, strains, elongation, total, y, unit, here,
    moved, other, own, strain, moment, free, force, tangent, point, pull, stretch, slope, chords,
    forces,
):  # fmt: skip
    """Slope of L by unit quaternions at the points of an element, chords and forces there.

    slope: four rows a point and part, chords and forces three; total: number of nodes.
    """
    order = nodes.shape[1]
    clear(slope, 0, 4 * parts * order)
    _combine(parts, scalars, m, strains, y, free)
    for i in range(order):
        weight, node = weights[e, i], nodes[e, i]
        copy_node(parts, total, node, unit, here)
        clear(moved, 0, 4 * parts)
        for j in range(order):
            by = spread(slopes[e, i, j])
            for part in range(parts):
                at = 4 * (part * total + nodes[e, j])
                for c in range(4):
                    add(moved, 4 * part + c, by * load(unit, at + c))
        clear(strain, 0, 3 * parts)
        on_axes(pairs, here, moved, strain)
        for part in range(parts):
            for a in range(3):
                value = spread(0.0)
                for b in range(3):
                    by = spread(2.0 * stiff[e, i, a, b])
                    value = value + by * load(strain, 3 * part + b)
                    by = spread(moment_of_strain[e, i, a, b])
                    value = value - by * load(free, 3 * part + b)
                store(moment, 3 * part + a, value)
        clear(other, 0, 4 * parts)
        clear(own, 0, 4 * parts)
        multiply_vector(pairs, here, moment, spread(2.0 * weight), other)
        multiply_vector(pairs, moved, moment, spread(-2.0 * weight), own)
        for j in range(order):
            by = spread(slopes[e, i, j])
            for part in range(parts):
                at = 4 * (part * order + j)
                for c in range(4):
                    add(slope, at + c, by * load(other, 4 * part + c))
        # N = ½ q · ∂N/∂q with ∂N/∂q = −2 f q t₀
        _force(parts, scalars, count, numbers, start, drop, arclengths[e, i], y, force)
        for c in range(3):
            store(tangent, c, spread(tangents[e, i, c]))
        clear(moved, 0, 4 * parts)
        clear(pull, 0, 4 * parts)
        vector_multiply(pairs, force, here, moved)
        multiply_vector(plain, moved, tangent, spread(-2.0), pull)
        _combine(parts, scalars, m, elongation, y, stretch)
        clear(other, 0, 4 * parts)
        dot(pairs, here, pull, other, 0)
        for part in range(parts):
            add(stretch, part, spread(0.5 * soft) * load(other, part))
            store(other, part, spread(0.0))
        add(stretch, 0, spread(1.0))
        multiply_vector(plain, here, tangent, spread(weight), other)
        clear(point, 0, 3 * parts)
        clear(strain, 0, 3 * parts)
        in_space(pairs, here, other, point)
        scale(pairs, 3, stretch, 0, point, strain)
        for part in range(parts):
            store(stretch, part, spread(-weight) * load(stretch, part))
            for c in range(3):
                at = 3 * (part * order + i) + c
                store(chords, at, load(strain, 3 * part + c))
                store(forces, at, load(force, 3 * part + c))
        scale(pairs, 4, stretch, 0, pull, own)
        for part in range(parts):
            for c in range(4):
                add(slope, 4 * (part * order + i) + c, load(own, 4 * part + c))


@njit(**INNER)
def _close(parts, e, order, size, m, arclengths, count, numbers, start, drop, chords, rows):
    """Take what the forces of multipliers in an element work along its chords from their rows."""
    for r in range(count):
        if numbers[r] >= m:
            continue
        for part in range(parts):
            work = spread(0.0)
            for i in range(order):
                for c in range(3):
                    by = spread(start[r, c] - arclengths[e, i] * drop[r, c])
                    work = work + by * load(chords, 3 * (part * order + i) + c)
            add(rows, (part + 1) * size - m + numbers[r], spread(0.0) - work)


@njit(**INNER)
def _lean_on_parent(
    pairs, plain, parts, h, node, parent, total, size, first, axis, tangent, turned, hinges, unit,
    here, other, own, number, slope, rows,
):  # fmt: skip
    """Slope by the angle of a hinge; that at its node is added to its parent, turned back."""
    for c in range(3):
        store(tangent, c, spread(axis[c]))
    copy_node(parts, total, node, unit, here)
    copy_node(parts, total, node, slope, own)
    clear(other, 0, 4 * parts)
    multiply_vector(plain, here, tangent, spread(0.5), other)
    clear(number, 0, parts)
    dot(pairs, own, other, number, 0)
    for part in range(parts):
        store(rows, part * size + first + h, load(number, part))
    copy_node(parts, hinges, h, turned, here)
    for part in range(parts):
        for c in range(1, 4):
            store(here, 4 * part + c, spread(0.0) - load(here, 4 * part + c))
    clear(other, 0, 4 * parts)
    multiply(pairs, own, here, other)
    for part in range(parts):
        for c in range(4):
            add(slope, 4 * (part * total + parent) + c, load(other, 4 * part + c))


@njit(**FLAGS)
def equations_lanes(
    pairs, plain, turns_of_held, nodes, owner, slopes, weights, tangents, arclengths, stiff,
    moment_of_strain, soft, counts, numbers, start, drop, strains, elongation, free, held, hinged,
    parents, hinge_axes, lengths, quadratic, z, p, moves_z, moves_p, out,
):  # fmt: skip
    """F of every lane and its parts along directions: out (lanes, parts, size).

    pairs: of products of jets; plain: of jets with constants; moves: (lanes, directions, …), none,
    one, or two for the mixed derivative; quadratic: rows of the multipliers.
    """
    size, parts, m, order = z.shape[1], out.shape[1], len(quadratic), nodes.shape[1]
    scalars, hinges = m + p.shape[1] + 1, len(hinged)
    total = len(free) + len(held) + hinges
    given, y = work_rows(parts * size + 8), work_rows(parts * scalars + 8)
    quaternions, unit = work_rows(4 * parts * total), work_rows(4 * parts * total)
    slope, turned = work_rows(4 * parts * total), work_rows(4 * parts * (hinges + 1))
    square, inverse = work_rows(parts * total), work_rows(parts * total)
    here, moved, other = work_rows(4 * parts), work_rows(4 * parts), work_rows(4 * parts)
    own, pull, turn = work_rows(4 * parts), work_rows(4 * parts), work_rows(4 * parts)
    strain, moment, actuated = work_rows(3 * parts), work_rows(3 * parts), work_rows(3 * parts)
    force, point, tangent = work_rows(3 * parts), work_rows(3 * parts), work_rows(3)
    stretch, number, angle = work_rows(parts), work_rows(parts), work_rows(parts)
    local, chords = work_rows(4 * parts * order), work_rows(3 * parts * order)
    forces, rows, axis = work_rows(3 * parts * order), work_rows(parts * size + 8), work_rows(1)[0]
    for block in range(0, len(z), LANES):
        lane = min(block, len(z) - LANES)
        read_units(
            pairs, parts, z, p, moves_z, moves_p, lane, m, free, held, hinged, parents, hinge_axes,
            turns_of_held, given, y, quaternions, square, inverse, axis, angle, turn, here, other,
            turned, unit,
        )  # fmt: skip
        clear(slope, 0, 4 * parts * total)
        clear(rows, 0, parts * size)
        for e in range(len(nodes)):
            k = owner[e]
            element_slopes(
                pairs, plain, parts, e, scalars, m, nodes, slopes, weights, tangents, arclengths,
                stiff, moment_of_strain, soft[k], counts[k], numbers[k], start[k], drop[k],
                strains[k], elongation[k], total, y, unit, here, moved, other, own, strain, moment,
                actuated, force, tangent, point, pull, stretch, local, chords, forces,
            )  # fmt: skip
            for i in range(order):
                for part in range(parts):
                    for c in range(4):
                        to = 4 * (part * total + nodes[e, i]) + c
                        add(slope, to, load(local, 4 * (part * order + i) + c))
            _close(
                parts, e, order, size, m, arclengths, counts[k], numbers[k], start[k], drop[k],
                chords, rows,
            )  # fmt: skip
        for part in range(parts):
            for r in range(m):
                value = spread(0.0)
                for s in range(scalars):
                    value = value + spread(quadratic[r, s]) * load(y, part * scalars + s)
                add(rows, (part + 1) * size - m + r, value)
        for h in range(hinges):
            _lean_on_parent(
                pairs, plain, parts, h, hinged[h], parents[h], total, size, 4 * len(free),
                hinge_axes[h], tangent, turned, hinges, unit, here, other, own, number, slope, rows,
            )  # fmt: skip
        for i in range(len(free)):
            slope_by_quaternion(
                pairs, parts, 4 * i, free[i], total, size, 0.5 * lengths[i], quaternions, square,
                inverse, unit, slope, here, own, other, number, rows,
            )  # fmt: skip
        for part in range(parts):
            position = (lane * parts + part) * size
            write_lanes(rows, part * size, 1, out, position, parts * size, size)

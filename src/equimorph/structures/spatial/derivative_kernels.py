"""Compiled kernel of F of a rod in space and its derivatives along directions, by jets.

See `lagrangian` for the equations, `jet_kernels` for jets. Rows of nodes lie part by part.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import LANES, load, spread, store, work_rows
from equimorph.structures.spatial.jet_kernels import (
    add,
    clear,
    dot,
    half_turn,
    in_space,
    multiply,
    multiply_vector,
    on_axes,
    reciprocal_root,
    scale,
    vector_multiply,
)


@njit(**INNER)
def read_jets(z, p, moves_z, moves_p, start, m, first, nodes, given, y):
    """Quaternions of nodes, and multipliers, parameters and 1, with their directions."""
    entries, parameters, k = z.shape[1], p.shape[1], moves_z.shape[1]
    free, scalars = entries - m, m + parameters + 1
    clear(y, 0, y.shape[0])
    clear(given, 0, given.shape[0])
    read_lanes(z, start * entries, entries, free, given, 4 * first, 1)
    for d in range(k):
        position, to = (start * k + d) * entries, 4 * (nodes * (1 + d) + first)
        read_lanes(moves_z, position, k * entries, free, given, to, 1)
    for lane in range(LANES):
        at = start + lane
        for j in range(m):
            y[j, lane] = z[at, free + j]
            for d in range(k):
                y[(1 + d) * scalars + j, lane] = moves_z[at, d, free + j]
        for j in range(parameters):
            y[m + j, lane] = p[at, j]
            for d in range(k):
                y[(1 + d) * scalars + m + j, lane] = moves_p[at, d, j]
        y[scalars - 1, lane] = 1.0


@njit(**INNER)
def copy_node(parts, nodes, node, source, here):
    """Jet of one node, from rows that lie part by part."""
    for part in range(parts):
        for c in range(4):
            store(here, 4 * part + c, load(source, 4 * (part * nodes + node) + c))


@njit(**INNER)
def normalise_node(pairs, parts, nodes, node, given, square, inverse, here, other, unit):
    """Unit quaternion of a node, with 1/|q| and |q|² in a row a part from parts · node on."""
    copy_node(parts, nodes, node, given, here)
    clear(square, parts * node, parts)
    clear(other, 0, 4 * parts)
    dot(pairs, here, here, square, parts * node)
    reciprocal_root(parts, square, parts * node, inverse)
    scale(pairs, 4, inverse, parts * node, here, other)
    for part in range(parts):
        for c in range(4):
            store(unit, 4 * (part * nodes + node) + c, load(other, 4 * part + c))


@njit(**INNER)
def turn_end(
    pairs, parts, side, node, nodes, scalars, turned, y, angle, turn, whole, product, unit
):  # fmt: skip
    """Unit quaternion of a clamp, exp(e₃ a/2) exp(e₂ b/2) exp(e₁ τ/2)."""
    for k in range(3):
        for part in range(parts):
            value = spread(0.0)
            for s in range(scalars):
                if turned[side, k, s] != 0.0:
                    value = value + spread(turned[side, k, s]) * load(y, part * scalars + s)
            store(angle, part, value)
        if k == 0:
            half_turn(parts, 2, angle, whole)
            continue
        half_turn(parts, 2 - k, angle, turn)
        clear(product, 0, 4 * parts)
        multiply(pairs, whole, turn, product)
        for i in range(4 * parts):
            store(whole, i, load(product, i))
    for part in range(parts):
        for c in range(4):
            store(unit, 4 * (part * nodes + node) + c, load(whole, 4 * part + c))


@njit(**INNER, forceinline=True)  # else its loops would not know the number of parts
def read_units(
    pairs, parts, z, p, moves_z, moves_p, start, scalars, nodes, held, turned, given, y, square,
    inverse, number, here, other, own, unit,
):  # fmt: skip
    """Unit quaternions of all nodes, clamps included, and multipliers, parameters and 1."""
    m, first = scalars - p.shape[1] - 1, held[0]
    read_jets(z, p, moves_z, moves_p, start, m, first, nodes, given, y)
    for side in range(2):
        if held[side]:
            turn_end(
                pairs, parts, side, side * (nodes - 1), nodes, scalars, turned, y, number,
                here, other, own, unit,
            )  # fmt: skip
    for node in range(first, nodes - held[1]):
        normalise_node(pairs, parts, nodes, node, given, square, inverse, here, other, unit)


@njit(**INNER)
def combine_jet(parts, scalars, e, i, table, picks, factor, y, out):
    """Add factor · Σ y · table, three rows a part."""
    for n in range(len(picks)):
        t0 = spread(factor * table[n, e, i, 0])
        t1, t2 = spread(factor * table[n, e, i, 1]), spread(factor * table[n, e, i, 2])
        for part in range(parts):
            value = load(y, part * scalars + picks[n])
            add(out, 3 * part, value * t0)
            add(out, 3 * part + 1, value * t1)
            add(out, 3 * part + 2, value * t2)


@njit(**INNER)
def moments_of(
    pairs, parts, scalars, e, i, stiffness, moments, moment_picks, torsion, torsion_picks, y,
    strain, number, out,
):  # fmt: skip
    """Moments K u − b + τ u₁ e₁, three rows a part; strain: half of u."""
    two = spread(2.0)
    for part in range(parts):
        for k in range(3):
            value = two * spread(stiffness[e, i, k]) * load(strain, 3 * part + k)
            store(out, 3 * part + k, value)
    combine_jet(parts, scalars, e, i, moments, moment_picks, -1.0, y, out)
    if len(torsion_picks) > 0:
        clear(number, 0, parts)
        for n in range(len(torsion_picks)):
            for part in range(parts):
                value = load(y, part * scalars + torsion_picks[n])
                add(number, part, two * spread(torsion[n, e, i]) * value)
        for n in range(len(pairs)):
            value = load(number, pairs[n, 1]) * load(strain, 3 * pairs[n, 2])
            add(out, 3 * pairs[n, 0], value)


@njit(**INNER)
def stretches_of(parts, scalars, e, i, softness, tension, tension_picks, y, axial, out):
    """1 + extension and shears, three rows a part, from the force on the axes."""
    clear(out, 0, 3 * parts)
    for part in range(parts):
        for k in range(3):
            value = spread(0.0) - spread(softness[e, i, k]) * load(axial, 3 * part + k)
            store(out, 3 * part + k, value)
        for n in range(len(tension_picks)):
            pull = spread(softness[e, i, 0] * tension[n, e, i])
            add(out, 3 * part, spread(0.0) - pull * load(y, part * scalars + tension_picks[n]))
    add(out, 0, spread(1.0))


@njit(**INNER)
def slope_by_quaternion(
    pairs, parts, first, node, nodes, size, length, given, square, inverse, unit, slope, here, own,
    other, number, rows,
):  # fmt: skip
    """Slope by the quaternion of a node, with that of its length, in rows from the first one on."""
    copy_node(parts, nodes, node, unit, here)
    copy_node(parts, nodes, node, slope, own)
    clear(number, 0, parts)
    dot(pairs, here, own, number, 0)
    for part in range(parts):
        store(number, part, spread(0.0) - load(number, part))
    scale(pairs, 4, number, 0, here, own)
    clear(other, 0, 4 * parts)
    scale(pairs, 4, inverse, parts * node, own, other)
    for part in range(parts):
        excess = load(square, parts * node + part)
        excess = excess - spread(1.0) if part == 0 else excess
        store(number, part, spread(length) * excess)
    copy_node(parts, nodes, node, given, here)
    scale(pairs, 4, number, 0, here, other)
    for part in range(parts):
        for c in range(4):
            store(rows, part * size + first + c, load(other, 4 * part + c))


@njit(**FLAGS)
def equations_lanes(
    pairs, plain, slopes, weights, stiffness, moments, moment_picks, torsion, torsion_picks,
    forces, force_picks, tension, tension_picks, softness, turned, held, lengths, quadratic,
    z, p, moves_z, moves_p, out,
):  # fmt: skip
    """F of every lane and its parts along directions: out (lanes, parts, size).

    pairs: of products of jets; plain: of jets with constants; moves: (lanes, directions, …), none,
    one, or two for the mixed derivative; forces: of the multipliers first, all scalars by number.
    """
    elements, order, m = slopes.shape[0], slopes.shape[1], quadratic.shape[0]
    degree, entries, parts = order - 1, z.shape[1], out.shape[1]
    nodes, scalars = elements * degree + 1, m + p.shape[1] + 1
    first, stop, soft = held[0], nodes - held[1], softness.shape[0] > 0
    rigid, one = plain, spread(1.0)
    given, unit = work_rows(4 * parts * nodes), work_rows(4 * parts * nodes)
    slope, y = work_rows(4 * parts * nodes), work_rows(parts * scalars)
    square, inverse = work_rows(parts * nodes), work_rows(parts * nodes)
    here, moved, other = work_rows(4 * parts), work_rows(4 * parts), work_rows(4 * parts)
    own, number = work_rows(4 * parts), work_rows(parts)
    strain, moment, stretch = work_rows(3 * parts), work_rows(3 * parts), work_rows(3 * parts)
    force, point = work_rows(3 * parts), work_rows(3 * parts)
    rows = work_rows(parts * entries + 8)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_units(
            pairs, parts, z, p, moves_z, moves_p, start, scalars, nodes, held, turned, given, y,
            square, inverse, number, here, other, own, unit,
        )  # fmt: skip
        clear(slope, 0, 4 * parts * nodes)
        clear(rows, 0, parts * entries)
        for e in range(elements):
            for i in range(order):
                base, weight = e * degree, weights[e, i]
                node = base + i
                copy_node(parts, nodes, node, unit, here)
                for part in range(parts):
                    for c in range(4):
                        value = spread(0.0)
                        for j in range(order):
                            at = 4 * (part * nodes + base + j) + c
                            value = value + spread(slopes[e, i, j]) * load(unit, at)
                        store(moved, 4 * part + c, value)
                clear(strain, 0, 3 * parts)
                on_axes(pairs, here, moved, strain)
                moments_of(
                    pairs, parts, scalars, e, i, stiffness, moments, moment_picks, torsion,
                    torsion_picks, y, strain, number, moment,
                )  # fmt: skip
                clear(other, 0, 4 * parts)
                clear(own, 0, 4 * parts)
                multiply_vector(pairs, here, moment, spread(2.0 * weight), other)
                multiply_vector(pairs, moved, moment, spread(-2.0 * weight), own)
                for j in range(order):
                    by = spread(slopes[e, i, j])
                    for part in range(parts):
                        at = 4 * (part * nodes + base + j)
                        for c in range(4):
                            add(slope, at + c, by * load(other, 4 * part + c))
                clear(force, 0, 3 * parts)
                combine_jet(parts, scalars, e, i, forces, force_picks, 1.0, y, force)
                clear(moved, 0, 4 * parts)
                vector_multiply(pairs, force, here, moved)
                rule = pairs
                if soft:
                    clear(point, 0, 3 * parts)
                    on_axes(pairs, here, moved, point)
                    stretches_of(
                        parts, scalars, e, i, softness, tension, tension_picks, y, point, stretch
                    )
                else:
                    rule = rigid
                    clear(stretch, 0, 3 * parts)
                    store(stretch, 0, one)
                multiply_vector(rule, moved, stretch, spread(-2.0 * weight), own)
                clear(other, 0, 4 * parts)
                multiply_vector(rule, here, stretch, spread(weight), other)
                clear(point, 0, 3 * parts)
                in_space(pairs, here, other, point)
                for part in range(parts):
                    for c in range(4):
                        add(slope, 4 * (part * nodes + node) + c, load(own, 4 * part + c))
                    for k in range(m):
                        value = spread(forces[k, e, i, 0]) * load(point, 3 * part)
                        value = value + spread(forces[k, e, i, 1]) * load(point, 3 * part + 1)
                        value = value + spread(forces[k, e, i, 2]) * load(point, 3 * part + 2)
                        add(rows, part * entries + entries - m + k, value)
        for part in range(parts):
            for k in range(m):
                value = spread(0.0)
                for s in range(scalars):
                    value = value + spread(quadratic[k, s]) * load(y, part * scalars + s)
                add(rows, part * entries + entries - m + k, value)
        for node in range(first, stop):
            slope_by_quaternion(
                pairs, parts, 4 * (node - first), node, nodes, entries, lengths[node], given,
                square, inverse, unit, slope, here, own, other, number, rows,
            )  # fmt: skip
        for part in range(parts):
            position = (start * parts + part) * entries
            write_lanes(rows, part * entries, 1, out, position, parts * entries, entries)

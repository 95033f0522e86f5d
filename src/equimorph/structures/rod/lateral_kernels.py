"""Compiled kernel of movements out of the plane, a vector of lanes at a time; at least eight lanes.

The second variation is that of `lateral.LateralBlock` in φ and ψ at the nodes. Inner nodes of an
element are eliminated, then its left vertex: what remains of a chain is the *front*, the 2 × 2
block of one vertex. Unknowns are numbered φ, ψ by node. Columns lie in tiles,
``columns[unknown, slot]``: in the first four slots the ties, an element's columns at φ and ψ of its
left and of its right vertex; then the closure ∫ψ, up to two right-hand sides, and a spare one.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import (
    LANES,
    absolute,
    entry,
    load,
    load2,
    load4,
    load8,
    repeat2,
    repeat4,
    repeat8,
    sincos,
    spread,
    store,
    where_less,
    work_rows,
)

TILE, CLOSURE, SIDE = np.int64(8), np.int64(4), np.int64(5)
"""Slots of a tile; the first ones of the closure and of the right-hand sides."""
SPARE = np.int64(4)
"""Rows behind a row of the factor: vectors of it are read four at a time."""
KEPT = np.int64(8)
"""Rows of a vertex: reciprocal pivots of φ and ψ, then the ties of φ and of ψ to what follows."""
PHI, PSI, FIRST, SECOND, MIXED, CLOSING, CABLE = range(7)
"""Coefficients at a point of φ², ψ², φ'ψ, φψ', φψ, ψ in the closure, and φ'² of cables."""


@njit(**INNER)
def _combined(table, rows, e, i, scalars):
    """Row entries of an element's node times the scalars that they belong to."""
    total = spread(0.0)
    for r in range(len(rows)):
        total = total + spread(table[r, e, i]) * load(scalars, rows[r])
    return total


@njit(**INNER)
def _coefficients(
    e, pairs, weights, rigidity, torsion, lateral, softness, across, along, bending, tension,
    cables, picks, angles, scalars, shift, points,
):  # fmt: skip
    """Coefficients of the second variation, less the shift, at the points of an element."""
    order = weights.shape[1]
    base, half = e * (order - 1), spread(0.5)
    for k in range(order):
        kappa = spread(0.0)
        for j in range(order):
            slope = spread(entry(pairs, ((e * order + k) * order + j) * 4 + 2))
            kappa = kappa + slope * load(angles, base + j)
        s, c = sincos(load(angles, base + k))
        a = _combined(across, picks[0], e, k, scalars)
        b = _combined(along, picks[1], e, k, scalars)
        pull = _combined(tension, picks[3], e, k, scalars)
        stretch = spread(1.0) - spread(softness[e, k]) * (a * s + b * c + pull)
        moment = spread(rigidity[e, k]) * kappa - _combined(bending, picks[2], e, k, scalars)
        cable = _combined(cables, picks[4], e, k, scalars)
        twist, bend, w = spread(torsion[e, k]) + cable, spread(lateral[e, k]), spread(weights[e, k])
        store(points, PHI * order + k, w * (kappa * (bend * kappa - moment) - shift))
        thrust = stretch * (a * s + b * c)
        store(points, PSI * order + k, w * (kappa * (twist * kappa - moment) - thrust - shift))
        store(points, FIRST * order + k, w * (half * moment - twist * kappa))
        store(points, SECOND * order + k, w * (bend * kappa - half * moment))
        store(points, MIXED * order + k, half * w * stretch * (a * c - b * s))
        store(points, CLOSING * order + k, w * stretch)
        store(points, CABLE * order + k, w * cable)


@njit(**INNER)
def _pair(pairs, at, points, order, i, j):
    """Entries φφ, φψ, ψφ, ψψ of two different nodes, all but those of cables."""
    d, back = spread(entry(pairs, at + 2)), spread(entry(pairs, at + 3))
    mixed = load(points, FIRST * order + j) * back + load(points, SECOND * order + i) * d
    other = load(points, FIRST * order + i) * d + load(points, SECOND * order + j) * back
    return spread(entry(pairs, at)), mixed, other, spread(entry(pairs, at + 1))


@njit(**INNER)
def _put(target, at, width, entries):
    """Write the entries of a pair of nodes into two rows that lie `width` apart."""
    store(target, at, entries[0])
    store(target, at + 1, entries[1])
    store(target, at + width, entries[2])
    store(target, at + width + 1, entries[3])


@njit(**INNER)
def _add_own(target, at, width, points, order, i):
    """Add to the entries of a node what it has with itself alone."""
    mixed = load(points, MIXED * order + i)
    store(target, at, load(target, at) + load(points, PHI * order + i))
    store(target, at + 1, load(target, at + 1) + mixed)
    store(target, at + width, load(target, at + width) + mixed)
    store(target, at + width + 1, load(target, at + width + 1) + load(points, PSI * order + i))


@njit(**INNER)
def _assemble(pairs, e, order, points, matrix, columns, front):
    """Upper half of the inner matrix of an element, ties and closure, and its part of the front."""
    last, step, zero = order - 1, order * 4, spread(0.0)
    width, start, table = 2 * (order - 2) + SPARE, e * last * 2 * TILE, e * order * step
    for i in range(1, last):
        row = 2 * (i - 1) * width
        for j in range(i, last):
            pair = _pair(pairs, table + i * step + 4 * j, points, order, i, j)
            _put(matrix, row + 2 * (j - 1), width, pair)
        _add_own(matrix, row + 2 * (i - 1), width, points, order, i)
        at = start + 2 * i * TILE
        pair = _pair(pairs, table + i * step, points, order, i, 0)
        _put(columns, at, TILE, pair)
        pair = _pair(pairs, table + i * step + 4 * last, points, order, i, last)
        _put(columns, at + 2, TILE, pair)
        store(columns, at + CLOSURE, zero)
        store(columns, at + TILE + CLOSURE, load(points, CLOSING * order + i))
    for side in range(2):
        i, at = side * last, 2 * side * TILE
        for other in range(2):
            j = other * last
            pair = _pair(pairs, table + i * step + 4 * j, points, order, i, j)
            _put(front, at + 2 * other, TILE, pair)
        _add_own(front, at + 2 * side, TILE, points, order, i)
        store(front, at + CLOSURE, zero)
        store(front, at + TILE + CLOSURE, load(points, CLOSING * order + i))


@njit(**INNER)
def _add_cables(pairs, e, order, points, matrix, columns, front):
    """Add the torsional stiffness that cables give an element, to entries φφ."""
    last, step = order - 1, order * 4
    width, start, table = 2 * (order - 2) + SPARE, e * last * 2 * TILE, e * order * step
    for i in range(order):
        for j in range(order):
            value = spread(0.0)
            for k in range(order):
                row = table + k * step + 2
                product = spread(entry(pairs, row + 4 * i) * entry(pairs, row + 4 * j))
                value = value + load(points, CABLE * order + k) * product
            side = 0 if j == 0 else 2
            if 0 < i < last and i <= j < last:
                at = 2 * (i - 1) * width + 2 * (j - 1)
                store(matrix, at, load(matrix, at) + value)
            elif 0 < i < last and j % last == 0:
                at = start + 2 * i * TILE + side
                store(columns, at, load(columns, at) + value)
            elif i % last == 0 and j % last == 0:
                at = (0 if i == 0 else 2 * TILE) + side
                store(front, at, load(front, at) + value)


@njit(**INNER)
def _factor(matrix, inner, lower, base, inverse, at):
    """LDLᵀ of an inner matrix: above the diagonal D·Lᵀ, below it L; and reciprocal pivots."""
    width = inner + SPARE
    for j in range(inner):
        row = base + j * width
        for i in range(j, inner, 4):
            value = load4(matrix, j * width + i)
            for k in range(j):
                factor = repeat4(load(lower, row + k))
                value = value - factor * load4(lower, base + k * width + i)
            store(lower, row + i, value)
        pivot = spread(1.0) / load(lower, row + j)
        store(inverse, at + j, pivot)
        for i in range(j + 1, inner):
            store(lower, base + i * width + j, load(lower, row + i) * pivot)


@njit(**INNER)
def _reduce(inner, lower, base, inverse, at, columns, first, front):
    """Forward-substitute the tiles of an element's inner nodes, and take them out of the front."""
    width = inner + SPARE
    for i in range(inner):
        value = load8(columns, first + i * TILE)
        for j in range(i):
            factor = repeat8(load(lower, base + i * width + j))
            value = value - factor * load8(columns, first + j * TILE)
        store(columns, first + i * TILE, value)
    for v in range(4):
        value = load8(front, v * TILE)
        for i in range(inner):
            factor = repeat8(load(columns, first + i * TILE + v) * load(inverse, at + i))
            value = value - factor * load8(columns, first + i * TILE)
        store(front, v * TILE, value)


@njit(**INNER)
def _add_products(columns, row, pivot, products):
    """Add an unknown to the products of the closure with itself and the right-hand sides."""
    tie = repeat4(load(columns, row + CLOSURE) * pivot)
    store(products, 0, load4(products, 0) + tie * load4(columns, row + CLOSURE))


@njit(**INNER)
def _eliminate_vertex(vertex, free, count, front, vertices, columns, at, products):
    """Eliminate φ and ψ of a vertex, those that are free, from the front of `count` unknowns."""
    zero, row = spread(0.0), vertex * KEPT
    for v in range(2):
        pivot = zero
        if free[v]:
            pivot = spread(1.0) / load(front, v * TILE + v)
        store(vertices, row + v, pivot)
        for i in range(v + 1, count):
            tie = load(front, v * TILE + i) if free[v] else zero
            store(vertices, row + (1 if v == 0 else 3) + i, tie)
            factor = repeat8(tie * pivot)
            if free[v]:
                value = load8(front, i * TILE) - factor * load8(front, v * TILE)
                store(front, i * TILE, value)
        store(columns, at + v * TILE + CLOSURE, load4(front, v * TILE + CLOSURE))
        _add_products(columns, at + v * TILE, pivot, products)


@njit(**INNER)
def _join(columns, at, carried, front):
    """Add right-hand sides of the right vertex, and what is left of the elements before."""
    for v in range(2):
        for slot in range(SIDE, TILE):
            store(front, v * TILE + slot, spread(0.0))
            side = load(columns, at + v * TILE + slot)
            store(front, (v + 2) * TILE + slot, side)
        store(front, v * TILE, load2(front, v * TILE) + load2(carried, v * TILE))
        own = load4(front, v * TILE + CLOSURE)
        store(front, v * TILE + CLOSURE, own + load4(carried, v * TILE + CLOSURE))


@njit(**INNER)
def _carry(front, carried):
    """What is left of the elements so far: the block of their right vertex, and its columns."""
    for v in range(2):
        store(carried, v * TILE, load2(front, (v + 2) * TILE + 2))
        store(carried, v * TILE + CLOSURE, load4(front, (v + 2) * TILE + CLOSURE))


@njit(**INNER)
def _start(columns, unknowns, sides, carried, products):
    """Clear what is not read, and begin the chain with the right-hand sides of its first vertex."""
    zero = spread(0.0)
    for i in range(unknowns):
        for slot in range(SIDE + sides, TILE):
            store(columns, i * TILE + slot, zero)
    carried[:], products[:] = 0.0, 0.0
    for v in range(2):
        for slot in range(SIDE, TILE):
            store(carried, v * TILE + slot, load(columns, v * TILE + slot))


@njit(**INNER)
def _note(pivot, noted):
    """Count a negative pivot; note the extremes and the sum of the reciprocals."""
    size, zero = absolute(pivot), spread(0.0)
    store(noted, 0, load(noted, 0) + where_less(pivot, zero, spread(1.0), zero))
    small, large = load(noted, 1), load(noted, 2)
    store(noted, 1, where_less(size, small, size, small))
    store(noted, 2, where_less(large, size, size, large))
    store(noted, 3, load(noted, 3) + pivot)


@njit(**INNER)
def _note_all(inverse, vertices, free, elements, closed, products, noted):
    """Negative pivots of the chain, and the closure's: −1 counts where its complement is."""
    for i in range(4):
        store(noted, i, spread(np.inf if i == 1 else 0.0))
    for i in range(inverse.shape[0]):
        _note(load(inverse, i), noted)
    for vertex in range(elements + 1):
        for v in range(2):
            end = 0 if vertex == 0 else 1
            if 0 < vertex < elements or free[2 * end + v]:
                _note(load(vertices, vertex * KEPT + v), noted)
    if closed:
        zero = spread(0.0)
        less = where_less(zero, load(products, 0), spread(1.0), zero)
        store(noted, 0, load(noted, 0) + less)


@njit(**INNER)
def _restore(e, elements, inner, lower, inverse, vertices, columns, force, solution):
    """Substitute two right-hand sides back in vertex `e` and the element right of it.

    Called from the last vertex down; force: of the closure, whose column is taken off.
    """
    first, width = e * (inner + 2), inner + SPARE
    for v in range(1, -1, -1):
        row = (first + v) * TILE
        value = load2(columns, row + SIDE) - repeat2(load(columns, row + CLOSURE)) * force
        for i in range(v + 1, 4 if e < elements else 2):
            tie = repeat2(load(vertices, e * KEPT + (1 if v == 0 else 3) + i))
            to = first + i if i < 2 else first + inner + i
            value = value - tie * load2(solution, 2 * to)
        pivot = repeat2(load(vertices, e * KEPT + v))
        store(solution, 2 * (first + v), value * pivot)
    base = e * inner * width
    for i in range(inner - 1 if e < elements else -1, -1, -1):
        row = (first + 2 + i) * TILE
        value = load2(columns, row + SIDE) - repeat2(load(columns, row + CLOSURE)) * force
        for v in range(4):
            to = first + v if v < 2 else first + inner + v
            value = value - repeat2(load(columns, row + v)) * load2(solution, 2 * to)
        for j in range(i + 1, inner):
            tie = repeat2(load(lower, base + i * width + j))
            value = value - tie * load2(solution, 2 * (first + 2 + j))
        store(solution, 2 * (first + 2 + i), value * repeat2(load(inverse, e * inner + i)))


@njit(**FLAGS)
def lateral_lanes(
    pairs, weights, rigidity, torsion, lateral, softness, across, along, bending,
    tension, cables, across_rows, along_rows, bending_rows, tension_rows, cable_rows, free, closed,
    angles, scalars, shift, rhs, x, negative, ratio,
):  # fmt: skip
    """Solve with the second variation less shift times mass, and count its negative eigenvalues.

    angles (lanes, nodes); scalars (lanes, scalars); pairs (elements, order, order, 4): stiffness of
    φ' and of ψ', derivative, and its transpose; tables (rows, elements, order) with the scalars
    that their rows belong to; free: whether φ and ψ of both ends are unknown; closed: whether there
    is a closure; rhs and x (lanes, sides, 2 nodes + closed): up to two right-hand sides, none to
    count only; negative includes the closure's; ratio: smallest over largest pivot.
    """
    elements, order = weights.shape
    lanes, nodes, count, sides = angles.shape[0], angles.shape[1], scalars.shape[1], rhs.shape[1]
    inner, last, size = 2 * (order - 2), 2 * (order - 1), 2 * nodes + closed
    theta, y, points = work_rows(nodes), work_rows(count), work_rows(7 * order)
    block = inner * (inner + SPARE)
    matrix, lower = (
        work_rows(block + SPARE),
        work_rows((elements if sides > 0 else 1) * block + SPARE),
    )
    columns, front, carried = work_rows(2 * nodes * TILE), work_rows(4 * TILE), work_rows(2 * TILE)
    inverse, vertices = work_rows(elements * inner), work_rows((elements + 1) * KEPT)
    products, noted, solution = work_rows(4), work_rows(4), work_rows(2 * (2 * nodes + 1))
    matrix[:] = 0.0
    lower[:] = 0.0
    picks = (across_rows, along_rows, bending_rows, tension_rows, cable_rows)
    cabled = len(cable_rows) > 0
    for start_block in range(0, lanes, LANES):
        start = min(start_block, lanes - LANES)
        read_lanes(angles, start * nodes, nodes, nodes, theta, 0, 1)
        read_lanes(scalars, start * count, count, count, y, 0, 1)
        for k in range(LANES):
            noted[0, k] = shift[start + k]
        moved = load(noted, 0)
        for side in range(sides):
            at = (start * sides + side) * size
            read_lanes(rhs, at, sides * size, 2 * nodes, columns, SIDE + side, TILE)
        _start(columns, 2 * nodes, sides, carried, products)
        for e in range(elements):
            at, first = e * last * TILE, (e * last + 2) * TILE
            base = e * block if sides > 0 else 0
            _coefficients(
                e, pairs, weights, rigidity, torsion, lateral, softness, across, along, bending,
                tension, cables, picks, theta, y, moved, points,
            )  # fmt: skip
            _assemble(pairs, e, order, points, matrix, columns, front)
            if cabled:
                _add_cables(pairs, e, order, points, matrix, columns, front)
            _factor(matrix, inner, lower, base, inverse, e * inner)
            _join(columns, at + last * TILE, carried, front)
            _reduce(inner, lower, base, inverse, e * inner, columns, first, front)
            for i in range(inner):
                pivot = load(inverse, e * inner + i)
                _add_products(columns, first + i * TILE, pivot, products)
            ends = (free[0], free[1]) if e == 0 else (np.int64(1), np.int64(1))
            _eliminate_vertex(e, ends, 4, front, vertices, columns, at, products)
            _carry(front, carried)
        ends = (free[2], free[3])
        at = elements * last * TILE
        _eliminate_vertex(elements, ends, 2, carried, vertices, columns, at, products)
        _note_all(inverse, vertices, free, elements, closed, products, noted)
        for k in range(LANES):
            negative[start + k] = np.int64(noted[0, k])
            good = noted[3, k] == noted[3, k]
            ratio[start + k] = noted[1, k] / noted[2, k] if good else np.nan
        if sides == 0:
            continue
        force = repeat2(spread(0.0))
        if closed:
            for k in range(LANES):
                for side in range(2):
                    noted[side, k] = rhs[start + k, min(side, sides - 1), 2 * nodes]
            force = (load2(products, 1) - load2(noted, 0)) / repeat2(load(products, 0))
        store(solution, 4 * nodes, force)
        for e in range(elements, -1, -1):
            _restore(e, elements, inner, lower, inverse, vertices, columns, force, solution)
        for side in range(sides):
            at = (start * sides + side) * size
            write_lanes(solution, side, 2, x, at, sides * size, size)

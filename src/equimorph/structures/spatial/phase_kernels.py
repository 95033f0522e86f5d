"""Compiled kernel of the phase condition of rods in space: its value and gradient.

Eight lanes at a time; see `phase` for what it is.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, write_lanes
from equimorph.linalg.simd import LANES, load, spread, store, work_rows
from equimorph.structures.spatial.derivative_kernels import (
    combine_jet,
    copy_node,
    read_units,
    stretches_of,
)
from equimorph.structures.spatial.jet_kernels import (
    ONE,
    add,
    clear,
    dot,
    in_space,
    multiply_vector,
    on_axes,
    vector_multiply,
)


@njit(**INNER)
def _unit_force(e, i, number, forces, force_picks, out):
    """Force of a multiplier of 1 at a node."""
    clear(out, 0, 3)
    for n in range(len(force_picks)):
        if force_picks[n] == number:
            for c in range(3):
                store(out, c, spread(forces[n, e, i, c]))


@njit(**INNER)
def _close(m, e, i, by, forces, point, closing):
    """Add by · force · point of all multipliers to a row each; these have the first tables."""
    for k in range(m):
        value = spread(forces[k, e, i, 0]) * load(point, 0)
        value = value + spread(forces[k, e, i, 1]) * load(point, 1)
        value = value + spread(forces[k, e, i, 2]) * load(point, 2)
        add(closing, k, by * value)


@njit(**FLAGS)
def condition_lanes(
    pairs, weights, forces, force_picks, tension, tension_picks, softness, turned, held, quadratic,
    z, p, gradients, values,
):  # fmt: skip
    """∂F by the last multiplier (lanes, size), and its row of F."""
    elements, order, scalars = weights.shape[0], weights.shape[1], quadratic.shape[0]
    degree, m, entries = order - 1, scalars - p.shape[1] - 1, z.shape[1]
    nodes, first = elements * degree + 1, held[0]
    stop, soft = nodes - held[1], softness.shape[0] > 0
    given, unit, slope = work_rows(4 * nodes), work_rows(4 * nodes), work_rows(4 * nodes)
    square, inverse, number = work_rows(nodes), work_rows(nodes), work_rows(1)
    here, pushed, other, own = work_rows(4), work_rows(4), work_rows(4), work_rows(4)
    push, force, stretch, axial = work_rows(3), work_rows(3), work_rows(3), work_rows(3)
    point, softer, moved, y = work_rows(3), work_rows(3), work_rows(4), work_rows(scalars)
    rows, value, closing = work_rows(entries + 8), work_rows(1), work_rows(m)
    no_z, no_p = np.empty((z.shape[0], 0, z.shape[1])), np.empty((z.shape[0], 0, p.shape[1]))
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_units(
            pairs, ONE, z, p, no_z, no_p, start, scalars, nodes, held, turned, given, y, square,
            inverse, number, here, other, own, unit,
        )  # fmt: skip
        clear(slope, 0, 4 * nodes)
        clear(value, 0, 1)
        for k in range(m):
            store(closing, k, spread(quadratic[k, m - 1]))
        for s in range(scalars):
            add(value, 0, spread(quadratic[m - 1, s]) * load(y, s))
        for e in range(elements):
            for i in range(order):
                node, weight = e * degree + i, weights[e, i]
                copy_node(ONE, nodes, node, unit, here)
                _unit_force(e, i, m - 1, forces, force_picks, push)
                clear(pushed, 0, 4)
                vector_multiply(pairs, push, here, pushed)
                clear(stretch, 0, 3)
                store(stretch, 0, spread(1.0))
                clear(own, 0, 4)
                if soft:
                    clear(force, 0, 3)
                    combine_jet(ONE, scalars, e, i, forces, force_picks, 1.0, y, force)
                    clear(moved, 0, 4)
                    vector_multiply(pairs, force, here, moved)
                    clear(axial, 0, 3)
                    on_axes(pairs, here, moved, axial)
                    stretches_of(
                        ONE, scalars, e, i, softness, tension, tension_picks, y, axial, stretch
                    )
                    clear(axial, 0, 3)
                    on_axes(pairs, here, pushed, axial)
                    for k in range(3):
                        soft_force = spread(softness[e, i, k]) * load(axial, k)
                        store(softer, k, spread(0.0) - soft_force)
                    multiply_vector(pairs, moved, softer, spread(-2.0 * weight), own)
                    clear(other, 0, 4)
                    multiply_vector(pairs, here, softer, spread(1.0), other)
                    clear(point, 0, 3)
                    in_space(pairs, here, other, point)
                    _close(m, e, i, spread(weight), forces, point, closing)
                multiply_vector(pairs, pushed, stretch, spread(-2.0 * weight), own)
                for c in range(4):
                    add(slope, 4 * node + c, load(own, c))
                clear(other, 0, 4)
                multiply_vector(pairs, here, stretch, spread(1.0), other)
                clear(point, 0, 3)
                in_space(pairs, here, other, point)
                for c in range(3):
                    add(value, 0, spread(weight) * load(push, c) * load(point, c))
        for node in range(first, stop):
            copy_node(ONE, nodes, node, unit, here)
            copy_node(ONE, nodes, node, slope, own)
            clear(number, 0, 1)
            dot(pairs, here, own, number, 0)
            along, by = load(number, 0), load(inverse, node)
            for c in range(4):
                across = load(own, c) - along * load(here, c)
                store(rows, 4 * (node - first) + c, by * across)
        for k in range(m):
            store(rows, entries - m + k, load(closing, k))
        write_lanes(rows, 0, 1, gradients, start * entries, entries, entries)
        for lane in range(LANES):
            values[start + lane] = value[0, lane]

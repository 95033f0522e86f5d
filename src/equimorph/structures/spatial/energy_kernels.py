"""Compiled kernel of the energy of a rod in space, and of how its axis shortens.

Eight lanes at a time; see `lagrangian` for what is computed.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, write_lanes
from equimorph.linalg.simd import LANES, load, spread, store, work_rows
from equimorph.structures.spatial.derivative_kernels import (
    combine_jet,
    copy_node,
    moments_of,
    read_units,
    stretches_of,
)
from equimorph.structures.spatial.jet_kernels import (
    ONE,
    add,
    clear,
    in_space,
    multiply_vector,
    on_axes,
    vector_multiply,
)


@njit(**INNER)
def _density(scalars, e, i, tension, tension_picks, moments, y, strain, moment, axial, stretch):
    """Energy of strains and of the force on the axes at a node, loads and multipliers included.

    strain: half of u; moments: those that do not come from strains; stretch: 1 + extension and
    shears, which are those of the softness times the force.
    """
    half, one = spread(0.5), spread(1.0)
    value = load(axial, 0)
    for k in range(3):
        value = value + (load(moment, k) - load(moments, k)) * load(strain, k)
        pull = load(axial, k)
        if k == 0:
            for n in range(len(tension_picks)):
                pull = pull + spread(tension[n, e, i]) * load(y, tension_picks[n])
            value = value + half * (load(stretch, 0) - one) * pull
        else:
            value = value + half * load(stretch, k) * pull
    return value


@njit(**INNER)
def _quadratic(m, scalars, quadratic, y):
    """½ yᵀ Q y less the multipliers' part of its slopes."""
    total, half = spread(0.0), spread(0.5)
    for s in range(scalars):
        row = spread(0.0)
        for t in range(scalars):
            if quadratic[s, t] != 0.0:
                row = row + spread(quadratic[s, t]) * load(y, t)
        by = half - spread(1.0) if s < m else half
        total = total + by * load(y, s) * row
    return total


@njit(**FLAGS)
def energies_lanes(
    pairs, slopes, weights, stiffness, moments, moment_picks, torsion, torsion_picks, forces,
    force_picks, tension, tension_picks, softness, turned, held, lengths, quadratic, z, p,
    energies, shortenings,
):  # fmt: skip
    """L without the multipliers' part, and shortenings at the nodes of all elements (lanes, …).

    lengths: half the stiffness of the lengths of unknown quaternions.
    """
    elements, order, scalars = slopes.shape[0], slopes.shape[1], quadratic.shape[0]
    degree, m, many = order - 1, scalars - p.shape[1] - 1, elements * order
    nodes, first = elements * degree + 1, held[0]
    stop, soft = nodes - held[1], softness.shape[0] > 0
    given, unit, y = work_rows(4 * nodes), work_rows(4 * nodes), work_rows(scalars)
    square, inverse, number = work_rows(nodes), work_rows(nodes), work_rows(1)
    here, moved, other, own = work_rows(4), work_rows(4), work_rows(4), work_rows(4)
    strain, moment, stretch, force = work_rows(3), work_rows(3), work_rows(3), work_rows(3)
    tied, axial, point, held_back = work_rows(3), work_rows(3), work_rows(3), work_rows(3)
    short, one = work_rows(many), spread(1.0)
    no_z, no_p = np.empty((z.shape[0], 0, z.shape[1])), np.empty((z.shape[0], 0, p.shape[1]))
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_units(
            pairs, ONE, z, p, no_z, no_p, start, scalars, nodes, held, turned, given, y, square,
            inverse, number, here, other, own, unit,
        )  # fmt: skip
        total = _quadratic(m, scalars, quadratic, y)
        for node in range(first, stop):
            excess = load(square, node) - one
            total = total + spread(0.25 * lengths[node]) * excess * excess
        for e in range(elements):
            for i in range(order):
                weight, base = spread(weights[e, i]), e * degree
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
                clear(tied, 0, 3)
                combine_jet(ONE, scalars, e, i, moments, moment_picks, 1.0, y, tied)
                clear(force, 0, 3)
                clear(held_back, 0, 3)
                combine_jet(ONE, scalars, e, i, forces, force_picks, 1.0, y, force)
                for n in range(len(force_picks)):
                    if force_picks[n] < m:
                        for c in range(3):
                            share = spread(forces[n, e, i, c]) * load(y, force_picks[n])
                            add(held_back, c, share)
                clear(own, 0, 4)
                vector_multiply(pairs, force, here, own)
                clear(axial, 0, 3)
                on_axes(pairs, here, own, axial)
                clear(stretch, 0, 3)
                store(stretch, 0, one)
                if soft:
                    stretches_of(
                        ONE, scalars, e, i, softness, tension, tension_picks, y, axial, stretch
                    )
                store(short, e * order + i, one - load(stretch, 0))
                value = _density(
                    scalars, e, i, tension, tension_picks, tied, y, strain, moment, axial, stretch
                )
                clear(other, 0, 4)
                multiply_vector(pairs, here, stretch, one, other)
                clear(point, 0, 3)
                in_space(pairs, here, other, point)
                for c in range(3):
                    value = value - load(held_back, c) * load(point, c)
                total = total + weight * value
        write_lanes(short, 0, 1, shortenings, start * many, many, many)
        store(number, 0, total)
        for lane in range(LANES):
            energies[start + lane] = number[0, lane]

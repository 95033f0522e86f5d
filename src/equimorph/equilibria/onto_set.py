"""Newton's method onto the set with free parameters and no conditions, by fused steps, in lanes."""

import numpy as np

from equimorph.arrays import Directions, Flags, Float, Lanes, Numbers, Parameters
from equimorph.equilibria.newton_kernels import along_lanes, correct_onto
from equimorph.equilibria.newton_step import (
    DOUBTFUL,
    Points,
    Problem,
    Tangents,
    start_at,
    weights_of,
)
from equimorph.linalg.kernels import orthonormal_lanes
from equimorph.structures.newton import Limits, Newton

STEEPEST = 1e3
"""Entry of a tangent, for changes of the parameters by their scales, from which on its space is
found by a bordered solve: near folds tangents over the parameters lose as many digits."""
Rows = Float[np.ndarray, "lanes k bordered"]


def settle_onto(problem: Problem, z: Lanes, p: Parameters, limits: Limits) -> tuple[Newton, Flags]:
    """Correct guesses onto the set; with them, whether the index of each lane is sure.

    The same as Newton's method with conditions, of which there are none: one kernel judges, moves
    and files all lanes after a step.
    """
    (lanes, size), k, structure = z.shape, problem.width, problem.structure
    rows, follows = start_at(problem, z, p).rows, isinstance(problem.frame, Tangents)
    directions = np.array(problem.directions, order="C")
    work = np.arange(lanes), np.full(lanes, np.inf), z.copy("C"), p.copy("C"), directions, rows
    numbers = np.empty(lanes, int), np.empty(lanes), np.empty(lanes), np.empty(lanes, int)
    result = (
        np.empty_like(work[2]),
        np.empty_like(work[3]),
        *numbers,
        np.empty((lanes, k, size + k)),
    )
    sure, too_long = np.empty(lanes, bool), limits.too_long_of(lanes)
    lengths = weights_of(structure, size + k), weights_of(structure, size + k, limits.multipliers)
    free = limits.iterations if limits.contraction == np.inf else limits.free
    left, number = lanes, 0
    while left:
        number += 1
        moves = _moves(problem, *(each[:left] for each in work[2:]))
        orthonormal_lanes(moves[0], k, lengths[0])
        stage = (number <= free, number >= limits.iterations, number == 1, follows)
        given = (work, left, (*result, sure), too_long, lengths, limits.lengths)
        left = correct_onto(moves, *given, float(limits.longest), stage)
    return Newton(*result), sure


def _moves(
    problem: Problem, z: Lanes, p: Parameters, directions: Directions, rows: Rows
) -> tuple[Rows, Float[np.ndarray, "lanes bordered"], Numbers, Flags]:
    """Directions along the set and the step onto it, its index, and whether that is sure.

    From the step at fixed parameters and its tangents; bordered near folds.
    """
    structure, (lanes, _, width) = problem.structure, rows.shape
    out = structure.respond(z, p, directions)
    along, onto, steepness = np.empty_like(rows), np.empty((lanes, width)), np.empty(lanes)
    along_lanes(out.dz, out.tangents, rows, along, onto, steepness)
    moves = along, onto, out.index, out.ratio >= DOUBTFUL
    steep = np.flatnonzero(~(steepness < STEEPEST) | np.isnan(out.ratio))
    if len(steep):
        some = Problem(structure, directions[steep], (), problem.frame)
        none = np.zeros(len(steep)), np.zeros((len(steep), 0))
        x, *told, _, _ = Points(some, z[steep], p[steep], *none, rows[steep]).bordered()
        for column, other in zip(moves, (x[:, :-1], x[:, -1], *told), strict=True):
            column[steep] = other
    return moves

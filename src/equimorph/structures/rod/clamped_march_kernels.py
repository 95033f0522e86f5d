"""The march, the search for events, and Newton's method of the rod between clamps, as a whole.

Constraints are bounds on the largest curvature, one a row: sign, unit, bound and ease.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS
from equimorph.marching.search_kernels import search_of
from equimorph.marching.tick_kernels import march_of
from equimorph.structures.newton_kernels import newton_of
from equimorph.structures.rod.clamped_field_kernels import largest_in, largest_work
from equimorph.structures.rod.clamped_kernels import advance_in, advance_work


@njit(**{**FLAGS, "_nrt": False})
def _step(
    work, tables, z, p, dp, row, corner, defect, force, growth,
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    stiffness, ends, weights, loads = tables[0]
    advance_in(
        work[0], stiffness, ends, weights, loads, z, p, dp, row, corner, defect,
        force, growth, dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
    )  # fmt: skip


@njit(**{**FLAGS, "_nrt": False})
def _excess(work, tables, z, p, bounds, found):
    stiffness, pressures, breaks, nodes, integral, rho, rises = tables[1]
    largest, place = work[2], work[3]
    largest_in(
        work[1], stiffness, pressures, breaks, nodes, integral, rho, rises, z, p, largest, place
    )
    for k in range(bounds.shape[0]):
        _compare(largest, bounds, k, z.shape[0], found)


@njit(**{**FLAGS, "_nrt": False})
def _compare(largest, bounds, k, count, found):
    sign, unit, bound, ease = bounds[k, 0], bounds[k, 1], bounds[k, 2], bounds[k, 3]
    for i in range(count):
        found[k, i] = sign * (largest[i] * unit - bound) - ease


_march, _search = march_of(_step, _excess), search_of(_step, _excess)
_newton = newton_of(_step)


@njit(**FLAGS)
def _work(tables, rows):
    (stiffness, _, _, _), (_, _, _, _, _, _, rises) = tables
    curvatures = largest_work(stiffness, rises), np.empty(rows), np.empty(rows)
    return (advance_work(stiffness), *curvatures)


@njit(**FLAGS)
def march_lanes(tables, bounds, problem, queue, block, move, files, scratch, rules):
    """March lanes along straight lines; see `marching.tick_kernels.march_of`."""
    work = _work(tables, block[0][2].shape[0])
    return _march(work, tables, bounds, problem, queue, block, move, files, scratch, rules)


@njit(**FLAGS)
def search_lanes(tables, bounds, problem, steps, block, move, scratch, values, root):
    """Find roots on straight lines; see `marching.search_kernels.search_of`."""
    work = _work(tables, block[0][5].shape[0])
    return _search(work, tables, bounds, problem, steps, block, move, scratch, values, root)


@njit(**FLAGS)
def newton_lanes(
    tables, guard, lanes, moves, ratio, progress, result, guards, weights, limits, rule
):
    """Correct guesses; see `structures.newton_kernels.newton_of`."""
    work = (advance_work(tables[0][0]),)
    given = lanes, moves, ratio, progress, result, guards, weights, limits, rule
    return _newton(work, tables, guard, *given)

"""Which states a set has: those on its cells, and those beside them that no violation parts."""

import numpy as np

from equimorph.arrays import Flags, Lanes, Numbers, Some
from equimorph.manifold.lookup.cell_index import NUDGE, Hits
from equimorph.manifold.lookup.exact_states import NEAREST, exact_states, nearest_pairs, parted
from equimorph.manifold.lookup.over import Sheets
from equimorph.structures import States
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_SOLUTION, SAME_STATE, SAME_TO_ROUNDING


def holding(sheets: Sheets, states: States) -> tuple[Flags, Numbers]:
    """Which states are among those over their own points; their cells, −1 if not known.

    The cell whose guess is nearest to a state is tried first, then the next ones, and vertices: at
    a cusp these have another index than states that are the same to round-off. Only for what is
    not found so all states over the point are asked for, once for all that lie over it.
    """
    z, p = states.z, states.p
    near, known, cell = sheets.near(p[:, sheets.free]), np.zeros(len(z), bool), np.full(len(z), -1)
    for most in (1, NEAREST):
        near = near.take(~known[near.point])
        good = near.take(_on_nearest(sheets, states, near, most))
        known[good.point], cell[good.point] = True, good.cell
    near = near.take(~known[near.point])
    good = near.take(_with_corners(sheets, states, near))
    known[good.point], cell[good.point] = True, good.cell
    rest = np.flatnonzero(~known)
    if len(rest):
        places, place = np.unique(p[rest], axis=0, return_inverse=True)
        over, point, of_over = sheets.over(places)
        first, last = (np.searchsorted(point, place, side) for side in ("left", "right"))
        mine = rest.repeat(last - first)
        theirs = np.concatenate([np.zeros(0, int), *map(np.arange, first, last)])
        same = np.flatnonzero(_are_same(sheets, z[mine], over.z[theirs]))
        mine, of_mine = mine[same], of_over[theirs[same]]
        kept = ~_lie_beyond(sheets, states[mine], of_mine)
        known[mine[kept]], cell[mine[kept]] = True, of_mine[kept]
    return known, cell


def _on_nearest(sheets: Sheets, states: States, near: Hits, most: int) -> Some:
    """Those of the cells near states, the nearest ones of each, that lead to the states."""
    z, p, structure = states.z, states.p, states.structure
    guess, pairs = sheets.guess(near), np.stack([near.point, np.arange(len(near))])
    some = nearest_pairs(structure, z, guess, pairs, near.point, most)
    own = near.point[some]
    found, good, index = exact_states(structure, guess[some], p[own])
    good &= index == sheets.cell_index[near.cell[some]]
    good &= _are_same(sheets, z[own], found)
    some, own = some[good], own[good]
    return np.asarray(some[~_lie_beyond(sheets, states[own], near.cell[some])])


def _with_corners(sheets: Sheets, states: States, near: Hits) -> Some:
    """Those of the cells near states that have a state itself as a corner."""
    corner, p = sheets.cells[near.cell], states.p[near.point]
    there = (
        np.abs(sheets.points.p[corner] - p[:, None]) <= SAME_TO_ROUNDING * sheets.structure.scales
    )
    hit, column = np.nonzero(there.all(axis=2))
    gap = states.z[near.point[hit]] - sheets.points.z[corner[hit, column]]
    return np.unique(hit[metric_length(sheets.structure, gap) <= SAME_STATE])


def _lie_beyond(sheets: Sheets, states: States, cell: Numbers) -> Flags:
    """Whether violations lie between states and their cells, which end at constraints there."""
    weights = np.nan_to_num(sheets.above.weights(states.p[:, sheets.free], cell))
    outside = (weights.min(axis=1, initial=0.0) < -NUDGE) & (cell >= 0)
    beside = np.flatnonzero(outside & sheets.capped[sheets.cells[cell]].any(axis=1))
    nearest = np.maximum(weights[beside], 0.0)
    nearest /= nearest.sum(axis=1, keepdims=True)
    corners = sheets.points.p[sheets.cells[cell[beside]]]
    there = states.p[beside].copy()
    there[:, sheets.free] = np.einsum("nc,ncd->nd", nearest, corners)[:, sheets.free]
    out = np.zeros(len(states), bool)
    out[beside] = parted(states[beside], there, sheets.constraints)
    return out


def _are_same(sheets: Sheets, z: Lanes, other: Lanes) -> Flags:
    return np.asarray(metric_length(sheets.structure, z - other) <= SAME_SOLUTION)

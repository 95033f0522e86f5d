"""Where descents from the cells of index one of a set land, and from single saddles over points.

See docs/barriers.md, "Over a set".
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Numbers, Parameters, Some
from equimorph.equilibria.descents import descend
from equimorph.equilibria.gradient_flow import FAITHFUL, Ending
from equimorph.equilibria.saddles import Nowhere
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.lookup.exact_states import StatesOver, exact_states, lift_to
from equimorph.model import Progress
from equimorph.structures import States, Structure
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_SOLUTION

CHUNK = 512
"""Descents that advance together."""
NONE = -1
"""Instead of a row or the number of a state."""

Ends = Int[np.ndarray, "saddles 2"]


@dataclass(frozen=True)
class Landings:
    """Where descents from the corners of cells of index one end, both ways.

    row: that of each cell, −1 for cells of another index; ends: of descents from their corners,
    both sides in the order of the first corner's; radius: their largest distance from the first,
    infinite where they lie on different sheets; code: zero, or the `Nowhere` where all of them end.
    """

    row: Int[np.ndarray, " C"]
    ends: Float[np.ndarray, "cells corners 2 size"]
    radius: Float[np.ndarray, "cells 2"]
    code: Int[np.ndarray, "cells 2"]


def landings_of(eset: EquilibriumSet, progress: Progress) -> Landings:
    """Descents from the vertices of all cells of index one, both ways."""
    structure, points = eset.structure, eset.points
    some = np.flatnonzero(eset.cell_index == 1)
    vertices, corners = np.unique(eset.cells[some], return_inverse=True)
    ends, code = np.zeros((len(vertices), 2, structure.size)), np.zeros((len(vertices), 2), int)
    for first in range(0, len(vertices), CHUNK):
        progress.report("descents", first, len(vertices))
        part = slice(first, first + CHUNK)
        at = vertices[part]
        led = descend(structure, points.z[at], points.p[at], FAITHFUL)
        ends[part], code[part] = led.z.swapaxes(0, 1), led.code.T
    row = np.full(len(eset.cells), NONE)
    row[some] = np.arange(len(some))
    corners = corners.reshape(len(some), -1)
    p = points.p[eset.cells[some]]
    return _of_cells(structure, row, p, ends[corners], code[corners])


def over_parameters(eset: EquilibriumSet, p: Parameters) -> StatesOver:
    """States of a set over rows of all parameters."""
    return eset.over(**dict(zip(eset.names, p[:, eset.setting.free].T.copy(), strict=True)))


@dataclass(frozen=True)
class SaddleLandings:
    """Vertices of index one, and the cells on which descents from them end, −1 where none is known.

    The two sides stand in no order.
    """

    vertices: Numbers
    cells: Int[np.ndarray, "vertices 2"]


def cells_of_landings(eset: EquilibriumSet, landings: Landings) -> SaddleLandings:
    """Cells of the set on which descents from its vertices of index one end."""
    corners = eset.cells[landings.row >= 0]
    vertices, first = np.unique(corners, return_index=True)
    ends = landings.ends.reshape(-1, *landings.ends.shape[2:])[first]
    over = over_parameters(eset, eset.points.p[vertices])
    sides = [[_known(over, k, z) for z in pair] for k, pair in enumerate(ends)]
    number = np.array(sides, int).reshape(-1, 2)
    return SaddleLandings(vertices, np.where(number >= 0, over.cell[number], NONE))


def _of_cells(
    structure: Structure,
    row: Int[np.ndarray, " C"],
    p: Float[np.ndarray, "cells corners P"],
    ends: Float[np.ndarray, "cells corners 2 size"],
    code: Int[np.ndarray, "cells corners 2"],
) -> Landings:
    """Landings from the corners of cells, and whether they lie on the same sheets.

    The mode of a corner may point to the other side than that of the first one.
    """

    def gap(one: np.ndarray, other: np.ndarray) -> Float[np.ndarray, "..."]:
        return metric_length(structure, one - other) ** 2

    first, turned = ends[:, :1], ends[:, :, ::-1]
    swap = gap(turned, first).sum(axis=2) < gap(ends, first).sum(axis=2)
    ends = np.where(swap[:, :, None, None], turned, ends)
    code = np.where(swap[:, :, None], code[:, :, ::-1], code)
    radius = np.sqrt(gap(ends, ends[:, :1]).max(axis=1, initial=0.0))
    # at a fold the state is itself the minimum beside it
    outcome = np.where(code == Ending.HELD, int(Ending.LANDED), code)
    mixed = (outcome != outcome[:, :1]).any(axis=1) | (outcome == Ending.SADDLE).any(axis=1)
    radius[mixed] = np.inf
    for one, other in combinations(range(ends.shape[1]), 2):
        cell, side = np.nonzero((code[:, [one, other]] == Ending.LANDED).all(axis=1))
        there = ends[cell, other, side]
        start = States(structure, ends[cell, one, side], p[cell, one])
        good = _same_sheet(start, States(structure, there, p[cell, other]))
        radius[cell[~good], side[~good]] = np.inf
    words = np.array([0, *(Nowhere.of(Ending(k)) for k in range(1, len(Ending) - 1))])
    return Landings(row, ends, radius, words[outcome[:, 0]])


def _same_sheet(start: States, goal: States) -> Flags:
    """Whether Newton's method, or a straight lift where it fails, leads from states to others."""
    structure = start.structure
    z, good, index = exact_states(structure, start.z, goal.p)
    good &= (index == 0) & _same(structure, z, goal.z)
    left = np.flatnonzero(~good)
    z, arrived = lift_to(start[left], goal.p[left], ())
    good[left[arrived]] = _same(structure, z, goal.z[left[arrived]])
    return good


def _same(structure: Structure, one: Lanes, other: Lanes) -> Flags:
    return metric_length(structure, (one - other)[:, : structure.unknowns]) <= SAME_SOLUTION


def ends_of_descents(over: StatesOver, saddles: Some) -> Ends:
    """States where descents from saddles over points end, or a `Nowhere`."""
    structure = over.states.structure
    ends = np.full((len(saddles), 2), int(Nowhere.LOST))
    for begin in range(0, len(saddles), CHUNK):
        part = saddles[begin : begin + CHUNK]
        led = descend(structure, over.states.z[part], over.states.p[part], FAITHFUL)
        for (side, k), ending in np.ndenumerate(led.code):
            met = ending in (Ending.LANDED, Ending.SADDLE)
            end = _known(over, int(over.point[part[k]]), led.z[side, k]) if met else NONE
            ends[begin + k, side] = end if met else Nowhere.of(Ending(int(ending)))
    return ends


def _known(over: StatesOver, point: int, z: Float[np.ndarray, " size"]) -> int:
    """Number of a state over a point, `Nowhere.BEYOND` if the set lacks it."""
    first, last = np.searchsorted(over.point, (point, point + 1))
    here = over.states.z[first:last]
    gap = metric_length(over.states.structure, (here - z)[:, : over.states.structure.unknowns])
    near = gap.min(initial=np.inf) <= SAME_SOLUTION
    return int(first + gap.argmin()) if near else Nowhere.BEYOND

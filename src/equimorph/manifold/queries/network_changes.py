"""Curves over parameters on which the transition network changes, as levels of the set.

See docs/barriers.md, "Where the network changes".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Int, Lanes, Parameters, Values
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.lookup.exact_states import StatesOver
from equimorph.manifold.queries.barrier_landings import over_parameters
from equimorph.manifold.queries.barriers import SetBarriers, nearest_states
from equimorph.manifold.queries.levels import Level, level_set, part
from equimorph.model import Descriptor
from equimorph.structures import States
from equimorph.structures.metric import metric_length

EQUAL = 2e-12
"""Part of the largest barrier that is added to differences: where symmetry makes energies equal all
along a curve, their round-off is no change of order."""
TIED = 1e-8
"""Difference of energies, relative to the largest barrier, that is none."""
APART = 1e-3
"""Distance in the metric from which on two stable states count as different: at folds a minimum and
its saddle are one."""


@dataclass(frozen=True, eq=False)
class NetworkChanges:
    """Where minima merge with saddles, swap order, or lose their lowest way out to another one.

    Parameters
    ----------
    eset
        The set; minima and saddles appear and vanish together at its folds.
    swaps
        States with the same energy as another stable state over the same parameters.
    passes
        Saddles that are one of the two lowest ways out of a minimum, and as high as the other.
    """

    eset: EquilibriumSet
    swaps: Level
    passes: Level

    def __repr__(self) -> str:
        """How many curves there are of each kind."""
        return (
            f"NetworkChanges over {self.eset.box}: {len(self.eset.folds)} folds, "
            f"{len(self.swaps.pieces)} curves on which minima swap order, "
            f"{len(self.passes.pieces)} on which lowest passes do"
        )


@check_arguments
def network_changes(field: SetBarriers) -> NetworkChanges:
    """Curves on which the transition network of a set changes, with exact states on them.

    Minima merge with saddles at the folds of the set. Two minima swap order where their energies
    are equal (the Maxwell set), and the least way out of a minimum leads over another saddle where
    the two lowest passes are equal. These are levels of functions on sheets of index 0 and 1: their
    vertices are solved for on the edges that they cross, see `level_set`. Where a saddle begins to
    lead to another state, at the same energies, is not among them.

    Parameters
    ----------
    field
        Barriers over the set, as by `barriers`.

    Examples
    --------
    >>> from equimorph import Box, Spring, barriers, equilibrium_set, network_changes
    >>> eset = equilibrium_set(Spring(), Box(F=(-0.1, 0.12)), fixed={"x_l": 0.8}, intervals=(7,))
    >>> changes = network_changes(barriers(eset))
    >>> bool(abs(changes.swaps.states["F"]).max() < 1e-9)  # both sides are alike
    True
    """
    return NetworkChanges(field.eset, *(_ties(field, index) for index in (0, 1)))


def _ties(field: SetBarriers, index: int) -> Level:
    """Where states of an index have the energy of another one; saddles if both are lowest passes.

    The function changes its sign there; places where it only jumps are dropped.
    """
    eset = field.eset

    def gap(z: Lanes, p: Parameters) -> Values:
        return _gap(field, over_parameters(eset, p), index, z, p)

    unit = eset.structure.descriptor("energy").unit
    some = part(eset, eset.cell_index == index)
    if len(some.cells) == 0:
        return Level(eset.points[:0], (), 0)
    found = level_set(some, Descriptor("energy gap", unit, gap), 0.0)
    z, p = found.states.z, found.states.p
    tied = np.abs(gap(z, p)) <= TIED * field.ceiling
    if index == 1:
        tied[tied] = _lowest(field, found.states[np.flatnonzero(tied)])
    pieces = [run for piece in found.pieces for run in _runs(piece, tied)]
    used = np.unique(np.concatenate([np.zeros(0, int), *(each.ravel() for each in pieces)]))
    numbered = tuple(np.searchsorted(used, each) for each in pieces)
    return Level(found.states[used], numbered, found.lost)


def _gap(field: SetBarriers, over: StatesOver, index: int, z: Lanes, p: Parameters) -> Values:
    """Least difference of energies to another state of an index, signed by those below."""
    structure, energy = over.states.structure, over.states.energy
    away = metric_length(structure, (over.states.z - z[over.point])[:, : structure.unknowns])
    other = np.flatnonzero((over.index == index) & (away > APART))
    lane = over.point[other]
    gap = (structure.energy(z, p) * structure.energy_scale)[lane] - energy[other]
    size, sign = np.full(len(z), field.ceiling), np.ones(len(z))
    np.minimum.at(size, lane, np.abs(gap))
    np.multiply.at(sign, lane, np.where(gap > 0.0, -1.0, 1.0))
    return np.asarray(sign * size + EQUAL * field.ceiling)


def _lowest(field: SetBarriers, saddles: States) -> Flags:
    """Whether saddles are among the two lowest ways out of a minimum, and as high as the other."""
    over = over_parameters(field.eset, saddles.p)
    number, energy = nearest_states(over, saddles.z, np.zeros(len(over.index))), over.states.energy
    pairs = np.unique(field.ways(over, exact=True)[:, [1, 0]], axis=0)
    start, top = pairs[np.lexsort((energy[pairs[:, 1]], pairs[:, 0]))].T
    first = np.flatnonzero(start[1:] == start[:-1])
    first = first[np.isin(first, np.searchsorted(start, np.unique(start)))]
    level = np.abs(energy[top[first]] - energy[top[first + 1]]) <= TIED * field.ceiling
    return np.isin(number, top[np.concatenate([first[level], first[level] + 1])])


def _runs(piece: Int[np.ndarray, "..."], tied: np.ndarray) -> list[Int[np.ndarray, "..."]]:
    """Parts of a piece of a level with ties alone: points, runs of a polyline, or triangles."""
    good = tied[piece]
    if piece.ndim == 2:
        return [piece[good.all(axis=1)]] if good.all(axis=1).any() else []
    if len(piece) == 1:
        return [piece] if good[0] else []
    parts = np.split(piece, np.flatnonzero(np.diff(good.astype(int))) + 1)
    return [each for each in parts if tied[each].all() and len(each) > 1]

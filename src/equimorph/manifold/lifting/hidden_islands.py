"""States inside cells of a set whose index their corners do not show: islands between folds.

The determinant of F_z vanishes on folds and on crossings of sheets. Where a closed curve of these
lies inside a cell, it has a minimum of the other sign there. On every cell it is modelled by a
quadratic polynomial, through its values at the corners of the cell and of its neighbours, in
coordinates along the set; where that dips, smaller and smaller simplices on the set lead to the
minimum.

See docs/decisions.md, "Determinants lead to islands inside cells".
"""

from dataclasses import dataclass
from hashlib import sha256
from itertools import combinations

import numpy as np

from equimorph.arrays import Cells, Float, Int, ItemValues
from equimorph.columns import Columns
from equimorph.equilibria.determinants import determinants
from equimorph.equilibria.settle import Guards, free_directions, settle
from equimorph.linalg.determinants import in_units
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.points import are_singular
from equimorph.manifold.geometry.quadratics import least_in_simplex, through_corners
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.topology import Adjacency
from equimorph.structures import States, join_states

DEEP = 0.5
"""Share of the least determinant met so far below which its minimum is sought: a minimum that is
no island is left as soon as it is met."""
VARYING = 2.0
"""Ratio of the largest determinant around a cell to the least one at its corners below which it
cannot dip inside."""
NARROWER = 1.0 / 3.0
"""Size of each simplex, relative to the one before; the first is as large as the cell."""
ZOOMS = 5
"""Simplices in each other: the last ones are 81 times smaller than the cell."""
FLAT = 1e-12
"""Part of their squared size that is added to simplices, which may be flat to round-off."""
ITERATIONS = 20
"""Of Newton's method, at most."""
NOWHERE = -1
"""Instead of a vertex: there is no cell beyond this side."""

Shares = Float[np.ndarray, "n corners"]


@dataclass(frozen=True)
class _Patches(Columns):
    """Simplices on a set: states at their corners, and then at other points nearby.

    unit, power: the determinant unit·2^power at the first corner of the cell that they lie on;
    determinants: over that; deep: value below which they dip.
    """

    unit: ItemValues
    power: ItemValues
    deep: ItemValues
    z: Float[np.ndarray, "n points size"]
    p: Float[np.ndarray, "n points parameters"]
    determinants: Float[np.ndarray, "n points"]


class IslandFinder:
    """Finds islands inside cells of sets of the same structure.

    Cells in which none was found are not searched again while their patches stay as they are.
    """

    def __init__(self) -> None:
        """No cell was searched yet."""
        self._without: set[bytes] = set()

    def find(self, eset: EquilibriumSet) -> States:
        """Equilibria inside cells that have not the index of these: one in each grid cell."""
        setting, d = eset.setting, len(eset.names)
        if d == 1 or len(eset.cells) == 0:  # edges are traced, and have no inside besides
            return eset.points[:0]
        patches = _of_cells(eset)
        least, centres, _ = _models(setting, patches)
        deep = np.flatnonzero(least < patches.deep)
        names = np.array([sha256(each.tobytes()).digest() for each in patches.z[deep]], object)
        new = np.flatnonzero([name not in self._without for name in names])
        deep, names = deep[new], names[new]
        found, origin = _zoom(setting, patches.take(deep), centres[deep])
        self._without.update(np.delete(names, origin))
        cells = [eset.mesh.locate(place) for place in found.p[:, setting.free]]
        return found[np.unique(cells, return_index=True)[1]]


def _zoom(
    setting: Setting, patches: _Patches, centres: Shares
) -> tuple[States, Int[np.ndarray, " found"]]:
    """States of the other index near places in patches, and the number of the patch of each."""
    number, guesses, size = np.arange(len(centres)), centres, 1.0
    found, origin = [States(setting.structure, patches.z[:0, 0], patches.p[:0, 0])], [number[:0]]
    for _ in range(ZOOMS):
        if len(number) == 0:
            break
        patches = _inside(setting, patches, centres, guesses, size)
        other = np.asarray((patches.determinants < 0.0).any(axis=1))
        found.append(_deepest(setting, patches.take(other)))
        origin.append(number[other])
        whole = np.isfinite(patches.determinants[:, : len(setting.free) + 1]).all(axis=1)
        left, size = np.flatnonzero(whole & ~other), NARROWER
        least, centres, guesses = _lowest(setting, patches.take(left))
        deep = np.flatnonzero(least < patches.deep[left])
        patches, number = patches.take(left[deep]), number[left[deep]]
        centres, guesses = centres[deep], guesses[deep]
    return join_states(setting.structure, found), np.concatenate(origin)


def _of_cells(eset: EquilibriumSet) -> _Patches:
    """Cells with the vertices across their sides, off folds and crossings, where much varies."""
    vertices, singular = eset.points, are_singular(eset.kinds)
    known = np.where(singular[:, None], 0.0, vertices.inertia[1])
    plain = np.flatnonzero(~singular[eset.cells].any(axis=1))
    around = np.concatenate([eset.cells, _across(eset.cells, eset.adjacency)], axis=1)[plain]
    unit, power = known[around[:, 0]].T
    values = np.where(around == NOWHERE, np.nan, in_units(known[around], power[:, None]))
    values[~np.isfinite(values)] = np.nan
    values *= np.sign(unit)[:, None]
    low = values[:, : eset.cells.shape[1]].min(axis=1)
    varying = np.flatnonzero(np.fmax.reduce(values, axis=1) > VARYING * low)
    of_cells = unit, power, low, around, values
    unit, power, low, around, values = (each[varying] for each in of_cells)
    size = np.abs(unit)
    deep, values = DEEP * low / size, values / size[:, None]
    return _Patches(unit, power, deep, vertices.z[around], vertices.p[around], values)


def _across(cells: Cells, whole: Adjacency) -> Cells:
    """Vertices of the neighbours of cells opposite to the sides between them."""
    out = np.full(cells.size, NOWHERE)
    one, other = whole.places[whole.manifold].T
    out[one], out[other] = cells.ravel()[other], cells.ravel()[one]
    return out.reshape(cells.shape)


def _models(
    setting: Setting, patches: _Patches
) -> tuple[ItemValues, Shares, Float[np.ndarray, "n others d"]]:
    """Least values of the models in their simplices, and where; coordinates of the other points."""
    d = len(setting.free)
    n, points = patches.determinants.shape
    if n == 0:
        return np.zeros(0), np.zeros((0, d + 1)), np.zeros((0, points - d - 1, d))
    rows = (np.concatenate(each) for each in (patches.z, patches.p))
    y = embed(setting, *rows).reshape(n, points, -1)
    away = y - y[:, :1]
    sides, others = away[:, 1 : d + 1], away[:, d + 1 :]
    gram = sides @ np.swapaxes(sides, 1, 2)
    gram += FLAT * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(d)
    at = np.swapaxes(np.linalg.solve(gram, sides @ np.swapaxes(others, 1, 2)), 1, 2)
    corners, values = np.split(patches.determinants, [d + 1], axis=1)
    return *least_in_simplex(through_corners(corners, at, values), d), at


def _lowest(setting: Setting, patches: _Patches) -> tuple[ItemValues, Shares, Shares]:
    """Least of the values and of those of the models, where the one is, and the other."""
    least, guesses, at = _models(setting, patches)
    at = np.concatenate([1.0 - at.sum(axis=2, keepdims=True), at], axis=2)
    corners = np.tile(np.eye(at.shape[2]), (len(at), 1, 1))
    values = np.where(np.isnan(patches.determinants), np.inf, patches.determinants)
    lowest, every = values.argmin(axis=1), np.arange(len(at))
    centres = np.concatenate([corners, at], axis=1)[every, lowest]
    return np.minimum(least, values[every, lowest]), centres, guesses


def _inside(
    setting: Setting, patches: _Patches, centres: Shares, guesses: Shares, size: float
) -> _Patches:
    """Smaller simplices on the set around places in others.

    With the middles of their sides, their centres, and guesses where the determinant is least.
    """
    structure, d = setting.structure, len(setting.free)
    weights = centres[:, None] + size * (_pattern(d) - 1.0 / (d + 1.0))
    weights = np.concatenate([weights, centres[:, None], guesses[:, None]], axis=1)
    n, points = weights.shape[:2]
    z, p = (np.concatenate(weights @ each[:, : d + 1]) for each in (patches.z, patches.p))
    directions = free_directions(structure, setting.free, len(z))
    guards = Guards(iterations=ITERATIONS)
    found = settle(structure, z, p, directions, guards=guards, frames=False)
    values = in_units(determinants(structure, found.z, found.p), np.repeat(patches.power, points))
    values /= np.repeat(patches.unit, points)
    values[~found.found | ~np.isfinite(values)] = np.nan
    values = values.reshape(n, points)
    return _Patches(
        patches.unit,
        patches.power,
        patches.deep
        if size > NARROWER
        else np.fmin(patches.deep, DEEP * np.fmin.reduce(values, axis=1)),
        found.z.reshape(n, points, -1),
        found.p.reshape(n, points, -1),
        values,
    )


def _pattern(d: int) -> Float[np.ndarray, "points corners"]:
    """Barycentric coordinates of the corners of a simplex, and of the middles of its sides."""
    corners = np.eye(d + 1)
    middles = [0.5 * (corners[i] + corners[j]) for i, j in combinations(range(d + 1), 2)]
    return np.concatenate([corners, middles])


def _deepest(setting: Setting, patches: _Patches) -> States:
    """States of simplices at which the determinant is least."""
    least, every = np.nanargmin(patches.determinants, axis=1), np.arange(len(patches.unit))
    return States(setting.structure, patches.z[every, least], patches.p[every, least])

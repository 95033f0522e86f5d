"""Natural states over a grid of settings: one from the structure, the rest by continuation."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Parameters, Settings
from equimorph.equilibria.settle import Guards, settle
from equimorph.model import Grid, position
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length

SHARE = 0.25
"""Largest correction of a step to a neighbour, relative to the step: beyond, it is not taken."""
GUARDS = Guards(iterations=8, longest=np.inf, converged=1e-7)
"""Newton squares the last correction."""
TRIES = 3
"""Vertices of each unreached piece of the grid at which the structure computes its state."""


@dataclass(frozen=True)
class NaturalSheet:
    """Natural states over the vertices of a grid, and over settings between them."""

    structure: Structure
    """The structure."""
    base: Float[np.ndarray, " parameters"]
    """All parameters, unloaded; those of the grid are replaced."""
    axes: tuple[Float[np.ndarray, " _"], Float[np.ndarray, " _"]]
    places: Int[np.ndarray, " 2"]
    """Grid lines and the places of their parameters."""
    z: Float[np.ndarray, "vertices size"]
    found: Bool[np.ndarray, " vertices"]
    """States over the vertices (row by row), and whether there is one."""

    def without_states(self) -> "NaturalSheet":
        """Return the sheet without its states, for those who are given what they need of it."""
        return replace(self, z=self.z[:0], found=self.found[:0])

    def parameters(self, settings: Settings) -> Parameters:
        """All parameters at settings, unloaded."""
        return _parameters(self.base, self.places, settings)

    def states(self, settings: Settings) -> tuple[Lanes, Flags]:
        """Natural states at settings, continued from the nearest vertices."""
        shape = tuple(len(axis) for axis in self.axes)
        near = []
        for axis, values in zip(self.axes, settings.T, strict=True):
            step = axis[1] - axis[0]
            near.append(np.clip(np.rint((values - axis[0]) / step), 0, len(axis) - 1).astype(int))
        vertex = np.ravel_multi_index(tuple(near), shape)
        start = np.stack([axis[k] for axis, k in zip(self.axes, near, strict=True)], axis=1)
        p = self.parameters(settings)
        z, found = np.full((len(p), self.structure.size), np.nan), self.found[vertex]
        here = np.flatnonzero(found)
        before = self.parameters(start[here])
        z[here], found[here] = _step(self.structure, self.z[vertex[here]], before, p[here])
        rest = np.flatnonzero(~found & self.found[vertex])
        if len(rest):
            z[rest], found[rest] = stable_natural(self.structure, p[rest])
        return z, found & self.structure.may_be_natural(p)


def natural_sheet(
    structure: Structure, grid: Grid, base: Float[np.ndarray, " parameters"]
) -> NaturalSheet:
    """Natural states over all vertices of a grid that can be reached from one of them.

    The structure gives the state at a vertex in the middle; its neighbours follow by a tangent step
    and Newton's method at fixed parameters, and so on. A step counts if its correction is small and
    the state stable. For every piece of the grid that cannot be reached in this way, the structure
    computes another state.
    """
    axes = grid.axes()
    shape = (len(axes[0]), len(axes[1]))
    settings = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    places = np.array([position(structure.parameters, name) for name in grid.names])
    p = _parameters(base, places, settings)
    z, found = np.full((len(p), structure.size), np.nan), np.zeros(len(p), bool)
    asked = np.zeros(len(p), int)
    defined = structure.may_be_natural(p)
    asked[~defined] = 1
    while (seeds := _seeds((found | ~defined).reshape(shape), asked)).size:
        asked[seeds] = 1
        z[seeds], found[seeds] = stable_natural(structure, p[seeds])
        _flood(structure, p, z, found, shape, seeds[found[seeds]])
    found &= defined
    return NaturalSheet(structure, base, (axes[0], axes[1]), places, z, found)


def stable_natural(structure: Structure, p: Parameters) -> tuple[Lanes, Flags]:
    """Natural states that the structure computes; a structure rests in none that is unstable."""
    z, found = structure.natural(p)
    stable = found.copy()
    stable[found] = structure.index(z[found], p[found]) == 0
    return z, stable


def _parameters(
    base: Float[np.ndarray, " parameters"], places: Int[np.ndarray, " 2"], settings: Settings
) -> Parameters:
    p = np.tile(base, (len(settings), 1))
    p[:, places] = settings
    return p


def _seeds(
    found: Bool[np.ndarray, "rows columns"], asked: Int[np.ndarray, " vertices"]
) -> Int[np.ndarray, " pieces"]:
    """One vertex that was not tried yet, in the middle of each unreached piece of the grid."""
    pieces, many = ndimage.label(~found)
    seeds = []
    for piece in range(1, many + 1):
        inside = np.flatnonzero(pieces == piece)
        if np.count_nonzero(asked[inside]) < min(TRIES, len(inside)):
            depth = ndimage.distance_transform_edt(np.pad(pieces == piece, 1))[1:-1, 1:-1].ravel()
            depth[asked > 0] = 0.0
            seeds.append(int(depth.argmax()))
    return np.array(seeds, int)


def _flood(
    structure: Structure,
    p: Float[np.ndarray, "vertices parameters"],
    z: Float[np.ndarray, "vertices size"],
    found: Bool[np.ndarray, " vertices"],
    shape: tuple[int, int],
    front: Int[np.ndarray, " front"],
) -> None:
    """Continue states from the vertices of a front to all in reach; fills z and `found`."""
    while len(front):
        start, target = _neighbours(front, shape)
        fresh = ~found[target]
        start, target = start[fresh], target[fresh]
        reached = np.zeros(0, int)
        # a vertex with several neighbours in the front: the second is tried where the first fails
        while len(target):
            _, first = np.unique(target, return_index=True)
            a, b = start[first], target[first]
            end, good = _step(structure, z[a], p[a], p[b])
            z[b[good]], found[b[good]] = end[good], True
            reached = np.concatenate([reached, b[good]])
            rest = np.setdiff1d(np.arange(len(target)), first)
            rest = rest[~found[target[rest]]]
            start, target = start[rest], target[rest]
        front = reached


def _neighbours(
    front: Int[np.ndarray, " front"], shape: tuple[int, int]
) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
    """Vertices of a front and their neighbours on the grid."""
    row, column = np.divmod(front, shape[1])
    starts, targets = [], []
    for down, right in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        i, j = row + down, column + right
        inside = (i >= 0) & (i < shape[0]) & (j >= 0) & (j < shape[1])
        starts.append(front[inside])
        targets.append((i * shape[1] + j)[inside])
    return np.concatenate(starts), np.concatenate(targets)


def _step(structure: Structure, z: Lanes, p: Parameters, target: Parameters) -> tuple[Lanes, Flags]:
    """States at `target` on the sheet of the stable states (z, p), and whether they are certain."""
    still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    tangent = structure.advance(z, p, target - p, still, one, none).tangent_z
    near = settle(structure, z + tangent, target, guards=GUARDS)
    end = near.z
    step, miss = (metric_length(structure, each) for each in (tangent, end - z - tangent))
    return end, near.found & (miss <= SHARE * step + 1e-9) & (near.index == 0)

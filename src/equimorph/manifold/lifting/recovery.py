"""States that a pairing lacks become equilibria over the vertices of its grid."""

import numpy as np
from jaxtyping import Int

from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting.completeness import seeds_from
from equimorph.manifold.lifting.grid import bisect
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.structures import States

HIDDEN = 12
"""Rounds of bisection around missing states that bring no new equilibria over grid vertices: of 50
searches 46 needed six at most."""


def recover(pairing: Pairing, missing: States) -> None:
    """Enter equilibria over the corners of grid cells around states that were missing.

    Cells are bisected where that brings nothing new: no corner lies below the piece of the set, or
    its straight cells leave out the states, which are close to a curved fold.
    """
    for _ in range(HIDDEN):
        if pairing.is_full:
            return
        known, mesh = pairing.points.count, pairing.mesh
        found, origin = seeds_from(pairing.setting, mesh, missing)
        ids, _ = pairing.points.over_vertices(*found)
        missing = missing[np.setdiff1d(np.arange(len(missing)), origin[ids >= known])]
        if len(missing) == 0 or mesh.dimension == 1:
            return
        around = np.unique([mesh.locate(point) for point in missing.p[:, pairing.setting.free]])
        sides = mesh.sides[around] if mesh.dimension == 2 else mesh.sides[mesh.faces[around]]
        chosen = longest(mesh, sides.reshape(len(around), -1))
        pairing.fit()
        pairing.use_mesh(bisect(mesh, np.unique(chosen), off_zero(pairing.setting)))


def off_zero(setting: Setting) -> tuple[bool, ...]:
    """Tell of which free parameters zero no line of the grid may hold: all.

    There much is symmetric, declared or not: a structure whose load is none may be its own image.
    """
    return (True,) * len(setting.free)


def longest(mesh: BaseMesh, sides: Int[np.ndarray, "n sides"]) -> Int[np.ndarray, " n"]:
    """Return the longest edge of each row, relative to the box."""
    ends = mesh.vertices[mesh.edges[sides]] / np.ptp(mesh.vertices, axis=0)
    length = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
    return np.asarray(sides[np.arange(len(sides)), length.argmax(axis=1)])

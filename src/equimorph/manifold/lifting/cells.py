"""Sheet lifting, part six: the cells of the set, of any dimension."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Int

from equimorph.manifold.geometry.points import CAP, CROSSING, FOLD
from equimorph.manifold.lifting.discs import assemble
from equimorph.manifold.lifting.loops import find_loops
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.volumes import Volumes, volumes_over


def _nothing() -> Int[np.ndarray, " 0"]:
    return np.zeros(0, int)


@dataclass(frozen=True)
class Cells:
    """Segments, triangles or tetrahedra of points with their index, and facets of three kinds.

    corners (C, d + 1), index (C,); folds, caps, crossings: facets on folds, on constraints and
    where sheets cross; the doubtful: grid cells over which the set could not be closed and cut
    without doubt.
    """

    corners: Int[np.ndarray, "C corners"]
    index: Int[np.ndarray, " C"]
    folds: Int[np.ndarray, "f d"]
    caps: Int[np.ndarray, "c d"]
    crossings: Int[np.ndarray, "x d"]
    doubtful_triangles: Int[np.ndarray, " t"] = field(default_factory=_nothing)
    doubtful_tetrahedra: Int[np.ndarray, " n"] = field(default_factory=_nothing)

    @property
    def doubtful(self) -> int:
        """Number of grid cells in doubt."""
        return len(self.doubtful_triangles) + len(self.doubtful_tetrahedra)


class CellFinder:
    """Finds the cells of the set over a mesh that is being bisected."""

    def __init__(self) -> None:
        self._known: Volumes | None = None

    def find(self, pairing: Pairing) -> Cells:
        """Cells of the set over a mesh whose edges are all lifted."""
        if pairing.mesh.dimension == 1:
            return _segments(pairing)
        if pairing.mesh.dimension == 2:
            discs = assemble(pairing, find_loops(pairing))
            marked = (discs.folds, discs.caps, discs.crossings)
            return Cells(discs.corners, discs.index, *marked, discs.doubtful)
        self._known = volumes_over(pairing, self._known)
        discs, balls = self._known.discs, self._known.balls
        marked = (balls.folds, balls.caps, balls.crossings)
        return Cells(balls.corners, balls.index, *marked, discs.doubtful, balls.doubtful)


def _segments(pairing: Pairing) -> Cells:
    """Pieces of the lifted edges between their points."""
    points, curves = pairing.points, pairing.curves
    pairs: list[tuple[int, int]] = []
    for curve, (edge, start, end) in enumerate(
        zip(curves.edge, curves.start, curves.end, strict=True)
    ):
        if pairing.ray(start, edge) == curve:
            line = [start, *curves.inner.get(curve, []), *([end] if end >= 0 else [])]
            pairs.extend(pairwise(line))
    corners = np.array(pairs, int).reshape(-1, 2)
    kind, index = points.kind[: points.count], points.index[: points.count]
    # of two neighbours on a curve at most one is singular
    regular = np.where(np.isin(kind[corners[:, 0]], (FOLD, CROSSING)), corners[:, 1], corners[:, 0])
    used = np.unique(corners)
    marked = (used[kind[used] == each, None] for each in (FOLD, CAP, CROSSING))
    return Cells(corners, index[regular], *marked)

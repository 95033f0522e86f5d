"""What must hold on every equilibrium set, whatever the structure."""

import numpy as np
from scipy.spatial import cKDTree

from equimorph.manifold import EquilibriumSet
from equimorph.manifold.topology import adjacency, flags_of, orientation, projected_volume

REGULAR = (0, 3, 5, 6)
FOLDED = (1, 4)
CAPPED = (2, 4)


def assert_faithful(eset: EquilibriumSet) -> None:
    """Clean audit; exact vertices; folds singular; one index per cell, which orients it."""
    assert eset.audit.clean, eset.audit
    assert_exact(eset)
    assert_index_of_cells(eset)
    assert_orientation_alternates(eset)
    assert_folds_part_indices(eset)
    assert_boundaries(eset)


def assert_exact(eset: EquilibriumSet) -> None:
    """Round-off residuals, the given fixed parameters, all vertices in the box."""
    assert eset.points.residual.max() < 1e-10
    for name, value in eset.fixed.items():
        assert np.array_equal(eset.points[name], np.full(len(eset.points), value))
    assert eset.box.contains(eset.coordinates, slack=1e-9).all()
    for constraint in eset.constraints:
        assert constraint.excess(eset.points.z, eset.points.p).max() < 1e-8


def assert_folds_are_singular(eset: EquilibriumSet, tolerance: float) -> None:
    """det F_z = 0 at fold vertices: an eigenvalue of the constrained Hessian vanishes."""
    folded = np.flatnonzero(np.isin(eset.kinds, FOLDED))
    if len(folded) == 0:
        return
    shift = np.full(len(folded), tolerance)
    nothing = np.zeros((len(folded), 0, eset.structure.size))
    z, p = eset.points.z[folded], eset.points.p[folded]
    above = eset.structure.solve(z, p, nothing, shift=shift).negative
    below = eset.structure.solve(z, p, nothing, shift=-shift).negative
    # exactly one eigenvalue lies between −tolerance and +tolerance
    assert (above - below == 1).all()
    # and it is the one that tells both sides apart
    assert np.array_equal(below - eset.structure.constraints, eset.index[folded])


def assert_index_of_cells(eset: EquilibriumSet) -> None:
    """The index of a cell is that of its regular vertices, counted anew."""
    index = eset.structure.index(eset.points.z, eset.points.p)
    regular = ~np.isin(eset.kinds, FOLDED)
    assert np.array_equal(index[regular], eset.index[regular])
    for corner in eset.cells.T:
        own = regular[corner]
        assert np.array_equal(index[corner[own]], eset.cell_index[own])
    # and on folds the lower of both sides
    folded = np.flatnonzero(~regular)
    low = np.full(len(eset.points), 99)
    np.minimum.at(low, eset.cells.ravel(), np.repeat(eset.cell_index, eset.cells.shape[1]))
    assert np.array_equal(low[folded], eset.index[folded])


def assert_orientation_alternates(eset: EquilibriumSet) -> None:
    """Oriented coherently, projected volumes of cells change sign with the parity of the index.

    Slivers at folds, where straight cells cut the corners of a curved fold, may be overturned.
    """
    signs, contradictions = orientation(eset.cells, adjacency(eset.cells))
    assert contradictions == 0
    volume = projected_volume(eset.coordinates, eset.cells) * signs * (-1) ** eset.cell_index
    for k in range(eset.audit.components):
        own = volume[eset.component == k] * np.sign(volume[eset.component == k].sum())
        assert -own[own < 0].sum() < 0.01 * own.sum()
        assert (own < 0).sum() < 0.05 * len(own)


def facets_of(piece: np.ndarray, d: int) -> np.ndarray:
    """Facets of a connected piece: a point, a polyline, or triangles one a row."""
    return np.stack([piece[:-1], piece[1:]], axis=1) if d == 2 else piece.reshape(-1, d)


def assert_folds_part_indices(eset: EquilibriumSet) -> None:
    """Cells on both sides of a facet differ in index by one on folds, and nowhere else."""
    whole, d = adjacency(eset.cells), len(eset.names)
    a, b = whole.links.T
    jump = np.abs(eset.cell_index[a] - eset.cell_index[b])
    folded = np.concatenate([np.zeros((0, d), int), *(facets_of(piece, d) for piece in eset.folds)])
    assert jump.max(initial=0) <= 1
    assert np.array_equal(flags_of(whole.facets, folded)[whole.across], jump == 1)
    assert np.isin(eset.kinds[folded], FOLDED).all()


def assert_boundaries(eset: EquilibriumSet) -> None:
    """Pieces are closed; their vertices lie on the box or on a constraint."""
    size = eset.box.upper - eset.box.lower
    x = eset.coordinates
    low, high = np.abs(x - eset.box.lower), np.abs(x - eset.box.upper)
    on_box = (np.minimum(low, high) < 1e-9 * size).any(axis=1)
    excess = np.full(len(x), -np.inf)
    for constraint in eset.constraints:
        excess = np.maximum(excess, constraint.excess(eset.points.z, eset.points.p))
    for loop in eset.boundaries:
        own = np.unique(loop.vertices)
        capped = np.abs(excess[own]) < 1e-8
        assert_closed(loop.vertices, len(eset.names))
        assert (on_box[own] | capped).all()
        assert loop.kind in {"box", "cap", "mixed"}
        assert loop.kind != "box" or on_box[own].all()
        assert loop.kind != "cap" or capped.all()


def assert_closed(piece: np.ndarray, d: int) -> None:
    """A point, a simple loop, or a surface without boundary."""
    if d == 2:
        assert piece[0] == piece[-1]
        assert len(np.unique(piece)) == len(piece) - 1
    if d == 3:
        assert (adjacency(piece).counts == 2).all()


def places(eset: EquilibriumSet) -> np.ndarray:
    """Vertices in the embedding: configuration in the metric and scaled free parameters."""
    structure = eset.structure
    names = [parameter.name for parameter in structure.parameters]
    scales = structure.scales[[names.index(name) for name in eset.names]]
    u = eset.points.z[:, : structure.unknowns] * np.sqrt(structure.mass)
    return np.concatenate([u, eset.coordinates / scales], axis=1)


def farthest(eset: EquilibriumSet, other: EquilibriumSet) -> float:
    """Largest distance of a vertex of one surface from the triangles of another.

    Of the other's triangles those with the nearest middles are looked at.
    """
    place, corners = places(eset), places(other)[other.cells]
    near = cKDTree(corners.mean(axis=1)).query(place, k=min(40, len(corners)))[1]
    gap = np.full(len(place), np.inf)
    for column in near.T:
        gap = np.minimum(gap, _to_triangles(place, corners[column]))
    return float(gap.max())


def _to_triangles(place: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance of points from triangles, one each."""
    base, sides = corners[:, 0], corners[:, 1:] - corners[:, :1]
    gram = sides @ np.swapaxes(sides, 1, 2)
    right = np.einsum("nkd,nd->nk", sides, place - base)
    share = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
    inside = (share.min(axis=1) >= 0.0) & (share.sum(axis=1) <= 1.0)
    foot = base + np.einsum("nk,nkd->nd", share, sides)
    gap = np.where(inside, np.linalg.norm(place - foot, axis=1), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, along = corners[:, i], corners[:, j] - corners[:, i]
        t = np.einsum("nd,nd->n", place - a, along) / np.einsum("nd,nd->n", along, along)
        foot = a + np.clip(t, 0.0, 1.0)[:, None] * along
        gap = np.minimum(gap, np.linalg.norm(place - foot, axis=1))
    return gap

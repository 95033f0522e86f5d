"""What must hold on every equilibrium set, whatever the structure."""

import numpy as np
from scipy.spatial import cKDTree

from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.excerpts import fabric_of
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import (
    adjacency,
    cut_at_crossings,
    faces_of,
    flags_of,
    labels,
    orientation,
    projected_volume,
)

REGULAR = (0, 3, 5, 6)
FOLDED = (1, 4)
CROSSED = 7
SINGULAR = (*FOLDED, CROSSED)
CAPPED = (2, 4)


def assert_faithful(eset: EquilibriumSet) -> None:
    """Clean audit; exact vertices; folds singular; one index per cell, which orients it."""
    assert eset.audit.clean, eset.audit
    assert_exact(eset)
    assert_index_of_cells(eset)
    assert_orientation_alternates(eset)
    assert_folds_part_indices(eset)
    assert_boundaries(eset)
    if len(eset.names) == 3:
        assert_links(eset)


def assert_links(eset: EquilibriumSet) -> None:
    """Around every vertex of a set over three parameters, cells form a ball, or half of one.

    Its link is a sphere, or a disc at the boundary of the set: vertices − edges + triangles. Where
    sheets cross, that holds for each part of them.
    """
    crossings = [np.zeros((0, 3), int), *eset.crossings]
    cells, origin = cut_at_crossings(eset.cells, np.concatenate(crossings), len(eset.points))
    count = len(origin)
    amounts = [
        np.bincount(faces.ravel(), minlength=count)
        for faces in (faces_of(cells, 2), faces_of(cells, 3), cells)
    ]
    whole = adjacency(cells)
    rim = np.zeros(count, bool)
    rim[whole.facets[whole.counts == 1]] = True
    assert np.array_equal(amounts[0] - amounts[1] + amounts[2], np.where(rim, 1, 2))


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
    regular = ~np.isin(eset.kinds, SINGULAR)
    assert np.array_equal(index[regular], eset.index[regular])
    for corner in eset.cells.T:
        own = regular[corner]
        assert np.array_equal(index[corner[own]], eset.cell_index[own])
    # and on folds and crossings the lowest of all sides
    folded = np.flatnonzero(~regular)
    low = np.full(len(eset.points), 99)
    np.minimum.at(low, eset.cells.ravel(), np.repeat(eset.cell_index, eset.cells.shape[1]))
    assert np.array_equal(low[folded], eset.index[folded])


def assert_orientation_alternates(eset: EquilibriumSet) -> None:
    """Oriented coherently, projected volumes of cells change sign with the parity of the index.

    Slivers at folds, where straight cells cut the corners of a curved fold, may be overturned.
    """
    whole = adjacency(eset.cells)
    signs, contradictions = orientation(eset.cells, whole)
    assert contradictions == 0
    volume = projected_volume(eset.coordinates, eset.cells) * signs * (-1) ** eset.cell_index
    # where sheets cross the orientation has no meaning beyond
    patch = labels(len(eset.cells), whole.links[whole.manifold])
    for k in range(patch.max(initial=-1) + 1):
        own = volume[patch == k] * np.sign(volume[patch == k].sum())
        assert -own[own < 0].sum() < 0.01 * own.sum()
        assert (own < 0).sum() < 0.05 * len(own)


def assert_upright(eset: EquilibriumSet) -> None:
    """No cell is folded over, neither over the parameters nor in the tangent planes at its corners.

    Coherently oriented, all cells project with the sign of their index's parity; and, on average
    over their corners, they look the same way as the tangent planes, which cells around orient.
    """
    assert eset.audit.overturned == 0
    whole = adjacency(eset.cells)
    signs, _ = orientation(eset.cells, whole)
    volume = projected_volume(eset.coordinates, eset.cells) * signs * (-1) ** eset.cell_index
    patch = labels(len(eset.cells), whole.links[whole.manifold])
    for k in range(patch.max(initial=-1) + 1):
        own = volume[patch == k]
        assert (own * np.sign(own.sum()) >= 0.0).all()
    fabric = fabric_of(eset)
    # the signs of those parts of sheets between which others cross are their own
    corners = fabric.vertices.place[fabric.cells]
    total = np.zeros(len(eset.cells))
    for plane in fabric.cells.T:
        flat = np.einsum("cde,cke->ckd", fabric.vertices.rows[plane], corners - corners[:, :1])
        total += volumes(flat) * signs
    for k in range(patch.max(initial=-1) + 1):
        own = total[patch == k]
        assert (own * np.sign(own.sum()) > 0.0).all()


def facets_of(piece: np.ndarray, d: int) -> np.ndarray:
    """Facets of a connected piece: a point, a polyline, or triangles one a row."""
    return np.stack([piece[:-1], piece[1:]], axis=1) if d == 2 else piece.reshape(-1, d)


def assert_folds_part_indices(eset: EquilibriumSet) -> None:
    """Cells on both sides of a facet differ in index by one on folds, and nowhere else."""
    whole, d = adjacency(eset.cells), len(eset.names)
    a, b = whole.links[whole.manifold].T
    across = whole.across[whole.manifold]
    jump = np.abs(eset.cell_index[a] - eset.cell_index[b])
    folded = np.concatenate([np.zeros((0, d), int), *(facets_of(piece, d) for piece in eset.folds)])
    assert jump.max(initial=0) <= 1
    assert np.array_equal(flags_of(whole.facets, folded)[across], jump == 1)
    assert np.isin(eset.kinds[folded], SINGULAR).all()


def assert_crossings(eset: EquilibriumSet, vanishing: int = 1) -> None:
    """Four cells around each facet, of two sheets whose strata end there; F_z is singular.

    `vanishing`: how many eigenvalues vanish together.
    """
    whole, d = adjacency(eset.cells), len(eset.names)
    crossed = np.concatenate([facets_of(piece, d) for piece in eset.crossings])
    flags = flags_of(whole.facets, crossed)
    assert np.array_equal(flags, whole.counts > 2)
    assert (whole.counts[flags] == 4).all()
    assert len(crossed) == eset.audit.crossings == flags.sum()
    assert np.array_equal(np.unique(crossed), np.flatnonzero(eset.kinds == CROSSED))
    for facet in np.flatnonzero(flags):
        around = np.flatnonzero((whole.cell_facets == facet).any(axis=1))
        assert len(np.unique(eset.stratum[around])) == 4
        # one sheet changes its index, and by one eigenvalue det [F_z F_p; tᵀ] its sign on both
        assert np.ptp(eset.cell_index[around]) == vanishing
    z, p = (each[eset.kinds == CROSSED] for each in (eset.points.z, eset.points.p))
    nothing, shift = np.zeros((len(z), 0, eset.structure.size)), np.full(len(z), 1e-7)
    above, below = (
        eset.structure.solve(z, p, nothing, shift=sign * shift).negative for sign in (1, -1)
    )
    assert (above - below >= vanishing).all()


def assert_boundaries(eset: EquilibriumSet) -> None:
    """Pieces are closed, or end where sheets cross; they lie on the box or on a constraint."""
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
        if not (eset.kinds[loop.vertices.flat[[0, -1]]] == CROSSED).all():
            assert_closed(loop.vertices, len(eset.names), eset.kinds == CROSSED)
        assert (on_box[own] | capped).all()
        assert loop.kind in {"box", "cap", "mixed"}
        assert loop.kind != "box" or on_box[own].all()
        assert loop.kind != "cap" or capped.all()


def assert_closed(piece: np.ndarray, d: int, crossed: np.ndarray) -> None:
    """A point, a simple loop, or a surface without boundary, which may cross itself."""
    if d == 2:
        assert piece[0] == piece[-1]
        assert len(np.unique(piece)) == len(piece) - 1
    if d == 3:
        whole = adjacency(piece)
        both = crossed[whole.facets].all(axis=1)
        assert (whole.counts[~both] == 2).all()
        assert np.isin(whole.counts, (2, 4)).all()


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

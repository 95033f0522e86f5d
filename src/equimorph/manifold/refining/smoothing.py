"""Vertices moved along the set to where the triangles around them have larger angles."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.marked_complex import Fabric, edges_of
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.exact_points import Aim, corrected
from equimorph.manifold.geometry.points import REFINED
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.refining.surgery import best_apart, moved

SHARP = np.radians(10.0)
"""Triangles with smaller angles are to be bettered."""
SHARES = (1.0, 0.5, 0.25, 0.125)
"""Of the way to the centroid of its star, how much a vertex may go."""


def smooth(fabric: Fabric, around: Bool[np.ndarray, " C"]) -> Fabric:
    """Draw free vertices of some triangles amid their stars, where all angles there get larger.

    A vertex goes along its tangent plane to the centroid of its star and is corrected orthogonally
    to that plane; what lies on folds, constraints or the box stays.
    """
    base = len(fabric.vertices)
    corners = np.unique(fabric.cells[around])
    corners = corners[fabric.vertex_marks[corners] == 0]
    if len(corners) == 0:
        return fabric
    ways = np.concatenate([share * _to_centroids(fabric, corners) for share in SHARES])
    corners = np.tile(corners, len(SHARES))
    found, vertices = _amid(fabric, corners, ways)
    near = np.zeros(base, bool)
    near[corners] = True
    edges, _ = edges_of(fabric.cells[near[fabric.cells].any(axis=1)], base)
    more = replace(fabric, vertices=fabric.vertices.joined(vertices))
    moves = np.stack([corners[found], base + np.arange(len(vertices))], axis=1)
    moves = best_apart(more, moves, edges)
    return moved(more, moves) if len(moves) else fabric


def _to_centroids(
    fabric: Fabric, chosen: Int[np.ndarray, " n"]
) -> Float[np.ndarray, "n coordinates"]:
    """From vertices to the centroids of the triangles around, by area."""
    place, number = fabric.vertices.place, np.full(len(fabric.vertices), -1)
    number[chosen] = np.arange(len(chosen))
    total, weight = np.zeros((len(chosen), place.shape[1])), np.zeros(len(chosen))
    for corner in fabric.cells.T:
        own = number[corner] >= 0
        at, corners = number[corner[own]], place[fabric.cells[own]]
        area = _areas(fabric.squared[own])
        np.add.at(total, at, area[:, None] * corners.mean(axis=1))
        np.add.at(weight, at, area)
    known = np.flatnonzero(weight > 0.0)
    away = np.zeros_like(total)
    away[known] = total[known] / weight[known, None] - place[chosen[known]]
    return away


def _areas(squared: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Areas of triangles from their squared sides, times four."""
    total = squared.sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(total**2 - 2.0 * (squared**2).sum(axis=1), 0.0)))


def _amid(
    fabric: Fabric, chosen: Int[np.ndarray, " n"], away: Float[np.ndarray, "n coordinates"]
) -> tuple[Bool[np.ndarray, " n"], Vertices]:
    """Vertices after steps along their tangent planes, and which of them were found."""
    setting, store, d = fabric.setting, fabric.vertices, fabric.dimension
    rows = store.rows[chosen]
    step = np.einsum("ndc,nc->nd", rows, away)
    dz, dp = split_step(setting, np.einsum("nd,ndf->nf", step, store.frame[chosen]))
    z, p = store.z[chosen] + dz, store.p[chosen] + dp
    span = np.tile(np.eye(d), (len(chosen), 1, 1))
    aim = Aim(setting, False, False, span, embed(setting, z, p), rows)
    pinned = corrected(aim, z, p, np.linalg.norm(step, axis=1))
    free, found = pinned.p[:, setting.free], pinned.found
    found &= ((free >= fabric.box[0]) & (free <= fabric.box[1])).all(axis=1)
    index = store.index[chosen]
    found[found] = setting.structure.index(pinned.z[found], pinned.p[found]) == index[found]
    states = pinned.z[found], pinned.p[found]
    count = int(found.sum())
    others = index[found], np.full(count, -1)
    return found, vertices_of(setting, states, np.full(count, REFINED), others, rows[found])

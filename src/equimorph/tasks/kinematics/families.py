"""All states of a set at which fewer descriptors than free parameters take given values."""

from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold import Level, level_set
from equimorph.manifold.topology import pieces
from equimorph.structures import States
from equimorph.tasks.kinematics.aiming import aimed
from equimorph.tasks.kinematics.prediction import Predictor
from equimorph.tasks.optimising.plane import Spots

NEAR = 1.0
"""Farthest way from the prediction, in lengths of the facet, of a state that belongs to it."""


def family(known: Predictor, wanted: Float[np.ndarray, " k"]) -> Level:
    """Level set of one descriptor, or of two over three parameters: curves.

    Of two, curves run through the facets (triangles) of the cells on which both take their values;
    `lost` counts facets and cells where the curve was not found.
    """
    if len(wanted) == 1:
        return level_set(known.eset, known.descriptors[0], float(wanted[0]))
    facets, share = _crossed(known, wanted)
    states, found = _exact(known, facets, share, wanted)
    links, broken = _links(known, facets, found)
    lost = int(np.sum(~found)) + broken
    return Level(states, tuple(pieces(links)) if len(links) else (), lost)


def _crossed(
    known: Predictor, wanted: Float[np.ndarray, " k"]
) -> tuple[Int[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Triangles on which the linear interpolation takes the values, and where."""
    cells = np.sort(known.eset.cells, axis=1)
    triples = np.concatenate([cells[:, list(keep)] for keep in combinations(range(4), 3)])
    triples = np.unique(triples, axis=0)
    corners = known.values[triples]
    near = ((corners.min(axis=1) <= wanted) & (wanted <= corners.max(axis=1))).all(axis=1)
    triples, corners = triples[near], corners[near]
    sides = corners[:, 1:] - corners[:, :1]
    regular = np.abs(np.linalg.det(sides)) > 1e-14 * np.abs(sides).max(axis=(1, 2)) ** 2
    triples, corners, sides = triples[regular], corners[regular], sides[regular]
    gap = (wanted - corners[:, 0])[:, :, None]
    inner = np.linalg.solve(np.swapaxes(sides, 1, 2), gap)[:, :, 0]
    share = np.concatenate([1.0 - inner.sum(axis=1, keepdims=True), inner], axis=1)
    inside = share.min(axis=1) >= 0.0
    return triples[inside], share[inside]


def _exact(
    known: Predictor,
    facets: Int[np.ndarray, "n 3"],
    share: Float[np.ndarray, "n 3"],
    wanted: Float[np.ndarray, " k"],
) -> tuple[States, Bool[np.ndarray, " n"]]:
    """Exact states near the predictions, and which of them were found."""
    eset = known.eset
    z = np.einsum("ck,cki->ci", share, eset.points.z[facets])
    p = np.einsum("ck,cki->ci", share, eset.points.p[facets])
    cells = np.sort(eset.cells, axis=1)
    owner: dict[tuple[int, ...], int] = {}
    for keep in combinations(range(4), 3):
        owner.update(zip(map(tuple, cells[:, list(keep)].tolist()), range(len(cells)), strict=True))
    own = np.array([owner[tuple(facet)] for facet in facets.tolist()], int)
    guess = Spots(z, p, known.planes(own))
    many = np.tile(wanted, (len(facets), 1))
    z, p, found = aimed(known.setting, guess, known.descriptors, many)
    n, mass = eset.structure.unknowns, eset.structure.mass
    side = eset.points.z[facets[:, 0]] - eset.points.z[facets[:, 1]]
    moved = np.sqrt((z - guess.z)[:, :n] ** 2 @ mass)
    found &= moved <= NEAR * (1e-3 + np.sqrt(side[:, :n] ** 2 @ mass))
    return States(eset.structure, z, p), found


def _links(
    known: Predictor, facets: Int[np.ndarray, "n 3"], found: Bool[np.ndarray, " n"]
) -> tuple[Int[np.ndarray, "m 2"], int]:
    """Pairs of found facets of one cell, and how many cells are in doubt."""
    number = {tuple(facet): k for k, facet in enumerate(facets.tolist()) if found[k]}
    links, broken = [], 0
    for cell in np.sort(known.eset.cells, axis=1).tolist():
        ends = [number[key] for key in combinations(cell, 3) if key in number]
        if len(ends) == 2:
            links.append(ends)
        elif ends:
            broken += 1
    return np.array(links, int).reshape(-1, 2), broken

"""States inside triangles around which two sheets change places.

So they do around an elliptic umbilic, where two eigenvalues of F_z vanish at once, and around the
narrow tube of folds through it, with three edges, which closes inside triangles of any size: in the
normal form ``x³/3 − x y² + c (x² + y²)/2 − a x − b y`` it is c² wide. In its middle both
eigenvalues are equal, and there lies a state that the edges of the triangle do not see.

See docs/decisions.md, "Sheets that change places have a state between them".
"""

from collections.abc import Iterator

import numpy as np

from equimorph.arrays import Some
from equimorph.equilibria.point_conditions import EqualEigenvalues
from equimorph.equilibria.settle import Guards, settle
from equimorph.manifold.geometry.exact_points import REACH, STEPS, middles
from equimorph.manifold.geometry.setting import principal_directions
from equimorph.manifold.geometry.simplices import plane_bases, shares_in
from equimorph.manifold.lifting.completeness import recover
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.structures import States
from equimorph.structures.metric import products_with

TWICE = 2
"""Ways around a triangle after which two sheets that change places come back."""


def lift_between(pairing: Pairing, triangles: Some) -> bool:
    """Put vertices below the states between sheets that change places; whether there are any."""
    mesh = pairing.mesh
    recover(pairing, states_between(pairing, triangles))
    return pairing.mesh is not mesh


def states_between(pairing: Pairing, triangles: Some) -> States:
    """States with two equal eigenvalues, inside triangles around which two sheets change places."""
    setting, store, mesh = pairing.setting, pairing.points, pairing.mesh
    structure = setting.structure
    pairs = [
        (triangle, own) for triangle in triangles.tolist() for own in _twisted(pairing, triangle)
    ]
    if not pairs:
        return States(structure, store.z[:0], store.p[:0])
    below = mesh.vertices[mesh.triangles[[triangle for triangle, _ in pairs]]]
    z, p, deviations = middles(setting, store, [own for _, own in pairs])
    # beside the middle both sheets are on opposite sides, in the plane of the eigenvectors
    along = principal_directions(deviations[:, :, : structure.unknowns], TWICE)
    span = plane_bases(below / setting.scales)
    directions = np.zeros((*span.shape[:2], p.shape[1]))
    directions[:, :, setting.free] = span * setting.scales
    around = np.linalg.norm(deviations, axis=2).max(axis=1)
    guards = Guards(**vars(STEPS), trust=REACH * around, within=setting.constraints)
    condition = EqualEigenvalues(products_with(structure, along))
    found = settle(structure, z, p, directions, (condition,), guards, frames=False)
    inside = shares_in(below, found.p[:, setting.free]).min(axis=1) > 0.0
    good = found.found & inside
    return States(structure, found.z[good], found.p[good])


def _twisted(pairing: Pairing, triangle: int) -> Iterator[list[int]]:
    """Points over the corners of a triangle on each two sheets that change places around it."""
    store, corner = pairing.points, pairing.mesh.triangles[triangle, 0]
    ways = {
        start: _around(pairing, triangle, start)
        for start in np.flatnonzero(store.vertex[: store.count] == corner).tolist()
    }
    for start, (*own, end) in ways.items():
        if start < end and end in ways and ways[end][-1] == start:
            yield [*own, *ways[end][:-1]]


def _around(pairing: Pairing, triangle: int, start: int) -> list[int]:
    """Points along the sides of a triangle, back to its first corner; up to where a sheet ends."""
    curves, vertex, way = pairing.curves, pairing.points.vertex, [start]
    corners = pairing.mesh.triangles[triangle]
    for side, corner in zip(
        pairing.mesh.sides[triangle].tolist(), np.roll(corners, -1), strict=True
    ):
        curve = pairing.ray(way[-1], side)
        end = int(curves.start[curve] + curves.end[curve]) - way[-1] if curve >= 0 else -1
        if curve < 0 or curves.end[curve] < 0 or vertex[end] != corner:
            break
        way.append(end)
    return way

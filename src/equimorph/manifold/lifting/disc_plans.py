"""How polygons over grid triangles will be cut."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from equimorph.manifold.geometry.points import CORNER, CROSSING, FOLD
from equimorph.manifold.geometry.simplices import plane_bases
from equimorph.manifold.lifting.loops import Polygon
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import MEETING, REGULAR, TURN, Chord

SINGULAR = {FOLD: TURN, CORNER: TURN, CROSSING: MEETING}
"""What points of some kinds are to `cutting`; those of all other kinds are regular."""


@dataclass
class Plan:
    """How a polygon will be cut: its points and chords, once extra points are found.

    sides: of the grid triangle, on which each point lies, one bit each; extra points inside it lie
    on none. kinds: of the points, as in `Points`. sheet: number of the polygon.
    """

    polygon: Polygon
    points: list[int]
    sides: dict[int, int]
    kinds: dict[int, int]
    chords: list[Chord] = field(default_factory=list)
    middle: dict[Chord, int] = field(default_factory=dict)
    sheet: int = 0

    def singular(self, point: int) -> int:
        """Return what a point of the polygon is to `cutting`."""
        return SINGULAR.get(self.kinds[point], REGULAR)

    def those(self, singular: int) -> list[int]:
        """Singular points of a sort."""
        return [point for point in self.points if self.singular(point) == singular]

    def append(self, point: int, kind: int) -> None:
        """Close the polygon through an extra point."""
        self.points.append(point)
        self.kinds[point] = kind

    def on(self, points: Sequence[int]) -> list[int]:
        """Sides on which points lie; the ends of a chord with a point on it count as on one."""
        sides = dict(self.sides)
        for k, chord in enumerate(self.middle):
            for end in chord:
                sides[end] = sides.get(end, 0) | 8 << k
        return [sides.get(point, 0) for point in points]


def chord_of(a: int, b: int) -> Chord:
    """Chord between two points, in either order."""
    return (a, b) if a < b else (b, a)


def planes(pairing: Pairing, triangles: list[int]) -> Float[np.ndarray, "n 2 d"]:
    """Orthonormal bases of the planes of grid triangles, in scaled parameters."""
    mesh = pairing.mesh
    return plane_bases(mesh.vertices[mesh.triangles[triangles]] / pairing.setting.scales)

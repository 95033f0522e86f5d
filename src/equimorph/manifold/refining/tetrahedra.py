"""How good tetrahedra are: their dihedral angles, and whether they are upright.

Dihedral angles are measured in the embedding. A tetrahedron must look the same way as those around
it in the tangent spaces at its corners, and project as its index demands.
"""

from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.marked_complex import Fabric, squared_sides

POOR = np.radians(18.0)
"""Tetrahedra with a smaller dihedral angle are to be bettered, if that can be done."""
OVERTURNED = 0.1
"""What the angle of a tetrahedron counts that projects against its index."""
AT_ONCE = 4096

Tetrahedra = Int[np.ndarray, "T 4"]
Values = Float[np.ndarray, " T"]


def smallest_angles(squared: Float[np.ndarray, "T 6"]) -> Values:
    """Smallest dihedral angles of tetrahedra with squared sides 01, 02, 03, 12, 13, 23.

    From the products of the gradients of the barycentric coordinates, which are cofactors of the
    products of the sides from corner 0.
    """
    a, b, c, ab, ac, bc = squared.T
    x, y, z = 0.5 * (a + b - ab), 0.5 * (a + c - ac), 0.5 * (b + c - bc)
    # gradients 1, 2, 3; that of corner 0 is minus their sum
    products = {
        (1, 1): b * c - z * z, (2, 2): a * c - y * y, (3, 3): a * b - x * x,
        (1, 2): y * z - x * c, (1, 3): x * z - y * b, (2, 3): x * y - z * a,
    }  # fmt: skip
    for k in (1, 2, 3):
        own = (products[min(k, other), max(k, other)] for other in (1, 2, 3))
        products[0, k] = -np.asarray(sum(own))
    products[0, 0] = -(products[0, 1] + products[0, 2] + products[0, 3])
    size = [1.0 / np.sqrt(np.maximum(products[k, k], 1e-300)) for k in range(4)]
    largest = np.full(len(squared), -1.0)
    for i, j in combinations(range(4), 2):
        np.maximum(largest, -products[i, j] * size[i] * size[j], out=largest)
    return np.asarray(np.arccos(np.clip(largest, -1.0, 1.0)))


def dihedrals(place: Float[np.ndarray, "V coordinates"], cells: Tetrahedra) -> Values:
    """Smallest dihedral angle of each of some tetrahedra."""
    return smallest_angles(squared_sides(place, cells))


def smallest_dihedral(fabric: Fabric) -> float:
    """Smallest dihedral angle of all tetrahedra, in degrees; 0 where there are none."""
    if fabric.dimension < 3:
        return 0.0
    return float(np.degrees(smallest_angles(fabric.squared).min(initial=np.pi)))


def worth(quality: Values, starts: Int[np.ndarray, " groups"]) -> Float[np.ndarray, " groups"]:
    """What groups of tetrahedra in a row are worth: as much as the worst of each.

    Where some are backward, their qualities add up.
    """
    worst = np.minimum.reduceat(quality, starts)
    return np.where(worst < 0.0, np.add.reduceat(np.minimum(quality, 0.0), starts), worst)


def beside(cells: Tetrahedra, near: Bool[np.ndarray, " V"]) -> Bool[np.ndarray, " V"]:
    """Which vertices are corners of cells with some corner near."""
    out = np.zeros_like(near)
    out[cells[near[cells].any(axis=1)]] = True
    return out


class Judge:
    """Tells how good tetrahedra between the vertices of a fabric are, there or not.

    `upright`: the sense, in the tangent space at each vertex, of most of what is around it, by
    volume.
    """

    def __init__(self, fabric: Fabric, upright: Float[np.ndarray, " V"] | None = None) -> None:
        store = fabric.vertices
        self.place, self._rows = store.place, store.rows
        if upright is None:
            cells = fabric.cells
            seen = self._seen(cells)
            around = np.bincount(cells.ravel(), weights=seen.ravel(), minlength=len(store))
            upright = np.where(around < 0.0, -1.0, 1.0)
        self.upright = upright

    def qualities(self, cells: Tetrahedra, index: Int[np.ndarray, " T"]) -> Values:
        """Smallest angles; less where tetrahedra are overturned, much less where backward.

        By π for each corner that sees a tetrahedron backward.
        """
        angle = dihedrals(self.place, cells)
        against = self.against(cells, index)
        backward = (self._seen(cells) * self.upright[cells] <= 0.0).sum(axis=1)
        return np.asarray(np.where(against, OVERTURNED, 1.0) * angle - np.pi * backward)

    def of(self, fabric: Fabric, near: Bool[np.ndarray, " V"]) -> Values:
        """Qualities of the cells of a fabric with some corner near; of others the angles alone."""
        out = smallest_angles(fabric.squared)
        own = near[fabric.cells].any(axis=1)
        out[own] = self.qualities(fabric.cells[own], fabric.cell_index[own])
        return out

    def against(self, cells: Tetrahedra, index: Int[np.ndarray, " T"]) -> Bool[np.ndarray, " T"]:
        """Which tetrahedra project against their index."""
        flat = self.place[:, -3:]
        sides = flat[cells[:, 1:]] - flat[cells[:, :1]]
        return np.asarray(determinants(sides) * np.where(index % 2 == 0, 1.0, -1.0) <= 0.0)

    def flat(
        self, vertex: Int[np.ndarray, " n"], others: Int[np.ndarray, "n m"]
    ) -> Float[np.ndarray, "n m 3"]:
        """Others as seen from vertices in the tangent spaces there, so that right is right."""
        away = self.place[others] - self.place[vertex][:, None]
        out = away @ np.swapaxes(self._rows[vertex], 1, 2)
        out[:, :, 0] *= self.upright[vertex][:, None]
        return np.asarray(out)

    def _seen(self, cells: Tetrahedra) -> Float[np.ndarray, "T 4"]:
        """Volumes, times six, of tetrahedra in the tangent spaces at their corners."""
        out = np.empty(cells.shape)
        for first in range(0, len(cells), AT_ONCE):
            own = cells[first : first + AT_ONCE]
            sides = self.place[own[:, 1:]] - self.place[own[:, :1]]
            for corner in range(4):
                flat = sides @ np.swapaxes(self._rows[own[:, corner]], 1, 2)
                out[first : first + AT_ONCE, corner] = determinants(flat)
        return out


def determinants(sides: Float[np.ndarray, "T 3 3"]) -> Values:
    """Determinants of three vectors each."""
    a, b, c = sides[:, 0], sides[:, 1], sides[:, 2]
    return np.asarray(
        a[:, 0] * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1])
        + a[:, 1] * (b[:, 2] * c[:, 0] - b[:, 0] * c[:, 2])
        + a[:, 2] * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    )

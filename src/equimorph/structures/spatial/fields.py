"""Fields along a rod in space: rotations, places, strains, and where they are largest."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.quaternions import RIGHT, matrices

POLISHING = 4
"""Newton iterations towards the largest curvature of an element."""
STATIONS = 5
"""Places a node at which curvatures are compared first."""


@dataclass(frozen=True, eq=False)
class Fields:
    """Fields of states at arclengths.

    Attributes
    ----------
    rotations
        Unit quaternions of the cross-sections.
    places
        Coordinates.
    strains
        Twist, and curvatures about n and b.
    """

    rotations: Float[np.ndarray, "lanes points 4"]
    places: Float[np.ndarray, "lanes points 3"]
    strains: Float[np.ndarray, "lanes points 3"]

    @property
    def frames(self) -> Float[np.ndarray, "lanes points 3 3"]:
        """Rotation matrices, with the columns t, n, b."""
        return matrices(self.rotations)


class SpatialFields:
    """Fields of the states of one rod.

    Strains follow from the moment at the left end of each element, which converges with twice the
    degree, and from the balance M' = r' × f inside it.
    """

    def __init__(self, mechanics: SpatialMechanics) -> None:
        self.mechanics, self.mesh, self.model = mechanics, mechanics.mesh, mechanics.model

    @cached_property
    def _sums(self) -> Float[np.ndarray, "elements order order"]:
        """Integrals from the left end of each element to its nodes."""
        return np.asarray(self.mesh.reference.integral * self.mesh.lengths[:, None, None])

    def nodal(
        self, z: Lanes, p: Parameters
    ) -> tuple[
        Float[np.ndarray, "lanes elements order 4"],
        Float[np.ndarray, "lanes elements order 3"],
        Float[np.ndarray, "lanes elements order 3"],
    ]:
        """Rotations, places and strains at the nodes of every element."""
        of, model, mesh = self.mechanics, self.model, self.mesh
        q, y = of.rotations(z, p)[None], of.scalars(z, p)[None]
        turned, moved, strain = of.element_strains(q)
        weights = mesh.element_weights[..., None]
        moments = of.section_moments(strain, y)[0]
        moment = 2.0 * weights * moments
        pull, axial = of.section_forces(q, y)
        stretch = of.stretches(axial, y)
        local = q[0][:, mesh.element_nodes]
        frames = matrices(local)
        slope = np.einsum("leick,leik->leic", frames, stretch[0])
        force = np.einsum("ls,seic->leic", y[0], model.force)
        # couple of each element on its left end, from the gradient of its energy
        first = np.einsum("ei,leik,leika->lea", of.slopes[:, :, 0], moment, turned[0])
        first -= np.einsum("lek,kab,leb->lea", moment[:, :, 0], RIGHT, moved[0][:, :, 0])
        pulled = (weights * stretch[0])[:, :, 0]
        first += np.einsum("lek,leka->lea", pulled, pull[0][:, :, 0])
        left = -0.5 * np.einsum("lea,leka->lek", first, turned[0][:, :, 0])
        left = np.einsum("leck,lek->lec", frames[:, :, 0], left)
        turning = np.cross(slope, force)
        inner = left[:, :, None] + np.einsum("eij,lejc->leic", self._sums, turning)
        body = np.einsum("leick,leic->leik", frames, inner)
        stiff = np.repeat(model.stiffness[None], len(z), axis=0)
        stiff[..., 0] += np.einsum("ls,sei->lei", y[0], model.torsion)
        strains = (body + np.einsum("ls,seik->leik", y[0], model.moment)) / stiff
        return local, self._places(slope, y[0]), strains

    def _places(
        self, slope: Float[np.ndarray, "lanes elements order 3"], y: Lanes
    ) -> Float[np.ndarray, "lanes elements order 3"]:
        """Coordinates at the nodes of every element."""
        inside = np.einsum("eij,lejc->leic", self._sums, slope)
        ends = np.cumsum(inside[:, :, -1], axis=1)
        out = inside + (ends - inside[:, :, -1])[:, :, None]
        origin = np.einsum("cs,ls->lc", self.model.origin, y)
        start = np.where(self.model.from_start, 0.0, ends[:, -1])
        return np.asarray(out + (origin - start)[:, None, None])

    def at(self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]) -> Fields:
        """Fields at arclengths."""
        rotations, places, strains = self.nodal(z, p)
        element, t = self.mesh.locate(s)
        basis = legendre.legvander(2.0 * t - 1.0, self.mesh.degree)
        local = basis @ self.mesh.reference.to_legendre

        def there(nodal: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("pi,lpic->lpc", local, nodal[:, element]))

        q = there(rotations)
        q /= np.linalg.norm(q, axis=-1, keepdims=True)
        return Fields(q, there(places), there(strains))

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """Largest bending curvature √(κ_n² + κ_b²), ends included, and where it is."""
        bends = self.nodal(z, p)[2][..., 1:]
        to_legendre, degree = self.mesh.reference.to_legendre, self.mesh.degree
        points = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, STATIONS * degree))
        table = legendre.legvander(2.0 * points - 1.0, degree) @ to_legendre
        square = (np.einsum("ti,leik->letk", table, bends) ** 2).sum(axis=-1)
        lanes = np.arange(len(z))
        square = np.where(np.isfinite(square), square, -1.0)
        element, at = np.divmod(
            square.reshape(len(z), self.mesh.elements * len(points)).argmax(axis=1), len(points)
        )
        coefficients = np.einsum("ci,lik->lck", to_legendre, bends[lanes, element])
        t = points[at]
        best, place = square[lanes, element, at], t.copy()
        width = np.pi / (STATIONS * degree)
        for _ in range(POLISHING):
            value, first, second = (_derivative(coefficients, t, k) for k in range(3))
            slope = (value * first).sum(axis=-1)
            bend = (value * second + first**2).sum(axis=-1)
            with np.errstate(divide="ignore", invalid="ignore"):
                move = np.where(bend < 0.0, -slope / bend, 0.0)
            t = np.clip(t + np.clip(np.nan_to_num(move), -width, width), 0.0, 1.0)
            now = (_derivative(coefficients, t, 0) ** 2).sum(axis=-1)
            place, best = np.where(now > best, t, place), np.maximum(now, best)
        best = np.where(best < 0.0, np.nan, best)
        return np.sqrt(best), self.mesh.breaks[element] + self.mesh.lengths[element] * place


def _derivative(
    coefficients: Float[np.ndarray, "lanes order 2"], t: Values, order: int
) -> Float[np.ndarray, "lanes 2"]:
    """k-th derivative by t of Legendre series in 2t − 1, one t a lane."""
    degree = coefficients.shape[1] - 1
    rows = [2.0**order * np.append(legendre.legder(row, order), np.zeros(order))
            for row in np.eye(degree + 1)]  # fmt: skip
    table = legendre.legvander(2.0 * t - 1.0, degree) @ np.stack(rows)[:, : degree + 1].T
    return np.asarray(np.einsum("lc,lck->lk", table, coefficients))

"""Fields along a rod in space: rotations, places, strains, and where they are largest."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.spatial.field_kernels import fields_lanes
from equimorph.structures.spatial.mechanics import SpatialMechanics, field_tables, pairs_of
from equimorph.structures.spatial.quaternions import matrices

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


@dataclass(frozen=True, eq=False)
class NodalFields:
    """Fields at the nodes of every element; see `Fields`."""

    rotations: Float[np.ndarray, "lanes elements order 4"]
    places: Float[np.ndarray, "lanes elements order 3"]
    strains: Float[np.ndarray, "lanes elements order 3"]
    largest: Values
    place: Values
    """Largest bending curvature √(κ_n² + κ_b²), and its arclength."""


class SpatialFields:
    """Fields of the states of one rod.

    Strains follow from the moment at the left end of each element, which converges with twice the
    degree, and from the balance M' = r' × f inside it.
    """

    def __init__(self, mechanics: SpatialMechanics) -> None:
        self.mechanics, self.mesh, self.model = mechanics, mechanics.mesh, mechanics.model

    @cached_property
    def _tables(self) -> tuple[np.ndarray, ...]:
        """What `field_kernels.fields_lanes` shares among lanes."""
        mesh, degree = self.mesh, self.mesh.degree
        to_legendre = mesh.reference.to_legendre
        stations = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, STATIONS * degree))
        values = legendre.legvander(2.0 * stations - 1.0, degree) @ to_legendre
        tables = (
            field_tables(self.model),
            (
                mesh.reference.integral * mesh.lengths[:, None, None], self.model.origin,
                np.array(self.model.from_start), np.column_stack([stations, values]), to_legendre,
                mesh.breaks,
            ),
        )  # fmt: skip
        return tuple(np.ascontiguousarray(each) for table in tables for each in table)

    def nodal(self, z: Lanes, p: Parameters) -> NodalFields:
        """Fields at the nodes of every element, and the largest curvature."""
        self.mechanics.check_widths((z, p))
        lanes, elements, order = len(z), self.mesh.elements, self.mesh.degree + 1
        rotations = np.empty((lanes, len(self.mesh.nodes), 4))
        places, strains = np.empty((2, lanes, elements, order, 3))
        largest, place = np.empty((2, lanes))
        outputs = [rotations, places, strains, largest, place]
        inputs = [np.ascontiguousarray(z), np.ascontiguousarray(p)]
        over_lanes(fields_lanes, (pairs_of(1)[0], *self._tables), inputs, outputs)
        local = rotations[:, self.mesh.element_nodes]
        return NodalFields(local, places, strains, largest, place)

    def at(self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]) -> Fields:
        """Fields at arclengths."""
        nodal = self.nodal(z, p)
        element, t = self.mesh.locate(s)
        basis = legendre.legvander(2.0 * t - 1.0, self.mesh.degree)
        local = basis @ self.mesh.reference.to_legendre

        def there(field: np.ndarray) -> np.ndarray:
            return np.asarray(np.matmul(local[:, None], field[:, element])[:, :, 0])

        q = there(nodal.rotations)
        q /= np.linalg.norm(q, axis=-1, keepdims=True)
        return Fields(q, there(nodal.places), there(nodal.strains))

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """Largest bending curvature √(κ_n² + κ_b²), ends included, and where it is."""
        nodal = self.nodal(z, p)
        return nodal.largest, nodal.place

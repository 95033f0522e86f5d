"""The part of the contract of structures that says how their masses move."""

from abc import ABC
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Velocity
from equimorph.errors import MissingError
from equimorph.structures.equations import Equations
from equimorph.structures.material_points import MaterialPoints

Velocities = Float[np.ndarray, "lanes k unknowns"]
Product = Callable[[Velocities], Velocities]
INERTIA_DIFFERENCE = 1e-5
"""Step of the unknowns in differences of the mass matrix."""


class Inertial(Equations, ABC):
    """Masses of a structure, which has none unless it says so."""

    kind: ClassVar[str]

    @property
    def time_unit(self) -> str:
        """Unit of time that `inertia` goes with; "time" where the structure's units are any."""
        return "time"

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Physical mass matrix M = JᵀWJ: kinetic energy ½ u̇ᵀMu̇ while the parameters rest.

        J is the derivative of the places of all material points by the unknowns, W their mass. M
        is in units of `energy` times `time_unit` squared; it may be singular where unknowns move no
        mass. It is not the metric `mass`.

        Raises
        ------
        MissingError
            If the structure has no mass.
        """
        del z, p
        raise MissingError(
            f"`structure` must have a mass; this {self.kind} has none. {self.massless}".rstrip()
        )

    @property
    def sprung(self) -> MaterialPoints | None:
        """Material points on springs whose places the unknowns leave free; None: there are none."""
        return None

    @property
    def massless(self) -> str:
        """How this kind of structure is given its mass, in one sentence; empty if it cannot be."""
        return ""

    def inertia_product(self, z: Lanes, p: Parameters) -> Product:
        """Function that multiplies k velocities in each lane by M; see `inertia`."""
        mass = self.inertia(z, p)
        return lambda v: np.asarray(v @ mass)

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ(u)[u̇, u̇] in ``d/dt ∂T/∂u̇ − ∂T/∂u = M ü + Γ``, while the parameters rest.

        Here by central differences of M along all unknowns; structures whose J is at hand give
        ``JᵀW D²x[u̇, u̇]``, with the places x of their material points.
        """
        n, step = self.unknowns, INERTIA_DIFFERENCE
        twice = np.empty_like(velocity)
        for i in range(n):
            shift = np.zeros_like(z)
            shift[:, i] = step
            change = self.inertia(z + shift, p) - self.inertia(z - shift, p)
            twice[:, i] = np.einsum("li,lij,lj->l", velocity, change, velocity)
        moved = np.zeros_like(z)
        moved[:, :n] = step * velocity
        along = self.inertia(z + moved, p) - self.inertia(z - moved, p)
        return np.asarray((np.einsum("lij,lj->li", along, velocity) - 0.5 * twice) / (2.0 * step))

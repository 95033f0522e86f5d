"""Common to the models of planar frames and of frames in space: numbers, lengths and loads."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.model.units import STANDARD_GRAVITY
from equimorph.structures.frame.any_network import AnyFrameNetwork
from equimorph.structures.frame.patterns import Patterns, patterns
from equimorph.structures.rod.discretisation import Mesh, reference_element
from equimorph.structures.unit_system import UnitSystem

Model = TypeVar("Model", bound="AnyFrameModel")


@dataclass(frozen=True, eq=False)
class AnyFrameModel(ABC):
    """Numbering of nodes and *scalars* y = (multipliers, p, 1), lengths, and loads."""

    network: AnyFrameNetwork
    """The frame as its user sees it."""
    patterns: Patterns
    """What its parameters do, non-dimensional."""
    mesh: Mesh
    """Elements of a piece of a member, of length 1."""
    length: float
    bending: float
    """Units of length and of bending stiffness, in those of the user's `system`."""
    system: UnitSystem

    @classmethod
    def of(
        cls: type[Model],
        network: AnyFrameNetwork,
        effects: tuple[dict[str, Any], dict[str, Any]],
        resolution: tuple[int, int],
        system: UnitSystem,
    ) -> Model:
        """Model of a network, in units of the mean length of its pieces and the mean stiffness.

        effects: of the actuators and of the loads, by name; resolution: elements, and their degree.
        """
        length, bending = float(network.lengths.mean()), network.bending
        mesh = Mesh(np.linspace(0.0, 1.0, resolution[0] + 1), reference_element(resolution[1]))
        found = patterns(network, *effects).scaled(length, bending)
        return cls(network, found, mesh, length, bending, system)

    @property
    @abstractmethod
    def multipliers(self) -> int:
        """Number of forces that balance without loads."""

    @property
    def force(self) -> float:
        """Unit of force."""
        return self.bending / self.length**2

    @property
    def energy(self) -> float:
        """Unit of energy and of couples."""
        return self.bending / self.length

    @cached_property
    def masses(self) -> Float[np.ndarray, " pieces"] | None:
        """Masses of the pieces, in units of force·time²/length; None if one is not known."""
        made, system, found = self.network, self.system, []
        owner = np.array(made.members_of_pieces)
        for m, weight, length in zip(owner.tolist(), made.weights, made.lengths, strict=True):
            member = made.members[m]
            what = f"mass of member {member.name}"
            if member.mass is not None:
                share = length / made.lengths[owner == m].sum()
                found.append(share * system.mass(member.mass, what))
            elif weight > 0.0 and not system.plain:
                pull = float(weight * length) * system.si("force")
                found.append(system.mass(pull / STANDARD_GRAVITY, what))
            else:
                return None
        return np.array(found)

    @property
    def scalars(self) -> int:
        """Number of multipliers and parameters, and 1 for the constant."""
        return self.multipliers + self.patterns.count + 1

    @property
    def own(self) -> slice:
        """Parameters among the scalars."""
        return slice(self.multipliers, self.scalars - 1)

    @property
    @abstractmethod
    def piece_nodes(self) -> Int[np.ndarray, "pieces nodes"]:
        """Nodes along each piece, from start to end."""

    @cached_property
    def nodes(self) -> Int[np.ndarray, "elements order"]:
        """Nodes of each element of each piece."""
        return self.piece_nodes[:, self.mesh.element_nodes].reshape(-1, self.mesh.degree + 1)

    @cached_property
    def lengths(self) -> Float[np.ndarray, " pieces"]:
        """Lengths of the pieces."""
        return np.asarray(self.network.lengths / self.length)

    @cached_property
    def loads(self) -> Float[np.ndarray, "parameters joints space"]:
        """Forces on the joints; a line load reaches the end of its piece.

        The share of its start is what the cycles of the network decide.
        """
        found = self.patterns.forces.copy()
        for k, end in enumerate(self.network.ends[:, 1].tolist()):
            found[:, end] += self.patterns.lines[:, k] * self.lengths[k]
        return found

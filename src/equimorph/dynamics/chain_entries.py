"""How the entries of a mechanism and the unknowns of a structure correspond."""

from abc import ABC, abstractmethod

import numpy as np

from equimorph.arrays import Float
from equimorph.dynamics.linkage import Linkage
from equimorph.dynamics.mechanism import Mechanism, Vector
from equimorph.dynamics.plant import LinkagePlant, Simulation
from equimorph.structures import State, States, Structure


class Chained(ABC):
    """A structure as chains of links, and how their entries and its unknowns correspond."""

    structure: Structure
    linkage: Mechanism
    links: int
    """Links of each chain."""
    length: float
    energy: float
    time: float = 1.0
    """Length, energy and time of the chain in the structure's units."""

    @abstractmethod
    def entries(self, state: State) -> Vector:
        """Entries of the mechanism next to a state; prescribed ones are set later."""

    @abstractmethod
    def simulation(self, step: float, damping: float) -> Simulation:
        """The mechanism in MuJoCo."""

    @abstractmethod
    def places(self, states: States) -> Float[np.ndarray, "lanes members joints space"]:
        """Places at the ends of links, in the structure's unit of length."""

    @abstractmethod
    def unknowns(self, v: Vector) -> Float[np.ndarray, " size"]:
        """Unknowns of the structure; multipliers 0."""


class PlanarChained(Chained):
    """A planar structure as a linkage."""

    linkage: Linkage

    @abstractmethod
    def angles(self, state: State) -> Float[np.ndarray, "members links"]:
        """Angles at the middles of the links."""

    @abstractmethod
    def turns(self, state: State) -> Float[np.ndarray, " nodes"]:
        """Turns of the nodes."""

    @abstractmethod
    def node_places(self, state: State) -> Float[np.ndarray, "nodes 2"]:
        """Places of the nodes, in units of the linkage."""

    def entries(self, state: State) -> Vector:
        """Places of nodes along their axes, turns, angles and strains."""
        linkage = self.linkage
        v = np.zeros(linkage.size)
        places = self.node_places(state)
        v[: 2 * linkage.nodes] = np.einsum("nx,nax->na", places, linkage.supports.axes).ravel()
        v[linkage.turn_entries] = self.turns(state)
        v[linkage.angle_entries] = self.angles(state)
        joints = self.places(state.batch)[0] / self.length
        sizes = np.linalg.norm(np.diff(joints, axis=1), axis=2)
        stretch = np.isfinite(linkage.axial)
        v[linkage.strain_entries] = np.where(stretch, sizes / linkage.lengths - 1.0, 0.0)
        return v

    def simulation(self, step: float, damping: float) -> Simulation:
        """The linkage in MuJoCo."""
        return LinkagePlant(self.linkage, step, damping)

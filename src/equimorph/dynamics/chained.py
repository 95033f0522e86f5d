"""How the angles of a chain and the unknowns of a structure correspond."""

from abc import ABC, abstractmethod

import numpy as np

from equimorph.array_types import Float
from equimorph.dynamics.linkage import Linkage, Vector
from equimorph.structures import State, States, Structure


class Chained(ABC):
    """A structure as chains of links, and how their angles and its unknowns correspond."""

    structure: Structure
    linkage: Linkage
    length: float
    energy: float
    time: float = 1.0
    """Length, energy and time of the chain in the structure's units."""

    @abstractmethod
    def angles(self, state: State) -> Float[np.ndarray, "members links"]:
        """Angles at the middles of the links."""

    @abstractmethod
    def turns(self, state: State) -> Float[np.ndarray, " nodes"]:
        """Turns of the nodes."""

    @abstractmethod
    def node_places(self, state: State) -> Float[np.ndarray, "nodes 2"]:
        """Places of the nodes, in units of the linkage."""

    @abstractmethod
    def places(self, states: States) -> Float[np.ndarray, "lanes members joints 2"]:
        """Places at the ends of links, in the structure's unit of length."""

    @abstractmethod
    def unknowns(self, v: Vector) -> Float[np.ndarray, " size"]:
        """Unknowns of the structure; multipliers 0."""

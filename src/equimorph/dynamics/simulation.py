"""Mechanisms that move in MuJoCo."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from equimorph.array_types import Float
from equimorph.dynamics.mechanism import Mechanism, Settings, Vector
from equimorph.optional_packages import load_package


def mujoco_module() -> Any:
    """MuJoCo, which only a replay needs; see `load_package`."""
    otherwise = ', or choose simulator="own", which is not independent'
    return load_package("mujoco", "replay", "simulator", otherwise)


class Simulation(ABC):
    """A mechanism that moves in MuJoCo under settings that change in time."""

    linkage: Mechanism
    _y: Settings | None = None

    def __init__(self, text: str) -> None:
        self._mujoco = mujoco_module()
        self.model: Any = self._mujoco.MjModel.from_xml_string(text)
        self.data: Any = self._mujoco.MjData(self.model)

    @abstractmethod
    def start(self, v: Vector, y: Settings) -> None:
        """Place the mechanism at rest."""

    @abstractmethod
    def set(self, y: Settings) -> None:
        """Set the actuators and loads."""

    @abstractmethod
    def step(self) -> None:
        """One step in time."""

    @abstractmethod
    def entries(self, qpos: Float[np.ndarray, " joints"], y: Settings) -> Vector:
        """Entries of the mechanism; places of nodes that members carry are theirs."""

    @property
    def v(self) -> Vector:
        """Entries of the mechanism as it is."""
        assert self._y is not None
        return self.entries(self.data.qpos, self._y)

    @property
    @abstractmethod
    def kinetic(self) -> float:
        """Kinetic energy."""

    @property
    def closure(self) -> float:
        """Largest distance by which a loop is open, relative to the unit of length."""
        return float(np.abs(self.linkage.closure(self.v)).max(initial=0.0))

    @property
    def speed(self) -> float:
        """Largest rate of a joint."""
        return float(np.abs(self.data.qvel).max(initial=0.0))

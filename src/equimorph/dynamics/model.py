"""What a replay needs of a structure: its own statics, and a plant that moves in time."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float
from equimorph.dynamics.balance import FoldDelay
from equimorph.equilibria import settle, snap_landing
from equimorph.errors import InputError
from equimorph.structures import State, States, Structure

Row = Float[np.ndarray, " parameters"]
Motion = Callable[[float], Row]
"""All parameters by time."""
Points = Float[np.ndarray, "points space"]


class Plant(ABC):
    """A structure that moves in time."""

    @abstractmethod
    def set(self, p: Row) -> None:
        """Set the parameters."""

    @abstractmethod
    def step(self) -> None:
        """One step in time."""

    @property
    @abstractmethod
    def points(self) -> Points:
        """Places of its points, in the structure's unit of length."""

    @property
    def place(self) -> np.ndarray:
        """Where it is, as `points_at` takes it."""
        return self.points

    def points_at(self, place: np.ndarray) -> Points:
        """Places of its points where it was."""
        return np.asarray(place)

    @property
    @abstractmethod
    def speed(self) -> float:
        """Largest speed of an unknown of the plant."""

    @property
    @abstractmethod
    def closure(self) -> float:
        """Largest distance by which constraints are violated, in the unit of length."""

    @property
    @abstractmethod
    def energy(self) -> float:
        """Potential and kinetic energy, in the structure's unit."""

    @abstractmethod
    def equilibrium(self) -> Points | None:
        """Points of the stable equilibrium of the plant's own statics near where it is."""

    @abstractmethod
    def guess(self) -> Float[np.ndarray, " size"]:
        """Unknowns of the structure where the plant is."""


@dataclass(frozen=True, eq=False)
class Course:
    """Statics of the plant at the times of a motion, while they exist.

    points: at each time; nan after the fold; fold: its time, None without one, nan where the
    statics were lost for another reason; delay: normal form of the fold; last: points there.
    """

    points: Float[np.ndarray, "times points space"]
    fold: float | None = None
    delay: FoldDelay | None = None
    last: Points | None = None


class Model(ABC):
    """A structure as a simulator sees it."""

    structure: Structure
    simulator: str
    """Whose equations of motion it has; "own" are those of the library."""
    unit: float
    """Time T of the model in the unit of schedules."""
    chain: int = 0
    """Number of points that are joined to a line each; 0: all of them."""

    @abstractmethod
    def reference(self, states: States) -> Float[np.ndarray, "lanes points space"]:
        """Places of the same points in equilibria of the library."""

    @abstractmethod
    def plant(self, start: State, step: float, damping: float) -> Plant:
        """The structure at rest at a state; step in units of T, damping too."""

    @abstractmethod
    def statics(
        self, start: State, motion: Motion, times: Float[np.ndarray, " times"], damping: float
    ) -> Course:
        """Its own equilibria along a motion."""


def landing(structure: Structure, z: Float[np.ndarray, " size"], p: Row) -> State | None:
    """Stable state of the library near unknowns, multipliers found for them; None if there is none.

    Where Newton's method does not lead there, the gradient flow does.
    """
    n = structure.unknowns
    many = np.ones((1 + structure.constraints, 1))
    pulled = many * z
    pulled[:, n:] = np.eye(len(many), len(many) - 1, -1)
    rest, *others = structure.residual(pulled, many * p)[:, :n]
    z = pulled[0]
    if others:
        z[n:] = np.linalg.lstsq((np.array(others) - rest).T, -rest, rcond=None)[0]
    return stable_near(structure, z, p) or flow_landing(State(structure, z, p))


def stable_near(structure: Structure, z: Float[np.ndarray, " size"], p: Row) -> State | None:
    """The stable equilibrium to which Newton's method leads; None if there is none."""
    found = settle(structure, z[None], p[None])
    state = State(structure, found.z[0], p)
    return state if found.found[0] and state.index == 0 else None


def flow_landing(state: State) -> State | None:
    """Where the gradient flow leads from a configuration that is no equilibrium."""
    try:
        ways = snap_landing(state)
    except InputError:
        return None
    return next((way.state for way in ways if way.landed), None)

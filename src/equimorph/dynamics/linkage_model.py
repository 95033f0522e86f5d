"""Rods and frames in MuJoCo, with the statics of their chains."""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Float
from equimorph.dynamics.balance import Balance, Quasistatics, balance, fold_delay, follow
from equimorph.dynamics.mechanism import Pulls, Settings, Vector
from equimorph.dynamics.model import Course, Model, Motion, Plant, Points, Row
from equimorph.dynamics.plant import Chained, Simulation
from equimorph.structures import State, States

ONE = np.ones(1)


class LinkageModel(Model):
    """Chains of links, simulated by MuJoCo."""

    simulator = "mujoco"

    def __init__(self, chained: Chained) -> None:
        self._chained, self.linkage = chained, chained.linkage
        self.structure, self.unit = chained.structure, chained.time
        self.chain = chained.links + 1

    def settings(self, p: Row) -> Settings:
        """Parameters and 1."""
        return np.concatenate([p, ONE])

    def balance(self, state: State) -> Balance | None:
        """The chain's own equilibrium next to a state."""
        y = self.settings(state.p)
        v = self.linkage.prescribe(self._chained.entries(state), y)
        return balance(self.linkage, v, self.multipliers(v, y), y)

    def multipliers(self, v: Vector, y: Settings) -> Pulls:
        """Those with which the forces balance best."""
        linkage = self.linkage
        none = np.zeros(linkage.closures)
        free = np.flatnonzero(linkage.free)
        matrix = linkage.jacobian(v, none, y)[free][:, linkage.size :]
        return np.asarray(
            np.linalg.lstsq(matrix, -linkage.residual(v, none, y)[free], rcond=None)[0]
        )

    def points(self, v: Vector) -> Points:
        """Places of the joints, in the structure's unit of length."""
        places = self.linkage.places(v)
        return np.asarray(places.reshape(-1, places.shape[2]) * self._chained.length)

    def reference(self, states: States) -> Float[np.ndarray, "lanes points space"]:
        """Places at the same arclengths."""
        places = self._chained.places(states)
        return places.reshape(len(states), -1, places.shape[3])

    def energy(self, v: Vector, y: Settings) -> float:
        """Potential energy in the structure's unit."""
        return self.linkage.potential(v, y) * self._chained.energy

    def unknowns(self, v: Vector) -> Float[np.ndarray, " size"]:
        """Unknowns of the structure in a configuration of the chain."""
        return self._chained.unknowns(v)

    @property
    def energy_unit(self) -> float:
        """Value of one unit of the chain's energy."""
        return self._chained.energy

    def plant(self, start: State, step: float, damping: float) -> Plant:
        """The chain in MuJoCo, at rest at its own equilibrium."""
        return MovingLinkage(self, self.begin(start), self._chained.simulation(step, damping))

    def begin(self, start: State) -> Balance:
        """The chain's equilibrium at the start.

        Raises `ArithmeticError` if there is none: the start is too close to a fold for this number
        of links.
        """
        found = self.balance(start)
        if found is None or found.least <= 0.0:
            raise ArithmeticError("the chain of links has no stable equilibrium near the start")
        return found

    def quasistatics(
        self, start: State, motion: Motion, times: Float[np.ndarray, " times"]
    ) -> Quasistatics:
        """The chain's equilibria along a motion."""
        return follow(self.begin(start), lambda t: self.settings(motion(t)), times)

    def statics(
        self, start: State, motion: Motion, times: Float[np.ndarray, " times"], damping: float
    ) -> Course:
        """The chain's equilibria, and the lateness at the fold where they end."""
        found = self.quasistatics(start, motion, times)
        last, delay = self.points(found.last.v), None
        points = np.full((len(times), *last.shape), np.nan)
        for k, each in enumerate(found.balances):
            points[k] = self.points(each.v)
        if found.fold is None:
            return Course(points)
        if np.isfinite(found.fold):
            delay = fold_delay(
                found.last, found.fold, lambda t: self.settings(motion(t)), damping, self.unit
            )
            delay = replace(delay, reach=delay.reach * self._chained.length)
        return Course(points, found.fold, delay, last)


class MovingLinkage(Plant):
    """A chain of links in MuJoCo."""

    def __init__(self, model: LinkageModel, start: Balance, simulation: Simulation) -> None:
        self._model, self._plant = model, simulation
        self._plant.start(start.v, start.y)
        self._y = start.y

    def set(self, p: Row) -> None:
        """Set the parameters."""
        self._y = self._model.settings(p)
        self._plant.set(self._y)

    def step(self) -> None:
        """One step in time."""
        self._plant.step()

    @property
    def points(self) -> Points:
        """Places of the joints."""
        return self._model.points(self._plant.v)

    @property
    def place(self) -> np.ndarray:
        """Joints of the simulation and settings."""
        return np.concatenate([self._plant.data.qpos, self._y])

    def points_at(self, place: np.ndarray) -> Points:
        """Places of the joints where it was."""
        return self._model.points(self._plant.entries(*np.split(place, [-len(self._y)])))

    @property
    def speed(self) -> float:
        """Largest rate of a joint."""
        return self._plant.speed

    @property
    def closure(self) -> float:
        """Largest gap at a closed loop."""
        return self._plant.closure

    @property
    def energy(self) -> float:
        """Potential and kinetic energy."""
        potential = self._model.energy(self._plant.v, self._y)
        return potential + self._plant.kinetic * self._model.energy_unit

    def equilibrium(self) -> Points | None:
        """The chain's own equilibrium nearby, if it is stable."""
        v = self._plant.v
        model = self._model
        found = balance(model.linkage, v, model.multipliers(v, self._y), self._y)
        if found is None or found.least <= 0.0:
            return None
        return model.points(found.v)

    def guess(self) -> Float[np.ndarray, " size"]:
        """Unknowns of the structure."""
        return self._model.unknowns(self._plant.v)

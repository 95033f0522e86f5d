"""Planar rods and frames in MuJoCo, with the statics of their chains."""

from dataclasses import replace

import numpy as np

from equimorph.array_types import Float
from equimorph.dynamics.balance import Balance, Quasistatics, balance, follow
from equimorph.dynamics.chained import Chained
from equimorph.dynamics.fold_delay import fold_delay
from equimorph.dynamics.linkage import Pulls, Settings, Vector
from equimorph.dynamics.model import Course, Model, Motion, Plant, Points, Row
from equimorph.dynamics.plant import LinkagePlant
from equimorph.structures import State, States


class LinkageModel(Model):
    """Chains of links, simulated by MuJoCo."""

    simulator = "mujoco"

    def __init__(self, chained: Chained) -> None:
        self._chained, self.linkage = chained, chained.linkage
        self.structure, self.unit = chained.structure, chained.time
        self.chain = self.linkage.lengths.shape[1] + 1

    def settings(self, p: Row) -> Settings:
        """Parameters and 1."""
        return np.append(p, 1.0)

    def balance(self, state: State) -> Balance | None:
        """The chain's own equilibrium next to a state."""
        linkage, chained = self.linkage, self._chained
        y = self.settings(state.p)
        v = np.zeros(linkage.size)
        places = chained.node_places(state)
        v[: 2 * linkage.nodes] = np.einsum("nx,nax->na", places, linkage.supports.axes).ravel()
        v[linkage.turn_entries] = chained.turns(state)
        v[linkage.angle_entries] = chained.angles(state)
        v[linkage.strain_entries] = self._strains(state, v)
        v = linkage.prescribe(v, y)
        return balance(linkage, v, self.multipliers(v, y), y)

    def _strains(self, state: State, v: Vector) -> Float[np.ndarray, "members links"]:
        places = self._chained.places(state.batch)[0] / self._chained.length
        sizes = np.linalg.norm(np.diff(places, axis=1), axis=2)
        stretch = np.isfinite(self.linkage.axial)
        return np.asarray(np.where(stretch, sizes / self.linkage.lengths - 1.0, 0.0))

    def multipliers(self, v: Vector, y: Settings) -> Pulls:
        """Those with which the forces balance best."""
        linkage = self.linkage
        none = np.zeros(2 * len(linkage.ends))
        free = np.flatnonzero(linkage.free)
        matrix = linkage.jacobian(v, none, y)[free][:, linkage.size :]
        return np.asarray(
            np.linalg.lstsq(matrix, -linkage.residual(v, none, y)[free], rcond=None)[0]
        )

    def points(self, v: Vector) -> Points:
        """Places of the joints, in the structure's unit of length."""
        return np.asarray(self.linkage.places(v).reshape(-1, 2) * self._chained.length)

    def reference(self, states: States) -> Float[np.ndarray, "lanes points space"]:
        """Places at the same arclengths."""
        return self._chained.places(states).reshape(len(states), -1, 2)

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
        return MovingLinkage(self, self.begin(start), step, damping)

    def begin(self, start: State) -> Balance:
        """The chain's equilibrium at the start.

        Raises
        ------
        ArithmeticError
            If there is none: the start is too close to a fold for this number of links.
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
        points = np.full(
            (len(times), self.linkage.lengths.size + len(self.linkage.ends), 2), np.nan
        )
        for k, each in enumerate(found.balances):
            points[k] = self.points(each.v)
        if found.fold is None:
            return Course(points)
        last, delay = self.points(found.last.v), None
        if np.isfinite(found.fold):
            delay = fold_delay(
                found.last, found.fold, lambda t: self.settings(motion(t)), damping, self.unit
            )
            delay = replace(delay, reach=delay.reach * self._chained.length)
        return Course(points, found.fold, delay, last)


class MovingLinkage(Plant):
    """A chain of links in MuJoCo."""

    def __init__(self, model: LinkageModel, start: Balance, step: float, damping: float) -> None:
        self._model = model
        self._plant = LinkagePlant(model.linkage, step, damping)
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

"""`SimulatedPlant`: a structure in a simulator that is moved and measured, for controllers."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import POSITIVE
from equimorph.dynamics.motion import TimedCorners
from equimorph.dynamics.replay import ReplaySettings, Simulator, hold
from equimorph.dynamics.simulators import model_of
from equimorph.equilibria import way_points
from equimorph.model import Descriptor
from equimorph.structures import State

QUIET = 1e-3
"""Speed, in units of 1/T, below which it is measured."""


class SimulatedPlant:
    """A structure in a simulator instead of hardware: it takes parameters and returns measurements.

    Parameters
    ----------
    start
        Stable state in which it rests at first.
    simulator
        "mujoco", "pyelastica", or "own": the structure's own equations of motion.
    rate
        Speed of the scaled parameters, per unit of time.
    settings
        Links, step, damping, and the time for which parameters are held after a move.

    Raises
    ------
    InputError
        If the simulator does not cover the structure, or MuJoCo is not installed.

    Examples
    --------
    >>> import equimorph as em
    >>> truss = em.Truss({"A": (0, 0), "B": (1, 0.5), "C": (2, 0)}, [("A", "B"), ("B", "C")],
    ...     {"A": "xy", "C": "xy"}, {"F": {"B": (0, -1)}}, masses={"B": 1.0})
    >>> plant = em.SimulatedPlant(truss.natural_state(), simulator="own", rate=1.0)
    >>> plant.move({"F": 0.01})
    >>> plant.departure(em.lift(truss.natural_state(), {"F": 0.01}).end.state) < 1e-4
    True
    """

    @check_arguments
    def __init__(
        self,
        start: State,
        *,
        simulator: Simulator = "mujoco",
        rate: Annotated[float, POSITIVE] = 0.05,
        settings: ReplaySettings | None = None,
    ) -> None:
        self._settings = settings or ReplaySettings(hold=5.0)
        self._rate, self._last = rate, start
        self._model = model_of(start, simulator, self._settings.links)
        self._plant = self._model.plant(start, self._settings.step, self._settings.damping)

    @check_arguments
    def move(self, to: Mapping[str, float]) -> None:
        """Change parameters at one speed, and hold them until the structure rests.

        Parameters
        ----------
        to
            New values of some parameters, by name.
        """
        if all(self._last[name] == value for name, value in to.items()):
            return
        rows = np.array(way_points(self._last.structure, self._last.p, to))
        way = np.linalg.norm((rows[1] - rows[0]) / self._last.structure.scales)
        motion = TimedCorners(np.array([0.0, way / self._rate]), rows)
        step = self._settings.step * self._model.unit
        for k in range(1, max(1, int(np.ceil(motion.duration / step))) + 1):
            self._plant.set(motion.at(k * step))
            self._plant.step()
        hold(self._plant, self._settings, QUIET)
        self._last = State(self._last.structure, self._plant.guess(), motion.rows[-1].copy())

    @check_arguments
    def measure(self, descriptor: Descriptor) -> float:
        """Value of a descriptor of the shape as it is; multipliers have no value in a simulator."""
        return float(descriptor.function(self._last.z[None], self._last.p[None])[0])

    @check_arguments
    def departure(self, state: State) -> float:
        """Largest distance of a point from where it is in a state, in the unit of length."""
        apart = self._plant.points - self._model.reference(state.batch)[0]
        return float(np.linalg.norm(apart, axis=1).max())

"""A structure in quasi-static motion under a load that its controller does not know."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

import equimorph as em


@dataclass
class Plant:
    """What stands on the bench: a true state, a load that wanders, sensors with noise.

    Parameters
    ----------
    state
        The true state.
    loads
        True values of the load, one for each step.
    name
        Its name.
    errors
        Standard errors of what is measured.
    random
        Of the noise.
    """

    state: em.State
    loads: Iterator[float]
    name: str
    errors: Mapping[em.Descriptor, float]
    random: np.random.Generator
    snapped: bool = False
    least: float = np.inf

    def write(self, command: Mapping[str, float]) -> None:
        """Move actuators and load together; where no equilibrium is left, snap."""
        there = {**command, self.name: next(self.loads)}
        if all(self.state[name] == value for name, value in there.items()):
            return
        path = em.lift(self.state, there)
        if not path.arrived:
            self.snapped = True
            landings = [each for each in em.snap_landing(path.end.state) if each.landed]
            path = em.lift(landings[0].state, there)
        self.state = path.end.state
        self.least = min(self.least, self.state.margin)

    def read(self) -> dict[em.Descriptor, float]:
        """Measured values."""
        return {
            what: what(self.state) + error * self.random.standard_normal()
            for what, error in self.errors.items()
        }


def wandering(start: float, random: np.random.Generator, drift: float, jump: float):
    """A random walk with one step of the load after 5 to 25 steps."""
    value, when = start, int(random.integers(5, 25))
    number = 0
    while True:
        yield value
        value += drift * random.standard_normal()
        number += 1
        if number == when:
            value += jump * random.choice([-1.0, 1.0])


@dataclass
class PlantInMuJoCo(Plant):
    """The same, moved and measured in MuJoCo; the statics of the library tell whether it snapped.

    Parameters
    ----------
    simulated
        The structure in the simulator, at rest in `state`.
    most
        Distance from the statics above which it has snapped.
    """

    simulated: em.SimulatedPlant | None = None
    most: float = 0.05

    def write(self, command: Mapping[str, float]) -> None:
        """Move actuators and load together."""
        names = [*command, self.name]
        super().write(command)
        self.simulated.move({name: self.state[name] for name in names})
        self.snapped |= self.simulated.departure(self.state) > self.most

    def read(self) -> dict[em.Descriptor, float]:
        """Measured values."""
        return {
            what: self.simulated.measure(what) + error * self.random.standard_normal()
            for what, error in self.errors.items()
        }

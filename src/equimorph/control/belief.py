"""What a controller believes, and how a measurement changes it.

The estimate is that of an iterated extended Kalman filter [BellCathey1993]_ whose model is the
equilibrium set itself: the commanded actuators are known, unknown loads wander, and the state is
the equilibrium over both on the sheet on which the structure was.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Values
from equimorph.equilibria import Guards, lift, settle
from equimorph.model import Constraint, Descriptor, position
from equimorph.structures import State, States, Structure

ROUNDS = 5
"""Most Gauss–Newton steps of an estimate; two are common."""
SETTLED = 1e-3
"""Step, in standard errors, after which an estimate is taken."""
DIFFERENCE = 1e-4
"""Change of a load, in its scale, over which descriptors are differenced."""
CLOSE = 0.05
"""Distance from the tangent, in the metric, within which a corrected state is on its sheet."""

Loads = Float[np.ndarray, " k"]
Covariance = Float[np.ndarray, "k k"]


class ControlStatus(StrEnum):
    """What a controller does, or why it does not go on."""

    FOLLOWING = "following"
    """It follows its route."""
    REPLANNED = "replanned"
    """The route was no longer safe under the estimated loads; another one is."""
    RETREATING = "retreating"
    """It leaves a place that is not safe under the estimated loads."""
    ARRIVED = "arrived"
    """The actuators are those of the goal."""
    NO_SAFE_WAY = "no safe way"
    """It stands: no route that was found is safe under the estimated loads."""
    NOT_EXPLAINED = "not explained"
    """It stands: no stable state of the set explains what was measured."""


@dataclass(frozen=True)
class Belief:
    """What a controller believes and commands; it changes by steps of the controller only.

    Parameters
    ----------
    state
        Estimated state at the commanded actuators and the estimated loads.
    covariance
        Covariance of the unknown loads, in the order of the controller's `unknown` (k, k).
    way_points
        Actuators that the rest of the route passes, the goal's last.
    checked
        Loads under which the whole rest of the route was found to be safe (k).
    status, why
        What the controller does, and the reason where it stands.
    surprise
        χ² of the last measurement under the belief before it, as a probability: small values are
        surprises.
    """

    state: State
    covariance: Covariance
    way_points: tuple[Mapping[str, float], ...]
    checked: Loads
    status: ControlStatus
    why: str = ""
    surprise: float = 1.0

    def __repr__(self) -> str:
        """Status and estimated state."""
        why = f": {self.why}" if self.why else ""
        return f"Belief({self.status}{why}; {self.state})"


@dataclass(frozen=True)
class Measurement:
    """Values of descriptors with their standard errors.

    Parameters
    ----------
    descriptors
        What is measured.
    values, errors
        Value and standard error of each.
    """

    descriptors: tuple[Descriptor, ...]
    values: Values
    errors: Values

    def residuals(self, states: States) -> Float[np.ndarray, "lanes values"]:
        """Residuals in standard errors."""
        found = np.stack([each.function(states.z, states.p) for each in self.descriptors], axis=1)
        return np.asarray((found - self.values) / self.errors)


@dataclass(frozen=True)
class Estimate:
    """State and loads that fit a measurement and a prior best.

    Parameters
    ----------
    state
        The state.
    covariance
        Posterior covariance of the loads (k, k).
    misfit
        χ²: squared residuals of measurement and prior.
    """

    state: State
    covariance: Covariance
    misfit: float


def positions(structure: Structure, names: Iterable[str]) -> Int[np.ndarray, " k"]:
    """Where parameters stand among those of a structure."""
    return np.array([position(structure.parameters, name) for name in names])


@dataclass(frozen=True)
class Moved:
    """States after moves of some parameters, and which of them arrived."""

    states: States
    arrived: Flags

    def first(self, count: int) -> "Moved":
        """The first of them."""
        return Moved(self.states[:count], self.arrived[:count])

    def keep(self, margin: float) -> Flags:
        """Which arrived at states with at least this margin."""
        good = self.arrived.copy()
        some = np.flatnonzero(good)
        good[some] = self.states[some].margin >= margin
        return good


def moved(
    states: States,
    names: Sequence[str],
    to: Float[np.ndarray, "lanes k"],
    within: Sequence[Constraint] = (),
) -> Moved:
    """Lift states along their own changes of some parameters; those without a change stay."""
    at = positions(states.structure, names)
    todo = np.flatnonzero((states.p[:, at] != to).any(axis=1))
    z, p, arrived = states.z.copy(), states.p.copy(), np.ones(len(states), bool)
    if len(todo):
        leg = {name: to[todo, i] for i, name in enumerate(names)}
        lifts = lift(states[todo], leg, within=within)
        z[todo], p[todo], arrived[todo] = lifts.states.z, lifts.states.p, lifts.arrived
    return Moved(States(states.structure, z, p), arrived)


def fitted(
    prior: State, names: Sequence[str], covariance: Covariance, measured: Measurement
) -> Estimate:
    """Estimate from a measurement and normally distributed loads about those of `prior`.

    Gauss–Newton; the state follows the loads on its sheet. Where that ends at a fold or a branch
    point the search ends, too, with the misfit of that place.
    """
    structure, k = prior.structure, len(names)
    at = positions(structure, names)
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    step = DIFFERENCE * structure.scales[at]
    here = prior.batch
    slopes = np.zeros((len(measured.values), k))
    for _ in range(ROUNDS):
        around = _differences(here, at, step)
        values = measured.residuals(around)
        slopes = ((values[1 : k + 1] - values[k + 1 :]) / (2.0 * step[:, None])).T
        drawn = whiten @ (here.p[0, at] - prior.p[at])
        whole = np.concatenate([slopes, whiten])
        change = np.linalg.lstsq(whole, -np.concatenate([values[0], drawn]), rcond=None)[0]
        if np.linalg.norm(whole @ change) < SETTLED:
            break
        there = _followed(around, change / step, names)
        here = there.states
        if not there.arrived.all():
            break
    drawn = whiten @ (here.p[0, at] - prior.p[at])
    misfit = float((measured.residuals(here)[0] ** 2).sum() + (drawn**2).sum())
    posterior = np.linalg.inv(slopes.T @ slopes + whiten.T @ whiten)
    return Estimate(here[0], posterior, misfit)


def _differences(here: States, at: Int[np.ndarray, " k"], step: Loads) -> States:
    """The state, then those with each load a little larger, then those a little smaller."""
    k = len(at)
    z, p = here.z.repeat(2 * k + 1, 0), here.p.repeat(2 * k + 1, 0)
    p[1 : k + 1, at] += np.diag(step)
    p[k + 1 :, at] -= np.diag(step)
    return States(here.structure, settle(here.structure, z, p).z, p)


def _followed(around: States, steps: Loads, names: Sequence[str]) -> Moved:
    """The first of some states after so many steps of each load, as `_differences` made them.

    One Newton correction from the tangent, where it stays close to it; otherwise a lift.
    """
    k, structure = len(steps), around.structure
    along_z, along_p = (0.5 * (x[1 : k + 1] - x[k + 1 :]) for x in (around.z, around.p))
    z, p = around.z[:1] + steps @ along_z, around.p[:1] + steps @ along_p
    stable, near = np.zeros(1, int), np.full(1, CLOSE)
    settled = settle(structure, z, p, guards=Guards(index=stable, trust=near))
    if settled.found[0]:
        return Moved(States(structure, settled.z, settled.p), settled.found)
    return moved(around[:1], names, p[:, positions(structure, names)])


def extremes(loads: Loads, beyond: Loads) -> Float[np.ndarray, "m k"]:
    """The loads, and those with one of them so much larger or smaller."""
    return np.concatenate([loads[None], loads + np.diag(beyond), loads - np.diag(beyond)])

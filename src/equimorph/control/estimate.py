"""What a controller believes of a state and of unknown loads, and how a measurement changes it.

The estimate is that of an iterated extended Kalman filter [BellCathey1993]_ whose model is the
equilibrium set itself: the commanded actuators are known, unknown loads wander, and the state is
the equilibrium over both on the sheet on which the structure was.

See docs/decisions.md, "A measured state may lie on the edge of stability".
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import chdtrc

from equimorph.arrays import Float, Values
from equimorph.control.likely_loads import Places, move_states
from equimorph.equilibria import Guards, settle
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures import State, States
from equimorph.tasks.motion.course import Linearisation, linearise

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
    """The structure is in the state of the goal, or at the last values of a moving target."""
    NO_SAFE_WAY = "no safe way"
    """It stands: no route that was found is safe under the estimated loads."""
    NOT_EXPLAINED = "not explained"
    """It stands: no stable state of the set explains what was measured."""


@dataclass(frozen=True)
class Belief:
    """Estimate and command of a controller; only steps of the controller change it.

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
    at
        Legs of a moving target that were followed.
    """

    state: State
    covariance: Covariance
    way_points: tuple[Mapping[str, float], ...]
    checked: Loads
    status: ControlStatus
    why: str = ""
    surprise: float = 1.0
    at: float = 0.0

    def __repr__(self) -> str:
        """Status and estimated state."""
        why = f": {self.why}" if self.why else ""
        return f"Belief({self.status}{why}; {self.state})"


ROUNDS = 20
"""Most Gauss–Newton steps of an estimate; two are common."""
SHARES = 0.25 ** np.arange(6)
"""Parts of a step that are tried where the whole one leads off the sheet or to a worse fit."""
SETTLED = 1e-3
"""Step, in standard errors, after which an estimate is taken."""
CLOSE = 0.05
"""Distance from the tangent, in the metric, within which a corrected state is on its sheet."""


@dataclass(frozen=True)
class Measurement:
    """Values of descriptors with their standard errors."""

    descriptors: tuple[Descriptor, ...]
    """What is measured."""
    values: Values
    errors: Values
    """Value and standard error of each."""

    @classmethod
    def of(
        cls, measured: Mapping[Descriptor, float], errors: Mapping[Descriptor, float]
    ) -> "Measurement":
        """Check measured values, and add their standard errors."""
        for each, value in measured.items():
            if each not in errors:
                raise InputError(f"`measured` must have standard errors; got {each.name}.")
            if not np.isfinite(value):
                raise InputError(f"`measured` must have numbers; got {each.name}: {value!r}.")
        values = np.array(list(measured.values()), float)
        return cls(tuple(measured), values, np.array([errors[each] for each in measured]))

    def residuals(self, states: States) -> Float[np.ndarray, "lanes values"]:
        """Residuals in standard errors."""
        found = np.stack([each.function(states.z, states.p) for each in self.descriptors], axis=1)
        return np.asarray((found - self.values) / self.errors)


@dataclass(frozen=True)
class Estimate:
    """State and loads that fit a measurement and a prior best."""

    state: State
    """The state."""
    covariance: Covariance
    """Posterior covariance of the loads (k, k)."""
    misfit: float
    """χ²: squared residuals of measurement and prior."""
    chance: float
    """Probability of a misfit as large as that."""


def fit_loads(prior: State, at: Places, covariance: Covariance, measured: Measurement) -> Estimate:
    """Estimate from a measurement and normally distributed loads about those of `prior`.

    Gauss–Newton whose steps are shortened until they lead to a better stable state on the sheet: a
    fold or a branch point before the whole step does not end the search. Where the best fit lies
    at such a place, the search comes closer to it with each step.
    """
    structure, scales = prior.structure, prior.structure.scales[at]
    whiten = np.linalg.inv(np.linalg.cholesky(covariance)) * scales

    def residuals(states: States) -> Float[np.ndarray, "lanes values"]:
        drawn = (states.p[:, at] - prior.p[at]) / scales @ whiten.T
        return np.concatenate([measured.residuals(states), drawn], axis=1)

    here = prior.batch
    left = residuals(here)[0]
    for _ in range(ROUNDS):
        along = linearise(structure, here.z, here.p, at, measured.descriptors)
        slopes = np.concatenate([along.slope[0] / measured.errors[:, None], whiten])
        change = np.linalg.lstsq(slopes, -left, rcond=None)[0]
        if np.linalg.norm(slopes @ change) < SETTLED:
            break
        for ahead in _after(here, at, along, change):
            found = residuals(ahead)
            misfits = (found**2).sum(axis=1)
            if misfits.min(initial=np.inf) < left @ left:
                best = int(np.argmin(misfits))
                here, left = ahead[best].batch, found[best]
                break
        else:
            break
    posterior = np.linalg.inv(slopes.T @ slopes) * np.outer(scales, scales)
    misfit = float(left @ left)
    chance = float(chdtrc(len(measured.values), misfit))
    return Estimate(here[0], posterior, misfit, chance)


def _after(here: States, at: Places, along: Linearisation, change: Loads) -> Iterator[States]:
    """The state after a change of the loads, if any; then those after parts of it.

    The first is corrected from the tangent and near it, the others are lifted.
    """
    z, p = here.z + change @ along.dz[0], here.p + change @ along.dp[0]
    stable, near = np.zeros(1, int), np.full(1, CLOSE)
    settled = settle(here.structure, z, p, guards=Guards(index=stable, trust=near))
    yield States(here.structure, settled.z, settled.p)[np.flatnonzero(settled.found)]
    loads = (here.p + SHARES[:, None] * (p - here.p))[:, at]
    states, arrived = move_states(here[np.zeros(len(SHARES), int)], at, loads)
    yield states[np.flatnonzero(arrived)]

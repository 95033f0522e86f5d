"""How a measurement changes what is believed of a state and of unknown loads.

The estimate is that of an iterated extended Kalman filter [BellCathey1993]_ whose model is the
equilibrium set itself: the commanded actuators are known, unknown loads wander, and the state is
the equilibrium over both on the sheet on which the structure was.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Values
from equimorph.control.belief import Covariance, Loads
from equimorph.control.likely import Places, moved
from equimorph.equilibria import Guards, settle
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures import State, States

ROUNDS = 5
"""Most Gauss–Newton steps of an estimate; two are common."""
SETTLED = 1e-3
"""Step, in standard errors, after which an estimate is taken."""
DIFFERENCE = 1e-4
"""Change of a load, in its scale, over which descriptors are differenced."""
CLOSE = 0.05
"""Distance from the tangent, in the metric, within which a corrected state is on its sheet."""


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

    @classmethod
    def of(
        cls, measured: Mapping[Descriptor, float], errors: Mapping[Descriptor, float]
    ) -> "Measurement":
        """Check measured values, and add their standard errors.

        Raises
        ------
        InputError
            If a descriptor has no standard error, or a value is not a number.
        """
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


def fitted(prior: State, at: Places, covariance: Covariance, measured: Measurement) -> Estimate:
    """Estimate from a measurement and normally distributed loads about those of `prior`.

    Gauss–Newton; the state follows the loads on its sheet. Where that ends at a fold or a branch
    point the search ends, too, with the misfit of that place.
    """
    structure, k = prior.structure, len(at)
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
        here, arrived = _followed(around, change / step, at)
        if not arrived:
            break
    drawn = whiten @ (here.p[0, at] - prior.p[at])
    misfit = float((measured.residuals(here)[0] ** 2).sum() + (drawn**2).sum())
    posterior = np.linalg.inv(slopes.T @ slopes + whiten.T @ whiten)
    return Estimate(here[0], posterior, misfit)


def _differences(here: States, at: Places, step: Loads) -> States:
    """The state, then those with each load a little larger, then those a little smaller."""
    k = len(at)
    z, p = here.z.repeat(2 * k + 1, 0), here.p.repeat(2 * k + 1, 0)
    p[1 : k + 1, at] += np.diag(step)
    p[k + 1 :, at] -= np.diag(step)
    return States(here.structure, settle(here.structure, z, p).z, p)


def _followed(around: States, steps: Loads, at: Places) -> tuple[States, bool]:
    """The first of some states after so many steps of each load, as `_differences` made them.

    One Newton correction from the tangent, where it stays close to it; otherwise a lift.
    """
    k, structure = len(steps), around.structure
    along_z, along_p = (0.5 * (x[1 : k + 1] - x[k + 1 :]) for x in (around.z, around.p))
    z, p = around.z[:1] + steps @ along_z, around.p[:1] + steps @ along_p
    stable, near = np.zeros(1, int), np.full(1, CLOSE)
    settled = settle(structure, z, p, guards=Guards(index=stable, trust=near))
    if settled.found[0]:
        return States(structure, settled.z, settled.p), True
    states, arrived = moved(around[:1], at, p[:, at])
    return states, bool(arrived[0])

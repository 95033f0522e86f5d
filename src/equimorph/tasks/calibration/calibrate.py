"""`calibrate`: fit unknown parameters to measured states by least squares over exact equilibria."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import check_start
from equimorph.errors import InputError
from equimorph.structures import States
from equimorph.tasks.calibration.branch import Branch, BranchEnds, Jacobian, Residuals
from equimorph.tasks.calibration.measurements import Measurement, Readings
from equimorph.tasks.calibration.unknowns import Family, Unknowns, Vector, Wanted, unknowns

CONVERGED = 1e-13
"""Relative change of the unknowns, and of the gradient, at which least squares end."""
EVALUATIONS = 200
"""Most trials of a fit."""
BLIND = 1e-8
"""Ratio of singular values of the scaled Jacobian below which a direction is not determined."""
LEVEL = 1e-6
"""Cosine between residuals and the fit's directions up to which a fit is at its minimum."""
NOTHING = 1e-9
"""Residuals that are round-off."""


Status = Literal["fitted", "undetermined", "branch ends", "limit", "not converged"]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Fitted unknowns, how well they are known, and the equilibria of the fit.

    Attributes
    ----------
    status
        "fitted"; "undetermined": the measurements do not determine some combination of unknowns;
        "branch ends": least squares leads beyond the end of a branch; "limit": beyond the limits of
        a parameter's meaning; "not converged".
    why
        Reason for a status other than "fitted".
    names, values
        The unknowns: what they are called and their values, also where the fit ended early.
    covariance
        Of the values, to first order in the errors of the measurements: (JᵀJ)⁻¹ with the Jacobian J
        of the residuals over σ; without σ, times the variance of the residuals. NaN unless fitted.
    residuals
        (predicted − measured)/σ, or without σ their difference, in the order of the measurements.
    freedom
        Degrees of freedom: measured numbers minus unknowns. With σ, Σ residuals² is close to it if
        the model holds.
    states
        Equilibria at the fitted parameters, one per measured state.
    """

    status: Status
    why: str
    names: tuple[str, ...]
    values: Vector
    covariance: Float[np.ndarray, "k k"]
    residuals: Float[np.ndarray, " numbers"]
    freedom: int
    states: States

    def __repr__(self) -> str:
        """Values with standard deviations, or the reason of a failure."""
        triples = zip(self.names, self.values, self.deviations, strict=True)
        values = ", ".join(f"{name} = {x:.6g} ± {error:.2g}" for name, x, error in triples)
        return (
            f"Calibration({values})" if self.fitted else f"Calibration({self.status}: {self.why})"
        )

    def __getitem__(self, name: str) -> float:
        """Value of an unknown by name."""
        return float(self.values[self.names.index(name)])

    @property
    def fitted(self) -> bool:
        """Whether there is a fit."""
        return self.status == "fitted"

    @property
    def deviations(self) -> Vector:
        """Standard deviations of the values."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def chi_squared(self) -> float:
        """Σ residuals²."""
        return float(self.residuals @ self.residuals)


@check_arguments
def calibrate(
    start: States,
    unknown: Wanted,
    measured: Sequence[Measurement],
    *,
    family: Family | None = None,
) -> Calibration:
    """Fit values, offsets or gains of parameters to measured descriptors and shapes.

    Least squares over exact equilibria by a trust-region method with the exact sensitivities of
    states, dz = −F_z⁻¹ F_p dp. Every trial is lifted from the last accepted states, so that the fit
    stays on their branches.

    Parameters
    ----------
    start
        Equilibria at the nominal parameters, one per measured state, each on the branch of the
        measured state.
    unknown
        What to fit: ``{name: kind}`` with kinds "value" (the parameter itself, the same in all
        states), "offset" (of the true parameter from the nominal one) or "gain" (true over
        nominal). A tuple of names shares one unknown: ``{("q", "f"): "gain"}``. The stiffness of a
        structure whose loads are relative to it is the inverse of their common gain. "data" are
        those of the structure itself, like a stiffness or a length; see `family`.
    measured
        `MeasuredValues` of descriptors and `MeasuredShape` points.
    family
        Structures by their data, if some of these are unknown. Derivatives by data are differences
        of fourth order; states are carried over by Newton's method with an unchanged index.

    Returns
    -------
    The `Calibration`; a fit that fails says why.

    Raises
    ------
    InputError
        If a state is no equilibrium, an unknown or a measurement has no meaning, only some
        measurements have a standard deviation, or there are fewer numbers than unknowns.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> rest = spring.natural_state(x_l=1.2).batch
    >>> loaded = em.lift(rest, {"F": 0.1}).states
    >>> angle = em.MeasuredValues(spring.descriptor("angle"), [-0.3])
    >>> em.calibrate(loaded, {"k": "value"}, [angle]).fitted
    True
    """
    for state in start:
        check_start(state)
    free = unknowns(start, unknown, family)
    values, sigma = _join_tables([each.table(start) for each in measured])
    count = int(np.isfinite(values).sum())
    if count < len(free.names):
        raise InputError(
            f"`measured` must hold at least as many numbers as there are unknowns, "
            f"{len(free.names)}; got {count}."
        )
    weights = np.ones_like(values) if sigma is None else sigma
    branch = Branch(free, measured, values, weights, start.z, start.p, free.start)
    with suppress(BranchEnds):
        least_squares(
            branch.residuals, free.start, branch.jacobian, x_scale="jac", ftol=1e-15,
            xtol=CONVERGED, gtol=CONVERGED, max_nfev=EVALUATIONS,
        )  # fmt: skip
    return _judge(free, branch, known=sigma is not None)


def _join_tables(tables: Sequence[Readings]) -> Readings:
    if not tables:
        raise InputError("`measured` must hold at least one measurement; got none.")
    values = np.concatenate([each.values for each in tables], axis=1)
    deviations = [each.sigma for each in tables if each.sigma is not None]
    if deviations and len(deviations) < len(tables):
        raise InputError("`sigma` must be given for all measurements or for none; got some.")
    return Readings(values, np.concatenate(deviations, axis=1) if deviations else None)


def _judge(free: Unknowns, branch: Branch, *, known: bool) -> Calibration:
    """Status of a fit, with its covariance."""
    assert branch.accepted is not None
    values, residuals, jacobian = branch.accepted
    k = len(free.names)
    freedom = len(residuals) - k
    lengths = np.linalg.norm(jacobian, axis=0)
    lengths[lengths == 0.0] = 1.0
    _, singular, right = np.linalg.svd(jacobian / lengths, full_matrices=False)
    covariance = np.full((k, k), np.nan)
    status, why = _verdict(branch, residuals, jacobian / lengths)
    if status == "fitted" and singular[-1] <= BLIND * singular[0]:
        status, why = "undetermined", _blind(free.names, right[-1] / lengths)
    if status == "fitted":
        inverse = (right.T / singular) / lengths[:, None]
        variance = 1.0 if known else float(residuals @ residuals) / freedom if freedom else np.nan
        covariance = variance * (inverse @ inverse.T)
    return Calibration(
        status, why, free.names, values, covariance, residuals, freedom, branch.states
    )


def _verdict(branch: Branch, residuals: Residuals, scaled: Jacobian) -> tuple[Status, str]:
    """Whether the fit is at a minimum; if not, what kept it from there."""
    size = float(np.linalg.norm(residuals))
    slope = np.abs(scaled.T @ residuals).max(initial=0.0)
    if slope <= max(LEVEL * size, NOTHING):
        return "fitted", ""
    kind, why = branch.failure
    if kind == "limit":
        return "limit", f"least squares leads on, but {why}"
    if kind:
        return "branch ends", f"least squares leads on, but {why}"
    return "not converged", f"{EVALUATIONS} evaluations did not suffice"


def _blind(names: Sequence[str], direction: Vector) -> str:
    """Name the combination of unknowns that the measurements do not determine."""
    share = direction / np.abs(direction).max()
    parts = [f"{x:+.3g} {name}" for name, x in zip(names, share, strict=True) if abs(x) > 1e-6]
    return f"the measurements do not depend on {' '.join(parts)}"

"""`estimate_state`: on which branch and under which load a measured structure is.

See docs/decisions.md, "A measured state may lie on the edge of stability".
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Int, Values
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.tangents import fold_slopes, split_step
from equimorph.manifold.geometry.topology import faces_of, facets_of
from equimorph.manifold.queries.least_squares import Residuals, nearest
from equimorph.manifold.queries.locate import ValueFit, distinct_states, pieces_of
from equimorph.manifold.queries.nearest import Ground, SetPoints, local_minima, points_at_vertices
from equimorph.model import Descriptor
from equimorph.structures import State, States, shape_coordinate
from equimorph.tolerances import METRIC_DIFFERENCE

STARTS = 16
"""Local minima over the vertices from which the best fits are searched."""
UNLIKELY = 1e-3
"""Chance of a χ² as large as that of the best fit below which nothing on the set explains it."""
NEGLIGIBLE = 1e-6
"""Weight, relative to the best, below which a fit is no candidate."""
INWARD = 1e-4
"""Distance from the edge of stability at which the fit is compared."""
PLACES = np.linspace(0.0, 1.0, 26)
"""Where shapes are compared if no other measurement is named."""

Measured = Mapping[Descriptor | str, float]


@dataclass(frozen=True)
class Resolving:
    """The measurement that best distinguishes the first candidate from the rest."""

    descriptor: Descriptor
    """What to measure."""
    values: Values
    """What each candidate would show."""
    separation: float
    """Least difference between the best candidate and another one, in standard errors of the
    measurement; in units of the descriptor where no error was given."""


@dataclass(frozen=True)
class StateEstimate:
    """The branch and the load of a measured structure, with candidates and their weights.

    Parameters
    ----------
    status
        "known", "ambiguous" if several candidates explain what was measured, or "refused" if none
        does, with the reason in `why`.
    states
        Candidates: the best fit on each plausible branch, best first.
    chi2
        Sum of the squared residuals, each in its standard error.
    weight
        Probability of each for equal prior probabilities: ``exp(−χ²/2)``, normalised.
    margin
        Stability margin of each.
    stratum
        Stratum of the set on which each lies, −1 if unknown.
    inside
        Whether each is a minimum of χ²; otherwise it lies on a fold or a side of the box, beyond
        which the fit improves.
    standard_errors
        Standard error of each free parameter of the set, by name, for each candidate.
    next_measurement
        What to measure in order to resolve an ambiguity; None if the estimate is unique.
    """

    status: Literal["known", "ambiguous", "refused"]
    why: str
    states: States
    chi2: Values
    weight: Values
    margin: Values
    stratum: Int[np.ndarray, " lanes"]
    inside: Flags
    standard_errors: Mapping[str, Values]
    next_measurement: Resolving | None = None

    def __repr__(self) -> str:
        """The best candidate with its weight, or the reason of a refusal."""
        if self.status == "refused":
            return f"StateEstimate(refused: {self.why})"
        return f"StateEstimate({self.status}: {self.state}, weight {self.weight[0]:.3g})"

    @property
    def known(self) -> bool:
        """Whether one candidate stands out."""
        return self.status == "known"

    @property
    def state(self) -> State:
        """The best candidate."""
        return self.states[0]


@check_arguments
def estimate_state(
    eset: EquilibriumSet,
    measured: Measured,
    errors: Measured,
    *,
    could_measure: Mapping[Descriptor, float] | None = None,
    confidence: float = 0.95,
    unstable: bool = False,
) -> StateEstimate:
    """Estimate the state of a structure on a set from measured values with errors.

    Weighted least squares on the set from every vertex that fits better than its neighbours; on
    the stability boundary where a fit would cross it. The free parameters of the set are estimated
    (the load, for example); prior knowledge of them is passed as measured values.

    Parameters
    ----------
    eset
        Set over all parameters that are not known exactly.
    measured
        Values of descriptors and, by name, of parameters; at least one for each free parameter.
    errors
        Standard error of each value.
    could_measure
        Descriptors that might be measured next, with their standard errors; coordinates of the
        shape if None.
    confidence
        Weight of the best candidate above which it counts as known.
    unstable
        Whether unstable equilibria are candidates, too.

    Returns
    -------
    Candidates with χ² and weights; also when no state fits, or several do.

    Raises
    ------
    InputError
        If there are too few values, a value or error is not a number, an error is missing, the
        confidence is not between 0 and 1, or the set has no cells.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> eset = em.equilibrium_set(spring, em.Box(F=(-0.4, 0.4)), fixed={"x_l": 0.8}, intervals=(9,))
    >>> found = em.estimate_state(eset, {spring.angle: 0.62}, {spring.angle: 0.01})
    >>> found.status, round(found.state["F"], 6)
    ('known', 0.009908)
    """
    fit = _fit(eset, measured, errors)
    if not unstable and not (eset.cell_index == 0).any():
        raise InputError("`eset` must have stable cells; got none.")
    found, misfit, inside = _minima(eset, fit.residuals, unstable)
    order = distinct_states(eset.structure, found, misfit)
    order = order[_weights(misfit[order] ** 2) > NEGLIGIBLE]
    found, chi2 = found.take(order), misfit[order] ** 2
    states = States(eset.structure, found.z, found.p)
    weight = _weights(chi2)
    freedom = max(len(measured) - len(eset.names), 1)
    status, why = _judge(states, chi2, weight, freedom, confidence)
    rivals = np.flatnonzero(weight > 1.0 - confidence)
    resolving = _resolving(states, rivals, could_measure) if status == "ambiguous" else None
    return StateEstimate(
        status,
        why if resolving is None else f"{why}; {resolving.descriptor.name} would distinguish them",
        states,
        chi2,
        weight,
        states.margin,
        np.array([pieces_of(eset, state)[0] for state in states], int),
        inside[order],
        _standard_errors(eset, found, fit.residuals),
        resolving,
    )


def _fit(eset: EquilibriumSet, measured: Measured, errors: Measured) -> ValueFit:
    if not len(eset.cells):
        raise InputError("`eset` must have cells; got an empty set.")
    for what in measured:
        if what not in errors:
            name = what if isinstance(what, str) else what.name
            raise InputError(f"`errors` must give one for every value; got none for {name}.")
    return ValueFit.of(eset, measured, errors)


def _minima(
    eset: EquilibriumSet, residuals: Residuals, unstable: bool
) -> tuple[SetPoints, Values, Flags]:
    """Best fits, their misfits, and whether they are minima; fits on folds are not."""
    ground = Ground(eset.setting, eset)
    value = np.linalg.norm(residuals(eset.points.z, eset.points.p), axis=1)
    cells = eset.cells if unstable else eset.cells[eset.cell_index == 0]
    starts = local_minima(faces_of(cells, 2), value)[:STARTS]
    found, misfit, inside = nearest(ground, points_at_vertices(eset, starts), residuals)
    if unstable:
        return found, misfit, inside
    stable = eset.structure.index(found.z, found.p) == 0
    kept, (edge, value) = (found.take(stable), misfit[stable]), _at_edge(ground, residuals, value)
    pairs = zip(vars(kept[0]).values(), vars(edge).values(), strict=True)
    whole = SetPoints(*(np.concatenate(pair) for pair in pairs))
    flags = np.concatenate([inside[stable], np.zeros(len(value), bool)])
    return whole, np.concatenate([kept[1], value]), flags


def _at_edge(
    ground: Ground, residuals: Residuals, value: Float[np.ndarray, " V"]
) -> tuple[SetPoints, Values]:
    """States at the edge of stability beyond which alone the fit would become better."""
    eset = ground.eset
    facets = facets_of(eset.folds, len(eset.names))
    facets = facets[(eset.index[facets] == 0).all(axis=1)]
    single = facets.shape[1] == 1
    starts = facets[:, 0] if single else local_minima(faces_of(facets, 2), value)[:STARTS]
    begin = points_at_vertices(eset, starts)
    if len(starts) == 0:
        return begin, np.zeros(0)
    edge, misfit, _ = nearest(Ground(ground.setting, eset, fold=True), begin, residuals)
    frames, rows = ground.frames(edge)
    across = fold_slopes(ground.setting, edge.z, edge.p, frames)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    here = SetPoints(edge.z, edge.p, rows)
    inner, there = ground.move(here, frames, INWARD * across)
    outer, back = ground.move(here, frames, -INWARD * across)
    stable = [eset.structure.index(side.z, side.p) == 0 for side in (inner, outer)]
    nearer = [np.linalg.norm(residuals(side.z, side.p), axis=1) < misfit for side in (inner, outer)]
    parts = there & back & (stable[0] != stable[1])
    closed = parts & ~np.where(stable[0], nearer[0], nearer[1])
    return edge.take(closed), misfit[closed]


def _weights(chi2: Values) -> Values:
    likely = np.exp(-0.5 * (chi2 - chi2.min(initial=np.inf)))
    return np.asarray(likely / likely.sum())


def _judge(
    states: States,
    chi2: Values,
    weight: Values,
    freedom: int,
    confidence: float,
) -> tuple[Literal["known", "ambiguous", "refused"], str]:
    if len(states) == 0:
        return "refused", "no state of the set comes near to what was measured"
    chance = float(chdtrc(freedom, chi2[0]))
    if chance < UNLIKELY:
        return "refused", (
            f"the best fit has χ² = {chi2[0]:.4g} ({freedom} degrees of freedom, chance "
            f"{chance:.1g}): no state of the set explains what was measured"
        )
    if weight[0] >= confidence:
        return "known", ""
    rivals = weight[weight > 1.0 - confidence]
    chances = ", ".join(f"{each:.3g}" for each in rivals)
    return "ambiguous", f"{len(rivals)} states explain what was measured, with weights {chances}"


def _resolving(
    states: States,
    rivals: Int[np.ndarray, " some"],
    could_measure: Mapping[Descriptor, float] | None,
) -> Resolving | None:
    """Measurement in which the best candidate differs most from the nearest rival."""
    options = _coordinates(states) if could_measure is None else dict(could_measure)
    best: Resolving | None = None
    for descriptor, error in options.items():
        values = descriptor(states)
        apart = float(np.abs(values[rivals[1:]] - values[0]).min() / error)
        if best is None or apart > best.separation:
            best = Resolving(descriptor, values, apart)
    return best


def _coordinates(states: States) -> dict[Descriptor, float]:
    """Coordinates of the drawn shape at some places, each with error one."""
    structure = states.structure
    dims = states[:1].shape(PLACES[:1]).shape[2]
    return {
        shape_coordinate(structure, axis, s): 1.0 for s in PLACES.tolist() for axis in "xyz"[:dims]
    }


def _standard_errors(
    eset: EquilibriumSet, spot: SetPoints, residuals: Residuals
) -> dict[str, Values]:
    """Linearised: covariance (JᵀJ)⁻¹ of tangent coordinates, carried over to the parameters."""
    setting, d = eset.setting, len(eset.names)
    frames, _ = Ground(setting, eset).frames(spot)
    columns = []
    for k in range(frames.shape[1]):
        dz, dp = split_step(setting, METRIC_DIFFERENCE * frames[:, k])
        ahead, behind = (residuals(spot.z + s * dz, spot.p + s * dp) for s in (1.0, -1.0))
        columns.append((ahead - behind) / (2.0 * METRIC_DIFFERENCE))
    slope = np.stack(columns, axis=2)
    values, vectors = np.linalg.eigh(np.swapaxes(slope, 1, 2) @ slope)
    moves = frames[:, :, frames.shape[2] - d :] * setting.scales
    spread = np.einsum("lki,lkp->lip", vectors, moves) ** 2
    # directions that change nothing measured and no parameter do not count
    least = np.maximum(1e-14 * values.max(axis=1, keepdims=True), 1e-300)
    variance = (spread / np.maximum(values, least)[:, :, None]).sum(axis=1)
    return dict(zip(eset.names, np.sqrt(variance).T, strict=True))

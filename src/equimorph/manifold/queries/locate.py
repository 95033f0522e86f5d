"""Where on a set a measured structure is: the state that fits best, and the next best."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Int, Lanes, Parameters
from equimorph.errors import InputError
from equimorph.linalg.apart import firsts_apart
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.topology import faces_of
from equimorph.manifold.lookup.exact_states import StatesOver
from equimorph.manifold.queries.least_squares import nearest
from equimorph.manifold.queries.nearest import Ground, SetPoints, local_minima, points_at_vertices
from equimorph.model import Descriptor, position
from equimorph.structures import State, States, Structure
from equimorph.structures.metric import metric_length, metric_places
from equimorph.tolerances import SAME_SOLUTION

CANDIDATES = 12
"""Local minima over the vertices from which the best fit is searched."""

Values = Float[np.ndarray, "lanes m"]
Measured = Mapping[Descriptor | str, float] | Float[np.ndarray, "points dims"]


@dataclass(frozen=True, eq=False)
class Place:
    """A state of a set that fits what was measured better than its neighbours do.

    Parameters
    ----------
    state
        The state.
    misfit
        Root of the sum of squared residuals, in standard errors or ranges; of shapes, the
        root-mean-square distance.
    stratum, component
        Numbers of the pieces of the set that it lies on, −1 if not known.
    inside
        Whether it is a minimum of the misfit; else it lies at a side of the box or a constraint,
        beyond which the misfit may fall on.
    """

    state: State
    misfit: float
    stratum: int
    component: int
    inside: bool


@dataclass(frozen=True, eq=False)
class Location:
    """Position of a structure on an equilibrium set.

    Parameters
    ----------
    best
        The best fit.
    runner_up
        The second-best fit, if there is one.
    """

    best: Place
    runner_up: Place | None

    @property
    def state(self) -> State:
        """State of the best fit."""
        return self.best.state

    @property
    def gap(self) -> float:
        """How much worse the runner-up fits; ∞ without one."""
        return np.inf if self.runner_up is None else self.runner_up.misfit - self.best.misfit

    def __repr__(self) -> str:
        """State, stratum, misfit and gap."""
        best = self.best
        return (
            f"Location({best.state} on stratum {best.stratum}; misfit {best.misfit:.3g}, "
            f"the next best is worse by {self.gap:.3g})"
        )


@check_arguments
def locate(
    eset: EquilibriumSet,
    measured: Measured,
    *,
    s: Float[np.ndarray, " points"] | None = None,
    errors: Mapping[Descriptor | str, float] | None = None,
) -> Location:
    """Find the state of a set that fits measured descriptors, or a measured shape, best.

    The vertices of the set that fit better than their neighbours are the starts of Newton's method
    for least squares on the set, stable and unstable parts alike. Different minima are candidates;
    the gap between the best two measures how well they are distinguished.

    Parameters
    ----------
    measured
        Values of descriptors and, by name, of parameters; or the points of a shape.
    s
        For shapes: where along the structure the points are, as in `States.shape`.
    errors
        Standard errors of the values; values without one are weighted by their range over the set.

    Raises
    ------
    InputError
        If there are fewer values than free parameters, a value is not a number, a parameter is
        fixed, a descriptor belongs to another structure, a shape has another number of points than
        the structure draws, or the set is empty.
    """
    if len(eset.cells) == 0:
        raise InputError("`eset` must have states to compare with; got an empty set.")
    fit = _Shape.of(eset, measured, s) if isinstance(measured, np.ndarray) else ValueFit.of(
        eset, measured, errors or {}
    )  # fmt: skip
    misfit = np.linalg.norm(fit.residuals(eset.points.z, eset.points.p), axis=1)
    starts = local_minima(faces_of(eset.cells, 2), misfit)[:CANDIDATES]
    ground = Ground(eset.setting, eset)
    found, value, inside = nearest(ground, points_at_vertices(eset, starts), fit.residuals)
    chosen = distinct_states(eset.structure, found, value)[:2]
    places = _places(eset, found.take(chosen), value[chosen], inside[chosen])
    return Location(places[0], places[1] if len(places) > 1 else None)


@dataclass(frozen=True)
class ValueFit:
    """Descriptors and parameters, in units of their errors."""

    eset: EquilibriumSet
    wanted: Mapping[Descriptor | str, float]
    errors: Mapping[Descriptor | str, float]

    @classmethod
    def of(
        cls,
        eset: EquilibriumSet,
        measured: Mapping[Descriptor | str, float],
        errors: Mapping[Descriptor | str, float],
    ) -> "ValueFit":
        """Values in units of their errors, or of their ranges over the set."""
        _check_values(eset, measured)
        known = cls(eset, measured, dict.fromkeys(measured, 1.0))
        spread = np.ptp(known.residuals(eset.points.z, eset.points.p), axis=0)
        units = dict(zip(measured, np.where(spread > 0.0, spread, 1.0).tolist(), strict=True))
        for what, error in errors.items():
            if what not in measured or not 0.0 < float(error) < np.inf:
                raise InputError(
                    "`errors` must be positive and of measured values; "
                    f"got {getattr(what, 'name', what)}: {error!r}."
                )
            units[what] = float(error)
        return cls(eset, measured, units)

    def residuals(self, z: Lanes, p: Parameters) -> Values:
        """Residual of each value."""
        parameters = self.eset.structure.parameters
        columns = [
            p[:, position(parameters, what)] if isinstance(what, str) else what.function(z, p)
            for what in self.wanted
        ]
        left = np.stack(columns, axis=1) - np.array(list(self.wanted.values()))
        return np.asarray(left / np.array([self.errors[what] for what in self.wanted]))


@dataclass(frozen=True)
class _Shape:
    """Points of a shape."""

    structure: Structure
    wanted: Float[np.ndarray, "points dims"]
    s: Float[np.ndarray, " points"] | None

    @classmethod
    def of(
        cls,
        eset: EquilibriumSet,
        wanted: Float[np.ndarray, "points dims"],
        s: Float[np.ndarray, " points"] | None,
    ) -> "_Shape":
        drawn = eset.points[:1].shape(s).shape[1:]
        if wanted.shape != drawn or not np.isfinite(wanted).all():
            raise InputError(
                f"`measured` must be the finite coordinates {drawn} of a shape; got an array of "
                f"shape {wanted.shape}. Give the places of its points by `s`."
            )
        return cls(eset.structure, wanted, s)

    def residuals(self, z: Lanes, p: Parameters) -> Values:
        """Distances along each axis, so that the norm is their root mean square over points."""
        gap = self.structure.shape(z, p, self.s) - self.wanted
        return np.asarray(gap.reshape(len(z), -1) / np.sqrt(len(self.wanted)))


def _check_values(eset: EquilibriumSet, measured: Mapping[Descriptor | str, float]) -> None:
    if len(measured) < len(eset.names):
        raise InputError(
            f"`measured` must give at least {len(eset.names)} values, one for each free parameter; "
            f"got {len(measured)}. With fewer, whole curves fit."
        )
    names = [each.name for each in eset.structure.parameters]
    for what in measured:
        if isinstance(what, str) and what not in names:
            raise InputError(
                f"`measured` must name parameters ({', '.join(names)}) or have descriptors; "
                f"got {what!r}."
            )
        if isinstance(what, str) and what not in eset.names:
            raise InputError(
                f"`measured` must name free parameters ({', '.join(eset.names)}); got {what!r}, "
                "which is fixed in the set."
            )


def distinct_states(
    structure: Structure, found: SetPoints, value: Float[np.ndarray, " lanes"]
) -> Int[np.ndarray, " kept"]:
    """Different states, the best first."""
    order = np.argsort(value, kind="stable")
    places = metric_places(structure, found.z, found.p)[order]
    return np.asarray(order[firsts_apart(places, SAME_SOLUTION)])


def _places(
    eset: EquilibriumSet, found: SetPoints, value: Float[np.ndarray, " lanes"], inside: Flags
) -> list[Place]:
    states = States(eset.structure, found.z, found.p)
    pieces = [pieces_of(eset, state) for state in states]
    return [
        Place(state, float(misfit), stratum, component, bool(minimum))
        for state, misfit, minimum, (stratum, component) in zip(
            states, value, inside, pieces, strict=True
        )
    ]


def pieces_of(eset: EquilibriumSet, state: State) -> tuple[int, int]:
    """Stratum and component that a state of the set lies on, −1 if it lies on none."""
    here = _place_over(eset, state)
    return (
        (-1, -1)
        if here is None
        else (int(here[0].stratum[here[1]]), int(here[0].component[here[1]]))
    )


def cell_of(eset: EquilibriumSet, state: State) -> int:
    """Cell that a state of the set lies in, −1 if it lies in none."""
    here = _place_over(eset, state)
    return -1 if here is None else int(here[0].cell[here[1]])


def _place_over(eset: EquilibriumSet, state: State) -> tuple[StatesOver, int] | None:
    """Equilibria of the set over a state's parameters, and which of them it is."""
    sides = zip(eset.names, eset.box.lower, eset.box.upper, strict=True)
    # round-off may have put it a little beyond a side of the box
    at = {name: np.array([np.clip(state[name], low, high)]) for name, low, high in sides}
    here = eset.over(**at)
    gap = metric_length(eset.structure, here.states.z - state.z)
    # next to a fold a state over rounded parameters moves by the root of round-off
    near = np.flatnonzero(gap < 10.0 * SAME_SOLUTION)
    return (here, int(near[gap[near].argmin()])) if len(near) else None

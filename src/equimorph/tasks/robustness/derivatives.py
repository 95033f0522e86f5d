"""Derivatives of states, descriptors and limit loads with respect to parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import LimitLoad, check_start
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.sensitivity import tangents
from equimorph.equilibria.trace_options import VIOLATIONS
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, names_of, position
from equimorph.structures import State

STEP = 1e-5
"""Step of central differences along the set, in scaled parameters."""
CRITICAL = 1e-5
"""Size of the smallest singular value, relative to the next, up to which a state is critical."""
FLAT = 1e-6
"""φᵀF_q relative to its factors, below which the path in q does not turn: a branch point."""
Vector = Float[np.ndarray, " k"]


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity:
    """How a state changes with parameters, by the implicit function theorem.

    Parameters
    ----------
    names
        The parameters.
    unknowns
        dz/dp: changes of unknowns and multipliers, one row for each parameter.
    descriptors
        dS/dp of each descriptor, by its name: one number for each parameter.
    """

    names: tuple[str, ...]
    unknowns: Float[np.ndarray, "parameters size"]
    descriptors: Mapping[str, Vector]

    def __repr__(self) -> str:
        """Of what by what."""
        return f"Sensitivity(of {', '.join(self.descriptors) or 'z'} by {', '.join(self.names)})"

    def __getitem__(self, key: tuple[str, str]) -> float:
        """Derivative of a descriptor by a parameter: ``found["height(0.5)", "Theta"]``."""
        descriptor, name = key
        return float(self.descriptors[descriptor][self.names.index(name)])


@check_arguments
def sensitivity(
    state: State, descriptors: Sequence[Descriptor] = (), names: Sequence[str] | None = None
) -> Sensitivity:
    """Derivatives of a state and of descriptors: ``dz = −F_z⁻¹ F_p dp``, ``dS = S_z dz + S_p dp``.

    Parameters
    ----------
    state
        A regular equilibrium.
    descriptors
        Scalars; where they have a kink the mean of both sides is given.
    names
        Parameters, including imperfections; by default all of them.

    Returns
    -------
    Derivatives of the unknowns and of each descriptor.

    Raises
    ------
    InputError
        If the state is no equilibrium or a critical one, a parameter takes away its orbit, or
        for an unknown name.
    """
    check_start(state)
    structure = state.structure
    chosen = tuple(names_of(structure.parameters) if names is None else names)
    at = [position(structure.parameters, name) for name in chosen]
    z, p = state.z[None], state.p[None]
    beside = Critical(structure, z, p, null_border(structure, z, p))
    if abs(beside.g[0]) < CRITICAL * np.linalg.norm(beside.v):
        raise InputError(
            f"`state` must be regular; got a critical one, {state}. See `limit_sensitivity`."
        )
    _check_pushes(state, chosen)
    directions = np.eye(len(structure.parameters))[at]
    dz = tangents(structure, z, p, directions[None])[0]
    slopes = {each.name: _slopes(state, each, dz, directions) for each in descriptors}
    return Sensitivity(chosen, dz, slopes)


@check_arguments
def limit_sensitivity(
    limit: LimitLoad,
    load: str,
    names: Sequence[str],
    within: Sequence[Constraint] = (),
) -> dict[str, float]:
    """Derivatives of a limit load with respect to parameters.

    At a fold with null vector φ: ``dq/da = −(φᵀF_a)/(φᵀF_q)``. Where a constraint ends the path:
    ``dq/da = −(dS/da)/(dS/dq)`` along the set.

    Parameters
    ----------
    limit
        A limit load found by `limit_load`.
    load
        The parameter that grew.
    names
        Parameters and imperfections.
    within
        The constraints of the limit load, where one of them was met.

    Returns
    -------
    dq/da by the name of each parameter.

    Raises
    ------
    InputError
        If the limit is a branch point, where imperfections act with a fractional power
        (`imperfection_law`), or has no derivative, a parameter takes away its orbit, a
        name is unknown, or its constraint is not given.
    """
    structure, state = limit.state.structure, limit.state
    places = {name: position(structure.parameters, name) for name in (*names, load)}
    if limit.kind == "fold":
        _check_pushes(state, names)
        phi = null_border(structure, state.z[None], state.p[None])[0]
        slopes = {name: float(phi @ _column(state, place)) for name, place in places.items()}
        size = np.linalg.norm(phi) * np.linalg.norm(_column(state, places[load]))
        if abs(slopes[load]) < FLAT * size:
            raise InputError(f"`limit` must be a fold in {load}; got one in other directions.")
        return {name: -slopes[name] / slopes[load] for name in names}
    if limit.kind in VIOLATIONS:
        met = [constraint for constraint in within if str(constraint) == limit.detail]
        detail = limit.detail or "a constraint"
        if limit.path is not None:
            met = met or [c for c in within if str(c) == limit.path.end.detail]
        if not met:
            raise InputError(f"`within` must hold the constraint that was met, {detail}; got none.")
        found = sensitivity(state, [met[0].descriptor], [*names, load])
        key = met[0].descriptor.name
        return {name: -found[key, name] / found[key, load] for name in names}
    if limit.kind == "branch point":
        raise InputError(
            "`limit` must be a fold or a constraint; got a branch point, near which the limit load "
            "changes with a fractional power of imperfections. See `imperfection_law`."
        )
    raise InputError(f"`limit` must be a fold or a constraint; got {limit.kind!r}.")


def _check_pushes(state: State, names: Sequence[str]) -> None:
    """Refuse parameters beside which a state on an orbit has one place only: it jumps there."""
    structure, z, p = state.structure, state.z[None], state.p[None]
    if not structure.along_orbits(z, p).any() or not structure.have_orbits(p)[0]:
        return
    for name in names:
        place = position(structure.parameters, name)
        moved = p.copy()
        moved[0, place] += structure.scales[place]
        if not structure.have_orbits(moved)[0]:
            raise InputError(
                "`names` must hold parameters that keep the orbit of the state; got "
                f"{name}, which picks one state of it, however small its change."
            )


def _slopes(
    state: State,
    descriptor: Descriptor,
    dz: Float[np.ndarray, "k size"],
    directions: Float[np.ndarray, "k parameters"],
) -> Vector:
    """Derivatives of a descriptor along the set."""
    scale = (np.abs(directions) @ state.structure.scales)[:, None]
    h = STEP * scale
    ahead, behind = (
        descriptor.function(state.z + sign * h * dz, state.p + sign * h * directions)
        for sign in (1.0, -1.0)
    )
    return np.asarray((ahead - behind) / (2.0 * h[:, 0]))


def _column(state: State, place: int) -> Float[np.ndarray, " size"]:
    """F_p for one parameter."""
    direction = np.zeros((1, len(state.p)))
    direction[0, place] = 1.0
    found = state.structure.parameter_derivative(state.z[None], state.p[None], direction)
    return np.asarray(found[0])

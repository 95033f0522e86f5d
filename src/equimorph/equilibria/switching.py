"""Branch switching: from a branch point onto every path that starts there."""

from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria.critical import NormalForm, normal_form
from equimorph.equilibria.curves import ParameterLine, dual
from equimorph.equilibria.lift import Path, check_start
from equimorph.equilibria.steps import Front, step_along
from equimorph.errors import InputError
from equimorph.model import position
from equimorph.structures import State

SINGULAR = 1e-6
"""What counts as zero at a branch point: vᵀF_p relative to its size, an eigenvalue."""
SHORTEST = 1e-4
"""Distance in the metric below which no start on a branch is tried."""


@dataclass(frozen=True)
class Branch:
    """One of the half-branches that leave a branch point.

    Parameters
    ----------
    state
        Equilibrium on it, near the branch point.
    curve
        0 or 1: the one of the two curves through the branch point to which it belongs. At
        pitchforks 0 is the straight one.
    slope
        Change of the parameter per unit length at the branch point; 0 on the side branches of a
        pitchfork.
    """

    state: State
    curve: int
    slope: float


@check_arguments
def branches(
    state: State, along: str, *, path: Path | None = None, distance: float = 0.05
) -> tuple[Branch, ...]:
    """Start on every path in one parameter that leads away from a simple branch point.

    Directions from the normal form: the roots of ``A ξ² + 2 B ξτ + C τ² = 0`` [Seydel2010]_; then
    Newton on the path at `distance`. Lift from the states that are returned.

    Parameters
    ----------
    state
        A branch point, like the end of a lift along `along`.
    along
        Parameter whose paths branch.
    path
        A lift that ended in `state`: its curve is not returned again.
    distance
        Length of the first step in the metric; halved where it fails.

    Returns
    -------
    Four half-branches, two of each curve, or those that could be started; two with `path`.

    Raises
    ------
    InputError
        If `state` is no branch point of paths along `along`, or an isolated or degenerate one.
    """
    structure = state.structure
    velocity = np.zeros((1, len(state.p)))
    velocity[0, position(structure.parameters, along)] = 1.0
    check_start(state)
    line = ParameterLine(structure, state.p[None].copy(), velocity)
    form = normal_form(structure, state.z[None], state.p[None], velocity)
    _check(state, along, form)
    tangents, found = _tangents(form), []
    known = None if path is None else int(np.argmax([_along(line, path, t) for t in tangents]))
    for curve, tangent in enumerate(tangents):
        if curve == known:
            continue
        for sign in (1.0, -1.0):
            away = _start(line, state, sign * tangent, distance)
            if away is not None:
                slope = float(sign * _unit(line, tangent)[-1])
                found.append(Branch(away, curve, slope))
    return tuple(found)


def _check(state: State, along: str, form: NormalForm) -> None:
    structure = state.structure
    v = form.phi / np.linalg.norm(form.phi)
    z, p = state.z[None], state.p[None]
    dp = np.zeros_like(p)
    dp[0, position(structure.parameters, along)] = 1.0
    column = structure.parameter_derivative(z, p, dp)[0]
    # B says how fast vᵀF_p changes with the state: a branch point may be off by round-off
    size = float(np.linalg.norm(column) + abs(form.mixed[0]))
    change = structure.solve(z, p, v[:, None]).x[0, 0]
    regular = np.linalg.norm(change) < 1.0 / SINGULAR
    if regular or abs(v[0] @ column) > SINGULAR * size:
        raise InputError(f"`state` must be a branch point of paths along {along}; got {state!r}.")
    if not form.discriminant[0] > 0.0 or form.kinds[0] == "degenerate":
        raise InputError(
            f"`state` must be a simple branch point where two paths along {along} cross; "
            f"got kind {form.kinds[0]!r}."
        )


def _tangents(form: NormalForm) -> list[Float[np.ndarray, " bordered"]]:
    """Tangents (dz, dt) of both curves, not normalised: at pitchforks the straight one first."""
    a, b, c = float(form.quadratic[0]), float(form.mixed[0]), float(form.path[0])
    sum_ = -(b + np.copysign(np.sqrt(form.discriminant[0]), b))
    # roots ξ : τ of a ξ² + 2 b ξτ + c τ² without cancellation: (c : sum) and (sum : a)
    ratios = [(c, sum_), (sum_, a)] if form.kinds[0] == "transcritical" else [(c, sum_), (1.0, 0.0)]
    return [np.append(xi * form.phi[0] + tau * form.psi[0], tau) for xi, tau in ratios]


def _unit(
    line: ParameterLine, tangent: Float[np.ndarray, " bordered"]
) -> Float[np.ndarray, " bordered"]:
    row, corner = dual(line.structure, line.weight, tangent[None, :-1], tangent[-1:])
    return np.asarray(tangent / np.sqrt(row[0] @ tangent[:-1] + corner[0] * tangent[-1]))


def _along(line: ParameterLine, path: Path, tangent: Float[np.ndarray, " bordered"]) -> float:
    """Cosine between a tangent and the last piece of a path."""
    z, p = path.states.z[-2:], path.states.p[-2:]
    place = int(np.argmax(line.velocity[0]))
    secant = _unit(line, np.append(z[1] - z[0], p[1, place] - p[0, place]))
    unit = _unit(line, tangent)
    row, corner = dual(line.structure, line.weight, unit[None, :-1], unit[-1:])
    return float(abs(row[0] @ secant[:-1] + corner[0] * secant[-1]))


def _start(
    line: ParameterLine, state: State, tangent: Float[np.ndarray, " bordered"], distance: float
) -> State | None:
    """Equilibrium at a distance along a tangent."""
    unit = _unit(line, tangent)
    here = Front(
        state.z[None].copy(), np.zeros(1), unit[None, :-1].copy(), unit[-1:], np.zeros(1, int)
    )
    while distance > SHORTEST:
        there, good = step_along(line, here, np.array([distance]))
        if good[0]:
            return State(state.structure, there.z[0], line.parameters(there.t)[0])
        distance *= 0.5
    return None

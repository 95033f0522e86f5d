"""What makes a point a local optimum, in numbers and in words."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.tasks.optimising.programme import Programme, is_stability
from equimorph.tasks.optimising.sqp import CriticalPoint

ACTIVE = 1e-7
"""Relative distance from a bound at which it is active."""
TIED = 1e-6
"""Relative difference of branches that take part in a kink."""

Kind = Literal["interior", "kink", "box", "constraint", "stability boundary"]


@dataclass(frozen=True)
class Certificate:
    """First and second order conditions at an optimum.

    Parameters
    ----------
    kind
        Where it sits: "stability boundary" before "constraint" before "box" before "kink" (a ridge
        where branches of a maximum cross) before "interior".
    residual
        Length of the gradient of the Lagrangian along the set: KKT's condition.
    active
        Constraints that hold with equality, and their multipliers.
    branches
        Places of the extrema that tie, and their shares of the gradient.
    curvature
        Smallest second derivative of the Lagrangian along the set, in directions that leave the
        active functions as they are; ∞ without such directions. Not negative at a minimum.
    across
        At a kink: slopes of the objective per unit of length on both sides of the ridge, away from
        it.
    converged
        Whether the last step was at round-off.
    """

    kind: Kind
    residual: float
    active: Mapping[str, float]
    branches: Mapping[float, float]
    curvature: float
    across: tuple[float, float] | None
    converged: bool

    def __repr__(self) -> str:
        """Where it sits, and the residual."""
        held = ", ".join(self.active)
        return f"Certificate({self.kind}{': ' + held if held else ''}; KKT {self.residual:.1e})"


def certificate(programme: Programme, found: CriticalPoint) -> Certificate:
    """Conditions at a point where a descent ended."""
    e, answer = found.expansion, found.answer
    f, g = e.f[0], e.g[0]
    active = np.flatnonzero(np.abs(g) <= ACTIVE)
    tied = np.flatnonzero(f >= f.max() - TIED * (1.0 + abs(f.max())))
    if not programme.objective.kinked:
        tied = tied[:1]
    slopes = np.concatenate([e.f_slope[0, tied], e.g_slope[0, active]])
    weights = np.concatenate([answer.weights[tied], answer.multipliers[active]])
    names = [str(programme.all[k]) for k in active]
    ridge = _ridge(e.f_slope[0, tied])
    return Certificate(
        _kind(programme, active.tolist(), ridge is not None),
        float(np.linalg.norm(weights @ slopes)),
        dict(zip(names, answer.multipliers[active].tolist(), strict=True)),
        _places(programme, found, tied.tolist()),
        float(curvatures(found, tied, active)[0].min(initial=np.inf)),
        ridge,
        found.converged,
    )


def _kind(programme: Programme, active: list[int], ridged: bool) -> Kind:
    constraints = [programme.all[k] for k in active]
    sides = len(programme.constraints)
    if any(is_stability(each) for each in constraints):
        return "stability boundary"
    if any(k < sides for k in active):
        return "constraint"
    if active:
        return "box"
    return "kink" if ridged else "interior"


def _ridge(slopes: Float[np.ndarray, "tied d"]) -> tuple[float, float] | None:
    """Slopes on both sides of a ridge, in the direction in which the branches differ most."""
    gaps = slopes[:, None] - slopes[None]
    size = np.linalg.norm(gaps, axis=2)
    if size.max() <= 1e-4 * (1e-12 + np.abs(slopes).max()):
        return None
    i, j = np.unravel_index(size.argmax(), size.shape)
    across = gaps[i, j] / size[i, j]
    rates = slopes @ across
    return float(rates.max()), float(-rates.min())


def _places(programme: Programme, found: CriticalPoint, tied: list[int]) -> dict[float, float]:
    if not programme.objective.kinked:
        return {}
    _, places = programme.objective.branches(found.point.z, found.point.p)
    return {float(places[0, k]): float(found.answer.weights[k]) for k in tied}


def curvatures(
    found: CriticalPoint, tied: Int[np.ndarray, " m"], active: Int[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "d k"]]:
    """Curvatures of the Lagrangian along directions that leave active functions as they are.

    In growing order, and the directions that have them.
    """
    e = found.expansion
    slopes = e.f_slope[0, tied]
    rows = np.concatenate([slopes[1:] - slopes[:1], e.g_slope[0, active]])
    free = np.eye(rows.shape[1])
    if len(rows):
        _, sizes, directions = np.linalg.svd(rows)
        rank = int((sizes > 1e-5 * max(1.0, sizes[0])).sum())
        free = directions[rank:].T
    bend = e.bend(0, found.answer)
    values, vectors = np.linalg.eigh(0.5 * free.T @ (bend + bend.T) @ free)
    return values, free @ vectors

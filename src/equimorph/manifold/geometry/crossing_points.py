"""Exact points where two smooth sheets of a set cross, as symmetry makes them in its slices.

Lyapunov–Schmidt reduction with a border b [Govaerts2000]_: where the residual is r b, the set is
``r(ξ, π) = 0`` in the amplitude ξ of the null vector and steps π of the parameters. It crosses
itself where the gradient of r vanishes together with r; its sheets are tangent to the two planes on
which the Hessian of r, of rank two and indefinite, vanishes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.critical import Critical, null_border
from equimorph.manifold.geometry.embedding import embed, principal_directions
from equimorph.manifold.geometry.exact_points import (
    REACH,
    Aim,
    Pinned,
    amid,
    cap_condition,
    middles,
)
from equimorph.manifold.geometry.points import Points
from equimorph.manifold.geometry.setting import Setting

NEWTON_STEPS = 15
POLISHED = 1e-9
"""Step, in any unknown, after which a point is exact: Newton is quadratic."""
RESIDUAL = 1e-9
INDEFINITE = 1e-6
"""Least ratio of the Hessian's eigenvalues of opposite sign at which sheets cross."""


@dataclass(frozen=True)
class Reduction:
    """Reduced equation at points: tangent vectors of the reduction, gradient and Hessian of r.

    along_z, along_p: changes of z and p with ξ, and with each of the k directions of the span;
    remainder: the Newton step of z that leaves the residual parallel to b.
    """

    along_z: Float[np.ndarray, "lanes k1 size"]
    along_p: Float[np.ndarray, "lanes k1 parameters"]
    remainder: Lanes
    gradient: Float[np.ndarray, "lanes k1"]
    hessian: Float[np.ndarray, "lanes k1 k1"]

    @property
    def crosses(self) -> np.ndarray:
        """Whether the Hessian has eigenvalues of both signs."""
        values = np.linalg.eigvalsh(self.hessian)
        low, high = -values[:, 0], values[:, -1]
        return np.asarray(np.minimum(low, high) > INDEFINITE * np.maximum(low, high))


def reduction(aim: Aim, z: Lanes, p: Parameters, b: Lanes) -> Reduction:
    """Lyapunov–Schmidt reduction for parameters in the span of an aim."""
    structure, lanes, k = aim.setting.structure, len(z), aim.span.shape[1]
    moves = [aim.direction(i) for i in range(k)]
    rhs = np.zeros((lanes, k + 2, structure.size + 1))
    rhs[:, 0, -1] = 1.0
    for i, move in enumerate(moves):
        rhs[:, 1 + i, :-1] = -structure.parameter_derivative(z, p, move)
    rhs[:, -1, :-1] = -structure.residual(z, p)
    x = Critical(structure, z, p, b).solve(rhs)
    v, still = np.ascontiguousarray(x[:, 0, :-1]), np.zeros_like(p)
    tangents = [(np.ascontiguousarray(x[:, i, :-1]), dp) for i, dp in enumerate((still, *moves))]
    remainder = np.ascontiguousarray(x[:, -1, :-1])
    hessian, gradient = np.empty((lanes, k + 1, k + 1)), -x[:, : k + 1, -1]
    for i, one in enumerate(tangents):
        for j, other in enumerate(tangents[: i + 1]):
            twice = structure.second_derivative(z, p, one, other)
            hessian[:, i, j] = hessian[:, j, i] = np.einsum("li,li->l", v, twice)
        twice = structure.second_derivative(z, p, one, (remainder, still))
        gradient[:, i] += np.einsum("li,li->l", v, twice)
    along_z, along_p = (np.stack([each[i] for each in tangents], axis=1) for i in range(2))
    return Reduction(along_z, along_p, remainder, gradient, hessian)


def pin_crossings(
    setting: Setting,
    points: Points,
    groups: Sequence[Sequence[int]],
    span: Float[np.ndarray, "lanes k d"],
    cap: bool = False,
) -> Pinned:
    """Crossing points amid groups of points, with parameters in a span; see `pins.pin`.

    With k directions, k − 1 conditions put the point amid its group; `cap`: a constraint is active
    in place of one of them.
    """
    z, p, deviations = middles(setting, points, groups)
    rows = principal_directions(deviations, span.shape[1] - 1 - cap)
    around = np.linalg.norm(deviations, axis=2).max(axis=1, initial=0.0)
    aim = Aim(setting, False, cap, span, embed(setting, z, p), rows)
    return corrected_crossings(aim, z, p, around)


def corrected_crossings(aim: Aim, z: Lanes, p: Parameters, around: Values) -> Pinned:
    """Gauss–Newton to crossing points that obey the conditions of an aim.

    The gradient of r has one component more than what is left to solve for, but all vanish
    together, so that convergence is quadratic.
    """
    z, p, structure = z.copy(), p.copy(), aim.setting.structure
    size, todo = np.full(len(z), np.inf), np.arange(len(z))
    crosses = np.zeros(len(z), bool)
    b = null_border(structure, z, p)
    for _ in range(NEWTON_STEPS):
        here = aim.take(todo)
        known = reduction(here, z[todo], p[todo], b[todo])
        dz, step = _step(here, z[todo], p[todo], known)
        crosses[todo] = known.crosses
        size[todo] = np.maximum(np.abs(dz).max(axis=1), np.abs(step).max(axis=1))
        share = np.minimum(1.0, 0.5 / np.maximum(size[todo], 1e-300))[:, None]
        z[todo] += share * dz
        p[todo] = here.moved(p[todo], share * step)
        v = known.along_z[:, 0]
        b[todo] = v / np.linalg.norm(v, axis=1, keepdims=True)
        todo = todo[(size[todo] > POLISHED) & np.isfinite(z[todo]).all(axis=1)]
        if len(todo) == 0:
            break
    gap = np.linalg.norm(embed(aim.setting, z, p) - aim.middle, axis=1)
    found = (size <= POLISHED) & crosses & (gap <= REACH * around + 1e-3)
    found[found] = np.abs(structure.residual(z[found], p[found])).max(axis=1) < RESIDUAL
    for constraint in aim.setting.constraints:
        found[found] &= constraint.excess(z[found], p[found]) < 1e-9
    return Pinned(z, p, found)


def _step(
    aim: Aim, z: Lanes, p: Parameters, known: Reduction
) -> tuple[Lanes, Float[np.ndarray, "lanes k"]]:
    """Changes of z, and along the span, of one Gauss–Newton step."""
    scale = np.abs(known.hessian).max(axis=(1, 2), keepdims=True)
    matrix, value = [known.hessian / scale], [known.gradient / scale[:, :, 0]]
    conditions = amid(aim, z, p) + ([cap_condition(aim, z, p)] if aim.cap else [])
    for each in conditions:
        by_z = np.einsum("lki,li->lk", known.along_z, each.by_z)
        by_z[:, 1:] += each.by_step
        here = each.value + np.einsum("li,li->l", known.remainder, each.by_z)
        norm = np.maximum(np.linalg.norm(by_z, axis=1), 1e-300)
        matrix.append(by_z[:, None] / norm[:, None, None])
        value.append((here / norm)[:, None])
    inverse = np.linalg.pinv(np.concatenate(matrix, axis=1), rcond=1e-10)
    step = -np.einsum("lij,lj->li", inverse, np.concatenate(value, axis=1))
    return known.remainder + np.einsum("lk,lki->li", step, known.along_z), step[:, 1:]

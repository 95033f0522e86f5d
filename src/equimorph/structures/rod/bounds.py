"""Bounds of the second derivatives of the clamped rod's equations over boxes of states."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Nodal, Parameters
from equimorph.structures.contract import Direction

MORE = 1.0 + 1e-12
"""Covers the round-off of the bounds themselves."""


@dataclass(frozen=True)
class ClampedBound:
    """``|D²F[v, w]|`` for F = Kθ + a cos θ − b sin θ, ∫cos θ − ν, ∫sin θ; a = μm − qR, b = λm.

    ``D²F = −(a cos θ − b sin θ) η_v η_w − (α_v sin θ + β_v cos θ) η_w − …`` with η, α, β the
    changes of θ, a, b; the constraints' are ``−Σ m cos θ η_v η_w`` and ``−Σ m sin θ η_v η_w``.

    Parameters
    ----------
    weights, loads
        m and |R| at all nodes.
    curving, sine, cosine
        Bounds of |a cos θ − b sin θ|, |sin θ| and |cos θ| over each box, at all nodes.
    """

    weights: Float[np.ndarray, " nodes"]
    loads: Float[np.ndarray, " nodes"]
    curving: Nodal
    sine: Nodal
    cosine: Nodal

    def __call__(self, v: Direction, w: Direction) -> Lanes:
        """Bound along directions with entries ≥ 0."""
        (turn_v, up_v, along_v), (turn_w, up_w, along_w) = self._changes(v), self._changes(w)
        both = turn_v * turn_w
        rows = self.curving * both
        rows += (up_v * self.sine + along_v * self.cosine) * turn_w
        rows += (up_w * self.sine + along_w * self.cosine) * turn_v
        closing = [(self.weights * each * both).sum(axis=1) for each in (self.cosine, self.sine)]
        return np.concatenate([rows[:, 1:-1], np.stack(closing, axis=1)], axis=1) * MORE

    def _changes(self, v: Direction) -> tuple[Nodal, Nodal, Nodal]:
        """|η|, |α| and |β| at all nodes."""
        dz, dp = v
        turn = spread_to_ends(dz, dp)
        up = dz[:, -1:] * self.weights + dp[:, 2:3] * self.loads
        return turn, up, dz[:, -2:-1] * self.weights


def spread_to_ends(reach: Lanes, ends: Parameters) -> Nodal:
    """Changes of the angles at all nodes; those of the ends are |Θ| + |Δ|."""
    outer = ends[:, :1] + ends[:, 1:2]
    return np.concatenate([outer, reach[:, :-2], outer], axis=1)


def clamped_bound(
    theta: Nodal,
    forces: tuple[Nodal, Nodal],
    reach: Direction,
    weights: Float[np.ndarray, " nodes"],
    loads: Float[np.ndarray, " nodes"],
) -> ClampedBound:
    """`ClampedBound` over boxes around angles θ and forces (a, b), which reach so far."""
    a, b = forces
    turn = spread_to_ends(*reach)
    more_a = reach[0][:, -1:] * weights + reach[1][:, 2:3] * np.abs(loads)
    more_b = reach[0][:, -2:-1] * weights
    sine, cosine = np.sin(theta), np.cos(theta)
    largest = np.hypot(np.abs(a) + more_a, np.abs(b) + more_b)
    curving = np.abs(a * cosine - b * sine) + more_a + more_b + turn * largest
    return ClampedBound(
        weights,
        np.abs(loads),
        np.minimum(curving, largest),
        np.minimum(np.abs(sine) + turn, 1.0),
        np.minimum(np.abs(cosine) + turn, 1.0),
    )

"""Normal forms of branch points: how two paths cross, and which of them is stable."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.curves import Curve
from equimorph.structures import Structure

SKEW = 1e-4
"""Quadratic over cubic coefficient, a length in the metric, from which on it counts as not zero."""
DEGENERATE = 1e-7
"""Size of the cubic coefficient, relative to its terms, below which its sign is not known."""


@dataclass(frozen=True)
class NormalForm:
    """Reduced equation of paths along ``dp`` at simple branch points.

    With the null vector φ, |φ| = 1 in the metric, and ψ from ``F_z ψ = −F_p dp``, ``b·ψ = 0``,
    points of the paths are ``z + ξφ + τψ``, ``p + τ dp`` up to terms of second order, where
    ``½ (A ξ² + 2 B ξ τ + C τ²) + c ξ³/6 = 0`` with ``A = φᵀF_zz[φ, φ]``,
    ``B = φᵀD²F[φ, (ψ, dp)]``, ``C = φᵀD²F[(ψ, dp), (ψ, dp)]`` (Lyapunov–Schmidt reduction).
    """

    phi: Lanes
    psi: Lanes
    quadratic: Values
    """A."""
    mixed: Values
    """B."""
    path: Values
    """C."""
    cubic: Values
    """c."""
    cubic_scale: Values

    @property
    def discriminant(self) -> Values:
        """B² − AC: two paths cross where it is positive, isolated points are where it is not."""
        return np.asarray(self.mixed**2 - self.quadratic * self.path)

    @property
    def kinds(self) -> list[str]:
        """Criticality of each branch point.

        "transcritical": two paths cross at finite slopes; "isola": no path leads through.
        Pitchforks have A = 0: "supercritical" if c > 0, when side branches are stable where the
        straight one is not, "subcritical" if c < 0, "degenerate" if c is not known from zero.
        """
        skew = np.abs(self.quadratic) > np.maximum(
            SKEW * np.abs(self.cubic), 1e-9 * self.cubic_scale
        )
        unknown = np.abs(self.cubic) <= DEGENERATE * self.cubic_scale
        kinds = np.where(self.cubic > 0.0, "supercritical", "subcritical")
        kinds = np.where(unknown, "degenerate", kinds)
        crossing = np.where(self.discriminant > 0.0, "transcritical", "isola")
        return [str(kind) for kind in np.where(skew, crossing, kinds)]


def normal_form(
    structure: Structure, z: Lanes, p: Parameters, dp: Parameters, bend: Parameters | None = None
) -> NormalForm:
    """Coefficients at simple branch points of paths along `dp`; F_zzz by differences, to 1e-10.

    `bend`: second derivative of the parameters along curved paths.
    """
    n, still = structure.unknowns, np.zeros_like(p)
    b = null_border(structure, z, p)
    norm = np.sqrt(b[:, :n] ** 2 @ structure.mass)
    # with b·v = 1 a border b·|b|_M makes v = φ of unit length in the metric
    at = Critical(structure, z, p, np.ascontiguousarray(b * norm[:, None]))
    phi = at.v
    rhs = np.zeros((len(z), 1, structure.size + 1))
    rhs[:, 0, :-1] = -structure.parameter_derivative(z, p, dp)
    psi = np.ascontiguousarray(at.solve(rhs)[:, 0, :-1])
    twice = structure.second_derivative(z, p, (psi, dp), (psi, dp))
    if bend is not None:
        twice = twice + structure.parameter_derivative(z, p, bend)
    return NormalForm(
        phi,
        psi,
        at.second(phi, still),
        at.second(psi, dp),
        np.einsum("li,li->l", phi, twice),
        at.cubic,
        at.cubic_scale,
    )


def criticality(curve: Curve, z: Lanes, t: Values) -> list[str]:
    """Classify simple branch points of curves in parameter space; see `NormalForm.kinds`."""
    return normal_form(curve.structure, z, curve.parameters(t), curve.rate(t), curve.bend(t)).kinds

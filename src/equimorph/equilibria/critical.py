"""Nearly singular equilibria: test functions of folds, branch points and cusps; normal forms."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.equilibria.curves import AlongCurve, Curve, along_parameters
from equimorph.structures import Equations, LinearSystem
from equimorph.structures.metric import metric_coordinates, metric_length

THIRD_STEP = 2e-3
"""Step of differences for F_zzz, in the metric: of fourth order, with errors near 1e-11."""


@dataclass(frozen=True)
class Critical:
    """Points with F_z nearly singular, seen through a border b.

    With ``[F_z b; bᵀ 0] [v; g] = [0; 1]`` the matrix F_z is singular exactly where g = 0, and then
    v is its null vector with b·v = 1 [Govaerts2000]_. All test functions are smooth in (z, p) as
    long as no second eigenvalue vanishes.
    """

    structure: Equations
    z: Lanes
    p: Parameters
    b: Lanes
    """The structure, the points, and their borders."""
    system: LinearSystem | None = None
    """F_z at the points, if it is at hand."""
    null: Float[np.ndarray, "lanes extended"] | None = None
    """(v, g), if they are known."""

    @cached_property
    def _bordered(self) -> Float[np.ndarray, "lanes extended"]:
        if self.null is not None:
            return self.null
        rhs = np.zeros((len(self.z), 1, self.structure.size + 1))
        rhs[:, 0, -1] = 1.0
        return np.asarray(self.solve(rhs)[:, 0])

    def solve(
        self, rhs: Float[np.ndarray, "lanes sides bordered"]
    ) -> Float[np.ndarray, "lanes sides bordered"]:
        """Solve with the bordered matrix, which stays regular at simple singular points."""
        border = (self.b[:, None], self.b[:, None], np.zeros((len(self.z), 1, 1)))
        if self.system is not None:
            return self.system.solve(rhs, border).x
        return self.structure.solve(self.z, self.p, rhs, border).x

    @property
    def v(self) -> Lanes:
        """Approximate null vector."""
        return np.ascontiguousarray(self._bordered[:, :-1])

    @property
    def g(self) -> Values:
        """Zero exactly where F_z is singular; its sign is minus the critical eigenvalue's."""
        return np.asarray(self._bordered[:, -1])

    def second(self, dz: Lanes, dp: Parameters) -> Values:
        """vᵀ D²F[(v, 0), (dz, dp)]: minus the derivative of g along (dz, dp)."""
        still = np.zeros_like(self.p)
        twice = self.structure.second_derivative(self.z, self.p, (self.v, still), (dz, dp))
        return np.asarray(np.einsum("li,li->l", self.v, twice))

    @property
    def quadratic(self) -> Values:
        """vᵀ F_zz[v, v]: zero at cusps."""
        return self.second(self.v, np.zeros_like(self.p))

    def along(self, dp: Parameters) -> Values:
        """vᵀ F_p dp: zero where paths along dp have a branch point instead of a fold."""
        column = self.structure.parameter_derivative(self.z, self.p, dp)
        return np.asarray(np.einsum("li,li->l", self.v, column))

    @cached_property
    def _cubic_parts(self) -> tuple[Values, Values, Values]:
        """Third derivative along v, the part of the unknowns that follow v², and their size."""
        structure, p, v = self.structure, self.p, self.v
        still = np.zeros_like(p)
        norm = metric_length(structure, v)
        h = THIRD_STEP / norm

        def at(shift: float) -> Values:
            z = self.z + (shift * h)[:, None] * v
            twice = structure.second_derivative(z, p, (v, still), (v, still))
            return np.asarray(np.einsum("li,li->l", v, twice))

        ahead, behind = (at(1.0), at(2.0)), (at(-1.0), at(-2.0))
        third = (8.0 * (ahead[0] - behind[0]) - (ahead[1] - behind[1])) / (12.0 * h)
        twice = structure.second_derivative(self.z, p, (v, still), (v, still))
        rhs = np.zeros((len(v), 1, structure.size + 1))
        rhs[:, 0, :-1] = twice
        w = np.ascontiguousarray(self.solve(rhs)[:, 0, :-1])
        inner = structure.second_derivative(self.z, p, (v, still), (w, still))
        following = 3.0 * np.einsum("li,li->l", v, inner)
        size = np.max(np.abs([*ahead, *behind]), axis=0) / h
        return third, following, size + np.abs(third) + np.abs(following)

    @property
    def cubic(self) -> Values:
        """c = vᵀF_zzz[v, v, v] − 3 vᵀF_zz[v, w] with F_z w = F_zz[v, v]: zero at swallowtails.

        The reduced energy along v is ``b ξ³/6 + c ξ⁴/24`` with b = `quadratic`.
        """
        third, inner, _ = self._cubic_parts
        return np.asarray(third - inner)

    @property
    def cubic_scale(self) -> Values:
        """Size of the terms that `cubic` is the sum of: what its round-off is relative to."""
        return self._cubic_parts[2]


Test = Callable[[Critical], Values]
"""Scalar of nearly singular states that vanishes where something happens."""


def null_border(structure: Equations, z: Lanes, p: Parameters) -> Lanes:
    """Unit vectors near the null vectors of F_z, by bordered solves that stay regular there."""
    return _system_at(structure, z, p).null_border()


def nearly_singular(structure: Equations, z: Lanes, p: Parameters) -> Critical:
    """Points seen through unit vectors near their null vectors."""
    system = _system_at(structure, z, p)
    return Critical(structure, z, p, system.null_border(), system)


def _system_at(structure: Equations, z: Lanes, p: Parameters) -> LinearSystem:
    return structure.linear_system(z, p, np.zeros((len(z), 0, p.shape[1])))


def null_vectors(
    structure: Equations, z: Lanes, p: Parameters
) -> tuple[Float[np.ndarray, "lanes unknowns"], Values]:
    """Null vectors on folds, as displacements of unit length in the metric, and φᵀF_zz[φ, φ]."""
    b = null_border(structure, z, p)
    at = Critical(structure, z, p, np.ascontiguousarray(b * metric_length(structure, b)[:, None]))
    return metric_coordinates(structure, at.v), at.quadratic


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

    at: Critical
    """The points, with a border such that v = φ."""
    phi: Lanes
    psi: Lanes
    quadratic: Values
    """A."""
    mixed: Values
    """B."""
    path: Values
    """C."""

    @property
    def cubic(self) -> Values:
        """c, by differences: not computed unless it is asked for."""
        return self.at.cubic

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
            SKEW * np.abs(self.cubic), 1e-9 * self.at.cubic_scale
        )
        unknown = np.abs(self.cubic) <= DEGENERATE * self.at.cubic_scale
        kinds = np.where(self.cubic > 0.0, "supercritical", "subcritical")
        kinds = np.where(unknown, "degenerate", kinds)
        crossing = np.where(self.discriminant > 0.0, "transcritical", "isola")
        return [str(kind) for kind in np.where(skew, crossing, kinds)]


def normal_form(structure: Equations, z: Lanes, p: Parameters, dp: Parameters) -> NormalForm:
    """Coefficients at simple branch points of paths along `dp`; F_zzz by differences, to 1e-10."""
    still, b = np.zeros_like(p), null_border(structure, z, p)
    norm = metric_length(structure, b)
    # with b·v = 1 a border b·|b|_M makes v = φ of unit length in the metric
    at = Critical(structure, z, p, np.ascontiguousarray(b * norm[:, None]))
    phi = at.v
    rhs = np.zeros((len(z), 1, structure.size + 1))
    rhs[:, 0, :-1] = -structure.parameter_derivative(z, p, dp)
    psi = np.ascontiguousarray(at.solve(rhs)[:, 0, :-1])
    twice = structure.second_derivative(z, p, (psi, dp), (psi, dp))
    path = np.asarray(np.einsum("li,li->l", phi, twice))
    return NormalForm(at, phi, psi, at.second(phi, still), at.second(psi, dp), path)


def criticality(curve: Curve, z: Lanes, t: Values) -> list[str]:
    """Classify simple branch points of curves in parameter space; see `NormalForm.kinds`."""
    equations, p = AlongCurve(curve), along_parameters(t)
    return normal_form(equations, z, p, np.tile([1.0, 0.0], (len(z), 1))).kinds

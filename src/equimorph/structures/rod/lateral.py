"""Movements of a planar rod out of its plane: the second variation, its inertia and solves.

See docs/decisions.md, "Leaving the plane is a second variation of its own".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.arrays import Bool, Float, Int, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.linalg import Border, BorderedSolution, no_border, solve_bordered
from equimorph.linalg.condensed import REFINABLE
from equimorph.linalg.determinants import no_determinants
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.margin import generic_vectors, inverse_step, stability_margin
from equimorph.structures.metric import metric_length
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.ends import FREE, End
from equimorph.structures.rod.lateral_kernels import lateral_lanes
from equimorph.structures.rod.mechanics import PlanarMechanics
from equimorph.structures.rod.model import RodModel
from equimorph.structures.rod.profiles import LoadShape, at_nodes, profile

Points = Float[np.ndarray, "lanes elements order"]
Movements = Float[np.ndarray, "lanes lateral"]
"""φ, ψ by node, and the force of the closure, of each lane."""

BELOW, MODE_SWEEPS = 1e-6, 4
"""Distance of a shift below an eigenvalue, relative to it or 1; solves towards its mode."""


@dataclass(frozen=True, eq=False)
class LateralStiffness:
    """Stiffness of a rod against twist and against bending out of its plane.

    Raises
    ------
    InputError
        For a stiffness that is not positive somewhere.
    """

    torsion: Any
    lateral: Any
    """GJ and EI about the axis in the plane, relative to the bending stiffness in the plane at the
    same place: numbers, tables [[s, f], ...] or callables; positive."""
    kinks: Sequence[float] = ()
    """Arclengths where a callable is not smooth."""

    def __post_init__(self) -> None:
        """Check that both are positive."""
        for name in ("torsion", "lateral"):
            lowest = self.shape(name).density(np.linspace(0.0, 1.0, 201)).min()
            if not lowest > 0.0:
                raise InputError(f"`{name}` must be positive everywhere; got {lowest:g}.")

    def shape(self, name: str) -> LoadShape:
        """One of them as a function of s."""
        return profile(getattr(self, name), name, self.kinks)

    @property
    def breaks(self) -> list[float]:
        """Arclengths where one of them is not smooth."""
        kinks = [self.shape(name).kinks for name in ("torsion", "lateral")]
        return [float(s) for s in np.unique(np.concatenate(kinks))]


@dataclass(frozen=True, eq=False)
class Holding:
    """Rotations that the supports prevent."""

    free: tuple[bool, bool, bool, bool]
    """Whether φ and ψ of end A, φ and ψ of end B are unknown."""
    closed: bool
    """Whether ∫ψ = 0 because both ends are held in the plane."""
    from_start: bool = True
    """Whether end A is held in the plane."""

    @classmethod
    def of(cls, ends: tuple[End, End]) -> "Holding":
        """Those that ends prevent: whatever holds a place or an angle holds φ and ψ.

        A pin is an axis across the plane; springs act in the plane and hold what is across it.
        """
        placed = [not (end.x == FREE and end.y == FREE) for end in ends]
        free = [not (here or end.angle != FREE) for here, end in zip(placed, ends, strict=True)]
        return cls((free[0], free[0], free[1], free[1]), all(placed), placed[0])


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Fields of states at the nodes of every element that the second variation is made of.

    Scales: curvature by 1/L, forces by 4π²B/L², stiffnesses and moments to match.
    """

    kappa: Points
    moment: Points
    thrust: Points
    shear: Points
    stretch: Points
    torsion: Points
    lateral: Float[np.ndarray, "elements order"]


class OutOfPlane:
    """The second variation of a planar rod for small rotations of its cross-sections.

    Cross-sections turn by w = φ t + ψ n + χ b, R → R exp[w]; χ stays in the plane and decouples.
    With κ, the moment M in the plane, the dead force f on the cross-section, the stretch
    s = 1 − γ (f·t + T) of the axis, and the stiffnesses C against twist and A against bending out
    of the plane::

        ½ ∫ C (φ' − κψ)² + A (ψ' + κφ)² − M [φ (ψ' + κφ) − ψ (φ' − κψ)]
              − s (f·t) ψ² + s (f·n) φψ ds

    with ∫ s ψ ds = 0 if both ends are held in the plane, relative to ∫ φ² + ψ². It is that of the
    rod whose rotation is interpolated as its angle θ is, with the same quadrature: critical loads
    converge with twice the degree. Conventions: couples inside the rod are semi-tangential; see
    `Holding` for the supports; a tendon of tension T at distance d adds T d² to C.

    z, p: of the planar rod; unknowns x = (φ, ψ by node, the force ν of the closure).

    Parameters
    ----------
    rod
        The planar mechanics.
    model
        Its Lagrangian, in its parameters or in these and further ones that are zero.
    holding
        What the supports prevent.
    stiffness
        C and A.

    References
    ----------
    [Antman2005]_, chapter 8.
    """

    def __init__(
        self, rod: PlanarMechanics, model: RodModel, holding: Holding, stiffness: LateralStiffness
    ) -> None:
        self.rod, self.model, self.holding = rod, model, holding
        self.mesh: Mesh = model.mesh
        self.torsion, self.lateral = (
            at_nodes(stiffness.shape(name), self.mesh) * model.nodal.rigidity
            for name in ("torsion", "lateral")
        )
        self.unknowns, self.constraints = 2 * len(self.mesh.nodes), int(holding.closed)
        self.mass = np.repeat(self.mesh.weights, 2)

    @property
    def size(self) -> int:
        """Length of x."""
        return self.unknowns + self.constraints

    @cached_property
    def slopes(self) -> Float[np.ndarray, "elements order order"]:
        """Derivative at the nodes of every element."""
        return np.ascontiguousarray(
            self.mesh.reference.derivative / self.mesh.lengths[:, None, None]
        )

    def _stiffness(
        self, values: Float[np.ndarray, "elements order"]
    ) -> Float[np.ndarray, "elements order order"]:
        """Element matrices ∫ c u' v' ds."""
        weighted = self.mesh.element_weights * values
        return np.asarray(np.einsum("eki,ek,ekj->eij", self.slopes, weighted, self.slopes))

    @cached_property
    def _pairs(self) -> Float[np.ndarray, "elements order order 4"]:
        """Stiffness of φ' and of ψ', derivative and its transpose, for all pairs of nodes."""
        twist, bend = self._stiffness(self.torsion), self._stiffness(self.lateral)
        tables = (twist, bend, self.slopes, self.slopes.transpose(0, 2, 1))
        return np.ascontiguousarray(np.stack(tables, axis=-1))

    @cached_property
    def _shared(self) -> tuple[Any, ...]:
        """What the kernel shares among lanes."""
        nodal = self.model.nodal
        tables = (nodal.across, nodal.along, nodal.bending, nodal.tension, nodal.torsion)
        rows = [np.flatnonzero(table.any(axis=(1, 2))) for table in tables]
        return (
            self._pairs,
            self.mesh.element_weights,
            nodal.rigidity,
            self.torsion,
            self.lateral,
            nodal.softness,
            *(np.ascontiguousarray(table[row]) for table, row in zip(tables, rows, strict=True)),
            *rows,
            np.array(self.holding.free, dtype=np.int64),
            np.int64(self.holding.closed),
        )

    def _state(self, z: Lanes, p: Parameters) -> tuple[np.ndarray, np.ndarray]:
        """Angles at all nodes; multipliers, parameters, further ones that are zero, and 1."""
        y = np.zeros((len(z), self.model.scalars))
        m = self.model.multipliers
        y[:, :m], y[:, m : m + p.shape[1]], y[:, -1] = z[:, self.rod.unknowns :], p, 1.0
        return self.rod.nodal_angles(z, p), y

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides lateral"],
        border: Border | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve for up to two right-hand sides with the second variation − shift · mass.

        `negative` counts the eigenvalue of the closure, too. What is held is zero in the solution.
        Lanes with a tiny pivot are solved by the pivoted dense factorisation. There is no `border`.
        """
        assert border is None
        angles, y = self._state(z, p)
        moved = np.zeros(len(z)) if shift is None else shift
        x, ratio = np.empty(rhs.shape), np.empty(len(z))
        negative = np.empty(len(z), dtype=np.int64)
        given = [np.ascontiguousarray(a) for a in (angles, y, moved, rhs)]
        over_lanes(lateral_lanes, self._shared, given, [x, negative, ratio])
        unsafe = ~(ratio >= REFINABLE)
        if unsafe.any():
            again = self._solve_in_full(z[unsafe], p[unsafe], rhs[unsafe], moved[unsafe])
            x[unsafe], negative[unsafe] = again.x, again.negative
        return BorderedSolution(x, negative, ratio, unsafe, no_determinants(len(z)))

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Number of independent movements out of the plane that lower the energy."""
        nothing = np.zeros((len(z), 0, self.size))
        return self.solve(z, p, nothing).negative - self.constraints

    def margin(self, z: Lanes, p: Parameters) -> Values:
        """Smallest eigenvalue relative to ∫ φ² + ψ², in units of 4π²B/L."""
        return stability_margin(self, z, p, floor=self._floor(z, p))

    def _floor(self, z: Lanes, p: Parameters) -> Values:
        """Numbers below all eigenvalues: the smallest over s with φ' and ψ' chosen freely."""
        at = self.coefficients(z, p)
        phi = -(at.moment**2) / (4.0 * at.lateral)
        psi = -(at.moment**2) / (4.0 * at.torsion) - at.stretch * at.thrust
        least = 0.5 * (phi + psi) - 0.5 * np.hypot(phi - psi, at.stretch * at.shear)
        return np.asarray(1.01 * least.min(axis=(1, 2)) - 1e-6)

    def mode(self, z: Lanes, p: Parameters) -> Movements:
        """Movement of the smallest eigenvalue: x = (φ, ψ by node, ν) with ∫ φ² + ψ² = 1.

        Its sign makes the sideways displacement −∫ψ of the middle of the rod positive.
        """
        value, n = self.margin(z, p), self.unknowns
        shift = value - BELOW * np.maximum(np.abs(value), 1.0)
        x = generic_vectors(self, len(z))
        for _ in range(MODE_SWEEPS):
            x = inverse_step(self, z, p, x[:, :n], shift)
            x /= metric_length(self, x)[:, None]
        half = self.mesh.integration(np.array([0.5]))[0]
        x *= np.where(x[:, 1:n:2] @ half > 0.0, -1.0, 1.0)[:, None]
        return np.asarray(x)

    # --- in full ----------------------------------------------------------------------------

    def coefficients(self, z: Lanes, p: Parameters) -> Coefficients:
        """Fields that the second variation is made of."""
        angles, y = self._state(z, p)
        nodal, theta = self.model.nodal, angles[:, self.mesh.element_nodes]
        along, across, bending, tension, cables = (
            np.einsum("lj,jei->lei", y, table)
            for table in (nodal.along, nodal.across, nodal.bending, nodal.tension, nodal.torsion)
        )
        kappa = np.einsum("eij,lej->lei", self.slopes, theta)
        c, s = np.cos(theta), np.sin(theta)
        thrust, shear = along * c + across * s, across * c - along * s
        stretch = 1.0 - nodal.softness * (thrust + tension)
        moment = nodal.rigidity * kappa - bending
        return Coefficients(
            kappa, moment, thrust, shear, stretch, self.torsion + cables, self.lateral
        )

    @property
    def free(self) -> Bool[np.ndarray, " unknowns"]:
        """Which of φ, ψ by node are unknown."""
        out = np.ones(self.unknowns, bool)
        out[:2], out[-2:] = self.holding.free[:2], self.holding.free[2:]
        return out

    def dense(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes lateral lateral"]:
        """The second variation in full, the closure included; unknowns that are held stay zero.

        Their rows and columns are those of the identity.
        """
        at, weights = self.coefficients(z, p), self.mesh.element_weights
        half = 0.5 * at.moment
        pairs = {  # of (value, slope) of φ and ψ
            (0, 0, 0, 0): at.kappa * (at.lateral * at.kappa - at.moment),
            (0, 1, 0, 1): at.torsion,
            (1, 0, 1, 0): at.kappa * (at.torsion * at.kappa - at.moment) - at.stretch * at.thrust,
            (1, 1, 1, 1): at.lateral + 0.0 * at.kappa,
            (0, 0, 1, 1): at.lateral * at.kappa - half,
            (0, 1, 1, 0): half - at.torsion * at.kappa,
            (0, 0, 1, 0): 0.5 * at.stretch * at.shear,
        }
        out, slopes = np.zeros((len(z), self.size, self.size)), self.slopes
        values = np.broadcast_to(np.eye(slopes.shape[1]), slopes.shape)
        for (f, df, g, dg), coefficient in pairs.items():
            tables = [(values, slopes)[derivative] for derivative in (df, dg)]
            local = np.einsum("lek,eki,ekj->leij", coefficient * weights, *tables, optimize=True)
            for e, nodes in enumerate(self.mesh.element_nodes):
                out[:, 2 * nodes[:, None] + f, 2 * nodes + g] += local[:, e]
                if f != g:
                    out[:, 2 * nodes[:, None] + g, 2 * nodes + f] += local[:, e].transpose(0, 2, 1)
        for e, nodes in enumerate(self.mesh.element_nodes if self.constraints else ()):
            out[:, 2 * nodes + 1, -1] += weights[e] * at.stretch[:, e]
            out[:, -1, 2 * nodes + 1] += weights[e] * at.stretch[:, e]
        held = np.flatnonzero(~self.free)
        out[:, held], out[:, :, held] = 0.0, 0.0
        out[:, held, held] = 1.0
        return out

    def _solve_in_full(
        self, z: Lanes, p: Parameters, rhs: Float[np.ndarray, "lanes sides lateral"], shift: Values
    ) -> BorderedSolution:
        """`solve` in full."""
        matrix, at = self.dense(z, p), np.flatnonzero(self.free)
        matrix[:, at, at] -= shift[:, None] * self.mass[at]
        sides = rhs.copy()
        sides[:, :, np.flatnonzero(~self.free)] = 0.0
        return solve_bordered(matrix, *no_border(len(z), self.size), sides)

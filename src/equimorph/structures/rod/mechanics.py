"""Interfaces of the mechanics of rods; rods add units, natural states and descriptors."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Nodal, Parameters, Some, Values, Velocity
from equimorph.errors import InputError
from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.linalg.intervals import Interval
from equimorph.linalg.kernels import largest_products
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.contract import CompiledSteps, Symmetry
from equimorph.structures.equations import Advance, Direction, Enclosed, Equations, Force
from equimorph.structures.material_points import MaterialPoints
from equimorph.structures.rod.discretisation import Mesh, error_by_refinement
from equimorph.structures.rod.planar_energy import PlanarEnergy
from equimorph.structures.whole_turns import WholeTurns

Bounds = Float[np.ndarray, "constraints 4"]
LARGEST_TAIL = 1e-3
"""Highest Legendre coefficients of θ, in radians, of an element that represents its part."""


class RodMechanics(Equations):
    """Energy, residual, derivatives and solves of a discretised rod in batches of lanes.

    z = (unknowns at the nodes, multipliers); methods as in `structures.contract.Structure`. All
    numbers are non-dimensional.
    """

    mesh: Mesh
    parameters: int
    """Number of parameters."""

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """One, as nothing here has a unit."""
        return np.ones(self.parameters)

    @property
    def determinant_sign(self) -> float:
        """Sign of the determinant of F_z over that which the kernel of `fused_advance` returns."""
        return 1.0

    def check_widths(self, *pairs: Direction) -> list[np.ndarray]:
        """States and directions (z, p) as contiguous arrays of the right widths, for the kernels.

        Kernels do not check what they read.
        """
        lanes = len(pairs[0][0])
        shapes = (lanes, self.unknowns + self.constraints), (lanes, self.parameters)
        for pair in pairs:
            if (pair[0].shape, pair[1].shape) != shapes:
                wrong = int(pair[0].shape == shapes[0])
                raise InputError(
                    f"`{'zp'[wrong]}` must have shape {shapes[wrong]}; got {pair[wrong].shape}. "
                    "States belong to the rod, and the resolution, that made them."
                )
        return [np.ascontiguousarray(array) for pair in pairs for array in pair]

    @abstractmethod
    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Potential energy E."""

    @abstractmethod
    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p."""

    @abstractmethod
    def support_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes axes"]:
        """Force of the support at A on the rod: multipliers, or what balances the loads."""

    @abstractmethod
    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random guesses."""

    @property
    def is_extensible(self) -> bool:
        """Whether the axis stretches."""
        return False

    def shortenings(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points"]:
        """Elastic shortenings of the axis at the nodes of every element; 0 if inextensible."""
        return np.zeros((len(z), 1))

    @property
    def whole_turns(self) -> WholeTurns:
        """Whole turns of what nothing, or springs alone, keep from it; none by default."""
        return WholeTurns.none(self.size)

    @abstractmethod
    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the highest Legendre coefficients of the rotations are small in every element."""

    @abstractmethod
    def guess_for(self, finer: Any, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes finer"]:
        """States as guesses of those of the same rod with other elements."""

    @abstractmethod
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Symmetries of the equilibrium set."""

    def fused_advance(  # a kernel, its tables, and what `advance` takes
        self,
        kernel: Callable[..., None],
        shared: tuple[object, ...],
        z: Lanes,
        p: Parameters,
        dp: Parameters,
        row: Lanes,
        corner: Values,
        defect: Values,
        *more: np.ndarray,
    ) -> Advance:
        """`advance` by one kernel; lanes with an unsafe pivot take the general solve."""
        z, p, row, dp = self.check_widths((z, p), (row, dp))
        given = z, p, dp, row, corner, defect
        return self.pivot_steps(*self.fused_step(kernel, shared, *given, *more), *given)

    def fused_advance_under(  # a kernel, its tables, and what `advance_under` takes
        self,
        kernel: Callable[..., None],
        shared: tuple[object, ...],
        force: Force,
        z: Lanes,
        p: Parameters,
        row: Lanes,
        corner: Values,
        defect: Values,
        *more: np.ndarray,
    ) -> Advance:
        """`advance_under` by one kernel; lanes with an unsafe pivot take the general solve.

        The kernel takes the force last, after `more`.
        """
        z, p = self.check_widths((z, p))
        given, none = (z, p, row, corner, defect), np.zeros_like(p)
        step = self.fused_step(kernel, shared, z, p, none, row, corner, defect, *more, *force)
        general = super().advance_under
        return _with_unsafe(
            *step, PIVOT_GUARD,
            lambda some: general((force[0][some], force[1][some]), *(x[some] for x in given)),
        )  # fmt: skip

    def fused_step(
        self, kernel: Callable[..., None], shared: tuple[object, ...], z: Lanes, *more: np.ndarray
    ) -> tuple[Advance, Values]:
        """Steps by one kernel, with the ratios of their pivots."""
        lanes = len(z)
        inputs = [np.ascontiguousarray(each) for each in (z, *more)]
        # one block each: memory that is released at once stays with the process, without new pages
        dz, tangent_z = np.empty((2, *z.shape))
        dt, tangent_t, residual, ratio = np.empty((4, lanes))
        index, determinant = np.empty(lanes, dtype=np.int64), np.empty((lanes, 2))
        outputs = (dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio)
        over_lanes(kernel, shared, inputs, outputs)
        determinant[:, 0] *= self.determinant_sign
        return Advance(*outputs[:-1]), ratio

    def pivot_steps(
        self, out: Advance, ratio: Values, *given: np.ndarray, guard: float = PIVOT_GUARD
    ) -> Advance:
        """Steps, those with an unsafe pivot by the general solve."""
        general = super().advance
        return _with_unsafe(out, ratio, guard, lambda some: general(*(x[some] for x in given)))


def _with_unsafe(
    out: Advance, ratio: Values, guard: float, general: Callable[[Some], Advance]
) -> Advance:
    """Steps, those whose ratio of pivots is below a guard by the general solve."""
    if not ratio.min(initial=1.0) >= guard:
        unsafe = np.flatnonzero(~(ratio >= guard))
        for name, column in vars(general(unsafe)).items():
            getattr(out, name)[unsafe] = column
    return out


class PlanarMechanics(RodMechanics):
    """Mechanics of a planar rod: the unknowns are the angles at the `unknown_nodes`."""

    held: tuple[bool, bool]
    """Whether the angles of the ends are prescribed."""

    @property
    @abstractmethod
    def planar_energy(self) -> PlanarEnergy:
        """The Lagrangian as tables."""

    def compiled_steps(self, bounds: Bounds) -> CompiledSteps | None:
        """Compiled loops under bounds on the largest curvature; None: there are none.

        A bound: sign (−1 for a lower one), unit of the curvature, bound, and ease.
        """
        return None

    def enclosure(self, z: Interval, p: Interval) -> Enclosed | None:
        """Bounds over boxes."""
        return self.planar_energy.bounds(z, p)

    def plain_energy(self) -> dict[str, Any] | None:
        """Tables of the Lagrangian."""
        return self.planar_energy.numbers()

    @property
    def sprung(self) -> MaterialPoints | None:
        """Points of a rod of mass 1 on springs that the unknowns leave free; none here."""
        return None

    @abstractmethod
    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Physical mass matrix JᵀWJ of a rod of total mass 1, in units of L and of its mass."""

    @abstractmethod
    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ of a rod of total mass 1, see `Structure.inertial_force`, in units of L."""

    @property
    @abstractmethod
    def unknown_nodes(self) -> slice:
        """Nodes whose angles are unknown."""

    @abstractmethod
    def nodal_angles(self, z: Lanes, p: Parameters) -> Nodal:
        """Angles θ at all nodes, the prescribed ends included."""

    @abstractmethod
    def nodal_places(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes 2"]:
        """Places of all nodes, whose derivatives are those in `inertia`."""

    @abstractmethod
    def fields(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths."""

    @abstractmethod
    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs."""

    @abstractmethod
    def end_moments(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
        """Couples of the supports, or actuators, on both ends of the rod."""

    def guess_for(self, finer: Any, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes finer"]:
        """States as guesses of those of the same rod with other elements."""
        matrix = self.mesh.interpolation(finer.mesh.nodes[finer.unknown_nodes])
        return np.concatenate([self.nodal_angles(z, p) @ matrix.T, z[:, self.unknowns :]], axis=1)

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the highest Legendre coefficients of θ are small in every element."""
        return self.tail(z, p) < LARGEST_TAIL

    def tail(self, z: Lanes, p: Parameters) -> Values:
        """Largest of the two highest Legendre coefficients of θ in all elements."""
        out = np.empty(len(z))
        largest_products(
            np.ascontiguousarray(self.nodal_angles(z, p)), self.mesh.highest_by_node, out
        )
        return out


SAMPLES = np.linspace(0.0, 1.0, 25)
"""Arclengths at which fields are compared."""

Rod = TypeVar("Rod", bound=RodMechanics)
Compared = Float[np.ndarray, "lanes compared"]


def discretisation_error(
    rod: Rod,
    finer: Rod,
    compared: Callable[[Rod, Lanes, Parameters], Compared],
    z: Lanes,
    p: Parameters,
) -> Values:
    """Twice the largest change of what is compared after Newton on a finer rod."""
    still, one, none = np.zeros((len(z), finer.size)), np.ones(len(z)), np.zeros(len(z))

    def correction(at: Lanes) -> Lanes:
        return finer.advance(at, p, np.zeros_like(p), still, one, none).dz

    def change(at: Lanes) -> Values:
        return np.asarray(np.abs(compared(finer, at, p) - compared(rod, z, p)).max(axis=1))

    return error_by_refinement(rod.guess_for(finer, z, p), correction, change)

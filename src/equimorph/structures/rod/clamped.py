"""PlanarMechanics of the clamped rod: energy, residual, derivatives and solves in batches.

Fields are recovered to the accuracy that they have at vertices.

See docs/decisions.md, "Kernels of the rod" and "Two mechanics of rods stay".
"""

from functools import cached_property, partial

import numpy as np

from equimorph.arrays import (
    Directions,
    Float,
    Int,
    Lanes,
    Nodal,
    Parameters,
    Sides,
    Values,
    Velocity,
)
from equimorph.linalg import BorderedSolution, CondensedLayout, no_border
from equimorph.linalg.condensed import PIVOT_GUARD, REFINABLE
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.contract import CompiledSteps, Symmetry
from equimorph.structures.equations import (
    Advance,
    AnyBorder,
    CompiledNewton,
    Direction,
    Force,
    LinearSystem,
    Response,
    Shift,
)
from equimorph.structures.rod.clamped_derivative_kernels import (
    energy_lanes,
    linearise_lanes,
    matrix_lanes,
    parameter_lanes,
    residual_lanes,
    second_lanes,
)
from equimorph.structures.rod.clamped_fields import ClampedFields
from equimorph.structures.rod.clamped_kernels import advance_lanes, advance_under_lanes
from equimorph.structures.rod.clamped_march_kernels import march_lanes, newton_lanes, search_lanes
from equimorph.structures.rod.clamped_response_kernels import MOST, respond_lanes
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.inertia import (
    inextensible_force,
    inextensible_inertia,
    inextensible_places,
)
from equimorph.structures.rod.mechanics import Bounds, PlanarMechanics
from equimorph.structures.rod.planar_energy import PlanarEnergy
from equimorph.structures.rod.profiles import LoadShape
from equimorph.structures.rod.units import FOUR_PI_SQUARED
from equimorph.structures.rod.waves import MODES, single_waves

PARAMETERS = 4
"""Number of parameters: Θ, Δ, q, ν."""


class ClampedMechanics(PlanarMechanics):
    """PlanarMechanics of the uniform rod between two clamps under one vertical line load.

    L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load
    weights R = m ρ and K the stiffness over 4π². Parameters (Θ, Δ, q, ν), multipliers (λ, μ).
    """

    constraints = 2
    parameters = PARAMETERS
    held = (True, True)

    def __init__(self, mesh: Mesh, load: LoadShape) -> None:
        self.mesh, self.load = mesh, load
        self.rho = load.cumulate(mesh)
        self.loads = mesh.assemble(self.rho)
        scaled = mesh.stiffness / FOUR_PI_SQUARED
        self.layout = CondensedLayout(scaled, np.array([1, mesh.elements - 1]))
        self.unknowns = len(mesh.nodes) - 2
        self.mass = mesh.weights[1:-1].copy()
        self.recovery = ClampedFields(mesh, load, self.layout.stiffness, self.rho)

    @cached_property
    def _matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stiffness, quadrature weights and load weights, as the kernels take them."""
        return self.layout.stiffness, self.mesh.weights, self.loads

    @cached_property
    def _step_data(self) -> tuple[np.ndarray, ...]:
        """What the fused step shares among lanes."""
        return self.layout.stiffness, self.layout.ends, self.mesh.weights, self.loads

    @property
    def unknown_nodes(self) -> slice:
        """All but the ends."""
        return slice(1, -1)

    # --- fields -----------------------------------------------------------------------------

    def nodal_angles(self, z: Lanes, p: Parameters) -> Nodal:
        """Angles θ at all nodes, the prescribed ends included."""
        z, p = self.check_widths((z, p))
        theta = np.empty((len(z), self.unknowns + 2))
        theta[:, 1:-1] = z[:, : self.unknowns]
        theta[:, 0], theta[:, -1] = p[:, 1] + p[:, 0], p[:, 1] - p[:, 0]
        return theta

    def fields(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths, recovered from the vertices."""
        z, p = self.check_widths((z, p))
        return self.recovery.fields(z, p, s)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the first arclength where it is."""
        z, p = self.check_widths((z, p))
        return self.recovery.largest_curvature(z, p)

    def kkt(
        self, z: Lanes, p: Parameters, shift: Shift = None
    ) -> tuple[Nodal, Float[np.ndarray, "lanes 2 nodes"]]:
        """F_z − shift·mass as `layout` takes it: diagonal to add to the stiffness, constraints."""
        z, p = self.check_widths((z, p))
        lanes, nodes = len(z), self.unknowns + 2
        diagonal, gradients = np.empty((lanes, nodes)), np.empty((lanes, 2, nodes))
        moved = np.zeros(lanes) if shift is None else np.ascontiguousarray(shift)
        over_lanes(matrix_lanes, self._matrices[1:], [z, p, moved], [diagonal, gradients])
        return diagonal, gradients

    # --- contract ---------------------------------------------------------------------------

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """∫ θ'²/(8π²) − q ∫ ρ sin θ."""
        z, p = self.check_widths((z, p))
        out = np.empty(len(z))
        energy_lanes(self.layout.stiffness, self.loads, z, p, out)
        return out

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """(∂L/∂θ at the inner nodes, ∫cos θ − ν, ∫ sin θ)."""
        return self._residual(z, p)[0]

    def _residual(self, z: Lanes, p: Parameters) -> tuple[Lanes, Float[np.ndarray, "lanes 3"]]:
        """F, and ∂L/∂(θ(0), θ(1), q)."""
        z, p = self.check_widths((z, p))
        out, ends = np.empty_like(z), np.empty((len(z), 3))
        over_lanes(residual_lanes, self._matrices, [z, p], [out, ends])
        return out, ends

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        z, p, _, dp = self.check_widths((z, p), (z, dp))
        out = np.empty_like(z)
        over_lanes(parameter_lanes, self._matrices, [z, p, dp], [out])
        return out

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        arrays = self.check_widths((z, p), v, w)
        out = np.empty_like(arrays[0])
        over_lanes(second_lanes, self._matrices[1:], arrays, [out])
        return out

    @cached_property
    def planar_energy(self) -> PlanarEnergy:
        """Tables of the energy, as those of `RodModel`: y = (λ, μ, Θ, Δ, q, ν, 1)."""
        nodes, scalars = self.unknowns + 2, self.constraints + PARAMETERS + 1
        sines, cosines, nothing = np.zeros((3, scalars, nodes))
        sines[1], sines[4], cosines[0] = self.mesh.weights, -self.loads, self.mesh.weights
        turned, span = np.zeros((nodes, scalars)), np.zeros((scalars, scalars))
        turned[[0, -1], 2], turned[[0, -1], 3], span[[0, 5], [5, 0]] = (1.0, -1.0), 1.0, -1.0
        return PlanarEnergy(
            place=np.r_[-1, : self.unknowns, -1], turned=turned,
            elements=self.mesh.element_nodes, stiffness=self.layout.stiffness,
            springs=np.zeros(nodes), slope=nothing, points=np.arange(nodes), sine=sines,
            cosine=cosines, stretch=nothing, tension=nothing, softness=np.zeros(nodes),
            quadratic=span, pressure=np.zeros((0, scalars)),
        )  # fmt: skip

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂(Θ, Δ, q, ν): actuator couples, ∫Qy, −λ."""
        first, last, lift = self._residual(z, p)[1].T
        return np.stack([first - last, first + last, lift, -z[:, -2]], axis=1)

    def nodal_places(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes 2"]:
        """Places of all nodes by integrals from end A."""
        return inextensible_places(self.mesh, self.nodal_angles(z, p))

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """JᵀWJ of the inner nodes' angles."""
        return inextensible_inertia(self.mesh, self.nodal_angles(z, p))[:, 1:-1, 1:-1]

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ of the inner nodes' angles."""
        rates = np.pad(velocity, ((0, 0), (1, 1)))
        return inextensible_force(self.mesh, self.nodal_angles(z, p), rates)[:, 1:-1]

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        return self._solve(*self.kkt(z, p, shift), rhs, border)

    def linear_system(self, z: Lanes, p: Parameters, directions: Directions) -> LinearSystem:
        """One kernel for F, F_p along directions and the matrix."""
        z, p = self.check_widths((z, p))
        (lanes, k, _), nodes = directions.shape, self.unknowns + 2
        given = [z, p, np.ascontiguousarray(directions)]
        residual, columns = np.empty_like(z), np.empty((lanes, k, self.size))
        diagonal, gradients = np.empty((lanes, nodes)), np.empty((lanes, 2, nodes))
        out = [residual, columns, diagonal, gradients]
        over_lanes(linearise_lanes, self._matrices, given, out)
        solve = partial(self._solve, diagonal, gradients)
        null = partial(self.layout.near_null, diagonal, gradients)
        return LinearSystem(residual, columns, solve, null)

    def _solve(
        self,
        diagonal: Nodal,
        gradients: Float[np.ndarray, "lanes 2 nodes"],
        rhs: Sides,
        border: AnyBorder,
    ) -> BorderedSolution:
        """Solve with F_z, given by its parts, bordered."""
        around = no_border(len(rhs), self.size) if border is None else border
        return self.layout.solve(diagonal, gradients, *around, rhs)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One fused kernel."""
        given = (z, p, dp, row, corner, defect)
        return self.fused_advance(advance_lanes, self._step_data, *given)

    def advance_under(
        self, force: Force, z: Lanes, p: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One fused kernel; lanes with an unsafe pivot take the general solve."""
        given = z, p, row, corner, defect
        return self.fused_advance_under(advance_under_lanes, self._step_data, force, *given)

    def correction(self, z: Lanes, p: Parameters) -> Advance:
        """The fused kernel, whose steps are exact enough down to smaller pivots."""
        z, p = self.check_widths((z, p))
        rest = np.zeros_like(p), np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
        found = self.fused_step(advance_lanes, self._step_data, z, p, *rest)
        return self.pivot_steps(*found, z, p, *rest, guard=REFINABLE)

    fused_directions = MOST

    def respond(self, z: Lanes, p: Parameters, directions: Directions) -> Response:
        """One fused kernel; lanes with an unsafe pivot take the general solve."""
        if directions.shape[1] > MOST:
            return super().respond(z, p, directions)
        out = self._fused_response(z, p, directions)
        unsafe = (~(out.ratio >= PIVOT_GUARD)).nonzero()[0]
        if len(unsafe):
            again = super().respond(z[unsafe], p[unsafe], directions[unsafe])
            for name, column in vars(again).items():
                getattr(out, name)[unsafe] = column
        return out

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian, as the fused kernel counts them."""
        out = self._fused_response(z, p, np.zeros((len(z), 0, PARAMETERS)))
        unsafe = (~(out.ratio >= PIVOT_GUARD)).nonzero()[0]
        if len(unsafe):
            out.index[unsafe] = super().index(z[unsafe], p[unsafe])
        return out.index

    def _fused_response(self, z: Lanes, p: Parameters, directions: Directions) -> Response:
        (z, p), (lanes, k) = self.check_widths((z, p)), directions.shape[:2]
        dz, tangents = np.empty_like(z), np.empty((lanes, k, self.size))
        index, determinant, ratio = np.empty(lanes, int), np.empty((lanes, 2)), np.empty(lanes)
        out = (dz, tangents, index, determinant, ratio)
        given = [z, p, np.ascontiguousarray(directions)]
        over_lanes(respond_lanes, self._step_data, given, out)
        return Response(*out)

    @cached_property
    def compiled_newton(self) -> CompiledNewton:
        """The loop over the fused step."""
        guards, widths = (REFINABLE, PIVOT_GUARD), (self.size, PARAMETERS)
        return CompiledNewton(newton_lanes, (self._step_data,), guards, widths)

    def compiled_steps(self, bounds: Bounds) -> CompiledSteps:
        """Loops over the fused step and the search for the largest curvature."""
        tables = self._step_data, self.recovery.extremum_data
        return CompiledSteps(march_lanes, search_lanes, tables, bounds, PIVOT_GUARD)

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Linear angles plus random sine waves, with random support forces.

        Eight waves and forces up to about 16 reach the compressed shapes with max |κ| near 20;
        `single_waves` those that finer elements resolve.
        """
        lanes, s = len(p), self.mesh.nodes[1:-1]
        waves = np.sin(np.pi * np.outer(MODES, s))
        amplitude = generator.normal(size=(lanes, len(MODES))) * (3.0 / MODES)
        amplitude *= generator.uniform(size=(lanes, 1))
        base = (p[:, 1] + p[:, 0])[:, None] * (1 - s) + (p[:, 1] - p[:, 0])[:, None] * s
        theta, forces = base + amplitude @ waves, generator.normal(size=(lanes, 2)) * 8.0
        some, wave, forces[some, 0] = single_waves(self.mesh, (True, True), lanes, generator)
        theta[some], forces[some, 1] = base[some] + wave[:, 1:-1], 0.0
        return np.concatenate([theta, forces], axis=1)

    def support_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
        """λ and μ."""
        return z[:, -2:].copy()

    def end_moments(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
        """∂L/∂θ(0) and ∂L/∂θ(1)."""
        return self._residual(z, p)[1][:, :2].copy()

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror x → ν − x for symmetric loads: θ(s) → −θ(1 − s), Δ → −Δ."""
        nodes, points = self.mesh.nodes, np.linspace(0.013, 0.487, 40)
        density = self.load.density
        if not np.allclose(density(points), density(1.0 - points), atol=1e-12):
            return ()
        if not np.allclose(nodes, 1.0 - nodes[::-1], atol=1e-12):
            return ()
        return (Symmetry("mirror", self._mirror, np.array([1.0, -1.0, 1.0, 1.0])),)

    def _mirror(self, z: Lanes, p: Parameters) -> tuple[Lanes, Parameters]:
        """θ(s) → −θ(1 − s), μ → q∫Q − μ, Δ → −Δ."""
        n, total = self.unknowns, self.rho[-1, -1]
        image = z.copy()
        image[:, :n] = -z[:, :n][:, ::-1]
        image[:, -1] = p[:, 2] * total - z[:, -1]
        return image, p * np.array([1.0, -1.0, 1.0, 1.0])

"""Mechanics of a rod in space: its matrix, solves with it, and Newton steps, in batches."""

from functools import cache, cached_property, partial

import numpy as np

from equimorph.arrays import (
    Directions,
    Entries,
    Float,
    Int,
    Lanes,
    Parameters,
    Sides,
    Values,
)
from equimorph.linalg import Border, BorderedSolution
from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.linalg.dense import no_border
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.equations import (
    Advance,
    AnyBorder,
    Direction,
    Equations,
    Force,
    LinearSystem,
    Shift,
)
from equimorph.structures.spatial.derivative_kernels import equations_lanes
from equimorph.structures.spatial.energy_kernels import energies_lanes
from equimorph.structures.spatial.lagrangian import LENGTH_STIFFNESS, SpatialLagrangian
from equimorph.structures.spatial.model import SpatialModel
from equimorph.structures.spatial.quaternions import PAIRS, Jet
from equimorph.structures.spatial.solve_kernels import solve_bordered_lanes
from equimorph.structures.spatial.step_kernels import advance_lanes


def step_tables(
    model: SpatialModel, lengths: Float[np.ndarray, " unknown"]
) -> tuple[np.ndarray, ...]:
    """What `step_kernels.advance_lanes` shares among lanes.

    Nodes of elements stand in the order of elimination: inner ones, left, right. Tables of the
    scalars belong to those with entries only, whose numbers among (p, 1) come after each table.
    `lengths` is half the stiffness of the lengths of unknown quaternions.
    """
    mesh, m = model.mesh, model.multipliers
    places = np.array([*range(1, mesh.degree), 0, mesh.degree])
    slopes = mesh.reference.derivative / mesh.lengths[:, None, None]
    weights = mesh.element_weights[:, places]
    stiff = weights[..., None] * model.stiffness[:, places]
    whole = np.ones(len(mesh.nodes))
    whole[model.unknown_nodes] = lengths
    forces, force_picks = _in_use(model.force[m:, :, places])
    moments, moment_picks = _in_use(model.moment[m:, :, places] * weights[..., None])
    torsion, torsion_picks = _in_use(model.torsion[m:, :, places] * weights)
    axes, closing, compliance = _closures(model)
    softness = model.softness[:, places] if model.soft else model.softness[:0]
    # the kernel weights the axes of the cross-section, and so the forces
    tables = (
        places, slopes[:, places][:, :, places], weights, stiff, moments, moment_picks, torsion,
        torsion_picks, forces, force_picks, *_in_use(model.tension[m:, :, places]), softness,
        model.turned[:, :, m:].reshape(6, -1),
        np.array(model.held, dtype=np.int64), axes, closing, compliance, whole,
    )  # fmt: skip
    return tuple(np.ascontiguousarray(each) for each in tables)


def equation_tables(
    model: SpatialModel, lengths: Float[np.ndarray, " unknown"]
) -> tuple[np.ndarray, ...]:
    """What `derivative_kernels.equations_lanes` shares among lanes, after the pairs of its jets.

    `lengths` are those of `step_tables`.
    """
    *tables, quadratic = energy_tables(model, lengths)
    return *tables, quadratic[: model.multipliers]


def energy_tables(
    model: SpatialModel, lengths: Float[np.ndarray, " unknown"]
) -> tuple[np.ndarray, ...]:
    """What `energy_kernels.energies_lanes` shares among lanes, after the pairs of its jets."""
    whole = np.ones(len(model.mesh.nodes))
    whole[model.unknown_nodes] = lengths
    return *field_tables(model), whole, np.ascontiguousarray(model.quadratic)


def condition_tables(model: SpatialModel) -> tuple[np.ndarray, ...]:
    """What `phase_kernels.condition_lanes` shares among lanes."""
    _, weights, *_, forces, picks, tension, tied, softness, turned, held = field_tables(model)
    quadratic = np.ascontiguousarray(model.quadratic)
    tables = weights, forces, picks, tension, tied, softness, turned, held, quadratic
    return pairs_of(1)[0], *tables


def field_tables(model: SpatialModel) -> tuple[np.ndarray, ...]:
    """Stiffnesses, loads and clamps by all scalars, at the nodes of elements in their order."""
    mesh = model.mesh
    slopes = mesh.reference.derivative / mesh.lengths[:, None, None]
    softness = model.softness if model.soft else model.softness[:0]
    tables = (
        slopes, mesh.element_weights, model.stiffness, *_in_use(model.moment),
        *_in_use(model.torsion), *_in_use(model.force), *_in_use(model.tension), softness,
        model.turned, np.array(model.held, dtype=np.int64),
    )  # fmt: skip
    return tuple(np.ascontiguousarray(each) for each in tables)


@cache
def pairs_of(parts: int) -> tuple[Int[np.ndarray, "pairs 3"], Int[np.ndarray, "parts 3"]]:
    """Pairs of parts whose products make those of a jet; and of those with a constant."""
    rows = [(to, a, b) for to, pairs in enumerate(PAIRS[parts]) for a, b in pairs]
    return np.array(rows), np.array([(part, part, 0) for part in range(parts)])


def _in_use(
    rows: Float[np.ndarray, "scalars ..."],
) -> tuple[np.ndarray, Int[np.ndarray, " used"]]:
    """Rows with entries, and their numbers."""
    picks = np.flatnonzero(np.abs(rows).reshape(len(rows), -1).max(axis=1) > 0.0)
    return rows[picks], picks


def _closures(
    model: SpatialModel,
) -> tuple[Int[np.ndarray, "3"], Float[np.ndarray, "3 scalars"], Float[np.ndarray, "3 3"]]:
    """Multiplier of each coordinate or −1, its row of the quadratic form, and the compliances."""
    m = model.multipliers
    axes, closing = np.full(3, -1), np.zeros((3, model.scalars - m))
    compliance = -np.eye(3)
    for k in range(m):
        axis = int(np.argmax(np.abs(model.force[k, 0, 0])))
        axes[axis] = k
        closing[axis] = model.quadratic[k, m:]
    held = np.flatnonzero(axes >= 0)
    compliance[np.ix_(held, held)] = model.quadratic[np.ix_(axes[held], axes[held])]
    return axes, closing, compliance


class SpatialMechanics(SpatialLagrangian, Equations):
    """Mechanics of the Lagrangian of a `SpatialModel`; methods as in `structures.contract`."""

    @cached_property
    def layout(self) -> SparseLayout:
        """Sparsity of F_z: dense blocks of elements, and a border."""
        first, size = self.model.unknown_nodes.start, self.size
        unknowns = (4 * (self.mesh.element_nodes - first))[:, :, None] + np.arange(4)
        blocks = unknowns.reshape(self.mesh.elements, -1)
        rows = np.repeat(blocks, blocks.shape[1], axis=1)
        columns = np.tile(blocks, blocks.shape[1])
        inside = (rows < self.unknowns) & (columns <= rows) & (columns >= 0)
        border = np.arange(self.unknowns * size, size * size)
        border = border[border // size >= border % size]
        keys = np.unique(np.concatenate([rows[inside] * size + columns[inside], border]))
        return SparseLayout(keys // size, keys % size, size, self.constraints)

    @cached_property
    def _groups(self) -> Int[np.ndarray, " size"]:
        """Groups of columns of F_z: inner nodes by their place in elements, vertices, multipliers.

        Two columns of a group have no rows of this or an earlier group in common: inner nodes of
        different elements work on vertices only, and of three vertices in a row each has its group.
        """
        nodes = np.arange(self.unknowns // 4) + self.model.unknown_nodes.start
        inner, vertex = nodes % self.mesh.degree, nodes // self.mesh.degree
        own = np.where(inner > 0, inner - 1, self.mesh.degree - 1 + vertex % 3)
        groups = (4 * own[:, None] + np.arange(4)).ravel()
        last = 4 * (self.mesh.degree + 2)
        return np.concatenate([groups, last + np.arange(self.constraints)])

    def entries(self, z: Lanes, p: Parameters, shift: Shift = None) -> Entries:
        """Entries of F_z − shift·mass in the order of `layout`, by derivatives along directions.

        For lanes with an unsafe pivot.
        """
        rows, columns, groups = self.layout.rows, self.layout.columns, self._groups
        count, lanes = int(groups.max()) + 1, len(z)
        ways = np.tile((np.arange(count)[:, None] == groups).astype(float), (lanes, 1))
        many = z.repeat(count, axis=0), p.repeat(count, axis=0)
        found = self.equations(*many, (ways, np.zeros_like(many[1])))[1]
        found = found.reshape(lanes, count, self.size)
        # F_z is symmetric, and the column of the later group is alone in the row of the other
        later = groups[rows] > groups[columns]
        column, row = np.where(later, rows, columns), np.where(later, columns, rows)
        entries = np.asarray(found[:, groups[column], row])
        if shift is not None:
            entries[:, self.layout.diagonal[: self.unknowns]] -= shift[:, None] * self.mass
        return entries

    # --- equations ------------------------------------------------------------------------------

    def equations(self, z: Lanes, p: Parameters, *directions: Direction, mixed: bool = True) -> Jet:
        """F with its derivatives along none, one or two directions, and the mixed one if asked."""
        self.check_widths((z, p), *directions)
        lanes, k = len(z), len(directions)
        parts = 2**k if mixed else 1 + k
        moves_z, moves_p = np.empty((lanes, k, self.size)), np.empty((lanes, k, self.parameters))
        for i, (dz, dp) in enumerate(directions):
            moves_z[:, i], moves_p[:, i] = dz, dp
        out = np.empty((lanes, parts, self.size))
        inputs = [np.ascontiguousarray(z), np.ascontiguousarray(p), moves_z, moves_p]
        over_lanes(equations_lanes, (*pairs_of(parts), *self._equation_tables), inputs, [out])
        return np.moveaxis(out, 1, 0)

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""
        return np.ascontiguousarray(self.equations(z, p)[0])

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        return np.ascontiguousarray(self.equations(z, p, (np.zeros_like(z), dp))[1])

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        return np.ascontiguousarray(self.equations(z, p, v, w)[3])

    def linear_system(self, z: Lanes, p: Parameters, directions: Directions) -> LinearSystem:
        """F, F_p along directions, two in each call of the kernel, and solves with F_z."""
        moves = [(np.zeros_like(z), dp) for dp in directions.transpose(1, 0, 2)]
        twos = [moves[i : i + 2] for i in range(0, max(len(moves), 1), 2)]
        jets = [self.equations(z, p, *two, mixed=False) for two in twos]
        columns = [column for jet in jets for column in jet[1:]]
        along = np.stack(columns, axis=1) if columns else np.zeros((len(z), 0, self.size))
        return LinearSystem(np.ascontiguousarray(jets[0][0]), along, partial(self.solve, z, p))

    def along_orbits(self, z: Lanes, p: Parameters) -> Lanes:
        """Rates of z at which states turn about an axis for nothing: 0."""
        return np.zeros_like(z)

    # --- energy ---------------------------------------------------------------------------------

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """L without the multipliers' part."""
        return self._energies(z, p)[0]

    def shortenings(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points"]:
        """Elastic shortenings of the axis at the nodes of every element."""
        return self._energies(z, p)[1]

    def _energies(
        self, z: Lanes, p: Parameters
    ) -> tuple[Values, Float[np.ndarray, "lanes points"]]:
        self.check_widths((z, p))
        energies, shortenings = np.empty(len(z)), np.empty((len(z), self.weights.size))
        inputs = [np.ascontiguousarray(z), np.ascontiguousarray(p)]
        shared = pairs_of(1)[0], *self._energy_tables
        over_lanes(energies_lanes, shared, inputs, [energies, shortenings])
        return energies, shortenings

    # --- solves ---------------------------------------------------------------------------------

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered.

        One kernel; lanes with an unsafe pivot take the sparse solve, which may pivot.
        """
        self.check_widths((z, p))
        around = no_border(len(z), self.size) if border is None else border
        found = self.eliminate(z, p, rhs, around, shift, np.empty((len(z), 0)))
        return self.pivot(found, z, p, rhs, around, shift)

    def eliminate(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Sides,
        around: Border,
        shift: Shift,
        springs: Float[np.ndarray, "lanes parts"],
    ) -> BorderedSolution:
        """The compiled solve, with the springs of its kernel; lanes to be pivoted are flagged."""
        lanes = len(z)
        lowered = np.zeros(lanes) if shift is None else shift * (2.0 / LENGTH_STIFFNESS)
        inputs = [np.ascontiguousarray(each) for each in (z, p, lowered, springs, *around, rhs)]
        x, ratio, determinant = np.empty(rhs.shape), np.empty(lanes), np.empty((lanes, 2))
        negative = np.empty(lanes, dtype=np.int64)
        outputs = [x, negative, determinant, ratio]
        over_lanes(solve_bordered_lanes, self.step_tables, inputs, outputs)
        negative -= 3 - self.constraints
        determinant[:, 0] *= self.determinant_sign
        return BorderedSolution(x, negative, ratio, ~(ratio >= PIVOT_GUARD), determinant)

    def pivot(
        self,
        found: BorderedSolution,
        z: Lanes,
        p: Parameters,
        rhs: Sides,
        around: Border,
        shift: Shift,
        last: Lanes | None = None,
    ) -> BorderedSolution:
        """Solutions where those flagged come from the sparse solve, with a last row if given."""
        if len(unsafe := np.flatnonzero(found.pivoted)):
            entries = self.entries(z[unsafe], p[unsafe], None if shift is None else shift[unsafe])
            if last is not None:
                own = self.layout.rows == self.size - 1
                entries[:, own] = last[unsafe][:, self.layout.columns[own]]
            some = tuple(np.ascontiguousarray(each[unsafe]) for each in around)
            again = self.layout.solve(entries, (some[0], some[1], some[2]), rhs[unsafe])
            found.take_over(unsafe, again)
            found.pivot_ratio[unsafe] = again.pivot_ratio
        return found

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian, from the pivots of the fused step."""
        row, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
        return self.advance(z, p, np.zeros_like(p), row, one, none).index

    @cached_property
    def _equation_tables(self) -> tuple[np.ndarray, ...]:
        return equation_tables(self.model, 0.5 * self.stiff_lengths)

    @cached_property
    def _energy_tables(self) -> tuple[np.ndarray, ...]:
        return energy_tables(self.model, 0.5 * self.stiff_lengths)

    @cached_property
    def step_tables(self) -> tuple[np.ndarray, ...]:
        """What the kernels of steps and solves share among lanes."""
        return step_tables(self.model, 0.5 * self.stiff_lengths)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`.

        One fused kernel; lanes with an unsafe pivot take the general solve.
        """
        none = np.empty((len(z), 0))
        given = z, p, dp, row, corner, defect, none, none, none
        return self.fused_advance(advance_lanes, self.step_tables, *given)

    def advance_under(
        self, force: Force, z: Lanes, p: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One fused kernel; lanes with an unsafe pivot take the general solve."""
        given = z, p, row, corner, defect, np.empty((len(z), 0))
        return self.fused_advance_under(advance_lanes, self.step_tables, force, *given)

    @property
    def determinant_sign(self) -> float:
        """Directions without a closure have the pivot −1 in the fused kernel."""
        return (-1.0) ** (3 - self.constraints)

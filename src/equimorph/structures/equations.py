"""F(z; p) = 0 with its derivatives and solves: what Newton's method asks of a structure."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from equimorph.arrays import Determinants, Directions, Float, Int, Lanes, Parameters, Sides, Values
from equimorph.linalg import Border, BorderedSolution
from equimorph.linalg.intervals import Interval
from equimorph.linalg.null_vectors import near_null

Direction = tuple[Lanes, Parameters]


@dataclass(frozen=True)
class Advance:
    """One Newton step on a curve through the equilibrium set, with the tangent.

    The bordered system is ``[F_z F_t; row corner] [dz; dt] = −[F; defect]`` with
    ``F_t = F_p·dp``; the tangent solves it for the right-hand side ``[0; 1]``.

    determinant: that of F_z as m and e of m·2^e where it costs nothing, else m is nan.
    """

    dz: Lanes
    dt: Values
    tangent_z: Lanes
    tangent_t: Values
    residual: Values
    index: Int[np.ndarray, " lanes"]
    determinant: Determinants


@dataclass(frozen=True)
class Response:
    """One Newton step dz at fixed parameters, and tangents: changes of z along directions.

    index, determinant: those of F_z as in `Advance`; ratio: smallest over largest pivot, nan where
    pivots are not trusted.
    """

    dz: Lanes
    tangents: Float[np.ndarray, "lanes k size"]
    index: Int[np.ndarray, " lanes"]
    determinant: Determinants
    ratio: Values


Force = tuple[Lanes, Lanes]
"""A force on the unknowns, which F equals along a curve, and its growth."""


@dataclass(frozen=True)
class CompiledNewton:
    """Newton's method as one loop over the kernel of a structure's step.

    Its steps are those of `Equations.correction` at fixed parameters, else of `Equations.advance`.
    """

    run: Callable[..., tuple[int, int]]
    """`newton_kernels.newton_of`, made with the structure's step."""
    tables: tuple[tuple[np.ndarray, ...], ...]
    """What it shares among lanes."""
    guards: tuple[float, float]
    """Least ratios of the pivots of a step, at fixed parameters and in planes; below them those
    methods take the step."""
    widths: tuple[int, int]
    """Entries of z and p."""


AnyBorder = Border | None
"""Columns, rows and corner around a matrix, or none."""
Shift = Values | None
"""Shift of the spectrum in each lane, or none."""
Solver = Callable[[Sides, AnyBorder], BorderedSolution]


@dataclass(frozen=True)
class LinearSystem:
    """F and its derivatives at points, computed together.

    residual: F; columns: F_p·d for each of k directions; solve: with F_z, bordered or not;
    near_null: what `null_border` computes, where that is possible at once.
    """

    residual: Lanes
    columns: Float[np.ndarray, "lanes k size"]
    solve: Solver
    near_null: Callable[[], Lanes] | None = None

    def null_border(self) -> Lanes:
        """Unit vectors near the null vectors of F_z, by bordered solves that stay regular there."""
        if self.near_null is not None:
            return self.near_null()
        return near_null(lambda rhs, border: self.solve(rhs, border).x, *self.residual.shape)


@dataclass(frozen=True)
class Enclosed:
    """F and its first derivatives over boxes, enclosed.

    residual: F (lanes, size); matrix: F_z, symmetric (lanes, size, size); columns: F_p (lanes,
    size, parameters).
    """

    residual: Interval
    matrix: Interval
    columns: Interval


class Equations(ABC):
    """F(z; p) = 0 with its derivatives, in batches, lanes first.

    ``z = (u, λ)`` has `unknowns` + `constraints` entries.
    """

    unknowns: int
    """Entries of z that the metric measures."""
    constraints: int
    """The other entries of z."""
    mass: Float[np.ndarray, " unknowns"]
    """Diagonal of the mass matrix: the metric of margins, distances and lengths."""

    @property
    def size(self) -> int:
        """Length of z."""
        return self.unknowns + self.constraints

    @property
    @abstractmethod
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """Change of each parameter that counts as one unit of length."""

    @abstractmethod
    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""

    @abstractmethod
    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""

    @abstractmethod
    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w], second derivative of F along two directions (dz, dp)."""

    def enclosure(self, z: Interval, p: Interval) -> Enclosed | None:
        """F and its first derivatives over boxes of states (lanes, size) and parameters.

        All values in the boxes lie within the bounds, rounding included; None if this structure
        knows no bounds.
        """
        return None

    def plain_energy(self) -> dict[str, Any] | None:
        """Energy in plain numbers, from which others compute F; None where none are written.

        Route certificates carry it; ``checker/check_route.py`` says how each kind is read.
        """
        return None

    @abstractmethod
    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with the KKT matrix F_z − shift·mass, bordered by (columns, rows, corner).

        The shift acts on the unknowns, not on the multipliers. `equimorph.linalg.solve_bordered`
        does it for a dense matrix, `DiscreteStructure` for a sparse one.
        """

    def solve_whole(
        self, z: Lanes, p: Parameters, rhs: Sides, shift: Values
    ) -> Float[np.ndarray, "lanes k size"]:
        """Solve with F_z − shift·mass, which is regular, where `solve` may leave orbits out."""
        return self.solve(z, p, rhs, None, shift).x

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian."""
        nothing = np.zeros((len(z), 0, self.size))
        return self.solve(z, p, nothing).negative - self.constraints

    def linear_system(self, z: Lanes, p: Parameters, directions: Directions) -> LinearSystem:
        """F, F_p along directions, and solves with F_z, for several solves at the same points.

        Here each part is computed by its own method; a structure that computes parts together says
        so by its own `linear_system`.
        """
        (lanes, k), size = directions.shape[:2], self.size
        changes = directions.reshape(lanes * k, directions.shape[2])
        many = (z.repeat(k, axis=0), p.repeat(k, axis=0), changes)
        columns = self.parameter_derivative(*many) if k else np.zeros((0, size))
        solve = partial(self.solve, z, p)
        return LinearSystem(self.residual(z, p), columns.reshape(lanes, k, size), solve)

    @property
    def compiled_newton(self) -> CompiledNewton | None:
        """Newton's method compiled as a whole; None: it is not."""
        return None

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`; see `Advance`."""
        system = self.linear_system(z, p, dp[:, None])
        return advance_by(system, row, corner, defect, self.constraints)

    def advance_under(
        self, force: Force, z: Lanes, p: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step at fixed parameters along ``F(z; p) = force``, which grows."""
        (now, growth), width = force, p.shape[1]
        here = self.linear_system(z, p, np.zeros((len(z), 0, width)))
        system = LinearSystem(here.residual - now, -growth[:, None], here.solve)
        return advance_by(system, row, corner, defect, self.constraints)

    fused_directions: int = 0
    """Most directions with which `respond` costs less than `linear_system` with its solves."""

    def respond(self, z: Lanes, p: Parameters, directions: Directions) -> Response:
        """One Newton step at fixed parameters, and the tangents along some directions.

        Without directions only index and determinant need be told.
        """
        if directions.shape[1] == 0:
            still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
            here = self.advance(z, p, np.zeros_like(p), still, one, none)
            told = here.index, here.determinant, np.full(len(z), np.nan)
            return Response(here.dz, np.zeros((len(z), 0, self.size)), *told)
        (lanes, k), size = directions.shape[:2], self.size
        # one call for all directions: calls cost more than lanes
        many, dp = k * lanes, directions.transpose(1, 0, 2).reshape(k * lanes, -1)
        still, one, none = np.zeros((many, size)), np.ones(many), np.zeros(many)
        out = self.advance(np.tile(z, (k, 1)), np.tile(p, (k, 1)), dp, still, one, none)
        tangents = out.tangent_z.reshape(k, lanes, size).transpose(1, 0, 2)
        told = out.index[:lanes], out.determinant[:lanes], np.full(lanes, np.nan)
        return Response(out.dz[:lanes], np.ascontiguousarray(tangents), *told)

    def correction(self, z: Lanes, p: Parameters) -> Advance:
        """One Newton step at fixed parameters, without a tangent.

        It may be less exact than `advance`: the error of a correction is itself corrected.
        """
        lanes = len(z)
        return self.advance(
            z, p, np.zeros(p.shape), np.zeros(z.shape), np.ones(lanes), np.zeros(lanes)
        )


class JointEquations(Equations):
    """Equations whose F, F_p·dp and F_z are computed together."""

    @abstractmethod
    def linearised(self, z: Lanes, p: Parameters, dp: Parameters) -> tuple[np.ndarray, ...]:
        """F, F_p·dp and the parts of F_z."""

    def parts(self, z: Lanes, p: Parameters) -> tuple[np.ndarray, ...]:
        """The parts of F_z."""
        return self.linearised(z, p, np.zeros_like(p))[2:]

    @abstractmethod
    def solver(
        self, parts: tuple[np.ndarray, ...], z: Lanes, p: Parameters, shift: Shift = None
    ) -> Solver:
        """Solves with F_z − shift·mass, given by the parts of F_z."""

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""
        return self.linearised(z, p, np.zeros_like(p))[0]

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        return self.linearised(z, p, dp)[1]

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        return self.solver(self.parts(z, p), z, p, shift)(rhs, border)

    def linear_system(self, z: Lanes, p: Parameters, directions: Directions) -> LinearSystem:
        """F, F_p along directions, and solves with F_z; computed together."""
        changes = [np.ascontiguousarray(each) for each in directions.transpose(1, 0, 2)]
        first = changes[0] if changes else np.zeros_like(p)
        residual, column, *parts = self.linearised(z, p, first)
        others = [self.linearised(z, p, dp)[1] for dp in changes[1:]]
        columns = np.stack([column, *others], axis=1)[:, : len(changes)]
        return LinearSystem(residual, columns, self.solver(tuple(parts), z, p))


def advance_by(
    system: LinearSystem, row: Lanes, corner: Values, defect: Values, constraints: int
) -> Advance:
    """`Advance` by the general bordered solve of a linear system with one column."""
    rhs = np.zeros((len(row), 2, row.shape[1] + 1))
    rhs[:, 0, :-1], rhs[:, 0, -1], rhs[:, 1, -1] = -system.residual, -defect, 1.0
    solution = system.solve(rhs, (system.columns, row[:, None], corner[:, None, None]))
    step, tangent = solution.x[:, 0], solution.x[:, 1]
    return Advance(
        np.ascontiguousarray(step[:, :-1]),
        step[:, -1].copy(),
        np.ascontiguousarray(tangent[:, :-1]),
        tangent[:, -1].copy(),
        np.abs(system.residual).max(axis=1),
        solution.negative - constraints,
        solution.determinant,
    )

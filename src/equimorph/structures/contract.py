"""The contract of structures: the methods by which the rest of the package uses them."""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.linalg import Border, BorderedSolution
from equimorph.model import (
    Constraint,
    Descriptor,
    Drawing,
    Parameter,
    names_of,
    parameter_vector,
)
from equimorph.structures.approach import straight_arcs

Direction = tuple[Lanes, Parameters]
Majorant = Callable[[Direction, Direction], Lanes]


@dataclass(frozen=True)
class Advance:
    """One Newton step on a curve through the equilibrium set, with the tangent.

    The bordered system is ``[F_z F_t; row corner] [dz; dt] = −[F; defect]`` with
    ``F_t = F_p·dp``; the tangent solves it for the right-hand side ``[0; 1]``.

    determinant: that of F_z where it costs nothing, else nan.
    """

    dz: Lanes
    dt: Values
    tangent_z: Lanes
    tangent_t: Values
    residual: Values
    index: Int[np.ndarray, " lanes"]
    determinant: Values


Solver = Callable[[Float[np.ndarray, "lanes sides bordered"], Border | None], BorderedSolution]


@dataclass(frozen=True)
class LinearSystem:
    """F and its derivatives at points, computed together.

    residual: F; columns: F_p·d for each of k directions; solve: with F_z, bordered or not.
    """

    residual: Lanes
    columns: Float[np.ndarray, "lanes k size"]
    solve: Solver


@dataclass(frozen=True)
class Symmetry:
    """An involution of unknowns and parameters that maps equilibria to equilibria."""

    name: str
    apply: Callable[[Lanes, Parameters], tuple[Lanes, Parameters]]
    signs: Float[np.ndarray, " parameters"]
    """Sign of each parameter of the image: −1 where it is reversed."""
    order: Int[np.ndarray, " parameters"] | None = None
    """Number of the parameter from which each one comes; None: all keep their place."""

    def image(
        self, p: Float[np.ndarray, "*lanes parameters"]
    ) -> Float[np.ndarray, "*lanes parameters"]:
        """Parameters of the image: ``signs · p[order]``."""
        return np.asarray(self.signs * (p if self.order is None else p[..., self.order]))


@runtime_checkable
class Equations(Protocol):
    """F(z; p) = 0 with its derivatives: the part of a structure's contract that Newton uses."""

    @property
    def unknowns(self) -> int:
        """Entries of z that the metric measures."""

    @property
    def constraints(self) -> int:
        """The other entries of z."""

    @property
    def size(self) -> int:
        """Length of z."""

    @property
    def mass(self) -> Float[np.ndarray, " unknowns"]:
        """Diagonal of the mass matrix."""

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """Change of each parameter that counts as one unit of length."""

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w], second derivative of F along two directions (dz, dp)."""

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: Border | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered; see `Structure.solve`."""

    def linear_system(
        self, z: Lanes, p: Parameters, directions: Float[np.ndarray, "lanes k parameters"]
    ) -> LinearSystem:
        """F, F_p along directions, and solves with F_z."""

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian."""

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`; see `Advance`."""


@dataclass(frozen=True)
class Growth:
    """Whether the energy is smooth on all of Rⁿ and grows there at infinity.

    Then Σ (−1)^index of all equilibria is 1 [Milnor1965]_.

    applies: whether that is so, shown or promised; promised: by the author of the energy only.
    """

    applies: bool
    reason: str
    promised: bool = False


class Structure(ABC):
    """A structure with energy E(u; p), constraints c(u; p) = 0 and L = E + λ·c.

    All methods take and return batches, lanes first. ``z = (u, λ)`` has `unknowns` + `constraints`
    entries and F = (∂L/∂u, c). A subclass gives the attributes without a value below and all
    abstract methods, and `drawing` if there are loads; its `kind` is registered in
    `equimorph.structures.KINDS`.
    """

    kind: ClassVar[str]
    parameters: tuple[Parameter, ...]
    unknowns: int
    constraints: int
    mass: Float[np.ndarray, " unknowns"]
    """Diagonal of the mass matrix: the metric of margins, distances and lengths."""
    length_unit: str = "1"
    """Unit of the coordinates to draw."""
    endless_in: ClassVar[str] = ""
    """Descriptor to bound, as infinitely many equilibria exist where it grows; empty if none."""
    upward: ClassVar[str] = "y"
    """Axis, y or z, that is upward in pictures of a structure in space."""
    energy_scale: float = 1.0
    """Value of one unit of `energy` in the units of the parameters, in joules for example."""

    @property
    def size(self) -> int:
        """Length of z."""
        return self.unknowns + self.constraints

    @cached_property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """Change of each parameter that counts as one unit of length."""
        return np.array([parameter.scale for parameter in self.parameters])

    def __repr__(self) -> str:
        """Kind and parameters."""
        return f"{type(self).__name__}({', '.join(names_of(self.parameters))})"

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """Return the kind, and the arguments of the constructor as plain data, by their names."""

    @cached_property
    def signature(self) -> Hashable:
        """The identity as one text; the structure itself if it cannot be written down."""
        try:
            return json.dumps(self.identity(), sort_keys=True)
        except InputError:
            return self

    @abstractmethod
    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Potential energy E."""

    @abstractmethod
    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""

    @abstractmethod
    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""

    @abstractmethod
    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w], second derivative of F along two directions (dz, dp)."""

    def second_derivative_bound(self, z: Lanes, p: Parameters, reach: Direction) -> Majorant | None:
        """Bound of D²F over boxes around (z, p) that reach so far in each entry; None if unknown.

        The bound is a function of two directions v, w with entries ≥ 0: entry i is at least
        |D²F[v', w']ᵢ| for all states in the box and all |v'| ≤ v, |w'| ≤ w, entry by entry.
        """
        del z, p, reach
        return None

    @abstractmethod
    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p: work-conjugates of the parameters (actuator efforts, the loads' displacements)."""

    @abstractmethod
    def solve(  # the bordered system has this many parts
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: Border | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve with the KKT matrix F_z − shift·mass, bordered by (columns, rows, corner).

        The shift acts on the unknowns, not on the multipliers. `equimorph.linalg.solve_bordered`
        does it for a dense matrix, `DiscreteStructure` for a sparse one.
        """

    @abstractmethod
    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Unloaded state from which the structure starts, and whether it was found."""

    def may_be_natural(self, p: Parameters) -> Flags:
        """Whether natural states are defined at parameters; they need not exist everywhere."""
        return np.ones(len(p), bool)

    @abstractmethod
    def unloaded(self) -> Mapping[str, float]:
        """Parameter values at which natural states are defined (loads at zero)."""

    def natural_parameters(self, values: Mapping[str, float]) -> Float[np.ndarray, " parameters"]:
        """Parameters of a natural state: loads as in `unloaded`, the rest as given or by default.

        Raises
        ------
        InputError
            For unknown or meaningless parameters, or a load that has another value.
        """
        for name, rest in self.unloaded().items():
            if values.get(name, rest) != rest:
                raise InputError(
                    f"`{name}` must be {rest:g} in the natural state; got {values[name]!r}."
                )
        return parameter_vector(self.parameters, {**values, **self.unloaded()})

    @abstractmethod
    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random guesses, one per lane, spread over what equilibria may look like."""

    @abstractmethod
    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether states lie within what the discretisation can represent."""

    @property
    def validity(self) -> tuple[Constraint, ...]:
        """Constraints beyond which the energy does not describe the structure; none by default.

        Sets end there as at constraints that are asked for.
        """
        return ()

    @abstractmethod
    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points space"]:
        """Coordinates to draw, in the plane or in space."""

    def frames(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"] | None:
        """Cross-sections at the points of `shape`, where a structure in space has them.

        The columns are the unit tangent, normal and binormal.
        """
        del z, p, s
        return None

    @property
    def flatness(self) -> float:
        """Width along the binormal over thickness along the normal, of cross-sections to draw."""
        return 1.0

    def arcs(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes arcs 4 space"]:
        """Shape as cubic arcs: both ends, and the derivatives there; straight lines by default."""
        return straight_arcs(self.shape(z, p))

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports, loads and actuators to draw around the shape; none by default.

        A structure with loads draws each as a force or a couple proportional to it.
        """
        del z, p
        return Drawing()

    @abstractmethod
    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written as `text`, like ``height(0.5)``.

        Every structure knows ``energy``, which reports show: `energy` times `energy_scale`.
        """

    @property
    def elevation(self) -> Descriptor:
        """Descriptor that is the height in figures of the set: the energy by default."""
        return Descriptor("energy", "energy", self.energy, "E", self.signature)

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Symmetries of the equilibrium set; none unless the structure says so."""
        return ()

    def growth(self, p: Float[np.ndarray, " parameters"]) -> Growth:
        """Whether the energy at parameters p is smooth on Rⁿ and grows at infinity."""
        del p
        return Growth(False, "it is not known whether the energy grows at infinity")

    def error_estimate(self, z: Lanes, p: Parameters) -> Values:
        """Discretisation error of the unknowns; zero for discrete structures."""
        return np.zeros(len(z))

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian."""
        nothing = np.zeros((len(z), 0, self.size))
        return self.solve(z, p, nothing).negative - self.constraints

    @property
    def watched(self) -> tuple[Descriptor, ...]:
        """Descriptors whose zeros are events on the lift of one state; see `Vanishing`."""
        return ()

    def index_out_of_plane(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"] | None:
        """Independent movements out of the plane that lower the energy; None: not judged."""
        del z, p
        return None

    def linear_system(
        self, z: Lanes, p: Parameters, directions: Float[np.ndarray, "lanes k parameters"]
    ) -> LinearSystem:
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

    def advance(  # the fused step of the hot path
        self,
        z: Lanes,
        p: Parameters,
        dp: Parameters,
        row: Lanes,
        corner: Values,
        defect: Values,
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`; see `Advance`."""
        system = self.linear_system(z, p, dp[:, None])
        return advance_by(system, row, corner, defect, self.constraints)


def joint_system(
    linearised: Callable[[Lanes, Parameters, Parameters], tuple[np.ndarray, ...]],
    solve: Callable[..., BorderedSolution],
    z: Lanes,
    p: Parameters,
    directions: Float[np.ndarray, "lanes k parameters"],
) -> LinearSystem:
    """`LinearSystem` by a function that computes F, F_p·dp and the parts of F_z together.

    `solve` takes z, p and these parts of F_z before the right-hand sides and the border.
    """
    changes = [np.ascontiguousarray(each) for each in directions.transpose(1, 0, 2)]
    residual, column, *parts = linearised(z, p, changes[0] if changes else np.zeros_like(p))
    others = [linearised(z, p, dp)[1] for dp in changes[1:]]
    columns = np.stack([column, *others], axis=1)[:, : len(changes)]
    return LinearSystem(residual, columns, partial(solve, z, p, *parts))


def bordered_advance(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    residual: Lanes,
    column: Lanes,
    row: Lanes,
    corner: Values,
    defect: Values,
) -> Advance:
    """`Advance` for any residual and column, by the structure's general bordered solve."""
    system = LinearSystem(residual, column[:, None], partial(structure.solve, z, p))
    return advance_by(system, row, corner, defect, structure.constraints)


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

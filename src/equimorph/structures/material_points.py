"""Masses of material points of rods and frames, springs at their supports, and what moves them."""

from abc import ABC
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Velocity
from equimorph.errors import MissingError
from equimorph.structures.equations import Equations

STEP = 1e-3
"""Step of the differences, of unknowns of size one: errors of 1e-13 of truncation and round-off."""
RANK = 1e-10
"""Relative size below which a compliance counts as none: such constraints do not give way."""
Places = Callable[[Lanes, Parameters], Float[np.ndarray, "many points space"]]
Velocities = Float[np.ndarray, "lanes k unknowns"]
Product = Callable[[Velocities], Velocities]
INERTIA_DIFFERENCE = 1e-5
"""Step of the unknowns in differences of the mass matrix."""


class SupportSpring(NamedTuple):
    """One of them: its stiffness, gaps that it opens, and moves of the points."""

    stiffness: float
    gaps: np.ndarray
    moves: np.ndarray


@dataclass(frozen=True)
class SupportSprings:
    """Springs against movements of supports along x, y or z, whose places s statics eliminates.

    In u and s the Lagrangian is ``L₀(u, λ) + λ·(gaps s) + ½ s·(k s)`` and terms of the parameters:
    the constraints change by ``gaps δs``, and the places of the material points by ``moves``.
    """

    stiffness: Float[np.ndarray, " springs"]
    gaps: Float[np.ndarray, "constraints springs"]
    moves: Float[np.ndarray, "springs points_or_1 space"]

    @classmethod
    def of(cls, springs: Sequence[SupportSpring], constraints: int, space: int) -> "SupportSprings":
        """Of the stiffness, the gaps and the moves of each, of which there may be none."""
        points = len(springs[0].moves) if springs else 1
        stiffness = np.array([each.stiffness for each in springs])
        gaps = np.array([each.gaps for each in springs]).reshape(len(springs), constraints).T
        moves = np.array([each.moves for each in springs]).reshape(len(springs), points, space)
        return cls(stiffness, gaps, moves)

    @property
    def follow(self) -> bool:
        """Whether the constraints tie all places of springs to the unknowns."""
        count = len(self.stiffness)
        return count == 0 or (self.gaps.size > 0 and np.linalg.matrix_rank(self.gaps) == count)


class _Moved(NamedTuple):
    """Derivatives of all places by the coordinates, and their masses.

    Multipliers follow the coordinates where constraints give way: their rates, derivatives of the
    places by them, and the inverse of the corner of F_z there.
    """

    columns: Float[np.ndarray, "places coordinates"]
    weights: Float[np.ndarray, " places"]
    follow: Float[np.ndarray, "constraints coordinates"]
    forced: Float[np.ndarray, "places constraints"]
    compliance: Float[np.ndarray, "constraints constraints"]


@dataclass(frozen=True)
class MaterialPoints:
    """Masses at places, which are functions of unknowns and multipliers.

    Derivatives are differenced to fourth order. Where constraints ``c(u, λ) = 0`` give way, the
    multipliers follow from the unknowns: ``c_u δu + c_λ δλ = 0``. Springs are given where their
    places are coordinates, too, after the unknowns.
    """

    equations: Equations
    places: Places
    masses: Float[np.ndarray, " points"]
    springs: SupportSprings | None = None

    def inertia(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes coordinates coordinates"]:
        """Mass matrix JᵀWJ of the coordinates."""
        count = self.equations.unknowns
        count += 0 if self.springs is None else len(self.springs.stiffness)
        out = np.empty((len(z), count, count))
        for lane in range(len(z)):
            moved = self._moved(z[lane], p[lane])
            out[lane] = moved.columns.T @ (moved.weights[:, None] * moved.columns)
        return out

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """``JᵀW D²x[u̇, u̇]``, with the second derivative of all places along the velocity."""
        out, rest = np.zeros_like(velocity), np.zeros_like(p)
        for lane in np.flatnonzero(velocity.any(axis=1)):
            moved = self._moved(z[lane], p[lane])
            bend = self._along(z[lane], p[lane], moved, velocity[lane], rest[lane])[1]
            out[lane] = moved.columns.T @ (moved.weights * bend)
        return out

    def driven_force(
        self, z: Lanes, p: Parameters, velocity: Velocity, dp: Parameters, ddp: Parameters
    ) -> Velocity:
        """``JᵀW`` times the acceleration of all places that rates and accelerations of p add."""
        out, rest = np.zeros_like(velocity), np.zeros_like(p)
        for lane in np.flatnonzero(dp.any(axis=1) | ddp.any(axis=1)):
            moved = self._moved(z[lane], p[lane])
            here, rate = (z[lane], p[lane], moved), velocity[lane]
            bend = self._along(*here, rate, dp[lane])[1] - self._along(*here, rate, rest[lane])[1]
            bend += self._along(*here, 0.0 * rate, ddp[lane])[0]
            out[lane] = moved.columns.T @ (moved.weights * bend)
        return out

    def _along(
        self,
        z: Float[np.ndarray, " size"],
        p: Float[np.ndarray, " parameters"],
        moved: _Moved,
        rate: Float[np.ndarray, " unknowns"],
        dp: Float[np.ndarray, " parameters"],
    ) -> tuple[Float[np.ndarray, " places"], Float[np.ndarray, " places"]]:
        """First and second derivatives of all places at rates of unknowns and parameters."""
        equations, n = self.equations, self.equations.unknowns
        size = max(np.abs(rate).max(), np.abs(dp / equations.scales).max(initial=0.0))
        if size == 0.0:
            nothing = np.zeros(len(moved.weights))
            return nothing, nothing
        gaps = equations.parameter_derivative(z[None], p[None], dp[None])[0, n:]
        way = np.concatenate([rate, moved.follow @ rate - moved.compliance @ gaps])
        step = STEP / size
        shares = step * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])[:, None]
        at = z + shares * way, p + shares * dp
        once = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * step)
        twice = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * step**2)
        places = self.places(*at).reshape(5, -1)
        gaps = twice @ equations.residual(*at)[:, n:]
        return once @ places, twice @ places - moved.forced @ (moved.compliance @ gaps)

    def _moved(
        self,
        z: Float[np.ndarray, " size"],
        p: Float[np.ndarray, " parameters"],
    ) -> _Moved:
        """Derivatives of all places at one state."""
        springs = self.springs
        n, c = self.equations.unknowns, self.equations.constraints
        places = _derivative(self.places, z, p)
        weights, places = np.repeat(self.masses, places.shape[1]), places.reshape(-1, n + c)
        rows = _derivative(self.equations.residual, z, p)[n:] if c else np.zeros((0, n))
        moved, forced, gradients, corner = places[:, :n], places[:, n:], rows[:, :n], rows[:, n:]
        size = np.abs(corner).max(initial=0.0)
        if springs is not None:
            spread = (len(springs.stiffness), len(self.masses), springs.moves.shape[2])
            own = np.broadcast_to(springs.moves, spread).reshape(spread[0], -1).T
            pulled = springs.gaps.T / springs.stiffness[:, None]
            moved, forced = np.concatenate([moved, own], axis=1), forced + own @ pulled
            gradients = np.concatenate([gradients, springs.gaps], axis=1)
            corner = corner + springs.gaps @ pulled
        compliance = _inverse(corner, RANK * size)
        follow = -compliance @ gradients
        return _Moved(moved + forced @ follow, weights, follow, forced, compliance)


def _inverse(matrix: Float[np.ndarray, "c c"], least: float) -> Float[np.ndarray, "c c"]:
    """Inverse of a symmetric matrix where its eigenvalues are larger than the least."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    kept = np.abs(values) > least
    return np.asarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T)


def _derivative(
    function: Callable[[Lanes, Parameters], np.ndarray],
    z: Float[np.ndarray, " size"],
    p: Float[np.ndarray, " parameters"],
) -> Float[np.ndarray, "... size"]:
    """Derivatives of values at one state by all entries of z, along the last axis."""
    steps = STEP * np.eye(len(z))
    at = np.concatenate([z + share * steps for share in (1.0, -1.0, 2.0, -2.0)])
    values = function(at, np.repeat(p[None], len(at), axis=0))
    ahead, behind, twice, back = values.reshape(4, len(z), *values.shape[1:])
    slope = (8.0 * (ahead - behind) - (twice - back)) / (12.0 * STEP)
    return np.asarray(np.moveaxis(slope, 0, -1))


class Inertial(Equations, ABC):
    """Masses of a structure, which has none unless it says so."""

    kind: ClassVar[str]

    @property
    def time_unit(self) -> str:
        """Unit of time that `inertia` goes with; "time" where the structure's units are any."""
        return "time"

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Physical mass matrix M = JᵀWJ: kinetic energy ½ u̇ᵀMu̇ while the parameters rest.

        J is the derivative of the places of all material points by the unknowns, W their mass. M
        is in units of `energy` times `time_unit` squared; it may be singular where unknowns move no
        mass. It is not the metric `mass`.

        Raises
        ------
        MissingError
            If the structure has no mass.
        """
        raise MissingError(
            f"`structure` must have a mass; this {self.kind} has none. {self.massless}".rstrip()
        )

    @property
    def sprung(self) -> MaterialPoints | None:
        """Material points on springs whose places the unknowns leave free; None: there are none."""
        return None

    @property
    def material(self) -> MaterialPoints | None:
        """Material points whose places may move with the parameters; None: masses do not."""
        return None

    def driven_force(
        self, z: Lanes, p: Parameters, velocity: Velocity, dp: Parameters, ddp: Parameters
    ) -> Velocity:
        """Forces of inertia that rates and accelerations of the parameters add to ``M ü + Γ``.

        Those of the material points; without these, ``(∂M/∂p·ṗ) u̇`` of an energy ½ u̇ᵀM(u, p)u̇.
        """
        if self.material is not None:
            return self.material.driven_force(z, p, velocity, dp, ddp)
        step = INERTIA_DIFFERENCE * dp
        change = self.inertia(z, p + step) - self.inertia(z, p - step)
        return np.asarray(np.einsum("lij,lj->li", change, velocity) / (2.0 * INERTIA_DIFFERENCE))

    @property
    def massless(self) -> str:
        """How this kind of structure is given its mass, in one sentence; empty if it cannot be."""
        return ""

    def inertia_product(self, z: Lanes, p: Parameters) -> Product:
        """Function that multiplies k velocities in each lane by M; see `inertia`."""
        mass = self.inertia(z, p)
        return lambda v: np.asarray(v @ mass)

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ(u)[u̇, u̇] in ``d/dt ∂T/∂u̇ − ∂T/∂u = M ü + Γ``, while the parameters rest.

        Here by central differences of M along all unknowns; structures whose J is at hand give
        ``JᵀW D²x[u̇, u̇]``, with the places x of their material points.
        """
        n, step = self.unknowns, INERTIA_DIFFERENCE
        twice = np.empty_like(velocity)
        for i in range(n):
            shift = np.zeros_like(z)
            shift[:, i] = step
            change = self.inertia(z + shift, p) - self.inertia(z - shift, p)
            twice[:, i] = np.einsum("li,lij,lj->l", velocity, change, velocity)
        moved = np.zeros_like(z)
        moved[:, :n] = step * velocity
        along = self.inertia(z + moved, p) - self.inertia(z - moved, p)
        return np.asarray((np.einsum("lij,lj->li", along, velocity) - 0.5 * twice) / (2.0 * step))

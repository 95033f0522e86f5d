"""Loci: curves of equilibria in several parameters on which scalar tests vanish."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Lanes, Parameters
from equimorph.equilibria.critical import Critical, Test, null_border
from equimorph.structures import Structure

Point = Float[np.ndarray, " coordinates"]
Points = Float[np.ndarray, "lanes coordinates"]

DIFFERENCE = 1e-5
"""Step of differences of tests, in the metric: it sets the rate of Newton, not the error."""
ACCEPTED = 1e-9
"""Size of the last correction; the next would be below round-off."""
ITERATIONS = 12


@dataclass(frozen=True)
class Locus:
    """F(z; p) = 0 and `tests` = 0 in z and the parameters at places `free` (one more than tests).

    `unfolded` adds an unknown β with F + βb = 0: it stands for a parameter that breaks a symmetry
    and stays zero along branch points that persist by symmetry.
    """

    structure: Structure
    base: Float[np.ndarray, " parameters"]
    free: Int[np.ndarray, " k"]
    tests: tuple[Test, ...]
    unfolded: bool = False
    singular: bool = True
    """Whether F_z is singular all along."""

    @property
    def dimension(self) -> int:
        """Free coordinates of the equilibrium set that the tests live on."""
        return len(self.free) + int(self.unfolded)

    @cached_property
    def weights(self) -> Point:
        """Metric of (z, free parameters, β); multipliers do not count."""
        structure = self.structure
        multipliers = np.zeros(structure.constraints)
        scaled = 1.0 / structure.scales[self.free] ** 2
        return np.concatenate([structure.mass, multipliers, scaled, np.ones(int(self.unfolded))])

    def joined(self, z: Float[np.ndarray, " size"], p: Float[np.ndarray, " parameters"]) -> Point:
        """Coordinates of a state."""
        return np.concatenate([z, p[self.free], np.zeros(int(self.unfolded))])

    def split(self, x: Points) -> tuple[Lanes, Parameters]:
        """z and all parameters."""
        size = self.structure.size
        p = np.tile(self.base, (len(x), 1))
        p[:, self.free] = x[:, size : size + len(self.free)]
        return np.ascontiguousarray(x[:, :size]), p

    def critical(self, x: Points, b: Float[np.ndarray, " size"]) -> Critical:
        """Test functions at points."""
        z, p = self.split(x)
        return Critical(self.structure, z, p, np.tile(b, (len(x), 1)))

    def frame(
        self, x: Point, b: Float[np.ndarray, " size"], rows: Float[np.ndarray, "d coordinates"]
    ) -> tuple[Point, Float[np.ndarray, "d coordinates"]]:
        """Newton correction onto the set with rows·dx = 0, and the kernel dual to the rows."""
        structure, d = self.structure, self.dimension
        z, p = self.split(x[None])
        columns, k = np.zeros((1, d, structure.size)), len(self.free)
        unit = np.eye(p.shape[1])[self.free]
        columns[0, :k] = structure.parameter_derivative(
            np.tile(z, (k, 1)), np.tile(p, (k, 1)), unit
        )
        residual = structure.residual(z, p)[0]
        if self.unfolded:
            columns[0, -1] = b
            residual = residual + x[-1] * b
        rhs = np.zeros((1, d + 1, structure.size + d))
        rhs[0, 0, : structure.size] = -residual
        rhs[0, 1:, structure.size :] = np.eye(d)
        inner, corner = rows[None, :, : structure.size], rows[None, :, structure.size :]
        solved = structure.solve(z, p, rhs, (columns, np.ascontiguousarray(inner), corner)).x[0]
        return solved[0], solved[1:]

    def slopes(
        self, x: Point, directions: Float[np.ndarray, "d coordinates"], tests: tuple[Test, ...],
        b: Float[np.ndarray, " size"],
    ) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m d"]]:  # fmt: skip
        """Values of tests and their derivatives along directions, by central differences."""
        d = len(directions)
        lengths = np.sqrt(directions**2 @ self.weights)
        shifts = DIFFERENCE * directions / np.maximum(lengths, 1e-300)[:, None]
        critical = self.critical(np.concatenate([x[None], x + shifts, x - shifts]), b)
        values = np.array([test(critical) for test in tests]).reshape(len(tests), 2 * d + 1)
        change = values[:, 1 : d + 1] - values[:, d + 1 :]
        return values[:, 0], change * lengths / (2.0 * DIFFERENCE)


@dataclass(frozen=True)
class Spot:
    """A point of a locus, an orthonormal kernel of [F_z F_p] with the tangent first, a border."""

    x: Point
    basis: Float[np.ndarray, "d coordinates"]
    b: Float[np.ndarray, " size"]

    @property
    def tangent(self) -> Point:
        """Unit tangent of the curve."""
        return np.asarray(self.basis[0])


def settle(locus: Locus, x: Point) -> Spot | None:
    """Nearest point of the locus, by Newton with the least correction; None if there is none."""
    size, d = locus.structure.size, locus.dimension
    z, p = locus.split(x[None])
    b = null_border(locus.structure, z, p)[0]
    waves = np.cos(np.outer(np.arange(1, d + 1), 1.7 * np.arange(size + d)) + 0.4)
    last = np.inf
    for _ in range(ITERATIONS):
        # any rows that see the kernel will do; then the kernel itself
        kernel = orthonormal(locus, locus.frame(x, b, waves)[1])
        if kernel is None:
            return None
        d0, kernel = locus.frame(x, b, kernel * locus.weights)
        values, slopes = locus.slopes(x + d0, kernel, locus.tests, b)
        if not (np.isfinite(slopes).all() and np.isfinite(d0).all()):
            return None
        step = d0 + np.linalg.lstsq(slopes, -values, rcond=None)[0] @ kernel
        x, size_now = x + step, _size(locus, step)
        if size_now <= ACCEPTED:
            null = np.linalg.svd(slopes)[2][-1]
            return _spot(locus, x, np.vstack([null @ kernel, kernel]), b)
        if size_now > max(0.5, 4.0 * last):
            return None
        last = size_now
        b = _border(locus, x, b)
    return None


def advance(
    locus: Locus,
    spot: Spot,
    length: float,
    bend: Point | None = None,
    meets: Test | None = None,
) -> Spot | None:
    """Point of the locus at `length` along the tangent of `spot`, by Newton; None if it fails.

    `bend` is an estimate of dT/ds. The first correction must stay below a quarter of the length,
    the following ones must shrink, and the tangents stay within acos 0.9. With a test that the
    point `meets` (is a root of), the length is a guess.
    """
    rows = spot.basis * locus.weights
    x = spot.x + length * spot.tangent
    if bend is not None:
        x = x + 0.5 * length**2 * bend
    limit = 0.25 * abs(length) + ACCEPTED
    tests = locus.tests if meets is None else (*locus.tests, meets)
    ahead = np.eye(locus.dimension)[:1]
    for _ in range(ITERATIONS):
        d0, kernel = locus.frame(x, spot.b, rows)
        values, slopes = locus.slopes(x + d0, kernel, tests, spot.b)
        matrix, rest = slopes, -values
        if meets is None:
            matrix = np.vstack([slopes, ahead])
            rest = np.append(rest, length - rows[0] @ (x - spot.x))
        if not (np.isfinite(matrix).all() and np.isfinite(rest).all()):
            return None
        step = d0 + np.linalg.lstsq(matrix, rest, rcond=None)[0] @ kernel
        size = _size(locus, step)
        if not size <= limit:
            return None
        x = x + step
        if size <= ACCEPTED:
            null = np.linalg.svd(slopes[: len(locus.tests)])[2][-1]
            tangent = np.sign(null[0]) * null @ kernel
            found = _spot(locus, x, np.vstack([tangent, kernel]), spot.b)
            turned = found is None or found.tangent @ rows[0] < 0.9
            return None if turned else found
        limit = max(0.5 * size, ACCEPTED)
    return None


def _spot(
    locus: Locus,
    x: Point,
    vectors: Float[np.ndarray, "some coordinates"],
    b: Float[np.ndarray, " size"],
) -> Spot | None:
    """Spot with the first vector as tangent and the border renewed."""
    basis = orthonormal(locus, vectors, locus.dimension)
    return None if basis is None else Spot(x, basis, _border(locus, x, b))


def _border(locus: Locus, x: Point, b: Float[np.ndarray, " size"]) -> Float[np.ndarray, " size"]:
    """Unit null vector; the old border where F_z is regular and has none."""
    v = locus.critical(x[None], b).v[0]
    return np.asarray(v / np.linalg.norm(v)) if np.isfinite(v).all() else b


def orthonormal(
    locus: Locus, vectors: Float[np.ndarray, "some coordinates"], count: int | None = None
) -> Float[np.ndarray, "d coordinates"] | None:
    """Orthonormal basis in the metric, the first vector's direction first; None if degenerate."""
    basis: list[Point] = []
    for vector in vectors:
        rest, whole = vector, np.sqrt(vector**2 @ locus.weights)
        for other in (*basis, *basis):  # twice is enough for round-off
            rest = rest - (other * locus.weights @ rest) * other
        norm = np.sqrt(rest**2 @ locus.weights)
        if norm > 1e-6 * whole:
            basis.append(rest / norm)
    wanted = len(vectors) if count is None else count
    return np.array(basis[:wanted]) if len(basis) >= wanted else None


def _size(locus: Locus, step: Point) -> float:
    multipliers = step[locus.structure.unknowns : locus.structure.size]
    return float(np.sqrt(step**2 @ locus.weights + 1e-2 * multipliers @ multipliers))

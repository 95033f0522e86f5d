"""Loci: curves of equilibria in several parameters on which scalar tests vanish."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from equimorph.arrays import Directions, Flags, Float, Int, Lanes, Numbers, Parameters, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, Test, null_border
from equimorph.equilibria.newton_step import Planes, Tangents
from equimorph.equilibria.point_conditions import Condition, Move, Plane, Vanishing
from equimorph.equilibria.settle import Guards, Settled, free_directions, settle
from equimorph.structures import Structure

Points = Float[np.ndarray, "lanes coordinates"]
Bases = Float[np.ndarray, "lanes d coordinates"]

ACCEPTED = 1e-9
"""Length of the last correction; the next would be below round-off."""
ITERATIONS = 12
"""Largest number of Newton iterations onto a critical curve."""
FIRST_SHARE, CONTRACTION = 0.25, 0.5
"""Longest first correction as a share of the step, and of each later one as a share of the one
before: more could lead to another curve."""
LEAST_COSINE = 0.9
"""Of the angle between the tangents at both ends of a step."""
SPREADING = 4.0
"""Growth of corrections at which the search for the nearest point ends."""
SMALL_EIGENVALUE = 1e-7
"""Size below which an eigenvalue is the one that vanishes along the locus."""
MULTIPLIERS = 1e-2
"""Weight of squared multipliers in the length of corrections: they are not in the metric."""
DEPENDENT = 1e-6
"""Length of the independent part of a direction, relative to the whole, that counts as zero."""


@dataclass(frozen=True)
class Locus:
    """F(z; p) = 0 and `tests` = 0 in z and the parameters at places `free` (one more than tests).

    `unfolded` adds an unknown β with F + βb = 0: it stands for a parameter that breaks a symmetry
    and stays zero along branch points that persist by symmetry. Coordinates are (z, free
    parameters, β).
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
    def weights(self) -> Float[np.ndarray, " coordinates"]:
        """Metric of (z, free parameters, β); multipliers do not count."""
        structure = self.structure
        multipliers = np.zeros(structure.constraints)
        scaled = 1.0 / structure.scales[self.free] ** 2
        return np.concatenate([structure.mass, multipliers, scaled, np.ones(int(self.unfolded))])

    @cached_property
    def directions(self) -> Directions:
        """Directions of the free parameters, for one lane."""
        return free_directions(self.structure, self.free, 1)

    def join(self, z: Lanes, p: Parameters) -> Points:
        """Coordinates of states."""
        return np.concatenate([z, p[:, self.free], np.zeros((len(z), int(self.unfolded)))], axis=1)

    def split(self, x: Points) -> tuple[Lanes, Parameters]:
        """z and all parameters."""
        size = self.structure.size
        p = np.empty((len(x), len(self.base)))
        p[:] = self.base
        p[:, self.free] = x[:, size : size + len(self.free)]
        return np.ascontiguousarray(x[:, :size]), p

    def critical(self, x: Points, b: Lanes) -> Critical:
        """Test functions at points, one border for each."""
        return Critical(self.structure, *self.split(x), b)

    def lengths(
        self, steps: Float[np.ndarray, "*lanes coordinates"]
    ) -> Float[np.ndarray, "*lanes"]:
        """Lengths of steps in the metric."""
        return np.asarray(np.sqrt(steps**2 @ self.weights))


@dataclass(frozen=True)
class Spots(Columns):
    """Points of loci, one a lane: coordinates, orthonormal kernels of [F_z F_p], borders, index.

    The first direction of a kernel is the unit tangent of the curve. The index counts the negative
    eigenvalues of the constrained Hessian, those within 1e-7 of zero left out.
    """

    x: Points
    basis: Bases
    b: Lanes
    index: Numbers

    @property
    def tangent(self) -> Points:
        """Unit tangents."""
        return np.ascontiguousarray(self.basis[:, 0])

    def turn(self, sign: Values) -> "Spots":
        """The same with tangents times a sign of each lane."""
        basis = self.basis.copy()
        basis[:, 0] *= sign[:, None]
        return replace(self, basis=basis)


def nearest(locus: Locus, x: Points) -> tuple[Spots, Flags]:
    """Points of the locus near guesses, by Newton with the least corrections; which were found."""
    z, p = locus.split(x)
    b = null_border(locus.structure, z, p)
    guards = Guards(ITERATIONS, converged=ACCEPTED, contraction=SPREADING, free=1,
                    multipliers=MULTIPLIERS)  # fmt: skip
    frame = Tangents(locus.unfolded)
    conditions: tuple[Condition, ...] = (_vanishing(locus.tests, len(x)),)
    if not locus.tests:  # without conditions the nearest point is the one at the same parameter
        by_p = locus.directions.repeat(len(x), axis=0)
        conditions = (Plane(z, p, np.zeros((len(x), 1, z.shape[1])), by_p),)
    found = _settle(locus, x, conditions, guards, frame)
    return _spots(locus, found, found.found, b)


def advance(
    locus: Locus,
    spots: Spots,
    lengths: Values,
    guess: Points | None = None,
    meets: Test | None = None,
    following: float = 0.0,
) -> tuple[Spots, Flags]:
    """Points of the locus at `lengths` along the tangents of `spots`, by Newton; which were found.

    They are corrected from guesses, or from the tangents. The first correction must stay below a
    quarter of the length, the following ones must shrink, and the tangents stay within acos 0.9.
    With a test that the points `meet` (are roots of), the lengths are guesses. Corrections below
    `following` are not taken: points are as exact, but tangents belong to the points before.
    """
    ahead = spots.x + lengths[:, None] * spots.tangent
    x = ahead if guess is None else guess
    guards = Guards(ITERATIONS, converged=ACCEPTED, following=following, contraction=CONTRACTION,
                    free=1, multipliers=MULTIPLIERS)  # fmt: skip
    rows = spots.basis * locus.weights
    tests = locus.tests if meets is None else (*locus.tests, meets)
    conditions: list[Condition] = [_vanishing(tests, len(x))] if tests else []
    if meets is None:
        by_z, by_p = _rows(locus, rows[:, :1])
        conditions.append(Plane(*locus.split(ahead), by_z, by_p))
    by_beta = rows[:, :, -1] if locus.unfolded else None
    frame = Planes(*_rows(locus, rows), by_beta, spots.b)
    found = _settle(locus, x, tuple(conditions), guards, frame)
    near = found.first <= FIRST_SHARE * np.abs(lengths) + ACCEPTED
    there, regular = _spots(locus, found, found.found & near, spots.b, rows[:, 0])
    cosine = np.einsum("li,li->l", there.tangent, rows[:, 0])
    return there, regular & (cosine >= LEAST_COSINE)


def onto_set(locus: Locus, x: Points, spots: Spots) -> Points:
    """Points of the equilibrium set above guesses, moved across the kernels of spots near by."""
    rows = spots.basis * locus.weights
    by_z, by_p = _rows(locus, rows)
    by_beta = rows[:, :, -1] if locus.unfolded else None
    plane = Plane(*locus.split(x), by_z, by_p)
    guards = Guards(iterations=3, converged=ACCEPTED)
    found = _settle(locus, x, (plane,), guards, Planes(by_z, by_p, by_beta, spots.b))
    return _coordinates(locus, found)


def _rows(locus: Locus, rows: Bases) -> tuple[np.ndarray, np.ndarray]:
    """Rows in coordinates, as rows for changes of z and of all parameters."""
    size, k = locus.structure.size, len(locus.free)
    by_p = np.zeros((*rows.shape[:2], len(locus.base)))
    by_p[:, :, locus.free] = rows[:, :, size : size + k]
    return rows[:, :, :size], by_p


def _vanishing(tests: tuple[Test, ...], lanes: int) -> Vanishing:
    return Vanishing(lambda some: tests, np.arange(lanes))


def _settle(
    locus: Locus, x: Points, conditions: tuple[Condition, ...], guards: Guards,
    frame: Tangents | Planes
) -> Settled:  # fmt: skip
    z, p = locus.split(x)
    directions = locus.directions.repeat(len(x), axis=0)
    return settle(locus.structure, z, p, directions, conditions, guards, frame)


def _coordinates(locus: Locus, found: Settled) -> Points:
    x = locus.join(found.z, found.p)
    if locus.unfolded:
        x[:, -1] = found.unfolding
    return x


def _spots(
    locus: Locus, found: Settled, good: Flags, b: Lanes, ahead: Points | None = None
) -> tuple[Spots, Flags]:
    """Spots at good points, with the borders renewed, and which of them are regular.

    Tangents have positive products with the rows `ahead`, if these are given.
    """
    size, k = locus.structure.size, len(locus.free)
    x, kernel = _coordinates(locus, found), found.frames.copy()
    kernel[:, :, size : size + k] *= locus.structure.scales[locus.free]
    basis, border, regular = np.zeros_like(kernel), b.copy(), np.zeros(len(x), bool)
    index = np.full(len(x), -1)
    if good.any():
        at = slice(None) if good.all() else np.flatnonzero(good)
        # the direction along which the tests stay zero is the last, and is to come first
        turned = np.linalg.svd(found.slopes[at, : len(locus.tests)])[2][:, ::-1] @ kernel[at]
        if ahead is not None:
            turned[:, 0] *= np.sign(np.einsum("li,li->l", turned[:, 0], ahead[at]))[:, None]
        basis[at], regular[at] = orthonormal(locus, turned)
        border[at], index[at] = _border_and_index(locus, x[at], b[at])
    return Spots(x, basis, border, index), regular


def _border_and_index(locus: Locus, x: Points, b: Lanes) -> tuple[Lanes, Numbers]:
    """Null vectors of F_z as borders, and the index, both from one call."""
    lanes, size = len(x), locus.structure.size
    (z, p), rhs = locus.split(np.concatenate([x, x])), np.zeros((2 * lanes, 1, size + 1))
    rhs[:, 0, -1] = 1.0
    row = np.concatenate([b, b])[:, None]
    shift = np.repeat([0.0, -SMALL_EIGENVALUE], lanes)
    solved = locus.structure.solve(z, p, rhs, (row, row, np.zeros((2 * lanes, 1, 1))), shift)
    v = solved.x[:lanes, 0, :-1]
    v = v / np.sqrt((v**2).sum(axis=1))[:, None]
    # a regular F_z has no null vector: the old border stays
    border = np.where(np.isfinite(v).all(axis=1)[:, None], v, b)
    return border, solved.negative[lanes:] - locus.structure.constraints


def test_slopes(
    locus: Locus, x: Points, directions: Bases, tests: tuple[Test, ...], b: Lanes
) -> tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m d"]]:
    """Values of tests and their derivatives along directions, by central differences."""
    if not tests:
        return np.zeros((len(x), 0)), np.zeros((len(x), 0, directions.shape[1]))
    size, k = locus.structure.size, len(locus.free)
    z, p = locus.split(x)
    along_p = np.zeros((*directions.shape[:2], len(locus.base)))
    along_p[:, :, locus.free] = directions[:, :, size : size + k]
    along_z = np.ascontiguousarray(directions[:, :, :size])
    move = Move(np.zeros_like(z), np.zeros_like(p), along_z, along_p)
    found = _vanishing(tests, len(x)).linear(Critical(locus.structure, z, p, b), move)
    return found.value, found.slopes


def orthonormal(locus: Locus, vectors: Bases) -> tuple[Bases, Flags]:
    """Orthonormal bases in the metric, the first vector's direction first; which are whole."""
    basis, rows = np.zeros_like(vectors), np.zeros_like(vectors)
    regular, whole = np.ones(len(vectors), bool), locus.lengths(vectors)
    for i in range(vectors.shape[1]):
        rest = vectors[:, i]
        if i:
            share = rows[:, :i] @ rest[:, :, None]
            rest = rest - (share * basis[:, :i]).sum(axis=1)
        norm = locus.lengths(rest)
        regular &= norm > DEPENDENT * whole[:, i]
        basis[:, i] = rest / np.maximum(norm, 1e-300)[:, None]
        rows[:, i] = basis[:, i] * locus.weights
    return basis, regular

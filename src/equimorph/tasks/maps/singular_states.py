"""Exact places of singular states, many at a time, each in two parameters of its own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.equilibria.critical import Critical, Test, null_border
from equimorph.structures import Structure

Pairs = Float[np.ndarray, "lanes 2 extended"]
TestsOf = Callable[[Int[np.ndarray, " some"]], tuple[Test, Test]]

ITERATIONS = 10
CONVERGED = 1e-9
DIFFERENCE = 1e-6
"""Step of differences of tests, in the metric: it sets the rate of Newton, not the error."""
FARTHEST = 0.5
"""Longest correction, in the metric: the guesses are close."""


@dataclass(frozen=True)
class _Space:
    """Unknowns and the two free parameters of each lane, with the metric and a border."""

    structure: Structure
    z: Lanes
    p: Parameters
    free: Int[np.ndarray, "lanes 2"]
    b: Lanes

    @property
    def weights(self) -> Float[np.ndarray, "lanes extended"]:
        """Metric of (z, free parameters); multipliers do not count."""
        structure = self.structure
        row = np.concatenate([structure.mass, np.zeros(structure.constraints)])
        scaled = 1.0 / structure.scales[self.free] ** 2
        return np.concatenate([np.tile(row, (len(self.z), 1)), scaled], axis=1)

    def moved(self, step: Float[np.ndarray, "lanes extended"]) -> "_Space":
        """Space at points moved by a step."""
        p = self.p.copy()
        np.put_along_axis(
            p, self.free, np.take_along_axis(p, self.free, axis=1) + step[:, -2:], axis=1
        )
        return _Space(self.structure, self.z + step[:, :-2], p, self.free, self.b)

    def take(self, lanes: Int[np.ndarray, " some"]) -> "_Space":
        """Return some of the lanes."""
        columns = (self.z, self.p, self.free, self.b)
        return _Space(self.structure, *(column[lanes] for column in columns))

    def frame(self, rows: Pairs) -> tuple[Float[np.ndarray, "lanes extended"], Pairs]:
        """Newton correction onto the set with rows·dx = 0, and the kernel dual to the rows."""
        structure, lanes = self.structure, len(self.z)
        columns = np.zeros((lanes, 2, structure.size))
        for k in range(2):
            unit = np.zeros_like(self.p)
            np.put_along_axis(unit, self.free[:, k : k + 1], 1.0, axis=1)
            columns[:, k] = structure.parameter_derivative(self.z, self.p, unit)
        rhs = np.zeros((lanes, 3, structure.size + 2))
        rhs[:, 0, :-2] = -structure.residual(self.z, self.p)
        rhs[:, 1:, -2:] = np.eye(2)
        inner = np.ascontiguousarray(rows[..., :-2])
        corner = np.ascontiguousarray(rows[..., -2:])
        solved = structure.solve(self.z, self.p, rhs, (columns, inner, corner)).x
        return solved[:, 0], solved[:, 1:]

    def tests(self, tests: Sequence[Test], kernel: Pairs) -> tuple[np.ndarray, np.ndarray]:
        """Values (tests, lanes) and derivatives (tests, lanes, 2) along the kernel."""
        spaces = [self, *(self.moved(DIFFERENCE * kernel[:, k]) for k in (0, 1))]
        at = Critical(
            self.structure,
            np.concatenate([each.z for each in spaces]),
            np.concatenate([each.p for each in spaces]),
            np.tile(self.b, (3, 1)),
        )
        values = np.array([test(at) for test in tests]).reshape(len(tests), 3, -1)
        slopes = (values[:, 1:] - values[:, :1]) / DIFFERENCE
        return values[:, 0], np.moveaxis(slopes, 1, 2)


def correct_singular_states(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    free: Int[np.ndarray, "lanes 2"],
    tests: TestsOf,
) -> tuple[Lanes, Parameters, Flags]:
    """States near guesses at which two tests vanish, in two parameters; and whether they are found.

    Newton's method on F = 0 and the tests, in a basis of the kernel of [F_z F_p] that is regular at
    folds, branch points and cusps.

    Parameters
    ----------
    structure
        The structure.
    z, p
        Guesses.
    free
        Places of the two parameters that vary, for each lane its own.
    tests
        What vanishes on some of the lanes, by their numbers; see
        `equimorph.equilibria.conditions`.
    """
    space = _Space(structure, z, p, free, null_border(structure, z, p))
    waves = np.cos(np.outer([1, 2], 1.7 * np.arange(structure.size + 2)) + 0.4)
    _, kernel = space.frame(np.tile(waves, (len(z), 1, 1)))
    end_z, end_p, found = z.copy(), p.copy(), np.zeros(len(z), bool)
    lanes = np.arange(len(z))
    for _ in range(ITERATIONS):
        space, kernel, size = _newton_step(space, kernel, tests(lanes))
        done, open_ = size <= CONVERGED, (size > CONVERGED) & (size < FARTHEST)
        end_z[lanes[done]], end_p[lanes[done]] = space.z[done], space.p[done]
        found[lanes[done]] = True
        left = np.flatnonzero(open_)
        if not len(left):
            break
        lanes, space, kernel = lanes[left], space.take(left), kernel[left]
        b = Critical(structure, space.z, space.p, space.b).v
        space = replace(space, b=b / np.linalg.norm(b, axis=1)[:, None])
    return end_z, end_p, found


def _newton_step(
    space: _Space, kernel: Pairs, tests: tuple[Test, Test]
) -> tuple[_Space, Pairs, Values]:
    """Corrected lanes, their kernels, and lengths of the corrections; ∞ where there is none."""
    kernel = _orthonormal(kernel, space.weights)
    onto, kernel = space.frame(kernel * space.weights[:, None])
    kernel = _orthonormal(kernel, space.weights)
    values, slopes = space.moved(onto).tests(tests, kernel)
    matrix = np.moveaxis(slopes, 1, 0)
    able = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(onto).all(axis=1)
    able[able] = np.abs(np.linalg.det(matrix[able])) > 0.0
    share = np.zeros((len(able), 2))
    share[able] = np.linalg.solve(matrix[able], -values.T[able][..., None])[..., 0]
    step = onto + np.einsum("lk,lki->li", share, kernel)
    step[~able] = 0.0
    size = np.sqrt((step**2 * space.weights).sum(axis=1))
    return space.moved(step), kernel, np.where(able, size, np.inf)


def _orthonormal(kernel: Pairs, weights: Float[np.ndarray, "lanes extended"]) -> Pairs:
    """Orthonormal pairs in the metric that span the same planes."""
    first = kernel[:, 0] / np.sqrt((kernel[:, 0] ** 2 * weights).sum(axis=1))[:, None]
    along = (kernel[:, 1] * first * weights).sum(axis=1)[:, None]
    rest = kernel[:, 1] - along * first
    rest = rest - (rest * first * weights).sum(axis=1)[:, None] * first
    second = rest / np.sqrt((rest**2 * weights).sum(axis=1))[:, None]
    return np.stack([first, second], axis=1)

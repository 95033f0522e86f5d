"""Plain explicit gradient flows on smooth energies: basins, what lies on their edges, passes."""

from collections.abc import Callable, Iterator

import numpy as np

Energy = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Gradient and Hessian of rows of configurations."""


STEP, STEPS, NEAR = 0.05, 4000, 0.03
"""Of a flow, for energies with stiffnesses up to about 40; Newton's step that ends it in a well."""
EDGE, RELAXING = 400, 400
"""Steps along the edge of a basin, and of a string."""
BISECTIONS = 10
"""Between points of two basins."""
EQUILIBRIUM = 1e-9
"""Slope up to which Newton has found a saddle; from far beside it, it may find nothing."""
CHECKED = 5
"""Steps after which it is seen again which flows have come to a well."""


def step(energy: Energy, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One Runge–Kutta step of third order of ẋ = −∇E, and the largest slopes before it."""
    a = -energy(x)[0]
    b = -energy(x + 0.5 * STEP * a)[0]
    c = -energy(x + STEP * (2 * b - a))[0]
    return x + STEP * (a + 4 * b + c) / 6, np.abs(a).max(axis=1)


def polish(energy: Energy, x: np.ndarray, times: int = 20) -> np.ndarray:
    """Newton."""
    for _ in range(times):
        gradient, hessian = energy(x)
        x = x - np.linalg.solve(hessian, gradient[..., None])[..., 0]
    return x


def relax(energy: Energy, x: np.ndarray, wells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where flows end, and the number of the well that is nearest to there."""
    x, todo = x.copy(), np.arange(len(x))
    for number in range(STEPS):
        x[todo], _ = step(energy, x[todo])
        if number % CHECKED == 0:
            slope, hessian = energy(x[todo])
            newton = np.linalg.solve(hessian, slope[..., None])[..., 0]
            bent = np.linalg.eigvalsh(hessian)[:, 0] < 0.0
            todo = todo[bent | (np.abs(newton).max(axis=1) > NEAR)]
        if len(todo) == 0:
            break
    assert len(todo) == 0
    x = polish(energy, x, 6)
    return x, np.linalg.norm(x[:, None] - wells[None], axis=2).argmin(axis=1)


def follow_edge(
    energy: Energy, wells: np.ndarray, generator: np.random.Generator, count: int
) -> Iterator[tuple[np.ndarray, int, int]]:
    """Saddles on the edges of basins: bisect between points of two basins, follow the flow there.

    Yields the saddle, and the two wells to which the flow leads from beside it.
    """
    x = generator.uniform(-2.0, 2.0, (2, count, wells.shape[1]))
    label = [relax(energy, each, wells)[1] for each in x]
    apart = label[0] != label[1]
    (a, b), low = x[:, apart], label[0][apart]
    for _ in range(BISECTIONS):
        middle = 0.5 * (a + b)
        same = relax(energy, middle, wells)[1] == low
        a, b = np.where(same[:, None], middle, a), np.where(same[:, None], b, middle)
    if not len(a):
        return
    # the flow is slow beside the saddle before it falls into a well
    nearest, slowest = a.copy(), np.full(len(a), np.inf)
    for _ in range(EDGE):
        after, slope = step(energy, a)
        better = (slope < slowest) & (np.linalg.eigvalsh(energy(a)[1])[:, 0] < 0.0)
        nearest[better], slowest[better] = a[better], slope[better]
        a = after
    for saddle in polish(energy, nearest):
        gradient, hessian = energy(saddle[None])
        value, vector = np.linalg.eigh(hessian[0])
        if (value < 0).sum() != 1 or np.abs(gradient).max() > EQUILIBRIUM:
            continue
        beside = saddle + 1e-3 * np.array([[1.0], [-1.0]]) * vector[:, 0]
        yield saddle, *map(int, relax(energy, beside, wells)[1])


def string_pass(energy: Energy, start: np.ndarray, goal: np.ndarray, images: int = 41) -> float:
    """Highest energy of a path between two wells that relaxes at even distances, a string."""
    share = np.linspace(0.0, 1.0, images)
    x = start + share[:, None] * (goal - start)
    for _ in range(RELAXING):
        x[1:-1] -= STEP * energy(x[1:-1])[0]
        length = np.append(0.0, np.linalg.norm(np.diff(x, axis=0), axis=1).cumsum())
        x = np.stack([np.interp(share * length[-1], length, column) for column in x.T], axis=1)
    height = energies(energy, x)
    k = int(height[1:-1].argmax()) + 1
    fall, bend = (height[k + 1] - height[k - 1]) / 2, height[k + 1] - 2 * height[k] + height[k - 1]
    return float(height[k] - 0.5 * fall**2 / bend)


def energies(energy: Energy, x: np.ndarray) -> np.ndarray:
    """Energies above that of the origin: the slope along the ray from there, by Gauss."""
    at, weights = np.polynomial.legendre.leggauss(5)
    slopes = [(energy(0.5 * (1 + t) * x)[0] * x).sum(axis=1) for t in at]
    return 0.5 * weights @ np.array(slopes)

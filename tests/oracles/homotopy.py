"""All complex roots of cubic systems by a total-degree homotopy, in batches of paths.

Independent of the package: ``H = (1 − t) γ (x³ − 1) + t F(x)`` with a random complex γ is followed
from the 3ⁿ roots at t = 0 by Runge–Kutta steps and Newton's method [SommeseWampler2005]_.
"""

from collections.abc import Callable
from itertools import product

import numpy as np

System = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Values (paths, n) and Jacobians (paths, n, n) at complex points (paths, n)."""

SHORTEST, LONGEST = 1e-7, 0.1
CLOSE = 1e-9


def complex_roots(
    system: System, unknowns: int, far: float, seed: int = 0
) -> tuple[np.ndarray, int]:
    """Ends of all paths that stay nearer than `far`, and how many paths were lost on the way.

    At infinity paths run farther than `far` at last, and are left there.
    """
    generator = np.random.default_rng(seed)
    gamma = np.exp(2j * np.pi * generator.random(unknowns))
    roots = np.exp(2j * np.pi * np.arange(3) / 3)
    x = np.array(list(product(roots, repeat=unknowns)))
    t, h = np.zeros(len(x)), np.full(len(x), 0.02)
    ended, lost = np.zeros(len(x), bool), np.zeros(len(x), bool)

    def both(x, t):
        value, slope = system(x)
        start, other = gamma * (x**3 - 1.0), np.zeros_like(slope)
        np.einsum("lii->li", other)[...] = gamma * 3.0 * x**2
        t = t[:, None]
        rate = value - start
        return (
            (1 - t) * start + t * value,
            (1 - t[:, :, None]) * other + t[:, :, None] * slope,
            rate,
        )

    def velocity(x, t):
        _, slope, rate = both(x, t)
        return -np.linalg.solve(slope, rate[:, :, None])[:, :, 0]

    while not (ended | lost).all():
        go = np.flatnonzero(~(ended | lost))
        here, now = x[go], t[go]
        step = np.minimum(h[go], 1.0 - now)
        s = step[:, None]
        k1 = velocity(here, now)
        k2 = velocity(here + 0.5 * s * k1, now + 0.5 * step)
        k3 = velocity(here + 0.5 * s * k2, now + 0.5 * step)
        k4 = velocity(here + s * k3, now + step)
        guess = here + s * (k1 + 2 * k2 + 2 * k3 + k4) / 6
        guess, size, first = _corrected(both, guess, now + step)
        good = (size < CLOSE) & (first < 1e-3)
        x[go[good]], t[go[good]] = guess[good], (now + step)[good]
        h[go] = np.clip(h[go] * np.where(good, np.where(first < 1e-5, 2.0, 1.0), 0.4), 0.0, LONGEST)
        ended[go] = t[go] >= 1.0
        gone = (np.linalg.norm(x[go], axis=1) > far) & (t[go] > 0.9)
        ended[go[gone]], x[go[gone]] = True, np.nan
        lost[go] = ~ended[go] & (h[go] < SHORTEST)
    return x[~lost & np.isfinite(x).all(axis=1)], int(lost.sum())


def _corrected(
    both: Callable[..., tuple[np.ndarray, ...]], x: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three steps of Newton's method at most, and the sizes of the last and of the first."""
    x, sizes = x.copy(), [np.full(len(x), np.inf)]
    for _ in range(3):
        size = sizes[-1].copy()
        left = np.flatnonzero(size >= CLOSE)
        value, slope, _ = both(x[left], t[left])
        change = np.linalg.solve(slope, value[:, :, None])[:, :, 0]
        x[left] -= change
        size[left] = np.linalg.norm(change, axis=1) / (1.0 + np.linalg.norm(x[left], axis=1))
        sizes.append(size)
    return x, sizes[-1], sizes[1]


def real_roots(
    system: System, unknowns: int, far: float = 1e4, seed: int = 0
) -> tuple[np.ndarray, int]:
    """Real roots nearer than `far`, polished and told apart, and how many paths were lost."""
    roots, lost = complex_roots(system, unknowns, far, seed)
    x = roots[np.abs(roots.imag).max(axis=1) < 1e-6].real.astype(complex)
    for _ in range(5):
        value, slope = system(x)
        x = (x - np.linalg.solve(slope, value[:, :, None])[:, :, 0]).real.astype(complex)
    kept: list[np.ndarray] = []
    for each in x.real:
        if not any(np.linalg.norm(each - other) < 1e-7 for other in kept):
            kept.append(each)
    return np.array(kept).reshape(-1, unknowns), lost

"""Shortest stable curves of the spring in its own coordinates (δ, x), by an independent search.

States are (δ, x, F) with F = sin δ − x tan δ; they are stable where x > cos³δ. The length of a fine
polygon is least for one with equal legs, so L-BFGS lowers the sum of their squares, with
logarithmic barriers at the fold and at the sides of the box that vanish.
"""

import numpy as np
from scipy.optimize import minimize

from equimorph.arrays import Float

Polygon = Float[np.ndarray, "_ 2"]
NODES = 100


def places(polygon: Polygon) -> Float[np.ndarray, "_ 3"]:
    """(δ, x, F) of a polygon in (δ, x)."""
    delta, x = polygon.T
    return np.stack([delta, x, np.sin(delta) - x * np.tan(delta)], axis=1)


def walls(polygon: Polygon, box: tuple[float, float, float, float]):
    """What stays positive, and its slopes by δ and x."""
    delta, x, force = places(polygon).T
    by_delta, by_x, one = np.cos(delta) - x / np.cos(delta) ** 2, -np.tan(delta), np.ones(len(x))
    sides = [x - box[0], box[1] - x, force - box[2], box[3] - force]
    value = np.stack([x - np.cos(delta) ** 3, *sides], axis=1)
    bend = 3.0 * np.cos(delta) ** 2 * np.sin(delta)
    slopes = [
        np.stack([bend, 0.0 * one, 0.0 * one, by_delta, -by_delta], axis=1),
        np.stack([one, one, -one, by_x, -by_x], axis=1),
    ]
    return value, np.stack(slopes, axis=2), np.stack([by_delta, by_x], axis=1)


def shortest_length(near: Polygon, box: tuple[float, float, float, float]) -> float:
    """Length of the shortest stable curve near a stable polygon, with the same ends."""
    gap = np.linalg.norm(np.diff(near, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(gap)])
    even = np.linspace(0.0, at[-1], NODES + 1)
    start = np.stack([np.interp(even, at, column) for column in near.T], axis=1)
    inner = start[1:-1]
    inner[:, 1] = np.maximum(inner[:, 1], np.cos(inner[:, 0]) ** 3 + 1e-4)

    def whole(flat):
        return np.concatenate([start[:1], flat.reshape(-1, 2), start[-1:]])

    def value(flat, strength):
        polygon = whole(flat)
        legs = np.diff(places(polygon), axis=0)
        room, slopes, by = walls(polygon[1:-1], box)
        if (room <= 0.0).any():
            return 1e10, np.zeros(len(flat))
        pull = 2.0 * NODES * (legs[:-1] - legs[1:])
        gradient = pull[:, :2] + pull[:, 2:] * by
        gradient -= strength / NODES * (slopes / room[:, :, None]).sum(axis=1)
        total = NODES * (legs**2).sum() - strength / NODES * np.log(room).sum()
        return total, gradient.ravel()

    flat = inner.ravel()
    for strength in 10.0 ** -np.arange(2.0, 8.0):
        flat = minimize(
            value, flat, (strength,), method="L-BFGS-B", jac=True,
            options={"maxiter": 4000, "maxfun": 8000, "maxcor": 30, "ftol": 1e-14, "gtol": 1e-9},
        ).x  # fmt: skip
    return float(np.linalg.norm(np.diff(places(whole(flat)), axis=0), axis=1).sum())

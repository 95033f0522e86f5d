"""Structures with states close to each other, or with very many, all of them known."""

import numpy as np

import equimorph as em

PLACE = "0.3*p + 0.2*r**2"
"""Where the close states of `close_sheets` begin."""


def close_sheets(distance: float, sheets: int = 3) -> em.EnergyStructure:
    """E' = (x − 3) Π (x − a − k·distance), k < `sheets`; the natural state x = 3 is far off."""
    y, c = f"(x - ({PLACE}))", f"(3 - ({PLACE}))"
    factors = np.poly(distance * np.arange(sheets))[::-1]
    # each term of the product times y − c, integrated
    terms = [
        f"({float(factor)!r})*({y}**{k + 2}/{k + 2} - {c}*{y}**{k + 1}/{k + 1})"
        for k, factor in enumerate(factors)
        if factor != 0.0
    ]
    unknown = em.Unknown("x", "3", guesses=(-2.5, 3.5))
    parameters = [
        em.Parameter("p", "1", 1.0, "actuator", 0.0),
        em.Parameter("r", "1", 1.0, "load", 0.0),
    ]
    return em.EnergyStructure(" + ".join(terms), [unknown], parameters)


def close_roots(distance: float, sheets: int, p: float, r: float) -> np.ndarray:
    """Equilibria of `close_sheets` over a point, in order."""
    return np.append(0.3 * p + 0.2 * r**2 + distance * np.arange(sheets), 3.0)


def truss_row(count: int, seed: int | None = None) -> em.Truss:
    """Two-bar trusses side by side, apexes joined by weak bars: 2^count stable states at F = 0.

    Green strain; half-span 1, rise 0.3. A seed varies the rises and couplings by up to 10 %.
    """
    generator = np.random.default_rng(seed)
    vary = generator.uniform(-0.1, 0.1, (2, count)) if seed is not None else np.zeros((2, count))
    joints, bars, supports = {}, [], {}
    for i in range(count):
        left, top, right = f"L{i}", f"T{i}", f"R{i}"
        joints[left], joints[right] = (2.5 * i - 1.0, 0.0), (2.5 * i + 1.0, 0.0)
        joints[top] = (2.5 * i, 0.3 * (1.0 + vary[0, i]))
        supports[left] = supports[right] = "xy"
        bars += [em.Bar((left, top)), em.Bar((top, right))]
        if i:
            bars.append(em.Bar((f"T{i - 1}", top), EA=0.05 * (1.0 + vary[1, i])))
    loads = {"F": {f"T{i}": (0.0, -1.0) for i in range(count)}}
    return em.Truss(joints, bars, supports, loads, strain="green")

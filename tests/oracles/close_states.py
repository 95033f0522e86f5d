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


def quadric(
    form: np.ndarray, centre: tuple[float, float, float], level: float
) -> em.EnergyStructure:
    """E' = (x − 3) (yᵀ form y − level), y = (x, p, r) − centre: a quadric beside a sheet x = 3.

    With the natural state x = 3 far off: necks, gaps, cones and spheres of any size and direction.
    """
    a = [[float(entry) for entry in row] for row in form]
    y, p, r = (f"({name} - ({float(at)!r}))" for name, at in zip("xpr", centre, strict=True))
    linear = f"({2.0 * a[0][1]!r}*{p} + {2.0 * a[0][2]!r}*{r})"
    rest = f"({a[1][1]!r}*{p}**2 + {2.0 * a[1][2]!r}*{p}*{r} + {a[2][2]!r}*{r}**2 - {level!r})"
    far = 3.0 - float(centre[0])
    energy = (
        f"{a[0][0]!r}*{y}**4/4 + ({linear} - {far * a[0][0]!r})*{y}**3/3"
        f" + ({rest} - {far!r}*{linear})*{y}**2/2 - {far!r}*{rest}*{y}"
    )
    unknown = em.Unknown("x", "3", guesses=(-2.5, 3.5))
    parameters = [
        em.Parameter("p", "1", 1.0, "actuator", 0.0),
        em.Parameter("r", "1", 1.0, "load", 0.0),
    ]
    return em.EnergyStructure(energy, [unknown], parameters)


def hyperboloid(tilt: float, azimuth: float, slope: float) -> np.ndarray:
    """Form of the cone with a right angle at its tip about an axis, flattened along x by `slope`.

    The axis leaves that of x by `tilt`. Its sheets are yᵀ form y = ±e²: + joined by a neck of
    radius e, − two apart.
    """
    axis = np.array([np.cos(tilt), *(np.sin(tilt) * np.array([np.cos(azimuth), np.sin(azimuth)]))])
    stretch = np.diag([1.0 / slope, 1.0, 1.0])
    return stretch @ (np.eye(3) - 2.0 * np.outer(axis, axis)) @ stretch

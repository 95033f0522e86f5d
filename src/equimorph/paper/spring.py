"""The constrained spring: equilibria at x_l = 0.80, the set, level sets, the tasks of the article.

Everything is known in closed form: F = k (1 − x_l/cos δ) sin δ, stable where x_l > cos³ δ.
"""

from pathlib import Path

import equimorph as em

START = {"delta": 0.62, "x_l": 0.80}
LEVELS = (-0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1)
"""Loads F of the level curves that are drawn, in units of k."""

SMOOTH = 1e-3
"""Distance of the surface from its triangles up to which lines on it look smooth at its cusp."""


def spring(folder: Path, accuracy: float = SMOOTH) -> dict[str, float]:
    """Answer the tasks of the article from C_s, at the load of C_s."""
    spring = em.Spring()
    angle, load, length = spring.angle, em.value_of(spring, "F"), em.value_of(spring, "x_l")
    within = [angle <= 1.2, angle >= -1.2]
    slice_ = em.equilibrium_set(spring, em.Box(F=(-0.1, 0.1)), fixed={"x_l": 0.8}, within=within)
    eset = em.equilibrium_set(
        spring, em.Box(x_l=(0.5, 1.2), F=(-0.25, 0.25)), within=within, intervals=(35, 35),
        accuracy=accuracy,
    )  # fmt: skip
    known = {angle: START["delta"], length: START["x_l"]}
    start = em.solve_shape(eset, known).stable[0]
    level = [load <= start["F"], load >= start["F"]]
    first = em.solve_shape(eset, {angle: 0.40, load: start["F"]}, start=start, within=level)
    exact = em.solve_shape(eset, {angle: 0.40, length: 0.90}).stable[0]
    at_level = em.equilibrium_set(spring, em.Box(x_l=(0.5, 1.2)), fixed={"F": start["F"]})
    flattest = em.optimise(at_level, angle, start=start).best.state
    mirrored = em.solve_shape(eset, {angle: -0.62, load: start["F"]}).stable[0]
    fixed_load = em.plan(at_level, start, mirrored)
    free_load = em.plan(eset, start, mirrored)
    cusp = em.manifold.cusps(eset).states[0]
    printed = em.solve_shape(eset, {angle: 0.30, length: 0.925}).stable[0]
    marks = {"$C_s$": start, "$C_t^1$": first.stable[0], "$C_t^2$": flattest, "$C_t^3$": mirrored}
    plots = em.plotting
    plots.save(plots.diagram(slice_, angle), folder, "spring-equilibria")
    plots.save(plots.surface(eset, angle, route=free_load), folder, "spring-set")
    levels = plots.level_plane(
        eset, (length, angle), load, (*LEVELS, start["F"]), route=free_load, marks=marks
    )
    plots.save(levels, folder, "spring-levels")
    assert free_load.path is not None
    return {
        "load of C_s": start["F"],
        "x_l of delta = 0.40 at the load of C_s": first.stable[0]["x_l"],
        "load of (0.40, 0.90)": exact["F"],
        "load of (0.30, 0.925)": printed["F"],
        "margin of (0.30, 0.925)": printed.margin,
        "delta of C_t2": angle(flattest),
        "x_l of C_t2": flattest["x_l"],
        "x_l of C_t3 at the load of C_s": mirrored["x_l"],
        "a route to C_t1 at fixed load": len(first.stable) > 0,
        "a route to C_t3 at fixed load": fixed_load.arrived,
        "a route to C_t3 with the load free": free_load.arrived,
        "largest x_l on that route": float(free_load.path.states["x_l"].max()),
        "x_l of the cusp": cusp["x_l"],
        "free parameters of the set": float(len(eset.names)),
    }

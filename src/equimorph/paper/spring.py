"""The constrained spring: equilibria at x_l = 0.80, the set, the tasks of the article."""

from pathlib import Path

import equimorph as em

START = {"delta": 0.62, "x_l": 0.80}


def main(folder: Path) -> dict[str, float]:
    """Answer the tasks of the article from C_s, at its own load."""
    spring = em.Spring()
    angle, load, length = spring.angle, em.value_of(spring, "F"), em.value_of(spring, "x_l")
    within = [angle <= 1.2, angle >= -1.2]
    slice_ = em.equilibrium_set(spring, em.Box(F=(-0.1, 0.1)), fixed={"x_l": 0.8}, within=within)
    eset = em.equilibrium_set(
        spring, em.Box(x_l=(0.5, 1.2), F=(-0.1, 0.1)), within=within, intervals=(35, 35)
    )
    known = {angle: START["delta"], length: START["x_l"]}
    start = em.solve_shape(eset, known).stable[0]
    level = [load <= start["F"], load >= start["F"]]
    first = em.solve_shape(eset, {angle: 0.40, load: start["F"]}, start=start, within=level)
    exact = em.solve_shape(eset, {angle: 0.40, length: 0.90}).stable[0]
    at_level = em.equilibrium_set(spring, em.Box(x_l=(0.5, 1.2)), fixed={"F": start["F"]})
    flattest = em.optimise(at_level, angle, start=start)
    mirrored = em.solve_shape(eset, {angle: -0.62, load: start["F"]}).stable[0]
    fixed_load = em.plan(at_level, start, mirrored)
    free_load = em.plan(eset, start, mirrored)
    plots = em.plotting
    plots.save(plots.diagram(slice_, angle), folder, "spring-equilibria")
    plots.save(plots.surface(eset, angle, route=free_load), folder, "spring-set")
    plots.save(plots.parameter_plane(eset, free_load), folder, "spring-plane")
    return {
        "load of C_s": start["F"],
        "x_l of delta = 0.40 at the load of C_s": first.stable[0]["x_l"],
        "load of (0.40, 0.90)": exact["F"],
        "delta of C_t2": angle(flattest.best.state),
        "x_l of C_t2": flattest.best.state["x_l"],
        "x_l of C_t3 at the load of C_s": mirrored["x_l"],
        "routes to C_t3 at fixed load": float(fixed_load.arrived),
        "routes to C_t3 with the load free": float(free_load.arrived),
        "largest x_l on that route": float(free_load.path.states["x_l"].max()),
    }

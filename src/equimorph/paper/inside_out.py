"""The arch turned inside out at q = 2.5 along the article's way-points, and without them."""

from pathlib import Path

import equimorph as em

WAY = ({"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0})
INTERVALS = (47, 81)
"""Grid intervals over Θ and Δ."""


def main(folder: Path, intervals: tuple[int, int] = INTERVALS) -> dict[str, float]:
    """Follow the route, measure it, and look for a shorter one."""
    arch = em.Rod("uniform")
    kappa, crown = arch.max_curvature, arch.height(0.5)
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    eset = em.equilibrium_set(
        arch, box, fixed={"q": 2.5}, within=[kappa <= 20], intervals=intervals
    )
    here = eset.at(Theta=1.0, Delta=0.0)
    up, down = max(here.stable, key=crown), min(here.stable, key=crown)
    route = em.plan(eset, up, down, via=WAY, monitor=[kappa])
    limited = em.plan(eset, up, down, via=WAY, within=[kappa <= 6])
    shorter = em.plan(eset, up, down, margin=0.3)
    panels = em.plotting.route_panels(eset, route, crown, limit=kappa <= 6)
    em.plotting.save(panels, folder, "inside-out")
    stable = eset.at(Theta=1.3, Delta=1.3).stable
    assert route.path is not None
    return {
        "equilibria at (1, 0)": float(len(here)),
        "stable equilibria at (1, 0)": float(len(here.stable)),
        "stable equilibria at (1.3, 1.3)": float(len(stable)),
        "crown of the upright arch": crown(up),
        "crown of the inverted arch": crown(down),
        "thrust lambda of the upright arch": float(up.multipliers[0]),
        "thrust lambda of the inverted arch": float(down.multipliers[0]),
        "supports that pull on the inverted arch": bool(down.multipliers[0] < 0.0),
        "a route along the way-points": route.arrived,
        "smallest margin of the route": route.margin,
        "length of the route": route.length,
        "largest max |kappa| of the route": float(kappa(route.path.states).max()),
        "max |kappa| of the goal": kappa(down),
        "a route within max |kappa| <= 6": limited.arrived,
        "length of the shortest route with margin 0.3": shorter.length,
    }

"""The article's arch: adaptation, parameterisations, tracking, and the way inside out."""

from pathlib import Path

import equimorph as em

FORCE = 1.0
"""In units of 4π²B/L²."""
TARGET = (0.23, 0.10)
"""Heights at s = 1/3 and 2/3, in units of L."""


def introduction(folder: Path) -> dict[str, float]:
    """Find two stable states under one load, and a shape that adapts to a load.

    A rod of length 1, clamped at both ends in rotary actuators a span sin 1 apart, under a force at
    its middle. The article gives no numbers for it; angles, force and target are ours.
    """
    rod = em.Rod(loads={"F": em.PointForce(0.5)})
    crown, third, other = rod.height(0.5), rod.height(1 / 3), rod.height(2 / 3)
    box = em.Box(Theta=(0.4, 1.6), Delta=(-0.9, 0.9))
    eset = em.equilibrium_set(
        rod, box, fixed={"F": FORCE}, within=[rod.max_curvature <= 20], intervals=(16, 25)
    )
    both = eset.at(Theta=1.0, Delta=0.1).stable
    up, down = max(both, key=crown), min(both, key=crown)
    rest = rod.natural_state(Theta=0.9, Delta=0.0)
    loaded = em.lift(rest, {"F": FORCE}).end.state
    wanted = dict(zip((third, other), TARGET, strict=True))
    adapted = em.track(loaded, wanted, actuators=["Theta", "Delta"])
    goal = adapted.path.states[-1]
    em.plotting.save(em.plotting.portraits(both), folder, "two-states")
    em.plotting.save(em.plotting.shapes(adapted.path, count=6), folder, "adaptation")
    return {
        "stable states under the force": float(len(both)),
        "crown of the upper state": crown(up),
        "crown of the lower state": crown(down),
        "margin of the upper state": up.margin,
        "margin of the lower state": down.margin,
        "crown at rest": crown(rest),
        "crown under the force": crown(loaded),
        "target reached": adapted.arrived,
        "smallest margin on the way": adapted.margin,
        "height at 1/3 adapted": third(goal),
        "height at 2/3 adapted": other(goal),
        "Theta adapted": goal["Theta"],
        "Delta adapted": goal["Delta"],
    }


LOAD = 2.5
"""Uniform load q, in units of B/L³."""
WITHIN = 10.0
"""Largest max |κ|: beyond it there is a gap."""


def parameterisations(folder: Path) -> dict[str, float]:
    """Build the four internal parameterisations on two sets of the arch at q = 2.5 near a cusp."""
    arch = em.Rod("uniform")
    crown, third = arch.height(0.5), arch.height(2 / 3)
    beside, around = (
        em.equilibrium_set(
            arch,
            em.Box(Theta=theta, Delta=(0.4, 1.1)),
            fixed={"q": LOAD},
            within=[arch.max_curvature <= WITHIN],
            intervals=(16, 34),
        )
        for theta in ((1.3, 1.6), (1.0, 1.3))
    )
    projection = em.Projection(beside)
    failing, heights = em.Projection(around), em.DescriptorChart(around, [third, "Delta"])
    reduced = em.reduce(around, prefer=em.charts.highest(crown))
    atlas = em.dissect(around)
    panels: list[em.Chart | em.Atlas | list[em.Chart]] = [
        projection,
        [failing, heights],
        reduced,
        atlas,
    ]
    em.plotting.save(em.plotting.parameterisation(panels, crown), folder, "parameterisations")

    (barrier,) = reduced.barriers
    (cut,) = (each for each in atlas.transitions if each.kind == "cut")
    cusp = cut.coords[0][cut.coords[0][:, 0].argmax()]
    twice = sum(overlap.domain.size for overlap in failing.overlaps if overlap.sheets == (0,))
    return {
        "(a) projection is single-valued": projection.single_valued,
        "(b) projection is single-valued": failing.single_valued,
        "(b) area with two stable states": twice,
        "(b) (y(2/3), Delta) is single-valued": heights.single_valued,
        "(c) barriers": float(len(reduced.barriers)),
        "(c) least jump at the barrier": float(barrier.jump.min()),
        "(c) largest jump at the barrier": float(barrier.jump.max()),
        "(c) gaps": float(len(reduced.gaps.loops)),
        "(c) area of the gaps": reduced.gaps.size,
        "(d) charts": float(len(atlas)),
        "(d) Theta of the cusp": float(cusp[0]),
        "(d) Delta of the cusp": float(cusp[1]),
    }


CORNERS = ((0.10, 0.10), (0.20, 0.10), (0.20, 0.20), (0.10, 0.20), (0.10, 0.10))
"""Heights at s = 1/3 and 2/3 at the corners of the closed motion, in units of L."""
REACH_INTERVALS = (35, 61)
"""Grid intervals over Θ and Δ."""


def tracking(folder: Path, intervals: tuple[int, int] = REACH_INTERVALS) -> dict[str, float]:
    """Move the heights at s = 1/3 and 2/3 around a square at q = 2.5.

    And find the reachable set of (0.15, 0.15).
    """
    arch = em.Rod("uniform")
    kappa, third, other = arch.max_curvature, arch.height(1 / 3), arch.height(2 / 3)
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    eset = em.equilibrium_set(
        arch, box, fixed={"q": 2.5}, within=[kappa <= 45], intervals=intervals
    )
    found = em.solve_shape(eset, {third: 0.15, other: 0.15})
    middle = found.stable[0]
    targets = [{third: left, other: right} for left, right in CORNERS]
    corner = em.track(middle, targets[0], actuators=["Theta", "Delta"])
    square = em.track(corner.states[-1], targets[1:], actuators=["Theta", "Delta"])
    reach = em.reachable(eset, middle, [third, other])
    em.plotting.save(em.plotting.reach_panels(reach, square), folder, "tracking")
    at_corners = [em.solve_shape(eset, target) for target in targets[:-1]]
    pieces = {piece.kind for piece in reach.boundary}
    limits = {piece.detail for piece in reach.boundary if piece.kind == "actuator limit"}
    return {
        "Theta at (0.15, 0.15)": middle["Theta"],
        "Delta at (0.15, 0.15)": middle["Delta"],
        "stable states at (0.15, 0.15)": float(len(found.stable)),
        "most stable states at a corner": float(max(len(each.stable) for each in at_corners)),
        "square tracked": square.arrived,
        "smallest margin on the square": square.margin,
        "largest change of an actuator around it": max(map(abs, (square.holonomy or {}).values())),
        "regions of stable states": float(len(reach.regions)),
        "kinds of boundary of the reachable set": float(len(pieces)),
        "sides of the box on its boundary": float(len(limits)),
    }


WAY = ({"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0})
SURFACE_INTERVALS = (47, 81)
"""Grid intervals over Θ and Δ."""


def inside_out(folder: Path, intervals: tuple[int, int] = SURFACE_INTERVALS) -> dict[str, float]:
    """Turn the arch inside out at q = 2.5 along the article's way-points, and without them."""
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

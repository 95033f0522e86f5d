"""The examples of the reproduction, in the order of the article, with their figures.

Of the constrained spring everything is known in closed form: F = k (1 − x_l/cos δ) sin δ, stable
where x_l > cos³ δ.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

import equimorph as em
from equimorph.paper import arch_maps, in_space, shape_control

SPRING, ROD = {"x_l": 0.8, "F": 0.02}, {"Theta": 0.9, "Delta": 0.15}
"""Settings of the structures that are drawn; the rod under the left-half load."""
THIN: dict[str, Any] = {"color": "#1a1a1a", "linewidth": 0.6}
DASHED = THIN | {"linestyle": (0, (5, 3)), "zorder": 0.5}
COIL = 0.035 * np.array([0.0, 0.0, *np.tile([1.0, -1.0], 7), 0.0, 0.0])
"""Distances of the corners of the coil from its axis."""
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


def models(folder: Path) -> dict[str, float]:
    """Draw both structures; there is nothing to compute."""
    em.plotting.save(_spring_model(), folder, "spring-model")
    em.plotting.save(_rod_model(), folder, "rod-model")
    return {}


@dataclass(frozen=True)
class Example:
    """A result of the article, reproduced.

    Parameters
    ----------
    title
        For people.
    main
        Draws the figures into a folder and returns the key numbers by name.
    captions
        Names of the figures without extension, and what stands below each.
    """

    title: str
    main: Callable[[Path], dict[str, float]]
    captions: dict[str, str]

    @property
    def name(self) -> str:
        """That of the function."""
        return self.main.__name__


EXAMPLES = (
    Example(
        "Two states under one load; adaptation to a load",
        shape_control.introduction,
        {
            "two-states": "Two stable states of one rod of length L, clamped in rotary actuators "
            "sin 1 · L apart at Θ = 1, Δ = 0.1, under the same force F = 1 · 4π²B/L² at its "
            "middle: the upper one (1, full line) and the lower one (2, dashed).",
            "adaptation": "The rod of the figure before, under the force F = 1 · 4π²B/L² at its "
            "middle with Θ = 0.9, Δ = 0 (start, dark), turns its ends until its points at s = 1/3 "
            "and 2/3 are 0.23 L and 0.10 L high (goal, light); thin: states on the way, all "
            "stable.",
        },
    ),
    Example(
        "Internal parameterisations",
        shape_control.parameterisations,
        {
            "parameterisations": "Equilibrium sets of the arch under the uniform load q = 2.5 "
            "(above; crown over both end angles, cut at max |κ| = 10, near a cusp of its folds) "
            "and their internal parameterisations (below). (a) Projection to Θ and Δ gives every "
            "state a separate place. (b) It fails where two states lie over one setting "
            "(hatched crosswise), and the height y(2/3) with Δ works. (c) Reduction to the state "
            "with the highest crown leaves a barrier (thick), over which neighbours jump, and a "
            "gap (hatched), over which no state is. (d) Dissection in three charts.",
        },
    ),
    Example(
        "The two structures",
        models,
        {
            "spring-model": "A spring of stiffness k and natural length 1 from A to B. The "
            "actuator sets the distance x_l of A from the line on which B slides; the vertical "
            "load F acts on B. The angle δ is the only unknown.",
            "rod-model": "A rod of length L between rotary actuators at A and B, a distance νL "
            "apart, under a load q Q(s) along its arclength s. The actuators set the end angles, "
            "θ(0) = θ_A = Δ + Θ and θ(L) = −θ_B = Δ − Θ.",
        },
    ),
    Example(
        "The constrained spring",
        spring,
        {
            "spring-equilibria": "Angle δ of the spring's equilibria over the force F with the "
            "actuator at x_l = 0.80: stable states as full lines, unstable ones dashed, rings at "
            "the folds, at which the spring snaps.",
            "spring-set": "Equilibrium set of the spring over actuator x_l and force F; blue "
            "states are stable, orange ones unstable, the thick line between them is the fold. "
            "With the load free a route leads around the cusp at x_l = 1, F = 0 from C_s (○) to "
            "δ = −0.62 at the same load (●).",
            "spring-levels": "The set seen along F, with its level sets: full lines where stable, "
            "dashed where not; the thick line is the stability boundary x_l = cos³ δ. C_t1 and "
            "C_t2 are reached from C_s along its level; C_t3 lies on another branch of that level "
            "and is reached with the load free only (red).",
        },
    ),
    Example(
        "Limit loads",
        arch_maps.limit_loads,
        {
            f"limit-loads-{load}": f"Largest {load} load over half the difference Θ and half the "
            f"sum Δ of the end angles, from the unloaded state until stability is lost (C1) or "
            "max |κ| reaches 10 (C2; dotted regions); hatched: C2 is violated without load. Lines "
            "are all curves on which the limit load jumps or bends, named by their causes; ends "
            "of lines are cusps or meet other lines. Thin: contours."
            for load in ("uniform", "left-half")
        },
    ),
    Example(
        "Largest curvatures at q = 2.5",
        arch_maps.curvatures,
        {
            f"curvatures-{load}": f"Largest curvature of the first stable state with q = 2.5 on "
            f"the path from rest under the {load} load, over half the difference Θ and half the "
            "sum Δ of the end angles. Thick: barriers, at which neighbours are far from each "
            "other on the set. Dotted regions: a real loading snaps on the way; hatched: the path "
            "leads to no stable state. Thin: contours."
            for load in ("uniform", "left-half")
        },
    ),
    Example(
        "A closed curve of heights, tracked",
        shape_control.tracking,
        {
            "tracking": "The arch under the uniform load q = 2.5 moves its heights at s = 1/3 and "
            "2/3 around a square (red, corners numbered). (a) Heights, with what can be reached "
            "from y(1/3) = y(2/3) = 0.15 L (ring) and its boundary by kinds. (b) The motion on "
            "the stable states. (c) The end angles, with the region of the start. (d) Shapes at "
            "the corners.",
        },
    ),
    Example(
        "The arch turned inside out",
        shape_control.inside_out,
        {
            "inside-out": "The arch under the uniform load q = 2.5 is turned inside out without a "
            "snap, along the article's way-points (red, 1 to 5). (a) The equilibrium set over both "
            "end angles, coloured by the number of unstable directions and cut at max |κ| = 20; "
            "thick: stability boundary and other folds; dashed: max |κ| = 6, paler beyond. (b) "
            "The end angles, darker where the arch has two stable states; hatched: beyond max |κ| "
            "= 20, at which the set is cut. (c) Shapes at the way-points.",
        },
    ),
    Example(
        "In space: limit loads",
        in_space.space_loads,
        {
            f"space-loads-{name}": f"Limit loads of the arch under the uniform load, {text}, in "
            "colours common to all five maps. Striped: the arch leaves its plane first; dotted: "
            "max |κ| = 10 is reached first; hatched: max |κ| exceeds 10 without load."
            for name, text in (
                ("planar", "held in its plane"),
                ("round", "made of a round rod (ν = 0.3)"),
                *(
                    (f"strip-{ratio:g}", f"made of a strip {ratio:g} times as wide as thick")
                    for ratio in in_space.RATIOS
                ),
            )
        },
    ),
    Example(
        "In space: sideways instead of a snap",
        in_space.space_sideways,
        {
            "space-sideways": "The arch with Θ = 0.9, Δ = 0 under the uniform load, made of a "
            "round rod (GJ/EI = 0.77). Black: states in the plane, upright and inverted; red: the "
            "pair of states beside it, mirror images of each other; full lines: stable in space, "
            "dotted: unstable. Left the height y of the middle, middle its distance z from the "
            "plane, right the arch seen along its chord, with the load. Between both branch "
            "points a round rod swings sideways and turns inside out under a growing load, "
            "without a snap.",
        },
    ),
    Example(
        "In space: the way inside out",
        in_space.space_route,
        {
            "space-route": "The article's way inside out at q = 2.5 in space: "
            "the lowest eigenvalue of the second variation out of the plane, left along "
            "the way for a round rod (ν = 0.3) and for rectangular sections by width to thickness, "
            "right the smallest one on the way. Below zero the arch leaves its plane.",
        },
    ),
    Example(
        "In space: how stiff is stiff enough",
        in_space.space_stiffness,
        {
            "space-stiffness": "Smallest stiffness A out of the plane, relative to EI in it, with "
            "which the arch under the uniform load (C = GJ/EI = 0.77) stays in its plane from rest "
            "up to q = 2.5, or up to its planar limit load where that is lower (left of the "
            "ridge). The figure is symmetric in Δ.",
        },
    ),
)


def _spring_model() -> Axes:
    """Draw the spring from its actuator A to the loaded roller B."""
    state = max(em.find_equilibria(em.Spring(), SPRING).stable, key=lambda each: each.z[0])
    ax = em.plotting.portraits(state.batch, [" "])
    ax.lines[-1].set_visible(False)
    (a, b), angle = state.shape(), float(state.z[0])
    along = (b - a) / np.linalg.norm(b - a)
    across, side = np.array([along[1], -along[0]]), np.sign(b[0] - a[0])
    shares = np.array([0.0, *np.linspace(0.25, 0.75, len(COIL) - 2), 1.0])
    coil = a + shares[:, None] * (b - a) + COIL[:, None] * across
    ax.plot(*coil.T, color="#1f5f99", linewidth=1.4, zorder=3)
    ax.plot([0.0, 0.0, a[0]], [1.35 * b[1], 0.0, 0.0], **DASHED)
    _mark_angle(ax, a, side, angle, 0.18, "δ")
    measure(ax, a[0], -0.14, "$x_l$")
    middle = 0.5 * (a + b) + 0.08 * across * np.sign(across[1])
    for text, place, right, up in (
        ("A", a, -0.05, 0.05), ("B", b, -0.04, 0.05), ("$F$", b, 0.03, 0.12), ("$k$", middle, 0, 0)
    ):  # fmt: skip
        ax.text(place[0] + right * side, place[1] + up, text, ha="center", va="center", size=8)
    ax.set(ylim=(-0.22, 1.4 * b[1]))
    ax.set_axis_off()
    return ax


def _rod_model() -> Axes:
    """Draw the rod between its rotary actuators under a load that covers half of it."""
    path = em.lift(em.Rod("left-half").natural_state(**ROD), {"q": 1.0})
    ax, shape = em.plotting.portraits(path.states[-1:], [" "]), path.end.state.shape()
    for name, place, side in (("A", shape[0], 1.0), ("B", shape[-1], -1.0)):
        angle = ROD["Theta"] + side * ROD["Delta"]
        ax.plot([place[0], place[0] + 0.24 * side], [0.0, 0.0], **DASHED)
        _mark_angle(ax, place, side, angle, 0.13, f"$\\theta_{name}$")
        ax.text(place[0] - 0.09 * side, 0.0, name, ha="center", va="center", size=8)
    measure(ax, shape[-1, 0], -0.1, "$ν L$")
    for at, gap, text in ((0.2, np.array([-0.12, 0.12]), "$q\\,Q(s)$"), (0.75, 0.03, "$s$")):
        x, y = shape[int(at * len(shape))] + gap
        ax.text(x, y, text, ha="center", va="center", size=8)
    ax.set(ylim=(-0.17, ax.get_ylim()[1]))
    ax.set_axis_off()
    return ax


def _mark_angle(ax: Axes, place: Any, side: float, angle: float, radius: float, text: str) -> None:
    """Draw the arc of an angle above the horizontal, with its symbol."""
    turn = np.linspace(0.0, angle, 30)
    ax.plot(place[0] + radius * side * np.cos(turn), place[1] + radius * np.sin(turn), **THIN)
    x, y = 1.3 * radius * np.cos(angle / 2), 1.3 * radius * np.sin(angle / 2)
    ax.text(place[0] + side * x, place[1] + y, text, ha="center", va="center", size=8)


def measure(ax: Axes, x: float, y: float, text: str) -> None:
    """Draw a dimension line from x = 0, with its symbol below."""
    look = {"arrowstyle": "<|-|>,head_width=0.12,head_length=0.3", "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (x, y), (0.0, y), arrowprops={**look, **THIN})
    ax.text(0.5 * x, y - 0.04, text, ha="center", va="center", size=8)

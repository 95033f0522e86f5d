"""The examples of the reproduction, in the order of the article, with their figures."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from equimorph.paper import arch_maps, in_space, shape_control
from equimorph.paper.models import models
from equimorph.paper.spring import spring


@dataclass(frozen=True)
class Example:
    """A result of the article, reproduced."""

    title: str
    """For people."""
    main: Callable[[Path], dict[str, float]]
    """Draws the figures into a folder and returns the key numbers by name."""
    captions: dict[str, str]
    """Names of the figures without extension, and what stands below each."""

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

"""The examples of the reproduction, in the order of the article, with their figures."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from equimorph.paper import curvatures, inside_out, introduction, limit_loads, spring, tracking


@dataclass(frozen=True)
class Example:
    """A result of the article, computed anew.

    Parameters
    ----------
    name, title
        Of the module, and for people.
    main
        Draws the figures into a folder and returns the key numbers by name.
    captions
        Names of the figures without extension, and what stands below each.
    """

    name: str
    title: str
    main: Callable[[Path], dict[str, float]]
    captions: dict[str, str]


EXAMPLES = (
    Example(
        "introduction",
        "Two states under one load; adaptation to a load",
        introduction.main,
        {
            "two-states": "Two stable states of a rod clamped in actuators at Θ = 1, Δ = 0.1 under "
            "the force F = 1 at its middle.",
            "adaptation": "From the shape under F = 1 (start) the ends turn until the points at "
            "s = 1/3 and 2/3 are as high as they were at rest (goal); all states on the way "
            "are stable.",
        },
    ),
    Example(
        "spring",
        "The constrained spring",
        spring.main,
        {
            "spring-equilibria": "Equilibria at x_l = 0.80 over the force.",
            "spring-set": "The equilibrium set over x_l and F. With the load free a route leads "
            "around the cusp at x_l = 1 from C_s (○) to its mirror image at the same load (●).",
            "spring-plane": "The same route over the plane of both parameters.",
        },
    ),
    Example(
        "limit_loads",
        "Limit loads",
        limit_loads.main,
        {
            f"limit-loads-{load}": f"Largest load before stability is lost or max |κ| reaches 10, "
            f"{load} load, with the curves on which it jumps or bends."
            for load in ("uniform", "left-half")
        },
    ),
    Example(
        "curvatures",
        "Largest curvatures at q = 2.5",
        curvatures.main,
        {
            f"curvatures-{load}": f"Largest curvature of the first stable state with q = 2.5 on "
            f"the path from rest, {load} load, with barriers; dots: a real loading snaps."
            for load in ("uniform", "left-half")
        },
    ),
    Example(
        "tracking",
        "A closed curve of heights, tracked",
        tracking.main,
        {"tracking-shapes": "The arch at the corners of the square of heights."},
    ),
    Example(
        "inside_out",
        "The arch turned inside out",
        inside_out.main,
        {
            "inside-out-surface": "The equilibrium set at q = 2.5, and the route along the "
            "article's way-points.",
            "inside-out-plane": "The route over the plane of both end angles; where the arch has "
            "two stable states it is darker.",
            "inside-out-shapes": "Shapes at equal steps along the route.",
        },
    ),
)

"""A round rod turns inside out under a load, where a planar model sees a snap.

The arch of the paper with Θ = 0.9, Δ = 0. In its plane it is stable up to q = 4.244 and then snaps:
no planar path of stable states leads on. As a round rod it leaves its plane at q = 1.6015, swings
around sideways and is back in its plane, inverted, from q = 2.4765 on. A force of 1 % of λ_cr
across the plane says to which side. It stays stable all the way; the smallest stability margin is
0.0246.

Run it: python examples/sideways.py; it writes sideways.png and sideways.gif.
"""

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from matplotlib.figure import Figure

import equimorph as em

SIDE = 0.01


@dataclass(frozen=True)
class Result:
    """What the plane says, and the path in space."""

    planar: em.LimitLoad
    path: em.Path


def main() -> Result:
    """Load the arch in its plane, and in space with a small force across it."""
    planar = em.limit_load(em.Rod().natural_state(Theta=0.9), "q")
    across = {"side": em.PointForce(0.5, (0.0, 0.0, 1.0))}
    rod = em.SpatialRod("uniform", torsion=1.0 / 1.3, lateral=1.0, loads=across)
    start = rod.natural_state(Theta=0.9)
    path = em.lift(start, [{"side": SIDE}, {"q": 3.0}, {"side": 0.0}])
    return Result(planar, path)


def figure(result: Result) -> Figure:
    """Shapes on the way."""
    drawn = em.plotting.shapes(result.path, count=6).figure
    assert isinstance(drawn, Figure)
    return drawn


def report(result: Result) -> str:
    """What happens, in two lines."""
    states, rod = result.path.states, result.path.states.structure
    aside = np.abs(rod.descriptor("z(0.5)")(states)).max()
    heights = rod.descriptor("height(0.5)")(states)
    return (
        f"in the plane: {result.planar}\n"
        f"in space: {result.path.end.kind}, middle from y = {heights[0]:.4f} to {heights[-1]:.4f} "
        f"by z = {aside:.4f}, smallest margin {states.margin.min():.4f}"
    )


if __name__ == "__main__":
    found = main()
    print(report(found))
    em.plotting.save(figure(found), ".", "sideways", ["png"])
    em.plotting.film(found.path, FilePath("sideways.gif"))

"""A soft arm of three segments that bend, upright under a weight at its tip.

E = ∫ ½ B (θ' − κ₀)² ds + P y(L), κ₀ = k₁, k₂, k₃ on the thirds; units of B and L. Straight, it
buckles at P = π²/4: the cusp of the set over (k₁, P). Below, it can be led from one side to the
other; above, it leans to either side and snaps.

Run it: python examples/arm.py
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

import equimorph as em

HEAVY = 3.0


@dataclass(frozen=True)
class Result:
    """The set over the lowest segment and the weight, and a way from the left to the right."""

    eset: em.EquilibriumSet
    route: em.Route


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Compute the set, and the way from leaning left to leaning right under the weight."""
    segments = {f"k{i + 1}": em.Curvature(1.0, i / 3, (i + 1) / 3) for i in range(3)}
    arm = em.Rod(
        ends=("clamped", "free"),
        actuators=segments,
        loads={"P": em.PointForce(1.0)},
        EI=1.0,
        length=1.0,
    )
    box = em.Box(k1=(-1.5, 1.6), P=(1.0, 4.0))
    upright = {"theta_A": np.pi / 2, "k2": 0.0, "k3": 0.0}
    eset = em.equilibrium_set(
        arm, box, fixed=upright, within=[arm.max_curvature <= 10], intervals=intervals
    )
    tip = arm.position(1.0)[0]
    leaning = eset.at(k1=0.0, P=HEAVY).stable
    left, right = min(leaning, key=tip), max(leaning, key=tip)
    return Result(eset, em.plan(eset, left, right, margin=0.002))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print(found.eset.audit)
    print(found.route)
    em.plotting.save(figure(found), ".", "arm")

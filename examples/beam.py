"""A beam that a sliding support has buckled, pressed off its middle, flips over without a snap.

E = ∫ (½ B θ'² + ½ EA ε²) ds − P work, both ends clamped at angle 0; EA L²/B = 2500. It buckles
where the support is pushed in by e, e (1 − e) = 4π² B/(EA L²): at ν = 0.98395, the cusp of the set
over (ν, P). The way around it: slide the support out, press, slide it in.

Run it: python examples/beam.py
"""

from dataclasses import dataclass

from matplotlib.axes import Axes

import equimorph as em


@dataclass(frozen=True)
class Result:
    """The set over the support's place and the force, and the way around its cusp."""

    eset: em.EquilibriumSet
    route: em.Route


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Compute the set, and the way from buckled upward to buckled downward."""
    beam = em.Rod(
        axial=2500.0,
        loads={"P": em.PointForce(0.4)},
        coordinates={},
        EI=1.0,
        length=1.0,
        span=0.975,
    )
    box = em.Box(nu=(0.97, 1.0), P=(-38.0, 42.0))
    level = {"theta_A": 0.0, "theta_B": 0.0}
    eset = em.equilibrium_set(
        beam, box, fixed=level, within=[beam.max_curvature <= 12], intervals=intervals
    )
    middle = beam.height(0.5)
    buckled = eset.at(nu=0.975, P=0.0).stable
    up, down = max(buckled, key=middle), min(buckled, key=middle)
    return Result(eset, em.plan(eset, up, down, margin=0.05))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print(found.eset.audit)
    print(found.route)
    em.plotting.save(figure(found), ".", "beam")

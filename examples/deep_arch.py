"""A deep arch of 215°, clamped at one foot and hinged at the other, loaded at its crown.

E = ∫ ½ B (θ' + 1/R)² ds − P work; units of B and R. With the clamp as built the load reaches
P R²/B = 8.97309 [DaDeppo and Schmidt 1975], then the arch snaps. With the clamp turned by 0.2 rad
it carries 10.9: the set over (θ_A, P) shows where, and a route leads there.

Run it: python examples/deep_arch.py
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

import equimorph as em

ANGLE = np.deg2rad(215.0)


@dataclass(frozen=True)
class Result:
    """Limit load as built, the set over clamp and load, and a way to a heavier load."""

    limit: em.LimitLoad
    eset: em.EquilibriumSet
    route: em.Route


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Compute the limit load, the set, and the way to what the clamp as built cannot carry."""
    arch = em.Rod(
        ends=("clamped", "pinned"),
        curvature=-1.0,
        loads={"P": em.PointForce(0.5)},
        span=2 * np.sin(ANGLE / 2),
        EI=1.0,
        length=ANGLE,
    )
    rest = arch.natural_state(theta_A=ANGLE / 2)
    box = em.Box(theta_A=(1.7, 2.3), P=(-1.0, 11.5))
    eset = em.equilibrium_set(arch, box, within=[arch.max_curvature <= 8], intervals=intervals)
    heavy = eset.at(theta_A=2.1, P=9.5).stable
    goal = max(heavy, key=arch.height(0.5))
    return Result(em.limit_load(rest, "P"), eset, em.plan(eset, rest, goal, margin=0.01))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print(f"limit load {found.limit.value:.5f} ({found.limit.kind})")
    print(found.eset.audit)
    print(found.route)
    em.plotting.save(figure(found), ".", "deep_arch")

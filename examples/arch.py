"""The arch turned inside out by its clamps, without a snap [Feher2025]_.

E = ∫ θ'²/(8π²) ds − q ∫ ρ sin θ ds, ends a span sin 1 apart at the angles Θ + Δ and Δ − Θ, q = 2.5.
Upright and inverted arch at (Θ, Δ) = (1, 0) lie on one stable stratum; the way through (1.3, 0),
(1.3, 1.3), (1, 1.3) is stable throughout, with the least margin 0.462.

Run it: python examples/arch.py
"""

from dataclasses import dataclass

from matplotlib.axes import Axes

import equimorph as em

WAY = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]


@dataclass(frozen=True)
class Result:
    """The set over both angles, and the way from upright to inverted."""

    eset: em.EquilibriumSet
    route: em.Route


def main(intervals: tuple[int, int] = (47, 81)) -> Result:
    """Compute the set, and the way along the way-points."""
    arch = em.Rod(load="uniform")
    safe = [arch.max_curvature <= 20]
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0))
    eset = em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=safe, intervals=intervals)
    here, rise = eset.at(Theta=1.0, Delta=0.0).stable, arch.height(0.5)
    up, down = max(here, key=rise), min(here, key=rise)
    return Result(eset, em.plan(eset, up, down, via=WAY, within=safe, margin=0.1))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print(found.eset.audit)
    print(found.route)
    em.plotting.save(figure(found), ".", "arch")

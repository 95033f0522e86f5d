"""Four internal parameterisations of the constrained spring, ``F = k (1 − x_l/cos δ) sin δ``.

(a) For x_l > 1 the parameters (x_l, F) are coordinates. (b) For x_l < 1 up to three states share
them, but (δ, x_l) are coordinates, folds included. (c) Of all stable states with |δ| ≤ 0.9 those of
least energy are single-valued over (x_l, F). A barrier runs along F = 0 up to the cusp at x_l = 1.
Where the angle would be too large there is a gap, or the other sheet takes over at a barrier.
(d) Cut along its folds, and from the cusp on along the shortest line, the set has three charts.

Run it: python examples/charts.py
"""

from matplotlib.figure import Figure

import equimorph as em

Panels = list[em.Chart | em.Atlas]


def main() -> Panels:
    """Build the charts of the four panels."""
    spring = em.Spring()
    angle, energy = spring.angle, spring.descriptor("energy")
    wide = em.Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))
    whole = em.equilibrium_set(spring, wide, intervals=(24, 24))
    right = em.equilibrium_set(spring, em.Box(x_l=(1.02, 1.3), F=(-0.5, 0.5)), intervals=(12, 24))
    within = [angle <= 0.9, angle >= -0.9]
    capped = em.equilibrium_set(spring, wide, within=within, intervals=(24, 24))
    panels: Panels = [
        em.Projection(right),
        em.DescriptorChart(whole, [angle, "x_l"]),
        em.reduce(capped, prefer=em.charts.lowest(energy)),
        em.dissect(whole),
    ]
    for panel in panels:
        print(panel)
    return panels


def figure(panels: Panels) -> Figure:
    """Draw the set above, its coordinates below."""
    return em.plotting.parameterisation(panels, panels[0].eset.structure.descriptor("angle"))


if __name__ == "__main__":
    em.plotting.save(figure(main()), ".", "charts")

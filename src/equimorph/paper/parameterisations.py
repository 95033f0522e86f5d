"""The four internal parameterisations, on the arch at q = 2.5 around a cusp of its folds."""

from pathlib import Path

import equimorph as em

LOAD = 2.5
"""Uniform load q, in units of B/L³."""
WITHIN = 10.0
"""Largest max |κ|: beyond it there is a gap."""


def main(folder: Path) -> dict[str, float]:
    """Build the charts of the four panels on two sets, and draw them."""
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

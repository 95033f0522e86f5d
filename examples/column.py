"""A column of two rigid links leans to one side under its load, and is led over to the other.

Hinge springs k hold the links to a turning foot and to each other; the dead weight P acts on the
top: E = ½ k ((φ₁ − α)² + (φ₂ − φ₁)²) + P (cos φ₁ + cos φ₂). Upright, at α = 0, it buckles at
P = (3 − √5)/2 k = 0.381966 k, a cusp of the set over (α, P). At P = 0.45 k turning the foot would
make it snap; the way around the cusp takes the load off first.

Run it: python examples/column.py; it writes column.png and column.svg.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

import equimorph as em


@dataclass(frozen=True)
class Result:
    """Buckling load, the set, and the way from one side to the other."""

    buckles: em.LimitLoad
    eset: em.EquilibriumSet
    route: em.Route


def column() -> em.EnergyStructure:
    """The column, from its energy alone; derivatives come from the formula."""
    return em.EnergyStructure(
        "k*((phi1 - alpha)**2 + (phi2 - phi1)**2)/2 + P*top",
        [em.Unknown(name, "alpha", guesses=(-2.0, 2.0), unit="rad") for name in ("phi1", "phi2")],
        [
            em.Parameter("alpha", "rad", 1.0, "actuator", 0.0),
            em.Parameter("P", "k", 1.0, "load", 0.0),
            em.Parameter("k", "N·m", 1.0, "fixed", 1.0, 0.0),
        ],
        definitions={"top": "cos(phi1) + cos(phi2)"},
        descriptors={"lean": "sin(phi1) + sin(phi2)"},
        draw=[[0, 0], ["sin(phi1)", "cos(phi1)"], ["sin(phi1) + sin(phi2)", "top"]],
        supports=[{"point": 0, "kind": "clamp", "angle": np.pi / 2}],
        forces=[{"point": 2, "force": [0, "-P"]}],
    )


def main(intervals: tuple[int, int] = (31, 31)) -> Result:
    """Buckle it, compute the set, and lead it over at P = 0.45."""
    made = column()
    buckles = em.limit_load(made.natural_state(), "P")
    box = em.Box(alpha=(-0.6, 0.6), P=(0.1, 0.6))
    eset = em.equilibrium_set(made, box, intervals=intervals)
    sides = sorted(eset.at(alpha=0.0, P=0.45).stable, key=made.descriptor("lean"))
    return Result(buckles, eset, em.plan(eset, sides[-1], sides[0], margin=0.05))


def figure(result: Result) -> Axes:
    """The set with its cusp, and the way around it."""
    return em.plotting.surface(
        result.eset, result.eset.structure.descriptor("lean"), route=result.route
    )


if __name__ == "__main__":
    found = main()
    print(f"buckles at P = {found.buckles.value:.6f}")
    print(found.eset.audit)
    print(found.route)
    em.plotting.save(figure(found), ".", "column")

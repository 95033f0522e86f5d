"""A buckled strip whose two ends turn: it flips over without a snap.

A steel strip of 400 mm, its ends clamped 380 mm apart, ν = 0.95 of its length: θ(0) = Δ + Θ,
θ(1) = Δ − Θ. Turned at one end alone it snaps at about α = 1.7818 √(1 − ν) = 0.398, at both ends
against the arch at about 2 √(1 − ν) = 0.447. Both turned the same way it becomes an S, from which
it goes either way.

Run it: python examples/strip.py
"""

from dataclasses import dataclass

from matplotlib.axes import Axes

import equimorph as em


@dataclass(frozen=True)
class Result:
    """The set over both end angles, the snap when one end turns alone, and the way around."""

    eset: em.EquilibriumSet
    snap: em.Path
    route: em.Route


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Compute the set and both ways from the arch above to the arch below."""
    steel = em.Strip("20 mm", "0.2 mm", E="210 GPa", nu=0.3)
    units = {"force": "N", "length": "mm"}
    strip = em.Rod(section=steel, length="400 mm", span="380 mm", units=units, loads={})
    box = em.Box(Theta=(-1.0, 1.0), Delta=(-1.0, 1.0))
    bound = strip.max_stress <= "630 MPa"
    eset = em.equilibrium_set(strip, box, within=[bound], intervals=intervals)
    flat = eset.at(Theta=0.0, Delta=0.0).stable
    up, down = max(flat, key=strip.height(0.5)), min(flat, key=strip.height(0.5))
    snap = em.lift(up, {"Theta": -0.45, "Delta": -0.45})
    return Result(eset, snap, em.plan(eset, up, down, margin=0.05))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print(found.eset.audit)
    turned = -2 * found.snap.end.state["Theta"]
    print(f"one end alone: {found.snap.end.kind} at {turned:.4f} rad")
    print(found.route)
    em.plotting.save(figure(found), ".", "strip")

"""A strip held in its M shape: how far its ends may be raised, and how to bring it there.

A straight strip of length 1 is clamped at two points ν apart, and both clamps are turned up by Θ.
It then bows up like an A; if Θ is small enough, it can also hang between its raised ends like an M.
E = ½ ∫ θ'² ds in units of EI and length. A shallow M sways and snaps at Θ = 2 √(1 − ν): there its
force reaches the load of the clamped strip's first asymmetric mode, tan(k/2) = k/2. The example
follows this limit to deep strips, and plans turns of both clamps that lead from A to M on stable
states only.

Run it: python examples/m_shape.py
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

import equimorph as em

SPANS = (0.999, 0.99, 0.9, 0.8, 0.7, 0.6, 0.5)
CLAMPS = {"nu": 0.7, "Theta": 0.5}
"""Span and angle for which the two shapes and the way between them are shown."""


@dataclass(frozen=True)
class Result:
    """Largest clamp angles of the M for several spans, and the way from A to M."""

    limits: tuple[em.LimitLoad, ...]
    route: em.Route


def main(intervals: tuple[int, int] = (24, 24)) -> Result:
    """Compute the limits, and the way over both clamp angles at one span."""
    strip = em.Rod()
    limits = [em.limit_load(hanging(strip, span), "Theta") for span in SPANS]
    box = em.Box(Theta=(-0.5, 2.0), Delta=(-1.6, 1.6))
    fixed = {"nu": CLAMPS["nu"]}
    curvature = strip.max_curvature <= 20
    eset = em.equilibrium_set(strip, box, fixed=fixed, within=[curvature], intervals=intervals)
    stable = eset.at(Theta=CLAMPS["Theta"], Delta=0.0).stable
    bow, hang = max(stable, key=strip.height(0.5)), min(stable, key=strip.height(0.5))
    return Result(tuple(limits), em.plan(eset, bow, hang, margin=0.2))


def hanging(strip: em.Rod, span: float) -> em.State:
    """Return the stable state that hangs down between level clamps."""
    found = em.find_equilibria(strip, {"nu": span, "Theta": 0.0})
    return min(found.stable, key=strip.height(0.5))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    for span, limit in zip(SPANS, found.limits, strict=True):
        shallow = 2.0 * np.sqrt(1.0 - span)
        print(f"span {span}: M up to {limit.value:.4f} rad ({limit.kind}), shallow {shallow:.4f}")
    print(found.route)
    em.plotting.save(figure(found), ".", "m_shape")

"""A stack of two bistable elements: nine equilibria, and a way around the snap of the lower one.

E = Σ ½ EA l₀ (l/l₀ − 1)² − F u of two guided bars of span 1 and rise 0.15, one above the other, u
the way of the load; EA = 1 kN, lengths in m. The lower bar is longer by a: at the cusp of the set,
a = 1 − √(1 + 0.15²) = −0.01119, it is as short as the span, and no longer snaps.

Run it: python examples/stack.py
"""

from dataclasses import dataclass

from matplotlib.axes import Axes

import equimorph as em

RISE = 0.15


@dataclass(frozen=True)
class Result:
    """The set over the actuator and the load, where the stack snaps to, and the way around."""

    eset: em.EquilibriumSet
    landed: em.State
    route: em.Route


def stack() -> em.Truss:
    """Return the stack: B and C slide up and down two guides, a bar from A to B and on to C."""
    return em.Truss(
        {"A": (0.0, 0.0), "B": (1.0, RISE), "C": (0.0, 2.0 * RISE)},
        [em.Bar(ends, EA="1 kN") for ends in (("A", "B"), ("B", "C"))],
        {"A": "xy", "B": "x", "C": "x"},
        {"F": {"C": (0.0, -1.0)}},
        {"a": {"A-B": 1.0}},
        units={"force": "N", "length": "m"},
    )


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Press the stack until its weaker element snaps; lead it there without a snap."""
    truss, top = stack(), stack().displacement("C", "y")
    box = em.Box(a=(-0.02, 0.004), F=(-0.9, 0.9))
    eset = em.equilibrium_set(truss, box, intervals=intervals)
    fold = em.lift(truss.natural_state(a=-0.003), {"F": 10.0}).end.state
    landed = next(each.state for each in em.snap_landing(fold) if each.landed)
    here = eset.at(a=-0.003, F=0.1).stable
    upright, over = max(here, key=top), min(here, key=lambda state: abs(top(state) + 0.27))
    return Result(eset, landed, em.plan(eset, upright, over, margin=2e-3))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print(found.eset.audit)
    print(found.landed)
    print(found.route)
    em.plotting.save(figure(found), ".", "stack")

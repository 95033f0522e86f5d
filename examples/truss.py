"""A von Mises truss turned over without a snap: its bars are shortened, pressed down, lengthened.

E = Σ ½ EA l₀ (l/l₀ − 1)² − F u of two bars of rest length √1.09 + a over a span of 2; units of EA
and half the span. With straight bars, a = 1 − √1.09 = −0.044, its two folds meet in a cusp.

Run it: python examples/truss.py
"""

from dataclasses import dataclass

from matplotlib.axes import Axes

import equimorph as em


@dataclass(frozen=True)
class Result:
    """The set over the length of the bars and the load, and the way around its cusp."""

    eset: em.EquilibriumSet
    route: em.Route


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Compute the set, and the way from upright to turned over."""
    truss = em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)},
        [em.Bar(ends, EA=1.0, EI=0.01) for ends in (("A", "B"), ("B", "C"))],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0.0, -1.0)}},
        {"a": {"A-B": 1.0, "B-C": 1.0}},
    )
    safe = [truss.max_utilisation <= 1]
    box = em.Box(a=(-0.1, 0.03), F=(-0.02, 0.02))
    eset = em.equilibrium_set(truss, box, within=safe, intervals=intervals)
    rest = eset.at(a=0.0, F=0.001).stable
    height = truss.displacement("B", "y")
    up, down = max(rest, key=height), min(rest, key=height)
    return Result(eset, em.plan(eset, up, down, within=safe, margin=0.0003))


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print(found.eset.audit)
    print(found.route)
    em.plotting.save(figure(found), ".", "truss")

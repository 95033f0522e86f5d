"""Lee's frame: both limit loads, and a way around its snap with members that bend themselves.

A column and a beam of length L, rigidly joined, pinned at their far ends; a load P on the beam at
L/5. E = Σ ∫ ½ EI (θ' − κ₀)² ds − P work; units of EI and L. As built it snaps at P = 18.5588, and
back at −9.4213 [Lee, Manuel and Rossow 1968]. With the column bent by k and the beam by −k, a
quasi-static way leads from one side of the snap to the other.

Run it: python examples/lee.py
"""

from dataclasses import dataclass

from matplotlib.axes import Axes

import equimorph as em


@dataclass(frozen=True)
class Result:
    """Limit loads as built, the set over bending and load, and a way around the snap."""

    limits: tuple[float, float]
    eset: em.EquilibriumSet
    route: em.Route


def lee_frame() -> em.Frame:
    """Return the frame with its actuators."""
    joints = {"A": (0.0, 0.0), "B": (0.0, 1.0), "C": (0.2, 1.0), "D": (1.0, 1.0)}
    return em.Frame(
        joints,
        [("A", "B"), ("B", "C"), ("C", "D")],
        {"A": "pinned", "D": "pinned"},
        {"P": {"C": (0.0, -1.0)}},
        {"k": {"curvature": {"A-B": 1.0, "B-C": -1.0, "C-D": -1.0}}},
    )


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Compute the limit loads, the set, and the way at P = 10."""
    frame = lee_frame()
    snap = em.limit_load(frame.natural_state(), "P")
    back = em.lift(frame.natural_state(), {"P": 25.0}, through_folds=True)
    down = em.lift(back.end.state, {"P": -12.0}, through_folds=True)
    box = em.Box(k=(-1.0, 2.5), P=(-5.0, 22.0))
    eset = em.equilibrium_set(frame, box, within=[frame.max_curvature <= 6], intervals=intervals)
    height = frame.displacement("C", "y")
    stable = eset.at(k=0.0, P=10.0).stable
    route = em.plan(eset, max(stable, key=height), min(stable, key=height), margin=0.2)
    return Result((snap.value, down.events[0].state["P"]), eset, route)


def figure(result: Result) -> Axes:
    """Shapes along the way."""
    return em.plotting.shapes(result.route)


if __name__ == "__main__":
    found = main()
    print("limit loads:", *(f"{value:.4f}" for value in found.limits))
    print(found.eset.audit)
    print(found.route)
    em.plotting.save(figure(found), ".", "lee")

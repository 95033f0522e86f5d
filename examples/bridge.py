"""An adaptive truss bridge: its lower chord shortens so that a load does not bend it down.

Six bays of bars with E = ½ EA l₀ ε², pinned at the left, on a roller at the right; a load F at
mid-span, an actuator a that lengthens all bars of the lower chord. No bar may reach its Euler load
π² EI/l₀². Mid-span is kept level while F grows, which takes a < 0.

Bars may pass each other, so that triangles of a truss can turn over about a side, each by itself:
thousands of states. No joint may move by more than half a bay, which leaves these out.

Run it: python examples/bridge.py
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import equimorph as em

BAYS, DEPTH, HEAVY, FARTHEST = 6, 0.8, 1.5, 0.5


@dataclass(frozen=True)
class Result:
    """Sag without actuation, the set over actuator and load, and the load with level mid-span."""

    sag: float
    eset: em.EquilibriumSet
    level: em.Path


def bridge() -> em.Truss:
    """Return the bridge: chords, posts, and diagonals that fall toward mid-span."""
    chords = [(f"{row}{i}", f"{row}{i + 1}") for row in "bt" for i in range(BAYS)]
    posts = [(f"b{i}", f"t{i}") for i in range(BAYS + 1)]
    half = BAYS // 2
    left = [(f"t{i}", f"b{i + 1}") for i in range(half)]
    right = [(f"b{i}", f"t{i + 1}") for i in range(half, BAYS)]
    return em.Truss(
        {f"{row}{i}": (float(i), DEPTH * (row == "t")) for i in range(BAYS + 1) for row in "bt"},
        [em.Bar(ends, EA=100.0, EI=0.3) for ends in (*chords, *posts, *left, *right)],
        {"b0": "xy", f"b{BAYS}": "y"},
        {"F": {f"b{half}": (0.0, -1.0)}},
        {"a": {f"b{i}-b{i + 1}": 1.0 for i in range(BAYS)}},
    )


def largest_move(truss: em.Truss) -> em.Descriptor:
    """Largest displacement of a joint."""

    def value(z: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.linalg.norm(truss.displacements(z, p), axis=2).max(axis=1)

    return em.Descriptor("largest_move", "m", value)


def main(intervals: tuple[int, int] = (15, 15)) -> Result:
    """Compute the sag, the set of states in which no bar buckles, and the way to the heavy load."""
    truss = bridge()
    middle, safe = truss.displacement(f"b{BAYS // 2}", "y"), truss.max_utilisation <= 1
    rest = truss.natural_state()
    sag = middle(em.lift(rest, {"F": HEAVY}, within=[safe]).end.state)
    box = em.Box(a=(-0.1, 0.1), F=(0.0, 2.0))
    upright = largest_move(truss) <= FARTHEST
    eset = em.equilibrium_set(truss, box, within=[safe, upright], intervals=intervals)
    level = em.lift(rest, {middle: 0.0, "F": HEAVY, "a": None}, within=[safe])
    return Result(sag, eset, level)


def figure(result: Result) -> Figure:
    """The actuator over the load, and the utilisation of the bars."""
    drawing = Figure(figsize=(7.0, 3.0), layout="constrained")
    left, right = drawing.subplots(1, 2)
    states = result.level.states
    left.plot(states["F"], states["a"])
    left.set(xlabel="F", ylabel="a", title="mid-span kept level", xticks=[0, 0.5, 1, 1.5])
    right.plot(states["F"], bridge().max_utilisation(states))
    right.set(xlabel="F", ylabel="max U", title="share of Euler's load", xticks=[0, 0.5, 1, 1.5])
    return drawing


if __name__ == "__main__":
    found = main()
    print(f"sag without actuation: {found.sag:.4f}")
    print(found.eset.audit)
    print(found.level.end.kind, found.level.end.state)
    em.plotting.save(figure(found), ".", "bridge")

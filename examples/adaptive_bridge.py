"""An adaptive truss bridge: eight actuators keep the deck level while a load drives across.

Six bays of bars with E = ½ EA l₀ ε², pinned at the left, on a roller at the right. A load of 1
moves from joint to joint of the lower chord, shared by neighbours as on a beam. Passive, mid-span
sinks by 0.214; with the six bars of the lower chord and two diagonals as actuators, planned by
random trees over lifted edges, no joint of the deck moves by more than 0.03, and no bar reaches its
Euler load.

Run it: python examples/adaptive_bridge.py
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import equimorph as em

BAYS, DEPTH, LEVEL, STROKE = 6, 0.8, 0.03, 0.05


@dataclass(frozen=True)
class Result:
    """Largest deflection without actuators, the route, its check, and deflections on the way."""

    passive: float
    route: em.Route
    check: em.Verification
    deck: np.ndarray


def bridge() -> em.Truss:
    """Return the bridge with a load on each inner joint of the deck and eight actuators."""
    chords = [(f"{row}{i}", f"{row}{i + 1}") for row in "bt" for i in range(BAYS)]
    posts = [(f"b{i}", f"t{i}") for i in range(BAYS + 1)]
    half = BAYS // 2
    left = [(f"t{i}", f"b{i + 1}") for i in range(half)]
    right = [(f"b{i}", f"t{i + 1}") for i in range(half, BAYS)]
    actuators = {f"a{i}": {f"b{i}-b{i + 1}": 1.0} for i in range(BAYS)}
    actuators |= {"c0": {"t0-b1": 1.0}, "c1": {f"b{BAYS - 1}-t{BAYS}": 1.0}}
    return em.Truss(
        {f"{row}{i}": (float(i), DEPTH * (row == "t")) for i in range(BAYS + 1) for row in "bt"},
        [em.Bar(ends, EA=100.0, EI=0.3) for ends in (*chords, *posts, *left, *right)],
        {"b0": "xy", f"b{BAYS}": "y"},
        {f"F{i}": {f"b{i}": (0.0, -1.0)} for i in range(1, BAYS)},
        actuators,
    )


def main() -> Result:
    """Plan the actuators for the load on its way, and check the schedule."""
    truss = bridge()
    rest = truss.natural_state()
    deck = [truss.displacement(f"b{i}", "y") for i in range(1, BAYS)]
    passive = deck[BAYS // 2 - 1](em.lift(rest, {f"F{BAYS // 2}": 1.0}).end.state)
    drive = [{"F1": 1.0}, *({f"F{i}": 0.0, f"F{i + 1}": 1.0} for i in range(1, BAYS - 1))]
    level = [side for y in deck for side in (y <= LEVEL, y >= -LEVEL)]
    actuators = em.Box(**{a.name: (-STROKE, STROKE) for a in truss.parameters[: BAYS + 2]})
    route = em.plan_sampled(
        rest, rest, actuators, loads=[*drive, {f"F{BAYS - 1}": 0.0}],
        within=[*level, truss.max_utilisation <= 1],
    )  # fmt: skip
    assert route.schedule is not None, route.why
    check = em.verify(route.schedule, within=level)
    return Result(passive, route, check, np.stack([y(check.states) for y in deck], axis=1))


def figure(result: Result) -> Figure:
    """Strokes of the actuators and deflections of the deck over the way of the load."""
    drawing = Figure(figsize=(7.0, 3.0), layout="constrained")
    left, right = drawing.subplots(1, 2)
    schedule = result.check.schedule
    assert schedule is not None, result.check.why
    left.plot(schedule.progress, schedule.values[:, : BAYS + 2], color="0.3", lw=0.8)
    left.set(xlabel="share of the way", ylabel="stroke", title="eight actuators")
    right.plot(schedule.progress, result.deck, color="0.3", lw=0.8)
    right.axhline(-result.passive, ls=":", color="0.6")
    right.axhline(result.passive, ls=":", color="0.6")
    right.set(xlabel="share of the way", ylabel="y", title="deck; dotted: ±0.214, passive")
    return drawing


if __name__ == "__main__":
    found = main()
    print(f"passive: {found.passive:.4f}")
    print(found.route, found.check)
    em.plotting.save(figure(found), ".", "adaptive_bridge")

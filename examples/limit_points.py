"""Two textbook trusses with limit points: one snaps through, a softer one snaps back.

Two bars of stiffness EA lean against each other, from supports 2L apart to a joint at height a. A
force F presses it down: with y the height of the joint, l² = L² + y² and l₀² = L² + a²,
F = 2 EA y (1/l − 1/l₀), with limit points at l³ = L² l₀ [Mises1923]_. Pressed by way of a vertical
bar of stiffness k, the load point moves a − y + F/k: where k is less than the slope |dF/dy| both
load and displacement turn back. Control of the displacement fails there; pseudo-arclength does not
see a difference.

Run it: python examples/limit_points.py; it writes limit_points.png and limit_points.svg.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import equimorph as em

RISE, STIFFNESS, STAND = 0.3, 0.02, 2.0
"""a and k relative to L and EA, and the length of the vertical bar."""


def two_bars() -> em.Truss:
    """The truss whose joint B is pressed directly; it can only move up and down."""
    joints = {"A": (-1.0, 0.0), "B": (0.0, RISE), "C": (1.0, 0.0)}
    supports = {"A": "xy", "B": "x", "C": "xy"}
    return em.Truss(joints, [("A", "B"), ("B", "C")], supports, {"F": {"B": (0.0, -1.0)}})


def pressed_by_a_bar() -> em.Truss:
    """The same truss, pressed at D by way of a vertical bar."""
    joints = {"A": (-1.0, 0.0), "B": (0.0, RISE), "C": (1.0, 0.0), "D": (0.0, RISE + STAND)}
    bars = [em.Bar(("A", "B"), 1.0), em.Bar(("B", "C"), 1.0), em.Bar(("B", "D"), STAND * STIFFNESS)]
    supports = {"A": "xy", "B": "x", "C": "xy", "D": "x"}
    return em.Truss(joints, bars, supports, {"F": {"D": (0.0, -1.0)}})


def main() -> dict[str, list[em.Path]]:
    """Follow both trusses through all limit points, until the joint bears the load from below."""
    return {"B": follow(two_bars()), "D": follow(pressed_by_a_bar())}


def follow(truss: em.Truss) -> list[em.Path]:
    """Three lifts, each through a fold back to the load at which it began."""
    state = truss.natural_state()
    paths: list[em.Path] = []
    for load in (0.02, -0.02, 0.02):
        options = em.TraceOptions(largest_step=0.02)
        paths.append(em.lift(state, {"F": load}, through_folds=True, options=options))
        state = paths[-1].end.state
    return paths


def limits(paths: list[em.Path]) -> list[em.State]:
    """The limit points."""
    return [each.state for path in paths for each in path.events if each.kind == "fold"]


def figure(result: dict[str, list[em.Path]]) -> Axes:
    """Load over the displacement of the joint where it acts, with the limit points."""
    labels = {"B": "pressed directly", "D": "by way of a bar"}
    colours = {"B": "#1d5a91", "D": "#a1561a"}
    with em.plotting.house_style():
        ax = Figure(figsize=(3.4, 2.6), layout="constrained").subplots(squeeze=False)[0, 0]
        ax.axhline(0.0, color="#d5d5d5", linewidth=0.8)
        for joint, paths in result.items():
            move = paths[0].states.structure.descriptor(f"displacement({joint},y)")
            load = np.concatenate([each.states["F"] for each in paths])
            down = np.concatenate([-move(each.states) for each in paths])
            ax.plot(down, load, color=colours[joint], label=labels[joint])
            for state in limits(paths):
                ax.plot(-move(state), state["F"], "o", color=colours[joint], markersize=4)
        ax.set(xlabel="displacement of the load, L", ylabel="load, EA")
        ax.legend(loc="lower right")
    return ax


if __name__ == "__main__":
    found = main()
    for joint, paths in found.items():
        print(joint, *(f"fold at F = {state['F']:+.6f}" for state in limits(paths)))
    length = np.cbrt(np.hypot(1.0, RISE))
    print(f"closed form: {2 * np.sqrt(length**2 - 1) * (1 / length - 1 / length**3):.6f}")
    em.plotting.save(figure(found), ".", "limit_points")

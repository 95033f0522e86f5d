"""A round rod leaves its plane: the arch under its load, sideways, and inside out without a snap.

Energy ½ ∫ (u·K u) ds of twist and two curvatures, rotations of the cross-sections as unit
quaternions. Known: the planar arch is left at q = 1.601471549, supercritically; a strip stays.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import equimorph as em

SIDEWAYS = em.LineLoad(direction=(0.0, 0.0, 1.0))
"""An imperfection: a small load across the plane."""


def main() -> tuple[float, em.Path]:
    """Lateral load of the perfect arch, and the path of an imperfect one."""
    perfect = em.SpatialRod(torsion=1 / 1.3, lateral=1.0)
    event = em.lift(perfect.natural_state(Theta=0.9), {"q": 2.0}).events[0]
    rod = em.SpatialRod("uniform", torsion=1 / 1.3, lateral=1.0, actuators={"push": SIDEWAYS})
    start = rod.natural_state(Theta=0.9)
    fine = em.TraceOptions(largest_step=0.05)
    path = em.lift(start, [{"push": 0.001}, {"q": 2.6}], options=fine)
    return event.state["q"], path


def figure(result: tuple[float, em.Path]) -> Figure:
    """Load against sideways displacement, and shapes seen along the chord."""
    load, path = result
    rod = path.states.structure
    assert isinstance(rod, em.SpatialRod)
    z = rod.position(0.5)[2]
    drawing, (left, right) = plt.subplots(
        1, 2, figsize=(7.2, 3.4), layout="constrained", width_ratios=(1.6, 1.0)
    )
    left.plot(z(path.states), path.states["q"], color="C0")
    left.axhline(load, color="0.6", lw=0.8, ls="--")
    left.annotate(f"q = {load:.4f}", (0.0, load), xytext=(4, 4), textcoords="offset points")
    left.set(xlabel="sideways displacement z(½) / L", ylabel="load q / (4π²B/L²)")
    loads = path.states["q"]
    for k, wanted in enumerate((0.0, 1.6, 1.7, 1.9, 2.2, 2.45, 2.6)):
        state = path.states[int(np.argmin(np.abs(loads - wanted)))]
        shape, color = state.shape(), plt.cm.viridis(k / 7)
        right.plot(shape[:, 2], shape[:, 1], color=color, label=f"q = {state['q']:.2f}")
    right.legend(fontsize="x-small", frameon=False, loc="lower right")
    right.set(xlabel="z / L", ylabel="y / L", aspect="equal")
    return drawing


if __name__ == "__main__":
    found = main()
    em.plotting.save(figure(found), ".", "round_arch", ["png"])
    print(f"leaves its plane at q = {found[0]:.9f}")

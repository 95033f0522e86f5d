"""The figure of time.md: a motion with limited jerks, and the deviation to be expected of it."""

from pathlib import Path

import matplotlib.pyplot as plt

import equimorph as em

ROUTE = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]
LIMITS = [{"Theta": limit, "Delta": limit} for limit in (0.2, 0.1, 0.1)]


def main() -> None:
    """Draw the actuators and the bound over time."""
    arch = em.Rod(load="uniform")
    upright = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
    schedule = em.verify(ROUTE, upright).schedule
    assert schedule is not None
    motion = em.retime(schedule, em.Rates(*LIMITS), tolerance=0.03).schedule
    assert motion is not None
    assert motion.times is not None
    times, bound = em.deviation_bound(motion, damping=0.05)
    figure, (above, below) = plt.subplots(2, 1, figsize=(6.4, 4.2), sharex=True)
    for name, style in (("Theta", "-"), ("Delta", "--")):
        above.plot(motion.times, motion.parameters[name], style, color="black")
    above.annotate("Θ", (0.6, 1.15), xytext=(4, 4), textcoords="offset points")
    above.annotate("Δ", (6.5, 0.75), xytext=(4, 4), textcoords="offset points")
    above.set_ylabel("end angles (rad)")
    below.plot(times, 100.0 * bound, color="black")
    below.set_ylim(bottom=0.0)
    below.set_ylabel("largest deviation\nto be expected (% of L)")
    below.set_xlabel("time (T)")
    for axes in (above, below):
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=130)


if __name__ == "__main__":
    main()

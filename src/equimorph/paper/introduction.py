"""The introduction's figure: two stable states under one load, and a shape that adapts to a load.

A rod of length 1, clamped at both ends in rotary actuators a span sin 1 apart, under a force at its
middle. The article gives no numbers for it; angles, force and target are ours.
"""

from pathlib import Path

import equimorph as em

FORCE = 1.0
"""In units of 4π²B/L²."""
TARGET = (0.23, 0.10)
"""Heights at s = 1/3 and 2/3, in units of L."""


def main(folder: Path) -> dict[str, float]:
    """Find both states under the force, and turn the ends until the loaded shape fits a target."""
    rod = em.Rod(loads={"F": em.PointForce(0.5)})
    crown, third, other = rod.height(0.5), rod.height(1 / 3), rod.height(2 / 3)
    box = em.Box(Theta=(0.4, 1.6), Delta=(-0.9, 0.9))
    eset = em.equilibrium_set(
        rod, box, fixed={"F": FORCE}, within=[rod.max_curvature <= 20], intervals=(16, 25)
    )
    both = eset.at(Theta=1.0, Delta=0.1).stable
    up, down = max(both, key=crown), min(both, key=crown)
    rest = rod.natural_state(Theta=0.9, Delta=0.0)
    loaded = em.lift(rest, {"F": FORCE}).end.state
    wanted = dict(zip((third, other), TARGET, strict=True))
    adapted = em.track(loaded, wanted, actuators=["Theta", "Delta"])
    goal = adapted.path.states[-1]
    em.plotting.save(em.plotting.portraits(both), folder, "two-states")
    em.plotting.save(em.plotting.shapes(adapted.path, count=6), folder, "adaptation")
    return {
        "stable states under the force": float(len(both)),
        "crown of the upper state": crown(up),
        "crown of the lower state": crown(down),
        "margin of the upper state": up.margin,
        "margin of the lower state": down.margin,
        "crown at rest": crown(rest),
        "crown under the force": crown(loaded),
        "target reached": adapted.arrived,
        "smallest margin on the way": adapted.margin,
        "height at 1/3 adapted": third(goal),
        "height at 2/3 adapted": other(goal),
        "Theta adapted": goal["Theta"],
        "Delta adapted": goal["Delta"],
    }

"""What an arch under its own weight can reach, and a square of heights in it.

The arch (load q = 2.5 in units of 4π²B/L³) is at heights y(1/3) = y(2/3) = 0.15 L, Θ = 1.621098,
Δ = 0. Its end actuators stay within 0.2 ≤ Θ ≤ 2.5 and |Δ| ≤ 2. What it can reach is symmetric and
ends where it would snap, where det J_S = 0, and at the limits. The square from (0.1, 0.1) to
(0.2, 0.2) is followed all around on stable states, and the actuators come back to where they were
[Feher2025]_, figure 9.
"""

from dataclasses import dataclass

from matplotlib.figure import Figure

import equimorph as em

SQUARE = [(0.1, 0.1), (0.2, 0.1), (0.2, 0.2), (0.1, 0.2), (0.1, 0.1)]
LIMITS = {"Theta": (0.2, 2.5), "Delta": (-2.0, 2.0)}


@dataclass(frozen=True)
class Result:
    """The reachable set, and the motion in it."""

    reach: em.Reach
    motion: em.Tracking


def main(intervals: tuple[int, int] = (24, 41)) -> Result:
    """Compute the set, what can be reached on it, and the motion."""
    arch = em.Rod(load="uniform")
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    box, within = em.Box(**LIMITS), [arch.max_curvature <= 60]
    eset = em.equilibrium_set(
        arch, box, fixed={"q": 2.5}, within=within, intervals=intervals, checks=0
    )
    upright = max(eset.at(Theta=1, Delta=0).stable, key=arch.height(0.5))
    start = em.track(upright, {left: 0.15, right: 0.15}, actuators=LIMITS).path.end.state
    corners = [{left: x, right: y} for x, y in SQUARE]
    motion = em.track(start, corners, actuators=LIMITS)
    return Result(em.reachable(eset, start, [left, right], accuracy=0.02), motion)


def figure(result: Result) -> Figure:
    """Image, set, parameters and shapes."""
    return em.plotting.reach_panels(result.reach, result.motion)


if __name__ == "__main__":
    found = main()
    print(found.motion, found.motion.holonomy)
    for piece in found.reach.boundary:
        print(piece.kind, piece.detail, len(piece.states))
    left, right = found.reach.descriptors
    print(found.reach.query({left: 0.25, right: 0.25}))
    em.plotting.save(figure(found), ".", "reachable")

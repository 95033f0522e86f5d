"""Heights at s = 1/3 and 2/3 moved around a square at q = 2.5, and the reachable region."""

from pathlib import Path

import equimorph as em

CORNERS = ((0.10, 0.10), (0.20, 0.10), (0.20, 0.20), (0.10, 0.20), (0.10, 0.10))
"""Heights at s = 1/3 and 2/3 at the corners of the closed motion, in units of L."""
INTERVALS = (35, 61)
"""Grid intervals over Θ and Δ."""


def main(folder: Path, intervals: tuple[int, int] = INTERVALS) -> dict[str, float]:
    """Track the square, and find the reachable set of (0.15, 0.15)."""
    arch = em.Rod("uniform")
    kappa, third, other = arch.max_curvature, arch.height(1 / 3), arch.height(2 / 3)
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    eset = em.equilibrium_set(
        arch, box, fixed={"q": 2.5}, within=[kappa <= 45], intervals=intervals
    )
    found = em.solve_shape(eset, {third: 0.15, other: 0.15})
    middle = found.stable[0]
    targets = [{third: left, other: right} for left, right in CORNERS]
    corner = em.track(middle, targets[0], actuators=["Theta", "Delta"])
    square = em.track(corner.states[-1], targets[1:], actuators=["Theta", "Delta"])
    reach = em.reachable(eset, middle, [third, other])
    em.plotting.save(em.plotting.reach_panels(reach, square), folder, "tracking")
    at_corners = [em.solve_shape(eset, target) for target in targets[:-1]]
    pieces = {piece.kind for piece in reach.boundary}
    limits = {piece.detail for piece in reach.boundary if piece.kind == "actuator limit"}
    return {
        "Theta at (0.15, 0.15)": middle["Theta"],
        "Delta at (0.15, 0.15)": middle["Delta"],
        "stable states at (0.15, 0.15)": float(len(found.stable)),
        "most stable states at a corner": float(max(len(each.stable) for each in at_corners)),
        "square tracked": square.arrived,
        "smallest margin on the square": square.margin,
        "largest change of an actuator around it": max(map(abs, (square.holonomy or {}).values())),
        "regions of stable states": float(len(reach.regions)),
        "kinds of boundary of the reachable set": float(len(pieces)),
        "sides of the box on its boundary": float(len(limits)),
    }

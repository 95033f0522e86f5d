"""Heights at s = 1/3 and 2/3 led around a square at q = 2.5, and what can be reached."""

from pathlib import Path

import equimorph as em

CORNERS = ((0.10, 0.10), (0.20, 0.10), (0.20, 0.20), (0.10, 0.20), (0.10, 0.10))


def main(folder: Path) -> dict[str, float]:
    """Track the square, and find the reachable set of (0.15, 0.15)."""
    arch = em.Rod("uniform")
    kappa, third, other = arch.max_curvature, arch.height(1 / 3), arch.height(2 / 3)
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    eset = em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=[kappa <= 20], intervals=(47, 81))
    middle = em.solve_shape(eset, {third: 0.15, other: 0.15}).stable[0]
    corner = em.track(
        middle, {third: CORNERS[0][0], other: CORNERS[0][1]}, actuators=["Theta", "Delta"]
    )
    legs = [{third: left, other: right} for left, right in CORNERS[1:]]
    square = em.track(corner.states[-1], legs, actuators=["Theta", "Delta"])
    reach = em.reachable(eset, middle, [third, other])
    at_corners = [int(abs(square.path.at - k).argmin()) for k in range(4)]
    corners = em.plotting.portraits(square.states[at_corners])
    em.plotting.save(corners, folder, "tracking-shapes")
    closing = square.holonomy or {}
    kinds = {piece.kind for piece in reach.boundary}
    return {
        "Theta at (0.15, 0.15)": middle["Theta"],
        "Delta at (0.15, 0.15)": middle["Delta"],
        "square tracked": float(square.arrived),
        "smallest margin on the square": square.margin,
        "largest change of an actuator around it": max(map(abs, closing.values())),
        "kinds of boundary of the reachable set": float(len(kinds)),
    }

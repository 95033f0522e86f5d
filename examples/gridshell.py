"""An elastic gridshell: a flat grid of rods is drawn in at its edge, and rises into a shell.

Five rods of 5 m cross four others of 6 m, all of glass-fibre 12 mm thick, on hinges about their
common normal (scissor joints): 49 pieces of rod in all. Both ends of every rod are drawn in by the
same way. A small push says that the grid rises; without it the flat state loses its stability and
either side is as good. No state on the way is unstable: nothing snaps. Without the push the shell
stands, and bears its own weight.

Run it: python examples/gridshell.py; it writes gridshell.png and gridshell.gif.
"""

import numpy as np
from matplotlib.figure import Figure

import equimorph as em

COLUMNS, ROWS = 4, 5
"""Number of rods along y and along x, which lie 1 m apart."""
DRAWN_IN, PUSH = 0.6, 3.0
"""Metres by which each end is moved, and force on each crossing in N."""
ROD = em.Round("12 mm", E="40 GPa", nu=0.3, density="2000 kg/m^3")


def grid() -> em.SpatialFrame:
    """The flat grid on ball joints around its edge."""
    joints = {
        f"j{i}{j}": (float(i), float(j), 0.0)
        for i in range(COLUMNS + 2)
        for j in range(ROWS + 2)
        if 0 < i <= COLUMNS or 0 < j <= ROWS
    }
    crossings = [f"j{i}{j}" for i in range(1, COLUMNS + 1) for j in range(1, ROWS + 1)]
    hinges = dict.fromkeys(crossings, (0.0, 0.0, 1.0))
    members: list[em.SpatialMember] = []
    inwards: dict[str, tuple[float, float, float]] = {}
    for j in range(1, ROWS + 1):
        through = [f"j{i}{j}" for i in range(COLUMNS + 2)]
        members.append(em.SpatialMember(through, section=ROD))
        inwards |= {through[0]: (1.0, 0.0, 0.0), through[-1]: (-1.0, 0.0, 0.0)}
    for i in range(1, COLUMNS + 1):
        through = [f"j{i}{j}" for j in range(ROWS + 2)]
        own = {joint: hinges[joint] for joint in through[1:-1]}
        members.append(em.SpatialMember(through, section=ROD, hinges=own))
        inwards |= {through[0]: (0.0, 1.0, 0.0), through[-1]: (0.0, -1.0, 0.0)}
    loads = {"push": dict.fromkeys(crossings, (0.0, 0.0, 1.0)), "g": {"weight": (0.0, 0.0, -1.0)}}
    return em.SpatialFrame(
        joints, members, dict.fromkeys(inwards, "pinned"), loads, {"draw": {"move": inwards}},
        elements=1, degree=8, units={"force": "N", "length": "m"},
    )  # fmt: skip


def main() -> em.Path:
    """Push, draw in, let go, and bear the weight."""
    frame = grid()
    return em.lift(
        frame.natural_state(), [{"push": PUSH}, {"draw": DRAWN_IN}, {"push": 0.0}, {"g": 1.0}]
    )


def figure(path: em.Path) -> Figure:
    """The grid pushed up a little, half-way, and as a shell under its weight."""
    states = path.states
    half = int(np.argmin(np.abs(states["draw"] - 0.3 * DRAWN_IN)))
    drawn = Figure(figsize=(9.0, 2.6), layout="constrained")
    for ax, at in zip(drawn.subplots(1, 3), (0, half, len(states) - 1), strict=True):
        em.plotting.portraits(states[[at]], [""], ax)
        ax.set_title(f"ends drawn in by {states['draw'][at]:.2f} m", fontsize=9)
    return drawn


def report(path: em.Path) -> str:
    """What the way and its end are like."""
    states, frame = path.states, path.states.structure
    assert isinstance(frame, em.SpatialFrame)
    effort = np.array([frame.descriptor("effort(draw)")(state) for state in states])
    rise = frame.place("j23", "z")(path.end.state)
    bent = frame.max_curvature(path.end.state)
    return (
        f"{path.end.kind}, {len(states)} states, smallest margin {states.margin.min():.3g}; "
        f"largest effort {np.abs(effort).max():.4g} N in all ends together; rise {rise:.4g} m, "
        f"smallest radius {1.0 / bent:.3g} m"
    )


if __name__ == "__main__":
    result = main()
    print(report(result))
    em.plotting.save(figure(result), ".", "gridshell", ["png"])
    em.plotting.film(result, "gridshell.gif")

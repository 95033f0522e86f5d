"""A planned way of an arch in MuJoCo, and the way back that snaps.

θ''/(4π²) + q ρ cos θ + λ sin θ − μ cos θ = 0 are the equilibria; MuJoCo knows nothing of them and
moves a chain of 24 links. Known answer: the way over (1.3, 1.3) holds, the straight one beyond
Δ = 0.418 does not.
"""

from matplotlib.axes import Axes

import equimorph as em
from equimorph.dynamics import Replay


def main() -> tuple[Replay, Replay]:
    """Replay both ways at 0.1 radians per unit of time."""
    arch = em.Rod(load="uniform")
    upright = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
    used = em.ReplaySettings(links=24, step=0.05)
    around = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]
    safe = em.replay(around, upright, rate=0.1, settings=used)
    snapping = em.replay({"Delta": 1.3}, upright, rate=0.1, settings=used)
    return safe, snapping


def figure(result: tuple[Replay, Replay]) -> Axes:
    """Deviation of the way that snaps from its equilibria, while they last."""
    return em.plotting.deviation_over_time(result[1])


if __name__ == "__main__":
    result = main()
    print(*result, sep="\n")
    em.plotting.save(figure(result), ".", "replay")

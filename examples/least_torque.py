"""The least motor torque that inverts a strip: a route over the lowest pass.

A steel strip of 300 × 12 × 0.25 mm is clamped 270 mm apart to two motors, θ(0) = Δ + Θ and
θ(1) = Δ − Θ. A mass of 50 g hangs at a third of its length, and it carries its own weight. How
strong must the motors be to turn it inside out without a snap? On every way the larger one of
their couples is at least 45.177 N mm, met at one state that no way avoids.

Run it: python examples/least_torque.py
"""

from dataclasses import dataclass

from matplotlib.axes import Axes

import equimorph as em

GRAVITY = 9.81


@dataclass(frozen=True)
class Result:
    """The set over both angles, what is kept low, and the route with its bottleneck."""

    eset: em.EquilibriumSet
    torque: em.Descriptor
    route: em.Route


def main(intervals: tuple[int, int] = (25, 25)) -> Result:
    """Compute the set and the route from the strip above to the strip below."""
    strip = em.Rod(
        EI=3280.0,
        length=300.0,
        span=270.0,
        units={"force": "N", "length": "mm"},
        loads={"F": em.PointForce(1 / 3), "g": em.LineLoad()},
    )
    weight = {"F": 0.05 * GRAVITY, "g": 7850 * GRAVITY * 3e-9}  # N, and N/mm of the strip
    box = em.Box(Theta=(-1.2, 1.2), Delta=(-1.2, 1.2))
    bound = strip.max_curvature <= 0.05
    eset = em.equilibrium_set(strip, box, fixed=weight, within=[bound], intervals=intervals)
    torque = em.largest_of("motor torque", *(abs(strip.end_moment(end)) for end in (0, 1)))
    up = em.optimise(eset, torque, within=[strip.height(0.5) >= 10]).best.state
    down = em.optimise(eset, torque, within=[strip.height(0.5) <= -10]).best.state
    return Result(eset, torque, em.plan(eset, up, down, objective=em.peak(torque)))


def figure(result: Result) -> Axes:
    """The torque along the route, with the least one that any route needs."""
    lowest = result.route.bottleneck
    assert lowest is not None, result.route.why
    return em.plotting.margins(result.route, within=[result.torque <= lowest.value])


if __name__ == "__main__":
    found = main()
    lowest = found.route.bottleneck
    assert lowest is not None, found.route.why
    place = ", ".join(f"{name} = {lowest.state[name]:.7f}" for name in found.eset.names)
    print(found.eset.audit)
    print(f"least torque {lowest.value:.6f} N mm at {place} ({lowest.kind})")
    print(found.route)
    em.plotting.save(figure(found), ".", "least_torque")

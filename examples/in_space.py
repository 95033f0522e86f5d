"""An arch that must not leave its plane, and how wide a strip is wide enough.

A planar arch may twist and bend sideways long before it snaps. With Θ = 0.9 under a uniform load
its planar limit load is 4.244; a round rod leaves its plane at 1.601. The way that turns the arch
inside out at q = 2.5 is stable in its plane throughout; in space it needs EI out of the plane of
1.4745 EI (GJ = 0.77 EI), or a strip 1.214 times as wide as thick.

Run it: python examples/in_space.py
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import equimorph as em

WAY = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]


@dataclass(frozen=True)
class Result:
    """Limit loads in the plane and of a round rod, the way, and the least ratio of the strip."""

    planar: em.LimitLoad
    round: em.LimitLoad
    way: em.Path
    least: float


def strip(ratio: float) -> tuple[float, float]:
    """GJ and EI out of the plane of a strip by width/thickness, relative to EI in the plane."""
    section = em.Strip(width=ratio, thickness=1.0, E=1.0, nu=0.3).properties()
    return section.torsion, section.lateral


def margins(way: em.Path, ratio: float) -> np.ndarray:
    """Lowest eigenvalue out of the plane along the way: negative where a strip leaves its plane."""
    rod = way.states.structure
    assert isinstance(rod, em.Rod)
    return rod.lateral_margin(*strip(ratio))(way.states)


def least_ratio(way: em.Path) -> float:
    """Width/thickness from which on the strip stays in its plane, by bisection to 1e-9."""
    leaves, stays = 1.0, 2.0
    while stays - leaves > 1e-9:
        middle = 0.5 * (leaves + stays)
        dips = margins(way, middle).min() < 0.0
        leaves, stays = (middle, stays) if dips else (leaves, middle)
    return stays


def main() -> Result:
    """Compute both limit loads, follow the way in the plane, and judge it for strips."""
    rod = em.Rod(torsion=1 / 1.3, lateral=1.0)
    rest = rod.natural_state(Theta=0.9)
    in_space = em.limit_load(rest, "q", within=[rod.stable_in_space])
    up = em.lift(rod.natural_state(Theta=1.0), {"q": 2.5}).end.state
    way = em.lift(up, WAY)
    return Result(em.limit_load(rest, "q"), in_space, way, least_ratio(way))


def figure(result: Result) -> Figure:
    """Draw the lowest eigenvalue out of the plane along the way for three strips."""
    drawing = Figure(figsize=(3.5, 2.5), layout="constrained")
    with em.plotting.house_style():
        ax = drawing.subplots(squeeze=False)[0, 0]
        share = result.way.length / result.way.length[-1]
        for ratio, colour in ((1.0, "#d1004b"), (result.least, "#e8902a"), (2.0, "#1f5f99")):
            label = f"{ratio:.3g} : 1"
            ax.plot(share, margins(result.way, ratio), color=colour, label=label)
        ax.axhline(0.0, color="#8c8c8c", linewidth=0.6)
        ax.set(xlabel="progress along the way", ylabel="lowest lateral eigenvalue")
        ax.legend(title="width : thickness")
    return drawing


if __name__ == "__main__":
    found = main()
    print(f"limit load in the plane {found.planar.value:.4f}, round rod {found.round.value:.4f}")
    print(f"a strip turns inside out in its plane if wider than {found.least:.3f} thicknesses")
    em.plotting.save(figure(found), ".", "in_space")

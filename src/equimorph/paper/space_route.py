"""The article's way inside out in space: which sections keep the arch in its plane."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import equimorph as em

ARCH = em.Rod()
WAY = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]
LOAD, POISSON = 2.5, 0.3
"""Uniform load q, and Poisson's ratio of the strips."""
RATIOS = (2.0, 10**0.5, 10.0, 40.0)
"""Widths of strips by their thicknesses."""
SECTIONS = {"round": (0.77, 1.0), "A = 2, C = 0.9": (0.9, 2.0)}
"""Further stiffnesses GJ = C EI and A EI out of the plane."""
COLOURS = ("#d1004b", "#e8902a", "#90b4d6", "#417aac", "#1d3f66")


def main(folder: Path, widths: int = 60) -> dict[str, float]:
    """Judge every state of the way for all sections."""
    up = em.lift(ARCH.natural_state(Theta=1.0), {"q": LOAD}).end.state
    path = em.lift(up, WAY, options=em.TraceOptions(largest_step=0.05))
    strips = {f"{ratio:.3g} : 1": strip(ratio) for ratio in RATIOS}
    found = {name: margins(path, *stiff) for name, stiff in (SECTIONS | strips).items()}
    ratios = np.geomspace(1.0, 40.0, widths)
    least = [margins(path, *strip(ratio)).min() for ratio in ratios]
    panels = Figure(figsize=(7.2, 2.6))
    with em.plotting.house_style():
        along, over = panels.subplots(1, 2)
        panels.subplots_adjust(left=0.09, right=0.98, bottom=0.17, top=0.96, wspace=0.35)
        for name, colour in zip(("round", *strips), COLOURS, strict=True):
            share = path.length / path.length[-1]
            along.plot(share, found[name], color=colour, linewidth=1.3, label=name)
        over.semilogx(ratios, least, color="#1a1a1a", linewidth=1.3)
        for ax in (along, over):
            ax.axhline(0.0, color="#8c8c8c", linewidth=0.6)
        along.set(xlabel="progress along the way", ylabel="lowest lateral eigenvalue")
        over.set(xlabel="width/thickness", ylabel="smallest on the way", xlim=(1.0, 40.0))
        over.set_xticks([1, 2, 5, 10, 20, 40], ["1", "2", "5", "10", "20", "40"])
        over.minorticks_off()
        along.legend(title="section", ncols=2)
        em.plotting.save(panels, folder, "space-route")
    numbers = {f"{name}: smallest on the way": float(each.min()) for name, each in found.items()}
    numbers["round: stable in space all along"] = bool(found["round"].min() > 0.0)
    return numbers


def strip(ratio: float) -> tuple[float, float]:
    """Torsional and lateral stiffness of a rectangular section by the one in the plane."""
    section = em.Strip(width=ratio, thickness=1.0, E=1.0, nu=POISSON).properties()
    return section.torsion, section.lateral


def margins(path: em.Path, torsion: float, lateral: float) -> np.ndarray:
    """Lowest lateral eigenvalues along a planar path for other stiffnesses out of the plane."""
    return np.asarray(ARCH.lateral_margin(torsion, lateral)(path.states))

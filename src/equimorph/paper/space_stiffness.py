"""How stiff the article's arch must be out of its plane, to be loaded and turned inside out."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

import equimorph as em

ARCH = em.Rod()
WAY = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]
LOAD, TORSION = 2.5, 0.77
"""Uniform load q, and GJ by EI, which is that of a round rod."""
LIMITS = np.log([0.02, 50.0])
"""Logarithms of the stiffnesses out of the plane between which the least one is searched."""


def main(folder: Path, settings: tuple[int, int] = (17, 17)) -> dict[str, float]:
    """Find the least stiffness for the way inside out, and for loading over both end angles."""
    up = em.lift(ARCH.natural_state(Theta=1.0), {"q": LOAD}).end.state
    way = em.lift(up, WAY, options=em.TraceOptions(largest_step=0.05)).states
    numbers = {
        f"least A for the way inside out, C = {torsion:g}": least_stiffness(way, torsion)
        for torsion in (0.77, 1.0, 1.4)
    }
    rest = ARCH.natural_state(Theta=0.9)
    limit = em.limit_load(rest, "q").value
    for text, load in (("q = 2.5", LOAD), ("the planar limit load", limit - 1e-5)):
        states = em.lift(rest, {"q": load}).states
        numbers[f"least A at (0.9, 0) up to {text}"] = least_stiffness(states, TORSION)
    axes = np.linspace(0.3, 1.5, settings[0]), np.linspace(0.0, 1.2, settings[1])
    least = np.full(settings, np.nan)
    for i, j in np.ndindex(settings):
        rest = ARCH.natural_state(Theta=float(axes[0][i]), Delta=float(axes[1][j]))
        states = em.lift(rest, {"q": LOAD}).states
        least[i, j] = least_stiffness(states[-1:], TORSION)  # the end is mostly the worst
        if margins(states, TORSION, 1.001 * float(least[i, j])).min() < 0.0:
            least[i, j] = least_stiffness(states, TORSION)
    levels, drawing = np.arange(0.2, 3.0, 0.2), Figure(figsize=(3.5, 2.8))
    with em.plotting.house_style():
        ax = drawing.add_axes((0.14, 0.14, 0.8, 0.82))
        lines = ax.contour(*axes, least.T, levels, colors="#1a1a1a", linewidths=0.8)
        ax.clabel(lines, fmt="%.1f")
        ax.set(xlabel="Θ (rad)", ylabel="Δ (rad)")
        em.plotting.save(drawing, folder, "space-stiffness")
    numbers["largest least A of the figure"] = float(least.max())
    return numbers


def margins(states: em.States, torsion: float, lateral: float) -> np.ndarray:
    """Lowest lateral eigenvalues of planar states for other stiffnesses out of the plane."""
    return np.asarray(ARCH.lateral_margin(torsion, lateral)(states))


def least_stiffness(states: em.States, torsion: float) -> float:
    """Smallest EI out of the plane, by that in it, for which all states are stable in space."""
    root = brentq(lambda log: margins(states, torsion, np.exp(log)).min(), *LIMITS, xtol=1e-7)
    return float(np.exp(root))

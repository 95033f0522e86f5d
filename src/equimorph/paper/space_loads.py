"""Limit loads of the article's arch in space: a round rod, and three strips, beside the plane."""

from pathlib import Path

import numpy as np

import equimorph as em

GRID = {"Theta": (0.3, 1.6, 40), "Delta": (-1.2, 1.2, 40)}
RATIOS = (1.25, 1.5, 3.0)
"""Widths of the strips by their thicknesses."""
POISSON = 0.3
"""Poisson's ratio of all sections."""
SETTINGS = ((0.6, 0.0), (0.9, 0.0), (0.9, 0.02), (1.2, 0.0), (1.5, 0.0), (0.94, 0.6))
"""Supports (Θ, Δ) in rad at which the load is quoted at which a round rod leaves its plane."""


def main(folder: Path, grid: em.Grid | None = None) -> dict[str, float]:
    """Compute the maps, the first lateral loads of the round rod, and what the strips need."""
    grid = grid or em.Grid(**GRID)
    rods = {"planar": em.Rod(), "round": em.Rod(torsion=1 / (1 + POISSON), lateral=1.0)}
    rods |= {f"strip {ratio:g}": strip(ratio) for ratio in RATIOS}
    numbers: dict[str, float] = {}
    highest = 0.0
    for name, rod in rods.items():
        within = [rod.max_curvature <= 10]
        within += [] if name == "planar" else [rod.stable_in_space]
        loads = em.limit_load_map(rod, grid, "q", within=within)
        largest = float(np.nanmax(loads.value))
        highest = highest or largest  # all maps have the colours of the first
        ax = em.plotting.load_map(loads, highest=highest)
        em.plotting.save(ax, folder, f"space-loads-{name.replace(' ', '-')}")
        numbers[f"{name}: largest limit load on the grid"] = largest
        sideways = loads.counts["lateral branch point"]
        defined = sum(loads.counts.values()) - loads.counts["undefined unloaded"]
        numbers[f"{name}: share of settings that leave the plane first"] = sideways / defined
    for load in ("uniform", "left-half"):
        rod = em.Rod(load, torsion=1 / (1 + POISSON), lateral=1.0)
        for theta, delta in SETTINGS:
            rest = rod.natural_state(Theta=theta, Delta=delta)
            found = em.limit_load(rest, "q", within=[rod.stable_in_space])
            numbers[f"round, {load}: leaves its plane at ({theta:g}, {delta:g})"] = found.value
            if (load, theta, delta) == ("uniform", 0.9, 0.0):
                numbers["round: snaps out of its plane at (0.9, 0)"] = (
                    found.criticality != "supercritical"
                )
    return numbers


def strip(ratio: float) -> em.Rod:
    """Rod with a rectangular section: its torsional and lateral stiffness by those in the plane."""
    section = em.Strip(width=ratio, thickness=1.0, E=1.0, nu=POISSON).properties()
    return em.Rod(torsion=section.torsion, lateral=section.lateral)

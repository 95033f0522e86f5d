"""Limit loads over both end angles, under the uniform and the left-half load."""

from pathlib import Path

import equimorph as em

GRID = {"Theta": (0.2, 2.5, 121), "Delta": (-2.0, 2.0, 160)}
SETTINGS = ((0.9, 0.0), (0.9, 0.02), (0.9, 0.04), (0.66, 1.36), (0.66, -1.36))
"""Supports (Θ, Δ) in rad whose limit loads the report quotes."""


def main(folder: Path, grid: em.Grid | None = None) -> dict[str, float]:
    """Compute both maps with the curves on which they jump or bend, and the quoted limit loads."""
    grid = grid or em.Grid(**GRID)
    numbers: dict[str, float] = {}
    for load in ("uniform", "left-half"):
        arch = em.Rod(load)
        within = [arch.max_curvature <= 10]
        loads = em.limit_load_map(arch, grid, "q", within=within)
        em.plotting.save(em.plotting.load_map(loads), folder, f"limit-loads-{load}")
        for theta, delta in SETTINGS:
            found = em.limit_load(arch.natural_state(Theta=theta, Delta=delta), "q", within=within)
            numbers[f"{load}: limit load at ({theta:g}, {delta:g})"] = found.value
            if delta == 0.0:
                numbers[f"{load}: lambda there"] = float(found.state.multipliers[0])
        best = em.strongest(loads).best
        numbers[f"{load}: largest limit load"] = best.value
        numbers[f"{load}: its Theta"], numbers[f"{load}: its Delta"] = best.setting.values()
        for kind, count in loads.counts.items():
            numbers[f"{load}: settings that end by {kind}"] = float(count)
    return numbers

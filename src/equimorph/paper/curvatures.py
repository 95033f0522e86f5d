"""Largest curvatures at q = 2.5 over both end angles, and the table of curvatures."""

from pathlib import Path

import equimorph as em

GRID = {"Theta": (0.2, 2.5, 121), "Delta": (-2.0, 2.0, 160)}
LOAD = 2.5
TABLE = em.Grid(Theta=(0.64, 0.96, 1), Delta=(-1.16, 1.16, 2))
"""Its corners and middles are the settings of the table, with Δ of either sign."""

SETTINGS = {(0.96, 0.0): (1, 1), (0.64, 1.16): (0, 2), (0.64, -1.16): (0, 0)}


def main(folder: Path, grid: em.Grid | None = None) -> dict[str, float]:
    """Compute both maps with their barriers, the table, and the least curvatures."""
    grid = grid or em.Grid(**GRID)
    numbers: dict[str, float] = {}
    for load in ("uniform", "left-half"):
        arch = em.Rod(load)
        kappa = arch.max_curvature
        curvatures = em.curvature_map(arch, grid, "q", LOAD)
        em.plotting.save(em.plotting.curvature_map(curvatures), folder, f"curvatures-{load}")
        table = em.curvature_map(arch, TABLE, "q", LOAD)
        for (theta, delta), (row, column) in SETTINGS.items():
            setting = f"{load}: max |kappa| at ({theta:g}, {delta:g})"
            numbers[setting] = float(table.value[row, column])
            numbers[f"{setting}: snaps on the way"] = float(table.snaps[row, column])
        eset = em.equilibrium_set(
            arch, grid.box, fixed={"q": LOAD}, within=[kappa <= 20], intervals=(24, 41)
        )
        best = em.optimise(eset, kappa).best
        numbers[f"{load}: least max |kappa|"] = best.value
        numbers[f"{load}: its Theta"] = best.state["Theta"]
        numbers[f"{load}: its Delta"] = best.state["Delta"]
    return numbers

"""Limit loads and largest curvatures over both end angles, under two loads; the table of these."""

from pathlib import Path

import equimorph as em

GRID = {"Theta": (0.2, 2.5, 121), "Delta": (-2.0, 2.0, 160)}
SETTINGS = ((0.9, 0.0), (0.9, 0.02), (0.9, 0.04), (0.66, 1.36), (0.66, -1.36))
"""Supports (Θ, Δ) in rad whose limit loads the report quotes."""


def limit_loads(folder: Path, grid: em.Grid | None = None) -> dict[str, float]:
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


LOAD = 2.5
"""Uniform load q of the map, in units of B/L³."""
TABULATED = ((0.96, 0.0), (0.64, 1.16), (0.64, -1.16), (0.64, 0.58), (0.64, -0.58))
"""Of the article's table; its Δ has another sign or scale, so that both signs and halves are tried.
"""
BESIDE = 1e-3
"""Width in rad of the grid cell at a setting for which the curvature is computed."""


def curvatures(folder: Path, grid: em.Grid | None = None) -> dict[str, float]:
    """Compute both maps with their barriers, the table, and the least curvatures."""
    grid = grid or em.Grid(**GRID)
    arches = {load: em.Rod(load) for load in ("uniform", "left-half")}
    numbers: dict[str, float] = {}
    best: dict[str, em.State] = {}
    for load, arch in arches.items():
        kappa = arch.max_curvature
        curvatures = em.curvature_map(arch, grid, "q", LOAD)
        em.plotting.save(em.plotting.curvature_map(curvatures), folder, f"curvatures-{load}")
        for theta, delta in TABULATED:
            value, snaps = curvature_at(arch, theta, delta)
            numbers[f"{load}: max |kappa| at ({theta:g}, {delta:g})"] = value
            numbers[f"{load}: snaps on the way to ({theta:g}, {delta:g})"] = snaps
        eset = em.equilibrium_set(
            arch, grid.box, fixed={"q": LOAD}, within=[kappa <= 20], intervals=(24, 41)
        )
        best[load] = em.optimise(eset, kappa).best.state
        numbers[f"{load}: least max |kappa|"] = kappa(best[load])
        numbers[f"{load}: its Theta"] = best[load]["Theta"]
        numbers[f"{load}: its Delta"] = best[load]["Delta"]
    for load, other in (("uniform", "left-half"), ("left-half", "uniform")):
        value, snaps = curvature_at(arches[other], best[load]["Theta"], best[load]["Delta"])
        numbers[f"{load}: max |kappa| there under the other load"] = value
        numbers[f"{load}: factor"] = value / numbers[f"{load}: least max |kappa|"]
        numbers[f"{load}: snaps on the way under the other load"] = snaps
    return numbers


def curvature_at(arch: em.Rod, theta: float, delta: float) -> tuple[float, bool]:
    """Largest curvature of the first stable state at one setting, and whether the way snaps."""
    corner = em.Grid(Theta=(theta, theta + BESIDE, 1), Delta=(delta, delta + BESIDE, 1))
    found = em.curvature_map(arch, corner, "q", LOAD)
    return float(found.value[0, 0]), bool(found.snaps[0, 0])

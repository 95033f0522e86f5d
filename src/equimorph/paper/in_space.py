"""The article's arch in space: limit loads, the way inside out, the branch beside the plane."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.optimize import brentq

import equimorph as em


class Stiffness(NamedTuple):
    """Of a section against torsion and out of the plane, by the one in the plane."""

    torsion: float
    lateral: float


GRID = {"Theta": (0.3, 1.6, 40), "Delta": (-1.2, 1.2, 40)}
RATIOS = (1.25, 1.5, 3.0)
"""Widths of the strips by their thicknesses."""
POISSON = 0.3
"""Poisson's ratio of all sections."""
SETTINGS = ((0.6, 0.0), (0.9, 0.0), (0.9, 0.02), (1.2, 0.0), (1.5, 0.0), (0.94, 0.6))
"""Supports (Θ, Δ) in rad at which the load is quoted at which a round rod leaves its plane."""


def space_loads(folder: Path, grid: em.Grid | None = None) -> dict[str, float]:
    """Compute the maps, the first lateral loads of the round rod, and what the strips need."""
    grid = grid or em.Grid(**GRID)
    rods = {"planar": em.Rod(), "round": em.Rod(torsion=1 / (1 + POISSON), lateral=1.0)}
    rods |= {
        f"strip {ratio:g}": em.Rod(torsion=strip(ratio).torsion, lateral=strip(ratio).lateral)
        for ratio in RATIOS
    }
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


ARCH = em.Rod()
WAY = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]
LOAD = 2.5
"""Uniform load q on the way inside out."""
ROUTE_RATIOS = (2.0, 10**0.5, 10.0, 40.0)
"""Widths of strips by their thicknesses."""
SECTIONS = {"round": Stiffness(0.77, 1.0), "A = 2, C = 0.9": Stiffness(0.9, 2.0)}
"""Further stiffnesses GJ = C EI and A EI out of the plane."""
COLOURS = ("#d1004b", "#e8902a", "#90b4d6", "#417aac", "#1d3f66")


def space_route(folder: Path, widths: int = 60) -> dict[str, float]:
    """Judge every state of the way for all sections."""
    path = way_inside_out()
    strips = {f"{ratio:.3g} : 1": strip(ratio) for ratio in ROUTE_RATIOS}
    found = {
        name: lateral_margins(path.states, *stiff) for name, stiff in (SECTIONS | strips).items()
    }
    ratios = np.geomspace(1.0, 40.0, widths)
    least = [lateral_margins(path.states, *strip(ratio)).min() for ratio in ratios]
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
        along.set(xlabel="progress along the route", ylabel="lowest lateral eigenvalue (4π²B/L)")
        over.set(
            xlabel="width / thickness", ylabel="smallest on the route (4π²B/L)", xlim=(1.0, 40.0)
        )
        over.set_xticks([1, 2, 5, 10, 20, 40], ["1", "2", "5", "10", "20", "40"])
        over.minorticks_off()
        along.legend(title="section", ncols=2)
        em.plotting.save(panels, folder, "space-route")
    numbers = {f"{name}: smallest on the way": float(each.min()) for name, each in found.items()}
    numbers["round: stable in space all along"] = bool(found["round"].min() > 0.0)
    return numbers


TORSION = 0.77
"""GJ by EI, which is that of a round rod."""
LIMITS = np.log([0.02, 50.0])
"""Logarithms of the stiffnesses out of the plane between which the least one is searched."""


def space_stiffness(folder: Path, settings: tuple[int, int] = (25, 25)) -> dict[str, float]:
    """Find the least stiffness for the way inside out, and for loading over both end angles."""
    way = way_inside_out().states
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
        if lateral_margins(states, TORSION, 1.001 * float(least[i, j])).min() < 0.0:
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


SIDE = 0.01
"""Force across the plane, by λ_cr, that says to which side the arch swings."""
LOAD_LABEL = "load q (4π²B/L²)"
BRANCHING = -1e-9
"""Least margin of states that are not unstable: it is zero, up to round-off, at branch points."""
SHOWN = (1.65, 1.8, 2.0, 2.2, 2.4)
"""Loads at which the arch is drawn beside its plane."""


def space_sideways(folder: Path) -> dict[str, float]:
    """Follow the states of a round rod beside its plane, and those in it on both sides."""
    across = {"side": em.PointForce(0.5, (0.0, 0.0, 1.0))}
    rod = em.SpatialRod("uniform", torsion=TORSION, lateral=1.0, loads=across)
    rest, fine = rod.natural_state(Theta=0.9), em.TraceOptions(largest_step=0.05)
    aside, inverted = (
        em.lift(rest, [{"side": SIDE}, {"q": load}, {"side": 0.0}]).end.state for load in (2.1, 3.0)
    )
    flat = [
        em.lift(state, {"q": load}, through_folds=True, options=fine)
        for state, load in ((rest, 3.0), (inverted, 1.0))
    ]
    beside = [em.lift(aside, {"q": load}, options=fine) for load in (1.0, 3.0)]
    y, z = rod.height(0.5), rod.position(0.5)[2]
    drawing = Figure(figsize=(7.2, 2.5))
    with em.plotting.house_style():
        high, wide, seen = drawing.subplots(1, 3, width_ratios=(1.0, 1.0, 0.6))
        drawing.subplots_adjust(left=0.08, right=0.99, bottom=0.18, top=0.96, wspace=0.38)
        for paths, colour, sides in ((flat, "#1a1a1a", (1.0,)), (beside, COLOURS[0], (-1.0, 1.0))):
            for states in (path.states for path in paths):
                stable = states.margin > BRANCHING
                for kept, line in ((stable, "-"), (~stable, ":")):
                    load = np.where(kept, states["q"], np.nan)
                    high.plot(load, y(states), line, color=colour, linewidth=1.3)
                    for side in sides:
                        wide.plot(load, side * z(states), line, color=colour, linewidth=1.3)
        shapes = [(1.0, rest), *((q, em.lift(aside, {"q": q}).end.state) for q in SHOWN)]
        for q, state in (*shapes, (3.0, inverted)):
            shape, colour = state.shape(), COLOURS[0] if q in SHOWN else "#1a1a1a"
            seen.plot(shape[:, 2], shape[:, 1], color=colour, linewidth=1.0)
            if q in SHOWN:
                seen.annotate(f" {q:g}", shape[len(shape) // 2, [2, 1]], fontsize=6)
        high.set(xlabel=LOAD_LABEL, ylabel="y(½) (L)")
        wide.set(xlabel=LOAD_LABEL, ylabel="z(½) (L)")
        seen.set(xlabel="z (L)", ylabel="y (L)", aspect="equal", xlim=(-0.02, 0.25))
        full = Line2D([], [], color="#1a1a1a", label="stable")
        dotted = Line2D([], [], color="#1a1a1a", linestyle=":", label="unstable")
        aside_line = Line2D([], [], color=COLOURS[0], label="beside the plane")
        high.legend(handles=[full, dotted, aside_line])
        em.plotting.save(drawing, folder, "space-sideways")
    leaves, rejoins = (path.end.state["q"] for path in beside)
    return {
        "the arch leaves its plane at q": leaves,
        "it is back in its plane at q": rejoins,
        "height of the middle at q = 2.1": float(y(aside)),
        "distance of the middle from the plane at q = 2.1": float(abs(z(aside))),
        "margin at q = 2.1": aside.margin,
    }


def least_stiffness(states: em.States, torsion: float) -> float:
    """Smallest EI out of the plane, by that in it, for which all states are stable in space."""
    root = brentq(
        lambda log: lateral_margins(states, torsion, np.exp(log)).min(), *LIMITS, xtol=1e-7
    )
    return float(np.exp(root))


def way_inside_out() -> em.Path:
    """The article's way inside out of the planar arch, in short steps."""
    up = em.lift(ARCH.natural_state(Theta=1.0), {"q": LOAD}).end.state
    return em.lift(up, WAY, options=em.TraceOptions(largest_step=0.05))


def strip(ratio: float) -> Stiffness:
    """Torsional and lateral stiffness of a rectangular section by the one in the plane."""
    section = em.Strip(width=ratio, thickness=1.0, E=1.0, nu=POISSON).properties()
    return Stiffness(section.torsion, section.lateral)


def lateral_margins(states: em.States, torsion: float, lateral: float) -> np.ndarray:
    """Lowest lateral eigenvalues of planar states for other stiffnesses out of the plane."""
    return np.asarray(ARCH.lateral_margin(torsion, lateral)(states))

"""Time against lanes, grid, elements and degree: writes docs/growth.png and docs/growth.md.

Run it on an idle machine: ``python benchmarks/growth.py``. Times are the least of several runs, all
kernels compiled before.
"""

import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import equimorph as em
from bench_lift import BOX, LARGEST, natural_states
from bench_maps import over
from bench_sets import lifted
from equimorph.equilibria import ParameterLine, TraceOptions, trace
from equimorph.plotting.style import DOUBLE_COLUMN, INDEX_COLOURS, INK, house_style
from equimorph.structures import Rod
from equimorph.tasks.maps.curvature import curvature_map
from equimorph.tasks.maps.limit_load import limit_load_map

DOCS = Path(__file__).parent.parent / "docs"
LANES = (1, 3, 10, 30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000)
ELEMENTS, DEGREES = (2, 4, 6, 9, 12, 18), (4, 6, 9, 12)
LOADS = ("uniform", "left-half")
GRIDS = ((12, 20), (24, 40), (47, 80), (93, 160))
BATCH = 4096


@dataclass(frozen=True)
class Timing:
    """Least time in seconds, and what it was for."""

    name: str
    lanes: int
    seconds: float
    note: str = ""

    @property
    def each(self) -> float:
        """Microseconds per lane."""
        return 1e6 * self.seconds / self.lanes


def least(work: Callable[[], object], lanes: int) -> float:
    """Least wall-clock time; short work is repeated more often."""
    best = np.inf
    for _ in range(10 if lanes <= 3000 else 5 if lanes <= 10_000 else 2):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best


def newton_step(lanes: int, elements: int = 6, degree: int = 9) -> Timing:
    """One Newton step with tangent and inertia."""
    states = natural_states(min(lanes, 1000), elements, degree)
    z, p = (np.resize(x, (lanes, x.shape[1])) for x in (states.z, states.p))
    velocity, row = np.zeros_like(p), np.zeros_like(z)
    velocity[:, 2] = 1.0
    one, none = np.ones(lanes), np.zeros(lanes)
    rod = states.structure
    seconds = least(lambda: rod.advance(z, p, velocity, row, one, none), lanes)
    return Timing("Newton step", lanes, seconds, f"{rod.size} unknowns")


def limit_loads(lanes: int, elements: int = 6, degree: int = 9) -> Timing:
    """Limit loads from natural states, up to max |κ| = 10."""
    states = natural_states(lanes, elements, degree)
    within = [states.structure.max_curvature <= LARGEST]
    seconds = least(lambda: em.limit_load(states, "q", within=within), lanes)
    return Timing("limit load", lanes, seconds, f"{states.structure.size} unknowns")


def short_lifts(lanes: int) -> Timing:
    """Edges of a grid of 93 intervals in Theta, at q = 1."""
    loaded = em.lift(natural_states(3000), {"q": 1.0})
    stable = loaded.states[np.flatnonzero(loaded.arrived)]
    states = stable[np.arange(lanes) % len(stable)]
    goal = {"Theta": states["Theta"] + (BOX[0][1] - BOX[0][0]) / 93}
    return Timing("short lift", lanes, least(lambda: em.lift(states, goal), lanes))


def equilibria_along_paths() -> Timing:
    """Equilibria on rays to q = 20, each with its index; `lanes` counts equilibria.

    They are counted once and not kept while the time is taken.
    """
    states = natural_states(10_000)
    velocity = np.tile([0.0, 0.0, 20.0, 0.0], (len(states), 1))
    line, z = ParameterLine(states.structure, states.p, velocity), states.z
    count = len(trace(line, z).points.t) + len(z)
    few = TraceOptions(record=False)
    seconds = least(lambda: trace(line, z, (), few), len(z))
    return Timing("equilibria along paths", count, seconds)


def load_map(intervals: tuple[int, int], load: str) -> Timing:
    """Limit loads over a grid, with the curves where they are not smooth."""
    arch = Rod(load=load)

    def run() -> object:
        return limit_load_map(arch, over(intervals), "q", within=[arch.max_curvature <= LARGEST])

    lanes = (intervals[0] + 1) * (intervals[1] + 1)
    return Timing(f"map, {load}", lanes, least(run, lanes))


def curvatures(intervals: tuple[int, int], load: str) -> Timing:
    """Curvatures at q = 2.5 over a grid, with the curves where the map changes."""
    arch = Rod(load=load)

    def run() -> object:
        return curvature_map(arch, over(intervals), "q", 2.5, within=[arch.max_curvature <= 20])

    lanes = (intervals[0] + 1) * (intervals[1] + 1)
    return Timing(f"curvature map with its curves, {load}", lanes, least(run, lanes))


def whole_set(intervals: tuple[int, int]) -> Timing:
    """All equilibria over a grid at q = 2.5, without random checks; `lanes` counts settings."""
    lanes = (intervals[0] + 1) * (intervals[1] + 1)
    return Timing("equilibrium set", lanes, least(lambda: lifted(intervals), lanes))


def natural(lanes: int) -> Timing:
    """Natural states of random settings in the box."""
    rod, generator = Rod(), np.random.default_rng(1)
    p = np.zeros((lanes, 4))
    p[:, 0], p[:, 1] = (generator.uniform(*sides, lanes) for sides in BOX)
    p[:, 3] = np.sin(1.0)
    return Timing("natural state", lanes, least(lambda: rod.natural(p), lanes))


def against_lanes(axes: Axes, rows: Sequence[Sequence[Timing]]) -> None:
    """Time per lane against lanes."""
    colours = (INK, INDEX_COLOURS[0], INDEX_COLOURS[1])
    for row, colour in zip(rows, colours, strict=True):
        lanes, each = [t.lanes for t in row], [t.each for t in row]
        axes.loglog(lanes, each, "o-", color=colour, markersize=2.5, linewidth=1.0)
        axes.annotate(
            row[-1].name, (lanes[-1], each[-1]), (4, 0), textcoords="offset points",
            color=colour, va="center",
        )  # fmt: skip
    axes.set(xlabel="lanes", ylabel="time per lane, µs", xlim=(0.7, 10_000 * rows[0][-1].lanes))
    axes.grid(visible=True)


def against_grid(axes: Axes, rows: Sequence[Sequence[Timing]]) -> None:
    """Time of maps and sets against settings."""
    styles = ((INDEX_COLOURS[0], "-"), (INDEX_COLOURS[0], "--"), (INK, "-"))
    for row, (colour, line) in zip(rows, styles, strict=True):
        settings, seconds = [t.lanes for t in row], [t.seconds for t in row]
        axes.loglog(
            settings, seconds, line, marker="o", color=colour, markersize=2.5, linewidth=1.0,
            label=row[0].name,
        )  # fmt: skip
    every = [t.seconds for row in rows for t in row]
    ticks = 2.0 ** np.arange(np.floor(np.log2(min(every))), np.ceil(np.log2(max(every))) + 1)
    axes.set(xlabel="settings of the grid", ylabel="time, s")
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.legend(frameon=False, loc="upper left")
    axes.grid(visible=True)


def against_resolution(axes: Axes, grid: Sequence[Sequence[Timing]]) -> None:
    """Newton step against elements, for some degrees."""
    for row, degree, shade in zip(grid, DEGREES, np.linspace(0.7, 0.0, len(DEGREES)), strict=True):
        each = [t.each for t in row]
        axes.plot(ELEMENTS, each, "o-", color=str(shade), markersize=2.5, linewidth=1.0)
        axes.annotate(
            f"degree {degree}", (ELEMENTS[-1], each[-1]), (4, 0), textcoords="offset points",
            va="center",
        )  # fmt: skip
    axes.set(xlabel="elements", ylabel=f"Newton step, µs per lane ({BATCH} lanes)", ylim=(0, None))
    axes.set_xlim(0, ELEMENTS[-1] * 1.5)
    axes.set_xticks(ELEMENTS)
    axes.grid(visible=True)


def figure(
    rows: Sequence[Sequence[Timing]],
    grids: Sequence[Sequence[Timing]],
    steps: Sequence[Sequence[Timing]],
) -> Figure:
    """All three diagrams side by side."""
    with house_style():
        drawing = Figure(figsize=(DOUBLE_COLUMN, 0.36 * DOUBLE_COLUMN), layout="constrained")
        left, middle, right = drawing.subplots(1, 3)
        against_lanes(left, rows)
        against_grid(middle, grids)
        against_resolution(right, steps)
        drawing.savefig(DOCS / "growth.png", dpi=200)
    return drawing


def machine() -> str:
    """Processor and number of cores that may be used."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        name = models[0].partition(":")[2].strip() if models else name
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{name}, {cores} cores"


def table(
    rows: Sequence[Sequence[Timing]],
    grids: Sequence[Sequence[Timing]],
    steps: Sequence[Sequence[Timing]],
    totals: Sequence[Timing],
) -> str:
    """Text of docs/growth.md."""
    lines = [
        "# Growth with lanes, grids and elements", "",
        f"{machine()}; warm; least of several runs;",
        "the default rod (6 elements of degree 9) unless said. Written by",
        "`benchmarks/growth.py`; `make bench-all` runs the benchmarks.",
        "", "| what | how many | time | per second |", "|---|---|---|---|",
    ]  # fmt: skip
    for timing in totals:
        rate = f"{timing.lanes / timing.seconds:,.0f}".replace(",", " ")
        count = f"{timing.lanes:,}".replace(",", " ")
        lines.append(f"| {timing.name} | {count} | {timing.seconds:.2f} s | {rate} |")
    lines += ["", "![Time against lanes, grid, elements and degree](growth.png)", ""]
    lines += ["Time per lane in µs:", "", "| lanes | " + " | ".join(r[0].name for r in rows) + " |"]
    lines.append("|---" * (len(rows) + 1) + "|")
    for column in zip(*rows, strict=True):
        cells = " | ".join(f"{t.each:.3g}" for t in column)
        lines.append(f"| {column[0].lanes:,} | {cells} |".replace(",", " "))
    lines += ["", "Time in seconds of maps with their curves, and of the set at q = 2.5:", ""]
    lines.append("| settings | " + " | ".join(row[0].name for row in grids) + " |")
    lines.append("|---" * (len(grids) + 1) + "|")
    for column in zip(*grids, strict=True):
        cells = " | ".join(f"{t.seconds:.2f}" for t in column)
        lines.append(f"| {column[0].lanes:,} | {cells} |".replace(",", " "))
    lines += ["", f"Newton step with tangent and inertia, µs per lane in a batch of {BATCH}:", ""]
    lines.append("| degree | " + " | ".join(f"{n} elements" for n in ELEMENTS) + " |")
    lines.append("|---" * (len(ELEMENTS) + 1) + "|")
    for degree, row in zip(DEGREES, steps, strict=True):
        lines.append(f"| {degree} | " + " | ".join(f"{t.each:.2f}" for t in row) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, draw and write."""
    natural_states(LANES[-1])
    for warm in (limit_loads, short_lifts, newton_step):
        warm(300)
    for load in LOADS:
        load_map((5, 8), load)
    whole_set((5, 9))
    rows = [[work(n) for n in LANES] for work in (limit_loads, short_lifts, newton_step)]
    grids = [[load_map(n, load) for n in GRIDS] for load in LOADS]
    grids.append([whole_set((i, j + 1)) for i, j in GRIDS])
    steps = [[newton_step(BATCH, n, degree) for n in ELEMENTS] for degree in DEGREES]
    totals = [equilibria_along_paths(), limit_loads(10_000), natural(10_000)]
    totals += [curvatures(GRIDS[-1], load) for load in LOADS]
    figure(rows, grids, steps)
    (DOCS / "growth.md").write_text(table(rows, grids, steps, totals), encoding="utf-8")


if __name__ == "__main__":
    main()

"""Time and memory of equilibrium sets over one, two and three parameters, and of refined ones.

Writes docs/growth_sets.png and docs/growth_sets.md. Run it on an idle machine:
``python benchmarks/growth_sets.py``. Every set is lifted in a process of its own, after a small one
that loads the kernels; time is that of both cores together, which neighbours on the machine disturb
little; memory is what the peak of the process exceeds that after loading.
"""

import json
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.plotting.style import DOUBLE_COLUMN, INDEX_COLOURS, INK, house_style
from equimorph.structures import Rod
from growth import machine

DOCS = Path(__file__).parent.parent / "docs"
CASES = {
    "d = 1": [(n,) for n in (100, 1000, 10_000, 40_000)],
    "d = 2": [(12, 21), (24, 41), (47, 81), (93, 161), (187, 321), (613, 1066)],
    "d = 2, refined": [(0.02,), (0.005,), (0.002,), (0.0006,), (0.00014,)],
    "d = 3": [(4, 5, 4), (6, 9, 5), (10, 13, 8), (18, 24, 15), (24, 31, 20)],
}


@dataclass(frozen=True)
class Growth:
    """Size, processor time in seconds and memory in bytes of a set."""

    name: str
    size: str
    vertices: int
    cells: int
    clean: bool
    seconds: float
    memory: float


def arch_set(name: str, size: Sequence[float]) -> EquilibriumSet:
    """Set of the arch up to max |κ| = 20: over Θ; over Θ and Δ; over Θ, Δ and q."""
    arch = Rod()
    within = [arch.max_curvature <= 20]
    if name == "d = 1":
        box, fixed = Box(Theta=(0.2, 2.5)), {"q": 2.5, "Delta": 0.3}
    elif name == "d = 3":
        box, fixed = Box(Theta=(0.6, 1.4), Delta=(-0.6, 0.6), q=(0, 3)), {}
    else:
        box, fixed = Box(Theta=(0.2, 2.5), Delta=(-2, 2)), {"q": 2.5}
    refined = name.endswith("refined")
    intervals = (24, 41) if refined else tuple(map(int, size))
    accuracy = size[0] if refined else None
    return equilibrium_set(
        arch, box, fixed=fixed, within=within, intervals=intervals, accuracy=accuracy, checks=0
    )


def measure(name: str, size: Sequence[float]) -> Growth:
    """Lift one set."""
    small: dict[str, Sequence[float]] = {"d = 1": (20,), "d = 3": (3, 3, 2)}
    arch_set(name, small.get(name, (0.1,) if name.endswith("refined") else (5, 9)))
    before = peak()
    start = time.process_time()
    eset = arch_set(name, size)
    seconds = time.process_time() - start
    told = " × ".join(f"{n:g}" for n in size)
    counts = (len(eset.points), len(eset.cells), eset.audit.clean)
    return Growth(name, told, *counts, seconds, peak() - before)


def peak() -> float:
    """Largest resident memory of this process so far, in bytes."""
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def measured_apart(name: str, size: Sequence[float]) -> Growth:
    """Lift one set in a process of its own."""
    command = [sys.executable, __file__, json.dumps([name, size])]
    out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return Growth(**json.loads(out))


def draw(rows: dict[str, list[Growth]]) -> Figure:
    """Time and memory against vertices."""
    looks = ((INK, "-", "o"), (INDEX_COLOURS[0], "-", "s"), (INDEX_COLOURS[0], "--", "D"),
             (INDEX_COLOURS[1], "-", "^"))  # fmt: skip
    with house_style():
        figure = Figure(figsize=(DOUBLE_COLUMN, 0.42 * DOUBLE_COLUMN), layout="constrained")
        axes: Sequence[Axes] = figure.subplots(1, 2)
        for row, (colour, line, marker) in zip(rows.values(), looks, strict=True):
            vertices = [each.vertices for each in row]
            for ax, values in (
                (axes[0], [each.seconds for each in row]),
                (axes[1], [max(each.memory, 1e6) / 1e6 for each in row]),
            ):
                ax.loglog(
                    vertices, values, line, color=colour, marker=marker, markersize=3,
                    linewidth=1.0, label=row[0].name,
                )  # fmt: skip
        for ax, label in zip(axes, ("processor time, s", "memory, MB"), strict=True):
            ax.set(xlabel="equilibria (vertices)", ylabel=label)
            ax.grid(visible=True)
        axes[0].legend(frameon=False, loc="upper left")
        figure.savefig(DOCS / "growth_sets.png", dpi=200)
    return figure


def table(rows: dict[str, list[Growth]]) -> str:
    """Text of docs/growth_sets.md."""
    lines = [
        "# Growth of equilibrium sets", "",
        f"{machine()}; warm; one run each, in a process of its own. Written by",
        "`benchmarks/growth_sets.py`. The arch up to max |κ| = 20 without random checks: over Θ at",
        "(Δ, q) = (0.3, 2.5); over (Θ, Δ) at q = 2.5, also refined from 24 × 41 intervals to an",
        "accuracy; over (Θ, Δ, q) up to q = 3. Processor time: of both cores together, so more",
        "than passes by the clock. Memory: peak less that of the program, of refined sets less",
        "that of the unrefined one.",
        "", "![Time and memory against vertices](growth_sets.png)", "",
        "| set | intervals or accuracy | vertices | cells | clean | processors, s | memory, MB |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    lines += [
        f"| {each.name} | {each.size} | {each.vertices} | {each.cells} | "
        f"{'yes' if each.clean else 'no'} | {each.seconds:.2f} | {each.memory / 1e6:.0f} |"
        for row in rows.values()
        for each in row
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, draw and write."""
    rows = {name: [measured_apart(name, size) for size in sizes] for name, sizes in CASES.items()}
    draw(rows)
    (DOCS / "growth_sets.md").write_text(table(rows), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(asdict(measure(*json.loads(sys.argv[1])))))  # noqa: T201
    else:
        main()

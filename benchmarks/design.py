"""Designs whose numbers docs/design.md gives: an arch turned over with less torque, and columns.

Run it: python benchmarks/design.py [arch|columns|shapes]; shapes draws docs/design.png.
"""

import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import equimorph as em

S, MIRRORED = (0.0, 0.25, 0.5, 0.75, 1.0), (0, 1, 2, 1, 0)
VARIABLES = {
    "k": ([-8.0] * 3, [8.0] * 3, [0.0] * 3),
    "b": ([0.4] * 3, [2.5] * 3, [1.0] * 3),
}
BOX = em.Box(Theta=(-1.6, 1.6), Delta=(-2.0, 2.0))


def tell(*words: object) -> None:
    """Write one line."""
    sys.stdout.write(" ".join(map(str, words)) + "\n")


def arch(k: list[float], b: list[float]) -> em.Rod:
    """Arch with intrinsic curvature k and stiffness b at three symmetric places each."""
    curvature, stiffness = (
        [[s, float(values[i])] for s, i in zip(S, MIRRORED, strict=True)] for values in (k, b)
    )
    return em.Rod(load="uniform", stiffness=stiffness, curvature=curvature)


def torque(rod: em.Rod) -> em.Descriptor:
    """Larger couple of the two motors."""
    efforts = [em.effort_of(rod, name) for name in ("Theta", "Delta")]
    first = em.function_of("M_A", lambda a, b: 0.5 * (a + b), *efforts)
    second = em.function_of("M_B", lambda a, b: 0.5 * (a - b), *efforts)
    return em.largest_of("torque", abs(first), abs(second))


def inversion(rod: em.Rod) -> em.RouteExtreme:
    """Question: the lowest peak of the torque while the arch is turned over at q = 0.5."""
    within = [rod.max_curvature <= 18.0]
    eset = em.equilibrium_set(
        rod, BOX, fixed={"q": 0.5}, within=within, intervals=(12, 21), checks=0
    )
    up = max(eset.at(Theta=0.7, Delta=0.0).stable, key=rod.height(0.5))
    down = min(eset.at(Theta=-0.7, Delta=0.0).stable, key=rod.height(0.5))
    return em.RouteExtreme(eset, up, down, em.peak(torque(rod)), margin=0.5)


def volume(k: list[float], b: list[float]) -> float:
    """∫ B ds."""
    del k
    return (b[0] + 2.0 * b[1] + b[2]) / 4.0


def arches() -> None:
    """Peak torque with margin ≥ 0.5 and max |κ| ≤ 18 on the whole route."""
    began = time.process_time()
    asked = inversion(arch([0.0] * 3, [1.0] * 3))
    found = em.design(arch, VARIABLES, asked, [em.DesignBound(volume, 1.0, 1.0)])
    tell(found, found.active, found.variables, f"{time.process_time() - began:.0f} s of CPU")
    for step in found.history:
        tell(f"  {step.value:.8f} after {step.rebuilds} sets, violation {step.violation:.1e}")


def columns() -> None:
    """Keller's and Olhoff and Rasmussen's."""
    for supports, elements in (("clamped-free", 32), ("clamped-clamped", 64)):
        began = time.process_time()
        found = em.strongest_column(supports, elements)
        tell(found, found.loads, f"{time.process_time() - began:.1f} s of CPU")


PLACES = (0.25, 0.5, 0.75)
SETTINGS = (
    ({"Theta": 0.2, "Delta": 0.0}, 1.0, (0.0966, 0.1426, 0.0756)),
    ({"Theta": 0.2, "Delta": 0.0}, -1.0, (-0.0078, -0.1072, -0.0603)),
    ({"Theta": 0.0, "Delta": 0.2}, -1.0, (0.0044, -0.0940, -0.0984)),
)
"""Motors, side of the middle, and heights to be held at the places (units of L)."""


def strip(k: list[float], b: list[float]) -> em.Rod:
    """Strip between clamps, with intrinsic curvature k and stiffness b at five places."""
    curvature, stiffness = (
        [[s, float(each)] for s, each in zip(S, values, strict=True)] for values in (k, b)
    )
    return em.Rod(loads={}, span=0.95, stiffness=stiffness, curvature=curvature)


def states(rod: em.Rod) -> list[em.State]:
    """The three states, each out of all equilibria on a line through its setting."""
    found = []
    for at, side, _ in SETTINGS:
        line = em.equilibrium_set(rod, em.Box(Theta=(-0.4, 0.4)), fixed={"Delta": at["Delta"]})
        stable, rise = line.at(Theta=at["Theta"]).stable, rod.height(0.5)
        found.append(max(stable, key=lambda each: side * rise(each)))
    return found


def gap(rod: em.Rod, heights: tuple[float, ...]) -> em.Descriptor:
    """Largest distance from the given heights."""
    each = [
        abs(em.function_of(f"gap at {s}", lambda y, to=to: y - to, rod.height(s)))
        for s, to in zip(PLACES, heights, strict=True)
    ]
    return em.largest_of("gap", *each)


def shapes() -> None:
    """Three shapes held by one strip: worst distance of nine heights."""
    began = time.process_time()
    first = strip([0.0] * 5, [1.0] * 5)
    before = states(first)
    asked = [
        em.StateValue(state, em.peak(gap(first, heights)))
        for state, (_, _, heights) in zip(before, SETTINGS, strict=True)
    ]
    total = em.DesignBound(lambda k, b: float(np.trapezoid(b, S)) + 0.0 * k[0], 1.0, 1.0)
    wide = {"k": ([-3.0] * 5, [3.0] * 5, [0.0] * 5), "b": ([0.4] * 5, [2.5] * 5, [1.0] * 5)}
    found = em.design(strip, wide, asked, [total], tolerance=1e-8)
    after = states(found.structure)
    held = [
        float(gap(found.structure, heights)(state))
        for state, (_, _, heights) in zip(after, SETTINGS, strict=True)
    ]
    tell(found, found.variables, f"{time.process_time() - began:.0f} s of CPU")
    tell("rebuilt:", held, "margins", [each.margin for each in after])
    draw(before, after)


def draw(before: list[em.State], after: list[em.State]) -> None:
    """Shapes of both strips, and the heights that were asked for."""
    titles = ("Θ = 0.2, upright", "Θ = 0.2, inverted", "Δ = 0.2")
    whole, axes = plt.subplots(1, 3, figsize=(9.0, 1.9), sharey=True, layout="constrained")
    for ax, title, one, other, (_, _, heights) in zip(
        axes, titles, before, after, SETTINGS, strict=True
    ):
        for state, style, label in ((one, "0.65", "uniform"), (other, "C0", "designed")):
            line = state.structure.shape(state.z[None], state.p[None])[0]
            ax.plot(*line.T, color=style, label=label)
        x = [float(other.structure.position(s)[0](other)) for s in PLACES]
        ax.plot(x, heights, "ko", markersize=5, fillstyle="none", label="asked for")
        ax.set(title=title, xlabel="x / L", aspect="equal")
    axes[0].set_ylabel("y / L")
    whole.legend(
        *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
    )
    whole.savefig(Path(__file__).parents[1] / "docs" / "design.png", dpi=160)


if __name__ == "__main__":
    wanted = sys.argv[1:] or ["arch", "columns"]
    for name in wanted:
        {"arch": arches, "columns": columns, "shapes": shapes}[name]()

"""Designs whose numbers docs/design.md gives: an arch turned over with less torque, and columns.

Run it: python benchmarks/design.py [arch|columns]
"""

import sys
import time

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


if __name__ == "__main__":
    wanted = sys.argv[1:] or ["arch", "columns"]
    for name in wanted:
        {"arch": arches, "columns": columns}[name]()

"""Random questions for the lowest peak, on grids of 1×, 2× and 4× the intervals, that must agree.

Run it: python benchmarks/bottlenecks.py [arch|strip|truss] [questions] [plan]

With "plan" it counts instead how often `plan` arrives just above the lowest peak and not below it.
"""

import sys
import time
import warnings
from collections import Counter

import numpy as np

import equimorph as em
from equimorph.tasks.planning.bottlenecks import find_bottleneck
from equimorph.tasks.planning.objectives import Extreme
from equimorph.tasks.route import Bottleneck

GRIDS = (1, 2, 4)
SAME = 1e-7
"""Largest difference of values on the grids, relative to the value, but at least to one."""
BESIDE = 2e-3
"""How far bounds lie above and below a peak, relative to it and its height above the ends."""
FROM_ENDS = 20
"""Peaks at an end that `plan` confirms; of all others, each one."""


def arch() -> tuple[list[em.EquilibriumSet], list[em.Descriptor]]:
    """The arch at q = 2.5."""
    rod = em.Rod(load="uniform")
    box, within = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2)), [rod.max_curvature <= 20]
    eset = [
        em.equilibrium_set(rod, box, fixed={"q": 2.5}, within=within, intervals=(24 * n, 42 * n))
        for n in GRIDS
    ]
    return eset, [rod.max_curvature, *_motors(rod)]


def strip() -> tuple[list[em.EquilibriumSet], list[em.Descriptor]]:
    """The strip without loads, ν = 0.95."""
    rod = em.Rod(loads={}, span=0.95)
    box, within = em.Box(Theta=(-1, 1), Delta=(-1, 1)), [rod.max_curvature <= 12]
    eset = [em.equilibrium_set(rod, box, within=within, intervals=(26 * n, 26 * n)) for n in GRIDS]
    return eset, [rod.max_curvature, *_motors(rod)]


def truss() -> tuple[list[em.EquilibriumSet], list[em.Descriptor]]:
    """The von Mises truss whose bars change their lengths."""
    truss = em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)},
        [em.Bar(ends, EA=1.0, EI=0.01) for ends in (("A", "B"), ("B", "C"))],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0.0, -1.0)}},
        {"a": {"A-B": 1.0, "B-C": 1.0}},
    )
    box = em.Box(a=(-0.1, 0.03), F=(-0.02, 0.02))
    eset = [em.equilibrium_set(truss, box, intervals=(26 * n, 26 * n)) for n in GRIDS]
    return eset, [truss.displacement("B", "y"), truss.max_utilisation]


def _motors(rod: em.Rod) -> list[em.Descriptor]:
    """Couples of both motors, and the larger of them."""
    both = [em.effort_of(rod, name) for name in ("Theta", "Delta")]
    first = em.function_of("M_A", lambda a, b: 0.5 * (a + b), *both)
    second = em.function_of("M_B", lambda a, b: 0.5 * (a - b), *both)
    return [first, abs(second), em.largest_of("motor", abs(first), abs(second))]


def wishes(eset: em.EquilibriumSet, more: list[em.Descriptor]) -> list[Extreme]:
    """Everything that is kept low, and of what is smooth also what is kept high."""
    structure = eset.structure
    own = [each(structure, name) for name in eset.names for each in (em.effort_of, em.value_of)]
    every = [*own, *(abs(each) for each in own), em.margin_of(structure), *more]
    smooth = [each for each in every if each.branches is None]
    return [*map(em.peak, every), *map(em.least, smooth)]


def random_state(eset: em.EquilibriumSet, rng: np.random.Generator) -> em.State:
    """A stable state over a random point of the box."""
    while True:
        at = rng.uniform(eset.box.lower, eset.box.upper)
        found = eset.at(**dict(zip(eset.names, at.tolist(), strict=True))).stable
        if len(found):
            return found[int(rng.integers(len(found)))]


def arrives(
    eset: em.EquilibriumSet, ends: tuple[em.State, em.State], wish: Extreme, found: Bottleneck
) -> tuple[bool, bool]:
    """Whether `plan` arrives under a bound just above a peak, and just below."""
    heights = [float(wish.descriptor(each)) for each in ends]
    size = max(1e-3, abs(found.value), *(abs(found.value - each) for each in heights))
    bounds = (wish.bound(found.value, side * BESIDE * size) for side in (1.0, -1.0))
    above, below = (em.plan(eset, *ends, within=[each]).arrived for each in bounds)
    return above, below


def confirm(name: str, questions: int) -> None:
    """Print how often `plan` arrives just above and just below the peaks of each kind."""
    warnings.simplefilter("ignore")
    grids, more = {"arch": arch, "strip": strip, "truss": truss}[name]()
    eset, rng, counts = grids[0], np.random.default_rng(0), Counter[tuple[str, bool, bool]]()
    wished, at_ends = wishes(eset, more), 0
    for _ in range(questions):
        ends = random_state(eset, rng), random_state(eset, rng)
        wish = wished[int(rng.integers(len(wished)))]
        passing = find_bottleneck(eset, ends, wish)
        if passing is None:
            continue
        found = passing.bottleneck
        at_ends += found.kind in ("start", "goal")
        if found.kind not in ("start", "goal") or at_ends <= FROM_ENDS:
            counts[(found.kind, *arrives(eset, ends, wish, found))] += 1
    for (kind, above, below), count in sorted(counts.items()):
        sys.stdout.write(f"{name}: {count} of kind {kind}: above {above}, below {below}\n")


def main(name: str = "arch", questions: int = 200) -> None:
    """Print what disagrees, and how long the answers took."""
    warnings.simplefilter("ignore")
    grids, more = {"arch": arch, "strip": strip, "truss": truss}[name]()
    sys.stdout.write(f"{name} {[len(each.points) for each in grids]}\n")
    wished, rng, kinds = wishes(grids[0], more), np.random.default_rng(0), Counter[str]()
    spent: list[list[float]] = []
    differing = 0
    for number in range(questions):
        ends = random_state(grids[-1], rng), random_state(grids[-1], rng)
        wish = wished[int(rng.integers(len(wished)))]
        found, took = [], []
        for eset in grids:
            begin = time.process_time()
            passing = find_bottleneck(eset, ends, wish)
            took.append(time.process_time() - begin)
            found.append(None if passing is None else passing.bottleneck)
        spent.append(took)
        known = [each for each in found if each is not None]
        kinds.update(each.kind for each in known)
        values = [each.value for each in known]
        spread = float(np.ptp(values)) if known else 0.0
        if len(known) not in (0, len(grids)) or spread > SAME * max(1.0, *map(abs, values or [0])):
            differing += 1
            sys.stdout.write(f"{number} {wish} {found}\n")
    median, longest = np.median(spent, axis=0), np.max(spent, axis=0)
    sys.stdout.write(f"{name}: {differing} of {questions} differ; {dict(kinds)}\n")
    sys.stdout.write(f"CPU seconds by grid: median {median.round(3)}, most {longest.round(3)}\n")


if __name__ == "__main__":
    if sys.argv[3:] == ["plan"]:
        confirm(sys.argv[1], int(sys.argv[2]))
    else:
        main(*sys.argv[1:2], *map(int, sys.argv[2:3]))

"""What random searches miss in silence: the sets of the soak with several seeds.

``python benchmarks/soak_seeds.py 3 10 38 64`` lifts sets 10, 38 and 64 of `soak_sets` with seeds 0
to 2 and prints, for each seed, the amount of the set: length, area or volume of its cells over that
of the box, which is the mean number of states over a point. Unlike numbers of vertices it does not
depend on where grids were bisected. Where amounts differ by more than bisection explains, seeds
with less lack pieces; beside it stands what the audit says that may be missing.
"""

import sys
import time
from dataclasses import dataclass

import numpy as np

from equimorph.manifold.geometry.simplices import volumes
from soak_sets import Question, compile_kernels, question

AGREEING = 2e-3
"""Relative difference of amounts that curved folds between straight cells may leave."""


@dataclass(frozen=True)
class Lifted:
    """A set with one seed."""

    amount: float
    stable: float
    missing_at_most: float
    clean: bool
    seconds: float


def lifted(asked: Question, seed: int) -> Lifted:
    """Lift a set and measure it."""
    start = time.process_time()
    eset = asked.lifted(seed)
    sizes = np.abs(volumes(eset.coordinates[eset.cells]))
    sizes = sizes / np.prod(asked.box.upper - asked.box.lower)
    stable = sizes[eset.cell_index == 0].sum()
    audit, spent = eset.audit, time.process_time() - start
    return Lifted(float(sizes.sum()), float(stable), audit.missing_at_most, audit.clean, spent)


def told(number: int, seeds: int) -> str:
    """One line on a set with so many seeds."""
    asked = question(number)
    compile_kernels(asked)
    sets = [lifted(asked, seed) for seed in range(seeds)]
    most = max(each.amount for each in sets)
    lacking = [1.0 - each.amount / most if most else 0.0 for each in sets]
    amounts = " ".join(f"{each.amount:.4f}" for each in sets)
    stable = " ".join(f"{each.stable:.4f}" for each in sets)
    bounds = " ".join(f"{each.missing_at_most:.2%}" for each in sets)
    silent = sum(
        lack > max(AGREEING, each.missing_at_most) and each.clean
        for lack, each in zip(lacking, sets, strict=True)
    )
    seconds = sum(each.seconds for each in sets)
    return (
        f"{number}\t{asked.name}\tamount {amounts}\tstable {stable}\tmissing at most {bounds}"
        f"\t{silent} lack more in silence\t{seconds:.0f} s"
    )


if __name__ == "__main__":
    for each in sys.argv[2:]:
        print(told(int(each), int(sys.argv[1])), flush=True)  # noqa: T201

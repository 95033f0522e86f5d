"""Words of random rows of three to five units, against loading in small steps.

Run it: python benchmarks/rows.py [rows]
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles import rows


def main(count: int = 1000) -> None:
    """Print how many rows disagree, and the time."""
    rng, begin = np.random.default_rng(0), time.process_time()
    kinds = {n: rows.structure(n) for n in (3, 4, 5)}
    differing = 0
    for number in range(count):
        n = int(rng.integers(3, 6))
        ours, brute = rows.compare(kinds[n], n, rng)
        if ours != brute:
            differing += 1
            sys.stdout.write(f"{number}: {ours} {brute}\n")
    spent = time.process_time() - begin
    sys.stdout.write(f"{differing} of {count} rows differ; {spent:.0f} s of CPU\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))

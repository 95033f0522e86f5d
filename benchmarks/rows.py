"""Words of random rows of three to five units, against loading in small steps.

Run it: python benchmarks/rows.py [rows] [first]
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles import rows


def main(count: int = 1000, begin: int = 0) -> None:
    """Print how many rows disagree, or have words that are not found either way, and the time."""
    began = time.process_time()
    kinds = {n: rows.structure(n) for n in (3, 4, 5)}
    differing = unsure = 0
    for number in range(begin, count):
        rng = np.random.default_rng([0, number])
        n = int(rng.integers(3, 6))
        ours, undecided, brute = rows.compare(kinds[n], n, rng)
        able = {word: ours[word] | undecided[word] for word in ours}
        wrong = {word for word in ours if not ours[word] <= brute[word] <= able[word]}
        differing, unsure = differing + bool(wrong), unsure + any(undecided.values())
        if wrong or any(undecided.values()):
            sys.stdout.write(f"{number}: differs at {wrong}, undecided {undecided}\n")
        if number % 50 == 49:
            sys.stdout.write(f"{number + 1} rows, {time.process_time() - began:.0f} s of CPU\n")
        sys.stdout.flush()
    sys.stdout.write(f"{differing} of {count - begin} rows differ, {unsure} have undecided words\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))

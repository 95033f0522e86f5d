"""Closed loop against blind play: the arch turns over under a load that nobody told.

`python benchmarks/closed_loop.py FIRST COUNT` adds runs to results/closed_loop.jsonl, one a line;
`python benchmarks/closed_loop.py summary` prints how many left the safe region.
"""

import json
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

import equimorph as em

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles.wandering_load import Plant, wandering

RESULTS = Path("results") / "closed_loop.jsonl"
MARGIN, STRIDE, LOAD, DRIFT, JUMP = 0.05, 0.1, 2.5, 0.01, 0.1


def ready() -> tuple[em.Controller, em.Belief, dict]:
    """Controller of the default arch, its first belief, and the sensors."""
    arch = em.Rod()
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    eset = em.equilibrium_set(arch, box, fixed={"q": LOAD}, within=[arch.max_curvature <= 20])
    crown = arch.height(0.5)
    states = eset.at(Theta=1, Delta=0).stable
    errors = {arch.height(s): 0.005 for s in (1 / 3, 0.5, 2 / 3)}
    controller = em.Controller(
        eset,
        min(states, key=crown),
        errors,
        {"q": DRIFT},
        jumps={"q": JUMP},
        margin=MARGIN,
        stride=STRIDE,
    )
    return controller, controller.start(max(states, key=crown)), errors


def plant_of(begun: em.Belief, errors: dict, seed: int) -> Plant:
    """The arch under a load that wanders and jumps once."""
    random = np.random.default_rng(seed)
    return Plant(begun.state, wandering(LOAD, random, DRIFT, JUMP), "q", errors, random)


def closed(controller: em.Controller, begun: em.Belief, plant: Plant) -> dict:
    """One run with the controller."""
    belief, seconds, planned = begun, [], []
    for _ in range(100):
        plant.write(controller.command(belief))
        if plant.snapped:
            break
        start = time.process_time()
        belief = controller.step(belief, plant.read())
        spent = seconds if belief.status == em.ControlStatus.FOLLOWING else planned
        spent.append(time.process_time() - start)
        if belief.status == em.ControlStatus.ARRIVED:
            break
    return {"status": str(belief.status), "snapped": plant.snapped, "least": plant.least,
            "step": float(np.median(seconds)), "planning": max(planned, default=0.0)}  # fmt: skip


def blind(begun: em.Belief, names: tuple[str, ...], plant: Plant) -> dict:
    """The same strides without looking."""
    here = {name: begun.state[name] for name in names}
    scales = begun.state.structure.scales[: len(names)]
    for point, there in pairwise([here, *({**here, **each} for each in begun.way_points)]):
        a, b = (np.array([each[name] for name in names]) for each in (point, there))
        count = max(1, int(np.ceil(np.linalg.norm((b - a) / scales) / STRIDE)))
        for share in np.arange(1, count + 1) / count:
            plant.write(dict(zip(names, (a + share * (b - a)).tolist(), strict=True)))
            plant.read()
            if plant.snapped:
                return {"snapped": True, "least": plant.least}
    return {"snapped": False, "least": plant.least}


def run(first: int, count: int) -> None:
    """Add runs to the results."""
    RESULTS.parent.mkdir(exist_ok=True)
    controller, begun, errors = ready()
    for seed in range(first, first + count):
        answers = {
            "seed": seed,
            "closed": closed(controller, begun, plant_of(begun, errors, seed)),
            "blind": blind(begun, controller.eset.names, plant_of(begun, errors, seed)),
        }
        with RESULTS.open("a") as file:
            file.write(json.dumps(answers) + "\n")


def say(text: object) -> None:
    """Print one line."""
    sys.stdout.write(f"{text}\n")


def summary() -> None:
    """Print the table."""
    rows = [json.loads(line) for line in RESULTS.read_text().splitlines()]
    for how in ("closed", "blind"):
        runs = [row[how] for row in rows]
        snapped = sum(each["snapped"] for each in runs)
        near = sum(each["least"] < MARGIN for each in runs)
        least = min(each["least"] for each in runs)
        say(f"{how}: {len(runs)} runs, {snapped} snapped, {near} below the margin, "
              f"least margin {least:.3f}")  # fmt: skip
    runs = [row["closed"] for row in rows]
    ends = {each["status"] for each in runs}
    say({end: sum(each["status"] == end for each in runs) for end in sorted(ends)})
    say(f"CPU: {1e3 * np.median([each['step'] for each in runs]):.1f} ms a step, "
          f"{np.median([each['planning'] for each in runs]):.2f} s to plan anew")  # fmt: skip


if __name__ == "__main__":
    if sys.argv[1] == "summary":
        summary()
    else:
        run(int(sys.argv[1]), int(sys.argv[2]))

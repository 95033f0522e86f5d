"""Closed loop against blind play: the arch turns over under a load that nobody told.

The load, 2.5 at first, walks by 0.03 a step and jumps once, by 0.5; sensors have 2 % noise. Blind
play follows the route of `plan` with the same margin, in the same strides.

`python benchmarks/closed_loop.py own FIRST COUNT` adds runs in the library's own statics to
results/closed_loop_own.jsonl, one a line, `mujoco FIRST COUNT` runs in MuJoCo to
results/closed_loop_mujoco.jsonl; `own summary` prints how many left the safe region.
"""

import json
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

import equimorph as em

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles.wandering_load import Plant, PlantInMuJoCo, wandering

MARGIN, STRIDE, LOAD, DRIFT, JUMP = 0.05, 0.1, 2.5, 0.03, 0.5
STEPS = 150
COARSE = em.ReplaySettings(links=20, step=0.05, hold=5.0)


def ready() -> tuple[em.Controller, em.Belief, dict]:
    """Controller of the default arch, its first belief, and the sensors."""
    arch = em.Rod()
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    eset = em.equilibrium_set(
        arch,
        box,
        fixed={"q": LOAD},
        within=[arch.max_curvature <= 20],
        intervals=(16, 28),
    )
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


def plant_of(begun: em.Belief, errors: dict, seed: int, simulator: str) -> Plant:
    """The arch under a load that wanders and jumps once."""
    random = np.random.default_rng(seed)
    loads = wandering(LOAD, random, DRIFT, JUMP)
    if simulator == "own":
        return Plant(begun.state, loads, "q", errors, random)
    simulated = em.SimulatedPlant(begun.state, rate=0.1, settings=COARSE)
    return PlantInMuJoCo(begun.state, loads, "q", errors, random, simulated=simulated)


def closed(controller: em.Controller, begun: em.Belief, plant: Plant) -> dict:
    """One run with the controller."""
    belief, seconds, planned = begun, [], []
    for _ in range(STEPS):
        plant.write(controller.command(belief))
        if plant.snapped:
            break
        start = time.process_time()
        belief = controller.step(belief, plant.read())
        spent = seconds if belief.status == em.ControlStatus.FOLLOWING else planned
        spent.append(time.process_time() - start)
        if belief.status == em.ControlStatus.ARRIVED:
            break
    return {
        "status": str(belief.status), "why": belief.why,
        "snapped": plant.snapped, "least": plant.least,
        "step": float(np.median(seconds)), "planning": max(planned, default=0.0),
    }  # fmt: skip


def blind(start: em.State, route: em.Route, plant: Plant) -> dict:
    """A route in the same strides, without looking."""
    here = {name: start[name] for name in route.way_points[0]}
    for point, there in pairwise([here, *route.way_points]):
        gap = np.linalg.norm([there[name] - point[name] for name in here])
        for share in np.linspace(0.0, 1.0, max(1, int(np.ceil(gap / STRIDE))) + 1)[1:]:
            plant.write({name: point[name] + share * (there[name] - point[name]) for name in here})
            if plant.snapped:
                return {"snapped": True, "least": plant.least}
    return {"snapped": False, "least": plant.least}


def results(simulator: str) -> Path:
    """Where runs are kept."""
    return Path("results") / f"closed_loop_{simulator}.jsonl"


def run(simulator: str, first: int, count: int) -> None:
    """Add runs to the results."""
    results(simulator).parent.mkdir(exist_ok=True)
    controller, begun, errors = ready()
    route = em.plan(controller.eset, begun.state, controller.goal, margin=MARGIN)
    for seed in range(first, first + count):
        plants = [plant_of(begun, errors, seed, simulator) for _ in range(2)]
        answers = {
            "seed": seed,
            "closed": closed(controller, begun, plants[0]),
            "blind": blind(begun.state, route, plants[1]),
        }
        with results(simulator).open("a") as file:
            file.write(json.dumps(answers) + "\n")


def say(text: object) -> None:
    """Print one line."""
    sys.stdout.write(f"{text}\n")


def summary(simulator: str) -> None:
    """Print the table."""
    rows = [json.loads(line) for line in results(simulator).read_text().splitlines()]
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
    if sys.argv[2] == "summary":
        summary(sys.argv[1])
    else:
        run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))

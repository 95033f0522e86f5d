"""Random schedules in MuJoCo: 100 motions of rods, trusses and frames at three speeds.

For each schedule that is safe: the speed limit of `speed_limit` for 1 % of the size, replays at
half of it, at it and at four times it. Counted are unpredicted snaps at or below the limit,
deviations above the tolerance there, and how careful the limit is. For each schedule that meets a
fold or a branch point: holds on both sides of it, with two dampings beyond it. Counted are those
that hold before and snap beyond, and landings that are not where that of `snap_landing` is.
Resumable: one line of JSON for each schedule in the file; what is there is not computed again.

    python benchmarks/replays.py results/replays.jsonl
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import equimorph as em
from equimorph.dynamics import ReplaySettings, replay
from equimorph.dynamics.simulators import model_of

COUNT = 100
TOLERANCE = 0.01
SPEEDS = (0.5, 1.0, 4.0)
RIGHT = 0.01
"""Distance from the landing of the gradient flow, relative to the size, that is none."""
DAMPINGS = (0.1, 1.0)
"""Damping ratios of the holds beyond a fold."""
USED = ReplaySettings(links=30, step=0.04, hold=20.0)


def structures() -> list[tuple[str, Any, dict[str, float], dict[str, tuple[float, float]]]]:
    """Kind, structure, natural setting, and ranges of what is changed."""
    line = {"A": (0, 0), "B": (0.5, 0.1), "C": (1, 0)}
    portal = {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)}
    bars = {"A": (-1, 0), "B": (0, 0.3), "C": (1, 0)}
    load = {"F": {"B": (0.1, -1)}}
    return [
        ("arch", em.Rod("uniform"), {"Theta": 1.0},
         {"Theta": (0.6, 1.4), "Delta": (-0.6, 0.6), "q": (0.0, 3.0)}),
        ("half loaded", em.Rod("left-half"), {"Theta": 1.0},
         {"Theta": (0.6, 1.4), "Delta": (-0.6, 0.6), "q": (0.0, 2.0)}),
        ("pinned", em.Rod("uniform", ends=("pinned", "pinned"), span=0.9, curvature=-2.0), {},
         {"q": (0.0, 2.0)}),
        ("arm", em.Rod(ends=("clamped", "free"), loads={"P": em.PointForce(1.0)},
                       actuators={"T": em.Tendon(0.05)}), {}, {"P": (0.0, 0.2), "T": (-1.0, 1.0)}),
        ("stretching", em.Rod("uniform", axial=30.0, span=0.9), {"Theta": 1.0},
         {"Theta": (0.7, 1.2), "q": (0.0, 2.0)}),
        ("truss", em.Truss(bars, [("A", "B"), ("B", "C")], {"A": "xy", "C": "xy"}, load,
                           {"a": {"A-B": 1.0}}, masses={"B": 1.0}), {},
         {"F": (0.0, 0.014), "a": (-0.02, 0.02)}),
        ("portal", em.Frame(portal, [em.Member(pair, mass=1.0) for pair in
                                     (("A", "B"), ("B", "C"), ("C", "D"))],
                            {"A": "fixed", "D": "fixed"}, {"P": {"B": (1, 0)},
                                                           "q": {"B-C": (0, -1)}}), {},
         {"P": (-4.0, 4.0), "q": (0.0, 8.0)}),
        ("shallow frame", em.Frame(line, [em.Member(pair, mass=0.5, EA=4000.0) for pair in
                                          (("A", "B"), ("B", "C"))],
                                   {"A": "pinned", "C": "pinned"}, {"P": {"B": (0, -1)}}), {},
         {"P": (0.0, 40.0)}),
    ]  # fmt: skip


def one(number: int) -> dict[str, Any]:
    """A random schedule of one structure, replayed at three speeds."""
    made = structures()
    kind, structure, natural, ranges = made[number % len(made)]
    generator = np.random.default_rng(number)
    start = em.natural_state(structure, **natural)
    corners = [
        {name: float(generator.uniform(*limits)) for name, limits in ranges.items()}
        for _ in range(2)
    ]
    found = em.verify(corners, start)
    size = float(np.ptp(start.shape(), axis=0).max())
    out: dict[str, Any] = {"number": number, "kind": kind, "verified": found.verified, "runs": []}
    if not found.verified:
        end = found.violation
        out["fold"] = end.kind if end else "margin"
        out["criticality"] = end.criticality if end else ""
        held = em.snap_in_time(corners, start, dampings=DAMPINGS, settings=USED)
        out["apart"] = abs(held.fold - held.fold_of_chain)
        out["held_below"] = held.held_below
        out["beyond"] = [{"left": each.left, "gap": each.gap / size} for each in held.beyond]
        return out
    damping = USED.damping * model_of(start, "mujoco", USED.links).unit
    limit = em.speed_limit(found.schedule, TOLERANCE * size, damping=damping, structure=structure)
    for speed in SPEEDS:
        times = np.asarray(limit.schedule.times) / speed
        played = replay(replace(limit.schedule, times=times), start, settings=USED)
        out["runs"].append({
            "speed": speed, "snapped": played.snapped,
            "dynamics": float(np.nanmax(played.dynamics)) / size,
        })  # fmt: skip
    return out


def summary(rows: list[dict[str, Any]]) -> str:
    """The table."""
    known = [row for row in rows if "error" not in row]
    safe = [row for row in known if row["verified"]]
    slow = [run for row in safe for run in row["runs"] if run["speed"] <= 1.0]
    at_limit = [run["dynamics"] for row in safe for run in row["runs"] if run["speed"] == 1.0]
    careful = np.median([TOLERANCE / max(each, 1e-12) for each in at_limit]) if at_limit else np.nan
    folds = [row for row in known if not row["verified"]]
    beyond = [run for row in folds for run in row["beyond"]]
    right = sum(run["left"] and run["gap"] < RIGHT for run in beyond)
    return (
        f"{len(rows)} schedules, {len(safe)} verified: {sum(run['snapped'] for run in slow)} snaps "
        f"in {len(slow)} replays at or below the limit; largest deviation there "
        f"{max((run['dynamics'] for run in slow), default=0.0):.2g} of the size, at most "
        f"{TOLERANCE} allowed; too careful by {careful:.2g} in the median. {len(folds)} with a "
        f"fold or branch point: {sum(row['held_below'] for row in folds)} hold before it; of "
        f"{len(beyond)} holds beyond it {sum(run['left'] for run in beyond)} snap and {right} land "
        f"where the gradient flow does. {len(rows) - len(known)} failed."
    )


def main(path: Path) -> None:
    """Compute what is missing, and say what was found."""
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    known = {row["number"] for row in rows}
    for number in range(COUNT):
        if number in known:
            continue
        try:
            row = one(number)
        except (em.errors.InputError, ArithmeticError) as error:
            row = {"number": number, "verified": False, "error": str(error)}
        rows.append(row)
        with path.open("a") as file:
            file.write(json.dumps(row) + "\n")
    sys.stdout.write(summary(rows) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

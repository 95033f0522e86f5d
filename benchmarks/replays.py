"""Random schedules in MuJoCo: 100 motions of rods, trusses and frames at three speeds.

For each schedule: the speed limit of `speed_limit` for 1 % of the size, replays at half of it, at
it and at four times it. Counted are unpredicted snaps at or below the limit, deviations above the
tolerance there, how careful the limit is, and landings that are no stable state of the library.
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
    out: dict[str, Any] = {"number": number, "kind": kind, "verified": found.verified, "runs": []}
    if not found.verified:
        out["fold"] = found.violation.kind if found.violation else "margin"
        slow = replay(corners, start, duration=400.0 * _unit(start), settings=USED)
        out["snapped"] = slow.snapped
        out["landed"] = bool(slow.landed_in is not None and slow.landed_in.stable)
        return out
    size = float(np.ptp(start.shape(), axis=0).max())
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


def _unit(state: em.structures.State) -> float:
    """About a fifth of the period of the lowest mode."""
    return 5.0 / float(state.batch.natural_frequencies(1)[0, 0])


def summary(rows: list[dict[str, Any]]) -> str:
    """The table."""
    safe = [row for row in rows if row["verified"] and "error" not in row]
    slow = [run for row in safe for run in row["runs"] if run["speed"] <= 1.0]
    at_limit = [run["dynamics"] for row in safe for run in row["runs"] if run["speed"] == 1.0]
    folds = [row for row in rows if not row["verified"] and "error" not in row]
    careful = np.median([TOLERANCE / max(each, 1e-12) for each in at_limit]) if at_limit else np.nan
    return (
        f"{len(rows)} schedules, {len(safe)} verified: {sum(run['snapped'] for run in slow)} snaps "
        f"in {len(slow)} replays at or below the limit; largest deviation there "
        f"{max((run['dynamics'] for run in slow), default=0.0):.2g} of the size, at most "
        f"{TOLERANCE} allowed; too careful by {careful:.2g} in the median. {len(folds)} with a "
        f"fold: {sum(row['snapped'] for row in folds)} snap, "
        f"{sum(row['landed'] for row in folds)} land in a stable state. "
        f"{sum('error' in row for row in rows)} failed."
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

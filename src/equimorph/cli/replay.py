"""`equimorph replay`: a schedule file in a simulator."""

import json
from pathlib import Path

import numpy as np

from equimorph.dynamics import Replay, ReplaySettings, replay
from equimorph.plotting import deviation_over_time, save
from equimorph.storage import read_schedule


def replay_file(
    file: Path, *, rate: float | None, simulator: str, links: int, picture: Path | None
) -> Replay:
    """Replay the schedule of a file, and draw its deviation."""
    schedule = read_schedule(file)
    played = replay(schedule, rate=rate, simulator=simulator, settings=ReplaySettings(links=links))  # type: ignore[arg-type]  # a word of the user, which `replay` checks
    if picture is not None:
        suffix = picture.suffix.lstrip(".") or "png"
        save(deviation_over_time(played), picture.parent, picture.stem, (suffix,))
    return played


def lines(played: Replay) -> list[str]:
    """What a replay says."""
    out = [repr(played)]
    if played.snapped and played.landed_in is not None:
        out.append(f"landed in {played.landed_in!r}")
    if not played.independent:
        out.append("The simulator shares the library's equations; it is not independent.")
    return out


def as_json(played: Replay) -> str:
    """The numbers on one line."""
    return json.dumps({
        "simulator": played.simulator,
        "duration": float(played.times[-1]),
        "largest_deviation": played.largest_deviation,
        "discretisation": float(np.nanmax(played.discretisation)),
        "dynamics": float(np.nanmax(played.dynamics)),
        "snapped": played.snapped,
        "where": played.where,
        "closure": played.closure,
    })  # fmt: skip

"""Equilibria of the library along the samples of a motion."""

from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float
from equimorph.dynamics.model import Model
from equimorph.structures import State
from equimorph.tasks.route import FINE
from equimorph.tasks.verification.schedule_check import follow_polyline


@dataclass(frozen=True, eq=False)
class Along:
    """Points of the equilibria at the samples, nan where they have ended.

    end, kind, at: the state at which they end, what it is, and the sample with the share of the
    way to the next one; None where they do not end.
    """

    points: Float[np.ndarray, "times points space"]
    end: State | None = None
    kind: str = "arrived"
    at: float = float("nan")


def equilibria_along(
    model: Model, begin: State, rows: Float[np.ndarray, "times parameters"]
) -> Along:
    """Follow the library's equilibria from sample to sample."""
    moves = np.abs(np.diff(rows, axis=0)).max(axis=1) > 0.0
    if not moves.any():
        return Along(np.repeat(model.reference(begin.batch), len(rows), axis=0))
    leg = np.concatenate([[0], np.cumsum(moves)])
    followed = follow_polyline(begin, rows[1:][moves], (), FINE)
    corners, ended = followed.corners, followed.end.kind != "arrived"
    if ended:
        corners = corners[followed.at[corners] < followed.end.at]
    known = model.reference(followed.states[corners])
    out = np.full((len(rows), *known.shape[1:]), np.nan)
    there = leg < len(known)
    out[there] = known[leg[there]]
    if not ended:
        return Along(out)
    whole = int(followed.end.at)
    at = np.flatnonzero(moves)[min(whole, int(moves.sum()) - 1)] + followed.end.at - whole
    return Along(out, followed.end.state, followed.end.kind, float(at))

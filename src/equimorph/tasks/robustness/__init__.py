"""Sensitivity and robustness: derivatives, laws of imperfections, room, trials, least snaps."""

from equimorph.tasks.robustness.derivatives import (
    Sensitivity,
    limit_sensitivity,
    sensitivity,
)
from equimorph.tasks.robustness.imperfection import ImperfectionLaw, imperfection_law
from equimorph.tasks.robustness.room import Room, stable_room
from equimorph.tasks.robustness.snaps import LeastSnap, least_snap
from equimorph.tasks.robustness.trials import Trials, random_trials

__all__ = [
    "ImperfectionLaw",
    "LeastSnap",
    "Room",
    "Sensitivity",
    "Trials",
    "imperfection_law",
    "least_snap",
    "limit_sensitivity",
    "random_trials",
    "sensitivity",
    "stable_room",
]

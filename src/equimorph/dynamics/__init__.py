"""Schedules in time: replay in a simulator of rigid bodies, and what happens at folds."""

from equimorph.dynamics.replay import Replay, ReplaySettings, replay
from equimorph.dynamics.shock import LeastShock, Shock, least_shock
from equimorph.dynamics.simulated_plant import SimulatedPlant
from equimorph.dynamics.snap_in_time import HeldLanding, SnapInTime, snap_in_time

__all__ = [
    "HeldLanding",
    "LeastShock",
    "Replay",
    "ReplaySettings",
    "Shock",
    "SimulatedPlant",
    "SnapInTime",
    "least_shock",
    "replay",
    "snap_in_time",
]

"""Schedules in time: how fast they may be, and motions that actuators can execute."""

from equimorph.tasks.timing.retiming import retime
from equimorph.tasks.timing.speed import SpeedLimit, deviation_bound, speed_limit

__all__ = ["SpeedLimit", "deviation_bound", "retime", "speed_limit"]

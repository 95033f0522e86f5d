"""Schedules in time: replay in a simulator of rigid bodies, and what happens at folds."""

from equimorph.dynamics.replay import Replay, ReplaySettings, replay

__all__ = ["Replay", "ReplaySettings", "replay"]

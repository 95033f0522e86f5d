"""Closed-loop control on a ready equilibrium set: estimate, keep clear of snaps, follow, replan."""

from equimorph.control.belief import Belief, ControlStatus
from equimorph.control.controller import Controller

__all__ = ["Belief", "ControlStatus", "Controller"]

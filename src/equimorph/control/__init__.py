"""Closed-loop control on a ready equilibrium set: estimate, keep clear of snaps, follow, replan."""

from equimorph.control.controller import Controller as Controller
from equimorph.control.estimate import Belief as Belief, ControlStatus as ControlStatus

"""Closed-loop control on a ready equilibrium set: estimate, keep clear of snaps, follow, replan."""

from equimorph.control.belief import Belief as Belief, ControlStatus as ControlStatus
from equimorph.control.controller import Controller as Controller

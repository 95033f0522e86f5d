"""Planning: the best route between two states, without a snap or with snaps at a price."""

from equimorph.tasks.planning.objectives import Objective, objective_of
from equimorph.tasks.planning.planner import plan

__all__ = ["Objective", "objective_of", "plan"]

"""Planning: the best route between two states, without a snap or with snaps at a price."""

from equimorph.tasks.planning.objectives import Objective, objective_of
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.planning.route_classes import alternatives
from equimorph.tasks.planning.sampling import SamplingOptions, plan_sampled
from equimorph.tasks.planning.smoothing import smoothed

__all__ = [
    "Objective",
    "SamplingOptions",
    "alternatives",
    "objective_of",
    "plan",
    "plan_sampled",
    "smoothed",
]

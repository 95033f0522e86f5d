"""Plain data: parameters, boxes, descriptors, constraints, schedules; sinks and journals."""

from equimorph.model.descriptor import (
    Constraint,
    Descriptor,
    Vanishing,
    are_feasible,
    eased,
    function_of,
    largest_of,
    worst_excess,
    worst_relative_excess,
)
from equimorph.model.drawing import (
    Actuator,
    ActuatorKind,
    Couples,
    Drawing,
    Forces,
    Support,
    SupportKind,
)
from equimorph.model.journal import (
    NOT_KEPT,
    Findings,
    Journal,
    Progress,
    Silent,
    content_of_descriptor,
    content_of_function,
    recalled,
)
from equimorph.model.obstacle import Disc, HalfPlane, Obstacle
from equimorph.model.parameter import (
    Box,
    Grid,
    Parameter,
    Role,
    names_of,
    parameter_vector,
    position,
)
from equimorph.model.rebuilding import Call, Rebuilt, remake, remember_call
from equimorph.model.schedule import Rates, Schedule
from equimorph.model.spline import Spline
from equimorph.model.workers import Workers, cut_rows, map_rows

__all__ = [
    "NOT_KEPT",
    "Actuator",
    "ActuatorKind",
    "Box",
    "Call",
    "Constraint",
    "Couples",
    "Descriptor",
    "Disc",
    "Drawing",
    "Findings",
    "Forces",
    "Grid",
    "HalfPlane",
    "Journal",
    "Obstacle",
    "Parameter",
    "Progress",
    "Rates",
    "Rebuilt",
    "Role",
    "Schedule",
    "Silent",
    "Spline",
    "Support",
    "SupportKind",
    "Vanishing",
    "Workers",
    "are_feasible",
    "content_of_descriptor",
    "content_of_function",
    "cut_rows",
    "eased",
    "function_of",
    "largest_of",
    "map_rows",
    "names_of",
    "parameter_vector",
    "position",
    "recalled",
    "remake",
    "remember_call",
    "worst_excess",
    "worst_relative_excess",
]

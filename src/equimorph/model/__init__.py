"""Plain data: parameters, boxes, descriptors, constraints, schedules; sinks and journals."""

from equimorph.model.descriptor import (
    Constraint as Constraint,
    Descriptor as Descriptor,
    Vanishing as Vanishing,
    are_feasible as are_feasible,
    ease as ease,
    function_of as function_of,
    largest_of as largest_of,
    worst_excess as worst_excess,
    worst_relative_excess as worst_relative_excess,
)
from equimorph.model.drawing import (
    Actuator as Actuator,
    ActuatorKind as ActuatorKind,
    Couples as Couples,
    Drawing as Drawing,
    Forces as Forces,
    Support as Support,
    SupportKind as SupportKind,
)
from equimorph.model.journal import (
    NOT_KEPT as NOT_KEPT,
    Findings as Findings,
    Journal as Journal,
    Progress as Progress,
    Silent as Silent,
    Workers as Workers,
    content_of_descriptor as content_of_descriptor,
    content_of_function as content_of_function,
    cut_rows as cut_rows,
    map_chunks as map_chunks,
    map_rows as map_rows,
    recall_or_compute as recall_or_compute,
)
from equimorph.model.obstacle import Disc as Disc, HalfPlane as HalfPlane, Obstacle as Obstacle
from equimorph.model.parameter import (
    Box as Box,
    Grid as Grid,
    Parameter as Parameter,
    Role as Role,
    Spline as Spline,
    names_of as names_of,
    parameter_vector as parameter_vector,
    position as position,
)
from equimorph.model.rebuilding import (
    Call as Call,
    Rebuilt as Rebuilt,
    remake as remake,
    remember_call as remember_call,
)
from equimorph.model.schedule import Rates as Rates, Schedule as Schedule

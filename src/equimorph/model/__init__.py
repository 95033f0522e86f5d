"""Plain data: parameters, boxes, descriptors, constraints, schedules, progress sinks."""

from equimorph.model.box import Box, Grid
from equimorph.model.descriptor import Constraint, Descriptor
from equimorph.model.parameter import (
    Parameter,
    Role,
    names_of,
    parameter_vector,
    position,
)
from equimorph.model.progress import Progress, Silent
from equimorph.model.schedule import Schedule
from equimorph.model.spline import Spline

__all__ = [
    "Box",
    "Constraint",
    "Descriptor",
    "Grid",
    "Parameter",
    "Progress",
    "Role",
    "Schedule",
    "Silent",
    "Spline",
    "names_of",
    "parameter_vector",
    "position",
]

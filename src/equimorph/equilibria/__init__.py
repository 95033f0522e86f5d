"""Equilibria: solving, lifting, events, limit loads, searching."""

from equimorph.equilibria.curves import NewtonHomotopy, ParameterLine
from equimorph.equilibria.lift import Event, Path, check_start, lift, way_points
from equimorph.equilibria.limit import LimitLoad, limit_load
from equimorph.equilibria.newton import newton
from equimorph.equilibria.outcome import Outcome, follow
from equimorph.equilibria.search import distinct, find_equilibria
from equimorph.equilibria.tracing import TraceOptions

__all__ = [
    "Event",
    "LimitLoad",
    "NewtonHomotopy",
    "Outcome",
    "ParameterLine",
    "Path",
    "TraceOptions",
    "check_start",
    "distinct",
    "find_equilibria",
    "follow",
    "lift",
    "limit_load",
    "newton",
    "way_points",
]

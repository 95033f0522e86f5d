"""Equilibria: solving, lifting, events, limit loads, searching."""

from equimorph.equilibria.both_ways import CriticalCurve
from equimorph.equilibria.completeness import Completeness
from equimorph.equilibria.critical_curves import (
    branch_curve,
    constraint_curve,
    cusp_curve,
    fold_curve,
    grazing_curve,
)
from equimorph.equilibria.curves import NewtonHomotopy, ParameterLine
from equimorph.equilibria.deflation import deflated_newton
from equimorph.equilibria.imperfections import Corner, corners_of, worst_named, worst_over
from equimorph.equilibria.lift import Event, Lifts, Path, check_start, lift, way_points
from equimorph.equilibria.lifting.legs import Leg, Waypoint
from equimorph.equilibria.lifting.paths import lift_legs
from equimorph.equilibria.limit import LimitLoad, LimitLoads, limit_load
from equimorph.equilibria.newton import newton
from equimorph.equilibria.outcome import Outcome, follow
from equimorph.equilibria.pools import distinct
from equimorph.equilibria.ranges import held_over
from equimorph.equilibria.search import FoundStates, find_equilibria, search_points
from equimorph.equilibria.snap import Landing, snap_landing
from equimorph.equilibria.switching import Branch, branches
from equimorph.equilibria.tracing import TraceOptions

__all__ = [
    "Branch",
    "Completeness",
    "Corner",
    "CriticalCurve",
    "Event",
    "FoundStates",
    "Landing",
    "Leg",
    "Lifts",
    "LimitLoad",
    "LimitLoads",
    "NewtonHomotopy",
    "Outcome",
    "ParameterLine",
    "Path",
    "TraceOptions",
    "Waypoint",
    "branch_curve",
    "branches",
    "check_start",
    "constraint_curve",
    "corners_of",
    "cusp_curve",
    "deflated_newton",
    "distinct",
    "find_equilibria",
    "fold_curve",
    "follow",
    "grazing_curve",
    "held_over",
    "lift",
    "lift_legs",
    "limit_load",
    "newton",
    "search_points",
    "snap_landing",
    "way_points",
    "worst_named",
    "worst_over",
]

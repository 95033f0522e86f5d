"""Equilibria: solving, lifting, events, limit loads, searching."""

from equimorph.equilibria.critical_curves import (
    CriticalCurve,
    branch_curve,
    constraint_curve,
    cusp_curve,
    fold_curve,
    grazing_curve,
)
from equimorph.equilibria.curves import ParameterLine
from equimorph.equilibria.energy_barriers import EnergyBarrier, EnergyPath, Merge
from equimorph.equilibria.legs import Leg, Waypoint
from equimorph.equilibria.lift import Event, Lifts, Path, check_start, lift, way_points
from equimorph.equilibria.limit_load import LimitLoad, LimitLoads, limit_load
from equimorph.equilibria.load_cycles import LoadCycle, load_cycle
from equimorph.equilibria.paths import lift_legs
from equimorph.equilibria.random_search import distinct
from equimorph.equilibria.search import Completeness, FoundStates, find_equilibria, search_points
from equimorph.equilibria.settle import Guards, Settled, settle
from equimorph.equilibria.snap import Landing, snap_landing
from equimorph.equilibria.switching import Branch, branches
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventKind, TraceOptions
from equimorph.equilibria.transitions import TransitionNetwork, transition_network
from equimorph.equilibria.worst_cases import (
    Corner,
    corners_of,
    stable_over,
    worst_named,
    worst_over,
)

__all__ = [
    "Branch",
    "Completeness",
    "Corner",
    "CriticalCurve",
    "EnergyBarrier",
    "EnergyPath",
    "Event",
    "EventKind",
    "FoundStates",
    "Guards",
    "Landing",
    "Leg",
    "Lifts",
    "LimitLoad",
    "LimitLoads",
    "LoadCycle",
    "Merge",
    "ParameterLine",
    "Path",
    "Settled",
    "TraceOptions",
    "Traces",
    "TransitionNetwork",
    "Waypoint",
    "branch_curve",
    "branches",
    "check_start",
    "constraint_curve",
    "corners_of",
    "cusp_curve",
    "distinct",
    "find_equilibria",
    "fold_curve",
    "grazing_curve",
    "lift",
    "lift_legs",
    "limit_load",
    "load_cycle",
    "search_points",
    "settle",
    "snap_landing",
    "stable_over",
    "trace",
    "transition_network",
    "way_points",
    "worst_named",
    "worst_over",
]

"""Equilibria: solving, lifting, events, limit loads, searching."""

from equimorph.equilibria.capture import Completeness as Completeness
from equimorph.equilibria.critical_curves import (
    CriticalCurve as CriticalCurve,
    branch_curve as branch_curve,
    constraint_curve as constraint_curve,
    cusp_curve as cusp_curve,
    fold_curve as fold_curve,
    grazing_curve as grazing_curve,
)
from equimorph.equilibria.curves import ParameterLine as ParameterLine
from equimorph.equilibria.energy_barriers import (
    EnergyBarrier as EnergyBarrier,
    EnergyPath as EnergyPath,
    Merge as Merge,
)
from equimorph.equilibria.legs import Leg as Leg, Waypoint as Waypoint
from equimorph.equilibria.lift import (
    Event as Event,
    Lifts as Lifts,
    Path as Path,
    check_start as check_start,
    lift as lift,
    way_points as way_points,
)
from equimorph.equilibria.limit_load import (
    LimitLoad as LimitLoad,
    LimitLoads as LimitLoads,
    limit_load as limit_load,
)
from equimorph.equilibria.load_cycles import LoadCycle as LoadCycle, load_cycle as load_cycle
from equimorph.equilibria.paths import lift_legs as lift_legs
from equimorph.equilibria.random_search import distinct as distinct
from equimorph.equilibria.rays import Ray as Ray, least_room as least_room, rays_of as rays_of
from equimorph.equilibria.search import (
    FoundStates as FoundStates,
    find_equilibria as find_equilibria,
    search_points as search_points,
)
from equimorph.equilibria.settle import Guards as Guards, Settled as Settled, settle as settle
from equimorph.equilibria.snap import Landing as Landing, snap_landing as snap_landing
from equimorph.equilibria.switching import Branch as Branch, branches as branches
from equimorph.equilibria.trace import Traces as Traces, trace as trace
from equimorph.equilibria.trace_options import EventKind as EventKind, TraceOptions as TraceOptions
from equimorph.equilibria.transitions import (
    TransitionNetwork as TransitionNetwork,
    transition_network as transition_network,
)
from equimorph.equilibria.worst_cases import (
    stable_over as stable_over,
    worst_named as worst_named,
    worst_on_lattice as worst_on_lattice,
    worst_over as worst_over,
)

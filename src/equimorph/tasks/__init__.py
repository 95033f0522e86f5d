"""Shape-control tasks."""

from equimorph.tasks.calibration import (
    Calibration,
    Family,
    MeasuredShape,
    MeasuredValues,
    calibrate,
)
from equimorph.tasks.estimation import Resolving, StateEstimate, estimate_state
from equimorph.tasks.maps import (
    ActuatorMap,
    CurvatureMap,
    LimitLoadMap,
    MapCurve,
    curvature_map,
    limit_load_map,
    natural_states_over,
    unloaded_base,
)
from equimorph.tasks.optimising import (
    Certificate,
    Optima,
    Optimum,
    Strongest,
    StrongestSettings,
    optimise,
    strongest,
)
from equimorph.tasks.planning import Objective, SamplingOptions, plan, plan_sampled
from equimorph.tasks.reach import Reach, attainable, reachable
from equimorph.tasks.robustness import (
    ImperfectionLaw,
    LeastSnap,
    Room,
    Sensitivity,
    Trials,
    imperfection_law,
    least_snap,
    limit_sensitivity,
    random_trials,
    sensitivity,
    stable_room,
)
from equimorph.tasks.route import Route
from equimorph.tasks.shapes import Shapes, solve_shape, solve_shapes
from equimorph.tasks.tracking import Tracking, track
from equimorph.tasks.verification import Proof, Verification, verify

__all__ = [
    "ActuatorMap",
    "Calibration",
    "Certificate",
    "CurvatureMap",
    "Family",
    "ImperfectionLaw",
    "LeastSnap",
    "LimitLoadMap",
    "MapCurve",
    "MeasuredShape",
    "MeasuredValues",
    "Objective",
    "Optima",
    "Optimum",
    "Proof",
    "Reach",
    "Resolving",
    "Room",
    "Route",
    "SamplingOptions",
    "Sensitivity",
    "Shapes",
    "StateEstimate",
    "Strongest",
    "StrongestSettings",
    "Tracking",
    "Trials",
    "Verification",
    "attainable",
    "calibrate",
    "curvature_map",
    "estimate_state",
    "imperfection_law",
    "least_snap",
    "limit_load_map",
    "limit_sensitivity",
    "natural_states_over",
    "optimise",
    "plan",
    "plan_sampled",
    "random_trials",
    "reachable",
    "sensitivity",
    "solve_shape",
    "solve_shapes",
    "stable_room",
    "strongest",
    "track",
    "unloaded_base",
    "verify",
]

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
from equimorph.tasks.optimising import Certificate, Optima, Optimum, optimise
from equimorph.tasks.planning import Objective, SamplingOptions, plan, plan_sampled
from equimorph.tasks.reach import Reach, attainable, reachable
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
    "Route",
    "SamplingOptions",
    "Shapes",
    "StateEstimate",
    "Tracking",
    "Verification",
    "attainable",
    "calibrate",
    "curvature_map",
    "estimate_state",
    "limit_load_map",
    "natural_states_over",
    "optimise",
    "plan",
    "plan_sampled",
    "reachable",
    "solve_shape",
    "solve_shapes",
    "track",
    "unloaded_base",
    "verify",
]

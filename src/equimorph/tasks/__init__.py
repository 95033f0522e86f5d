"""Shape-control tasks."""

from equimorph.tasks.calibration import (
    Calibration,
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
from equimorph.tasks.plan import plan
from equimorph.tasks.route import Route
from equimorph.tasks.shapes import Shapes, solve_shape
from equimorph.tasks.tracking import Tracking, track

__all__ = [
    "ActuatorMap",
    "Calibration",
    "CurvatureMap",
    "LimitLoadMap",
    "MapCurve",
    "MeasuredShape",
    "MeasuredValues",
    "Resolving",
    "Route",
    "Shapes",
    "StateEstimate",
    "Tracking",
    "calibrate",
    "curvature_map",
    "estimate_state",
    "limit_load_map",
    "natural_states_over",
    "plan",
    "solve_shape",
    "track",
    "unloaded_base",
]

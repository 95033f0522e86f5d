"""Shape-control tasks."""

from equimorph.tasks.maps import (
    CurvatureMap,
    LimitLoadMap,
    MapCurve,
    curvature_map,
    limit_load_map,
)
from equimorph.tasks.plan import plan
from equimorph.tasks.route import Route

__all__ = [
    "CurvatureMap",
    "LimitLoadMap",
    "MapCurve",
    "Route",
    "curvature_map",
    "limit_load_map",
    "plan",
]

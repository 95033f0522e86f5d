"""Maps over a grid of actuator settings."""

from equimorph.tasks.maps.actuator_map import ActuatorMap, natural_states_over, unloaded_base
from equimorph.tasks.maps.curvature import CurvatureMap, curvature_map
from equimorph.tasks.maps.curves import MapCurve
from equimorph.tasks.maps.limit_load import LimitLoadMap, limit_load_map

__all__ = [
    "ActuatorMap",
    "CurvatureMap",
    "LimitLoadMap",
    "MapCurve",
    "curvature_map",
    "limit_load_map",
    "natural_states_over",
    "unloaded_base",
]

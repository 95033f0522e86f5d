"""Maps over a grid of actuator settings."""

from equimorph.tasks.maps.curvature import CurvatureMap, curvature_map
from equimorph.tasks.maps.curves import MapCurve
from equimorph.tasks.maps.limit_load import LimitLoadMap, limit_load_map

__all__ = ["CurvatureMap", "LimitLoadMap", "MapCurve", "curvature_map", "limit_load_map"]

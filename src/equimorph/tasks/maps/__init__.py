"""Maps over a grid of actuator settings."""

from equimorph.tasks.maps.curves import MapCurve
from equimorph.tasks.maps.limit_load import LimitLoadMap, limit_load_map

__all__ = ["LimitLoadMap", "MapCurve", "limit_load_map"]

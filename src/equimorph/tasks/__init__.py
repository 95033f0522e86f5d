"""Shape-control tasks."""

from equimorph.tasks.maps import LimitLoadMap, MapCurve, limit_load_map
from equimorph.tasks.plan import plan
from equimorph.tasks.route import Route

__all__ = ["LimitLoadMap", "MapCurve", "Route", "limit_load_map", "plan"]

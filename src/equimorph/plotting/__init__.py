"""Figures and films of results; nothing else in the package draws."""

from equimorph.plotting.charts import chart_domain, parameterisation
from equimorph.plotting.film import film
from equimorph.plotting.level_plane import level_plane
from equimorph.plotting.maps import curvature_map, load_map
from equimorph.plotting.optima import beside_strongest, followed, landscape, strongest_settings
from equimorph.plotting.plane import diagram, parameter_plane, solutions
from equimorph.plotting.reach import reach_panels, reach_parameters, reach_plane
from equimorph.plotting.replays import deviation_over_time, replay_film
from equimorph.plotting.robustness import imperfection_laws, room, sensitivities, trials
from equimorph.plotting.route_panels import alternative_routes, route_panels
from equimorph.plotting.schedules import margins, schedule_strips
from equimorph.plotting.shapes import calibration, portraits, shapes
from equimorph.plotting.snaps import snap_panels
from equimorph.plotting.style import house_style, save
from equimorph.plotting.surface import surface
from equimorph.plotting.transitions import (
    disconnectivity,
    energy_path,
    least_barriers,
    network_changes,
)
from equimorph.plotting.words import words

__all__ = [
    "alternative_routes",
    "beside_strongest",
    "calibration",
    "chart_domain",
    "curvature_map",
    "deviation_over_time",
    "diagram",
    "disconnectivity",
    "energy_path",
    "film",
    "followed",
    "house_style",
    "imperfection_laws",
    "landscape",
    "least_barriers",
    "level_plane",
    "load_map",
    "margins",
    "network_changes",
    "parameter_plane",
    "parameterisation",
    "portraits",
    "reach_panels",
    "reach_parameters",
    "reach_plane",
    "replay_film",
    "room",
    "route_panels",
    "save",
    "schedule_strips",
    "sensitivities",
    "shapes",
    "snap_panels",
    "solutions",
    "strongest_settings",
    "surface",
    "trials",
    "words",
]

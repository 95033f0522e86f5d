"""Figures and films of results; nothing else in the package draws."""

from equimorph.plotting.charts import (
    chart_domain as chart_domain,
    parameterisation as parameterisation,
)
from equimorph.plotting.film import film as film
from equimorph.plotting.level_plane import level_plane as level_plane
from equimorph.plotting.maps import curvature_map as curvature_map, load_map as load_map
from equimorph.plotting.optima import (
    beside_strongest as beside_strongest,
    followed as followed,
    landscape as landscape,
    strongest_settings as strongest_settings,
)
from equimorph.plotting.plane import (
    diagram as diagram,
    parameter_plane as parameter_plane,
    solutions as solutions,
)
from equimorph.plotting.reach import (
    reach_panels as reach_panels,
    reach_parameters as reach_parameters,
    reach_plane as reach_plane,
)
from equimorph.plotting.replays import (
    deviation_over_time as deviation_over_time,
    replay_film as replay_film,
)
from equimorph.plotting.robustness import (
    imperfection_laws as imperfection_laws,
    room as room,
    sensitivities as sensitivities,
    trials as trials,
)
from equimorph.plotting.route_panels import (
    alternative_routes as alternative_routes,
    route_panels as route_panels,
)
from equimorph.plotting.schedules import margins as margins, schedule_strips as schedule_strips
from equimorph.plotting.shapes import (
    calibration as calibration,
    portraits as portraits,
    shapes as shapes,
)
from equimorph.plotting.snaps import snap_panels as snap_panels
from equimorph.plotting.style import house_style as house_style, save as save
from equimorph.plotting.surface import surface as surface
from equimorph.plotting.transitions import (
    disconnectivity as disconnectivity,
    energy_path as energy_path,
    least_barriers as least_barriers,
    network_changes as network_changes,
)
from equimorph.plotting.words import words as words

"""Results and schedules as files that other programs open."""

from equimorph.storage.certificates import write_certificate as write_certificate
from equimorph.storage.charts import load_chart as load_chart, save_chart as save_chart
from equimorph.storage.journal import open_journal as open_journal
from equimorph.storage.maps import write_map as write_map
from equimorph.storage.results import (
    Results as Results,
    append_results as append_results,
    load_set as load_set,
    read_results as read_results,
    save_set as save_set,
    write_results as write_results,
)
from equimorph.storage.schedule import (
    read_schedule as read_schedule,
    write_schedule as write_schedule,
)
from equimorph.storage.surface import write_shapes as write_shapes, write_surface as write_surface
from equimorph.storage.trajectory import (
    trajectory_message as trajectory_message,
    write_trajectory as write_trajectory,
)

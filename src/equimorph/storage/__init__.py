"""Results and schedules as files that other programs open."""

from equimorph.storage.certificates import write_certificate
from equimorph.storage.charts import load_chart, save_chart
from equimorph.storage.journal import open_journal
from equimorph.storage.maps import write_map
from equimorph.storage.results import (
    Results,
    append_results,
    load_set,
    read_results,
    save_set,
    write_results,
)
from equimorph.storage.schedule import read_schedule, write_schedule
from equimorph.storage.surface import write_shapes, write_surface
from equimorph.storage.trajectory import trajectory_message, write_trajectory

__all__ = [
    "Results",
    "append_results",
    "load_chart",
    "load_set",
    "open_journal",
    "read_results",
    "read_schedule",
    "save_chart",
    "save_set",
    "trajectory_message",
    "write_certificate",
    "write_map",
    "write_results",
    "write_schedule",
    "write_shapes",
    "write_surface",
    "write_trajectory",
]

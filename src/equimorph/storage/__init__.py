"""Results and schedules as files that other programs open."""

from equimorph.storage.map_table import write_map
from equimorph.storage.results import Results, read_results, write_results
from equimorph.storage.schedule import read_schedule, write_schedule

__all__ = [
    "Results",
    "read_results",
    "read_schedule",
    "write_map",
    "write_results",
    "write_schedule",
]

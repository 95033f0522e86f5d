"""What the files of a results folder are called."""

INPUT_COPY = "study.toml"
RESULTS = "results.h5"
GRID = "results.vtkhdf"
"""The same file under the name by which ParaView knows it, where there is a set to be shown."""
REPORT = "index.html"
EXPLORER = "explorer.html"

SURFACE = "surface"
DIAGRAM = "diagram"
PLANE = "parameter-plane"
STABLE_PLANE = "stable-plane"


def task_files(table: str, name: str) -> str:
    """Beginning of the names of the files of a question of one kind."""
    return f"{name}-{table}"


def schedule_table(name: str) -> str:
    """File name of the schedule of the route called `name`; its sidecar ends in ``.json``."""
    return f"{name}-schedule.csv"


def route_name(name: str, number: int) -> str:
    """Name of one of several routes between the same states, counted from 1, the best."""
    return name if number == 1 else f"{name}-{number}"

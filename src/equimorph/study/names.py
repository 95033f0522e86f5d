"""What the files of a results folder are called."""

from dataclasses import dataclass

INPUT_COPY = "study.toml"
RESULTS = "results.h5"
REPORT = "index.html"

SURFACE = "surface"
DIAGRAM = "diagram"
PLANE = "parameter-plane"
STABLE_PLANE = "stable-plane"


@dataclass(frozen=True)
class RouteFigures:
    """File names of the figures of one route, without extension; the film's with it."""

    plane: str
    parameters: str
    shapes: str
    margins: str
    film: str


def route_figures(name: str) -> RouteFigures:
    """File names of the figures of the route called `name`."""
    return RouteFigures(
        f"{name}-plane",
        f"{name}-parameters",
        f"{name}-shapes",
        f"{name}-margins",
        f"{name}-film.gif",
    )


def map_files(name: str) -> str:
    """Beginning of the names of all files of the map called `name`: a figure and two tables."""
    return f"{name}-map"


def task_files(table: str, name: str) -> str:
    """Beginning of the names of the files of a question of one kind."""
    return f"{name}-{table}"


def schedule_table(name: str) -> str:
    """File name of the schedule of the route called `name`; its sidecar ends in ``.json``."""
    return f"{name}-schedule.csv"


def route_name(name: str, number: int) -> str:
    """Name of one of several routes between the same states, counted from 1, the best."""
    return name if number == 1 else f"{name}-{number}"

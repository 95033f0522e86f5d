"""Which figures a study gets, and what their files are called."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from matplotlib.axes import Axes

from equimorph import plotting
from equimorph.model import Progress
from equimorph.study.outcome import Outcome, RouteOutcome

SURFACE = "surface"
PLANE = "parameter-plane"
STABLE_PLANE = "stable-plane"


@dataclass(frozen=True)
class RouteFigures:
    """File names of the figures of one route, without extension; the film's with it."""

    plane: str
    shapes: str
    margins: str
    film: str


def route_figures(name: str) -> RouteFigures:
    """File names of the figures of the route called `name`."""
    return RouteFigures(f"{name}-plane", f"{name}-shapes", f"{name}-margins", f"{name}-film.gif")


def draw_figures(outcome: Outcome, folder: Path, progress: Progress) -> None:
    """Draw all figures of an outcome.

    Parameters
    ----------
    outcome
        What was found.
    folder
        Where the files go.
    progress
        Told how far the drawing is.
    """
    drawings = _drawings(outcome)
    films = [each for each in outcome.routes if each.arrived]
    total = len(drawings) + len(films)
    for done, (name, draw) in enumerate(drawings.items()):
        progress.report("figures", done, total)
        plotting.save(draw(), folder, name)
    for done, each in enumerate(films, start=len(drawings)):
        progress.report("figures", done, total)
        plotting.film(
            each.route, folder / route_figures(each.name).film, eset=outcome.equilibrium_set
        )
    progress.report("figures", total, total)


def _drawings(outcome: Outcome) -> dict[str, Callable[[], Axes]]:
    """Still figures by file name."""
    eset, arrived = outcome.equilibrium_set, [each for each in outcome.routes if each.arrived]
    first = arrived[0].route if arrived else None
    drawings: dict[str, Callable[[], Axes]] = {
        SURFACE: partial(plotting.surface, eset, outcome.problem.height, route=first),
        STABLE_PLANE: partial(plotting.parameter_plane, eset, count="stable"),
    }
    # With routes, each of them is shown on this plane; once more without it would say nothing new.
    if not outcome.routes:
        drawings[PLANE] = partial(plotting.parameter_plane, eset)
    for each in outcome.routes:
        drawings |= _drawings_of_route(outcome, each)
    return drawings


def _drawings_of_route(outcome: Outcome, each: RouteOutcome) -> dict[str, Callable[[], Axes]]:
    names, route = route_figures(each.name), each.route
    plane = partial(plotting.parameter_plane, outcome.equilibrium_set, route)
    if not each.arrived:
        return {names.plane: plane}
    return {
        names.plane: plane,
        names.shapes: partial(plotting.shapes, route),
        names.margins: partial(plotting.margins, route),
    }

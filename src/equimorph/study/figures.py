"""Which figures a study gets, and what their files are called."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from matplotlib.axes import Axes

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.study.folder import ResultsFolder
from equimorph.study.names import PLANE, STABLE_PLANE, SURFACE, map_files, route_figures
from equimorph.study.outcome import MapOutcome, Outcome, RouteOutcome
from equimorph.tasks import CurvatureMap, LimitLoadMap


@dataclass(frozen=True)
class Figure:
    """A figure of a study: its files, and how they get into a folder."""

    files: tuple[str, ...]
    draw: Callable[[Path], None]


def draw_figures(outcome: Outcome, folder: ResultsFolder, progress: Progress) -> None:
    """Draw all figures of an outcome that the folder does not hold yet.

    Parameters
    ----------
    outcome
        What was found.
    folder
        Where the files go, figure by figure.
    progress
        Told how far the drawing is.
    """
    figures = _figures(outcome)
    for done, figure in enumerate(figures):
        progress.report("figures", done, len(figures))
        if not folder.holds(figure.files):
            with folder.adding() as staging:
                figure.draw(staging)
    progress.report("figures", len(figures), len(figures))


def _figures(outcome: Outcome) -> list[Figure]:
    eset = outcome.equilibrium_set
    of_set = [] if eset is None else _figures_of_set(outcome, eset)
    return [*of_set, *(_figure_of_map(each) for each in outcome.maps)]


def _figures_of_set(outcome: Outcome, eset: EquilibriumSet) -> list[Figure]:
    arrived = [each for each in outcome.routes if each.arrived]
    first = arrived[0].route if arrived else None
    height = outcome.problem.height
    figures = [
        _still(SURFACE, partial(plotting.surface, eset, height, route=first)),
        _still(STABLE_PLANE, partial(plotting.parameter_plane, eset, count="stable")),
    ]
    # With routes, each of them is shown on this plane; once more without it would say nothing new.
    if not outcome.routes:
        figures.append(_still(PLANE, partial(plotting.parameter_plane, eset)))
    for each in outcome.routes:
        figures += _figures_of_route(eset, each)
    return figures


def _figure_of_map(each: MapOutcome) -> Figure:
    def draw() -> Axes:
        if isinstance(each.map, CurvatureMap):
            return plotting.curvature_map(each.map)
        assert isinstance(each.map, LimitLoadMap)
        return plotting.load_map(each.map)

    return _still(map_files(each.name), draw)


def _figures_of_route(eset: EquilibriumSet, each: RouteOutcome) -> list[Figure]:
    names, route = route_figures(each.name), each.route
    plane = _still(names.plane, partial(plotting.parameter_plane, eset, route))
    if not each.arrived:
        return [plane]
    return [
        plane,
        _still(names.shapes, partial(plotting.shapes, route)),
        _still(names.margins, partial(plotting.margins, route)),
        Figure((names.film,), lambda folder: _draw_film(eset, each, folder)),
    ]


def _still(name: str, draw: Callable[[], Axes]) -> Figure:
    def into(folder: Path) -> None:
        plotting.save(draw(), folder, name)

    return Figure((f"{name}.png", f"{name}.svg"), into)


def _draw_film(eset: EquilibriumSet, each: RouteOutcome, folder: Path) -> None:
    path = folder / route_figures(each.name).film
    plotting.film(each.route, path, eset=eset)

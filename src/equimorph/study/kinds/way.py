"""What kinds have in common whose answer is a way on the set."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.kinds.kind import Figure, still
from equimorph.study.names import route_figures
from equimorph.tasks import Route


def figures_of_way(eset: EquilibriumSet | None, name: str, route: Route) -> Sequence[Figure]:
    """Shapes and margins; the plane (alone if refused) and a film over two parameters.

    Over fewer or more, the parameters that move instead.
    """
    names = route_figures(name)
    shapes = still(names.shapes, partial(plotting.shapes, route))
    margins = still(names.margins, partial(plotting.margins, route))
    if eset is None or len(eset.names) != 2:
        if not route.arrived or route.schedule is None:
            return []
        moves = still(names.parameters, partial(plotting.schedule_strips, route.schedule))
        return [moves, shapes, margins]
    plane = still(names.plane, partial(plotting.parameter_plane, eset, route))
    film = Figure((names.film,), partial(_draw_film, eset, route, names.film))
    return [plane, shapes, margins, film] if route.arrived else [plane]


def pictures_of_way(folder: Path, name: str, what: str) -> str:
    """Those of the figures that there are, with captions; `what` is "route" or "motion"."""
    names = route_figures(name)
    captions = {
        f"{names.plane}.png": f"The {what} on the plane of the free parameters.",
        f"{names.parameters}.png": f"Parameters that move along the {what}.",
        f"{names.shapes}.png": f"Shapes at equal steps along the {what}, start to goal.",
        f"{names.margins}.png": f"How far each state is from instability along the {what}.",
    }
    return html.pictures(folder, {names.film: f"The structure along the {what}."}, captions)


def _draw_film(eset: EquilibriumSet, route: Route, name: str, folder: Path) -> None:
    plotting.film(route, folder / name, eset=eset)

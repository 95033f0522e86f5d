"""`explore`: an equilibrium set as one offline page.

See docs/decisions.md, "The explorer is one page of its own".
"""

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from equimorph.argument_checks import check_arguments
from equimorph.charts import Reduction
from equimorph.errors import InputError
from equimorph.explorer.contents import Question, contents
from equimorph.explorer.pictures import json_in_html, pack
from equimorph.manifold import EquilibriumSet, SetBarriers, SnapGraph, snap_graph
from equimorph.model import Descriptor, Progress
from equimorph.storage.files import write_text
from equimorph.tasks.route import Route

SCRIPT = "explorer.min.js"
"""Program of the page, which ``make explorer`` builds from the folder ``explorer``."""


@check_arguments
def explore(
    eset: EquilibriumSet | SetBarriers,
    route: Route | Mapping[str, Route] | None = None,
    path: str | Path = "explorer.html",
    *,
    title: str | None = None,
    descriptors: Sequence[Descriptor] = (),
    reduction: Reduction | None = None,
    snaps: SnapGraph | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a page in which a person can turn a set, walk on it, and judge routes.

    The page is one file that loads nothing else. It shows the set over its parameters with folds,
    constraint boundaries, barriers and routes, the shape of any state on it, and its numbers with
    their units. Between vertices states are interpolated, and the page says so; what it says of
    way-points that are drawn there is coarse, and it exports them as a study file.

    Parameters
    ----------
    eset
        Equilibrium set over one, two or three free parameters, with at least one cell; or energy
        barriers over one: the page then draws, too, at which energies the stable states over the
        same parameters join, with a slider for each parameter.
    route
        A route, or several by name, to play and to scrub; a refused one is shown as far as it goes.
    path
        The page, whose name ends in ``.html``; a file there is replaced.
    title
        Heading; by default the kind of the structure.
    descriptors
        Further scalars for heights, colours and numbers. The page has the elevation of the
        structure, those of the constraints, the margins, the energy and the efforts of actuators.
    reduction
        Its barriers are drawn.
    snaps
        Where snaps lead; by default `snap_graph` of the set.
    progress
        Sink for progress reports of the snap graph.

    Returns
    -------
    The path of the page.

    Raises
    ------
    InputError
        If the set is empty, the name does not end in ``.html``, a route, a descriptor or
        the reduction is of another structure, the snap graph of another set, or the file cannot
        be written.
    """
    barriers, shown = (eset, eset.eset) if isinstance(eset, SetBarriers) else (None, eset)
    place = Path(path)
    if place.suffix != ".html":
        raise InputError(f"`path` must end in .html; got {str(path)!r}.")
    if not len(shown.cells):
        raise InputError("`eset` must have cells to be shown; got an empty set.")
    if snaps is not None and snaps.eset is not shown:
        raise InputError(f"`snaps` must be of `eset`; got those of {snaps.eset}.")
    routes = {"route": route} if isinstance(route, Route) else dict(route or {})
    graph = snaps or snap_graph(shown, progress=progress)
    heading = title or f"Equilibrium set of a {shown.structure.kind}"
    asked = Question(shown, routes, graph, reduction, barriers, tuple(descriptors), heading)
    write_text(place, _page(asked))
    return place


def _page(asked: Question) -> str:
    """The whole page as text."""
    words, arrays = contents(asked)
    directory, packed = pack(arrays)
    program = files("equimorph.explorer").joinpath(SCRIPT).read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:\">\n"
        f"<title>{escape(asked.title)}</title>\n</head>\n<body>\n"
        '<noscript>This page needs JavaScript.</noscript>\n<main id="explorer"></main>\n'
        f'<script type="application/json" id="words">'
        f"{json_in_html({**words, 'directory': directory})}</script>\n"
        f'<script type="text/plain" id="arrays">{packed}</script>\n'
        f"<script>\n{program}</script>\n</body>\n</html>\n"
    )

"""Which figures a study gets, and what their files are called."""

from functools import partial

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.study.folder import ResultsFolder
from equimorph.study.names import DIAGRAM, PLANE, STABLE_PLANE, SURFACE
from equimorph.study.prepare import Outcome
from equimorph.study.question import Figure, still


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
    figures = [] if eset is None else _figures_of_set(outcome, eset)
    for each in outcome.answers:
        figures += each.question.kind.figures(each.question, eset, each.answer)
    return figures


def _figures_of_set(outcome: Outcome, eset: EquilibriumSet) -> list[Figure]:
    height = outcome.problem.ground.height
    if len(eset.names) == 1:
        return [still(DIAGRAM, partial(plotting.diagram, eset, height))]
    if len(eset.names) == 3:
        return []
    routes = [found[0] for found in outcome.of("route").values()]
    first = next((route for route in routes if route.arrived), None)
    figures = [
        still(SURFACE, partial(plotting.surface, eset, height, route=first)),
        still(STABLE_PLANE, partial(plotting.parameter_plane, eset, count="stable")),
    ]
    # With routes, each of them is shown on this plane; once more without it would say nothing new.
    if not routes:
        figures.append(still(PLANE, partial(plotting.parameter_plane, eset)))
    return figures

"""Run a study: compute, store, draw, report."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Progress, Silent
from equimorph.storage import read_results, write_results, write_schedule
from equimorph.study.choose import choose_state
from equimorph.study.figures import draw_figures
from equimorph.study.folder import RESULTS, ResultsFolder, open_results_folder
from equimorph.study.outcome import Outcome, RouteOutcome
from equimorph.study.prepare import Problem, Task, at_key, prepare
from equimorph.study.problem import Study, parse_study, read_study_text
from equimorph.study.report import report
from equimorph.tasks import plan

INPUT_COPY = "study.toml"
REPORT = "index.html"
FIGURE_SECONDS = "figures"


def run_study(
    path: Path, out: Path, *, replace: bool = False, progress: Progress | None = None
) -> Outcome:
    """Run a study file into a results folder.

    Everything is stored as soon as it is known. A set that an earlier run left in the folder is
    read instead of computed, if it was asked for in the same words.

    Parameters
    ----------
    path
        The study file.
    out
        The results folder; made if it does not exist.
    replace
        Replace the results of another study, or of an earlier version of this one.
    progress
        Told how far the run is.

    Returns
    -------
    All answers; a route that is refused is an answer.

    Raises
    ------
    InputError
        For a wrong study file, a start or goal that is no stable equilibrium, or a folder that
        cannot be written or holds something else.
    """
    sink = progress or Silent()
    text = read_study_text(path)
    study = parse_study(text, path.name)
    problem = prepare(study)
    folder = open_results_folder(out, study, replace=replace)
    folder.add_text(INPUT_COPY, text)
    outcome = solve(study, problem, folder, sink)
    with _timed(outcome.seconds, FIGURE_SECONDS), folder.adding() as staging:
        draw_figures(outcome, staging, sink)
    with folder.adding() as staging:
        page = report(outcome, folder.path, text, study.title or path.stem)
        (staging / REPORT).write_text(page, encoding="utf-8")
    return outcome


def solve(study: Study, problem: Problem, folder: ResultsFolder, progress: Progress) -> Outcome:
    """Compute everything that a study asks for, and store it in the folder.

    Parameters
    ----------
    study, problem
        What is asked, as written and as objects.
    folder
        Where results go and where an earlier set may be.
    progress
        Told how far the run is.
    """
    seconds: dict[str, float] = {}
    with _timed(seconds, "equilibrium set"):
        eset, reused = _equilibrium_set(study, problem, folder, progress)
    with _timed(seconds, "equilibria"):
        points = tuple(eset.at(**point) for point in problem.points)
    routes = []
    for i, task in enumerate(problem.tasks):
        progress.report("routes", i, len(problem.tasks))
        with _timed(seconds, f"route {task.section.name}"):
            routes.append(_route(eset, problem, task))
    progress.report("routes", len(routes), len(routes))
    _store_routes(eset, problem, routes, folder)
    return Outcome(study, problem, eset, points, tuple(routes), reused, seconds)


def _equilibrium_set(
    study: Study, problem: Problem, folder: ResultsFolder, progress: Progress
) -> tuple[EquilibriumSet, bool]:
    """Set of an earlier run if it can be read, else a new one; and whether it was read."""
    if folder.holds(RESULTS):
        try:
            return read_results(folder.path / RESULTS).equilibrium_set, True
        except InputError:
            # A damaged file of ours is no loss: the set is computed again and replaces it.
            pass
    # What the study leaves out takes the library's default.
    intervals = study.equilibrium_set.intervals
    options: dict[str, Any] = {} if intervals is None else {"intervals": tuple(intervals)}
    with at_key("set"):
        eset = equilibrium_set(
            problem.structure,
            problem.box,
            fixed=problem.fixed,
            within=problem.constraints,
            progress=progress,
            **options,
        )
    with folder.adding() as staging:
        write_results(staging / RESULTS, eset, problem.height)
    return eset, False


def _route(eset: EquilibriumSet, problem: Problem, task: Task) -> RouteOutcome:
    section = task.section
    start = choose_state(eset, section.start, f"{task.key}.start")
    goal = choose_state(eset, section.goal, f"{task.key}.goal")
    with at_key(task.key):
        route = plan(
            eset,
            start,
            goal,
            via=section.via,
            within=task.constraints,
            margin=section.margin,
            monitor=[problem.height],
        )
    return RouteOutcome(task, start, goal, route)


def _store_routes(
    eset: EquilibriumSet, problem: Problem, routes: list[RouteOutcome], folder: ResultsFolder
) -> None:
    with folder.adding() as staging:
        named = {each.name: each.route for each in routes}
        write_results(staging / RESULTS, eset, problem.height, named)
        for each in routes:
            if each.route.schedule is not None:
                write_schedule(each.route.schedule, staging / f"{each.name}-schedule.csv")


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Generator[None]:
    start = perf_counter()
    yield
    seconds[stage] = perf_counter() - start

"""Run a study: compute, store, draw, report."""

from collections.abc import Generator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Progress, Silent
from equimorph.storage import write_map, write_results, write_schedule
from equimorph.storage.files import read_text
from equimorph.storage.parts import JOURNEY_PART, STATES_PART, Journey, set_part
from equimorph.structures import States
from equimorph.study.checkpoints import Checkpoints
from equimorph.study.choose import choose_state
from equimorph.study.figures import draw_figures
from equimorph.study.folder import ResultsFolder, open_results_folder
from equimorph.study.maps import answered_map
from equimorph.study.memory import MemoryWatch, check_memory
from equimorph.study.names import INPUT_COPY, REPORT, RESULTS, map_files, schedule_table
from equimorph.study.outcome import Outcome, RouteOutcome
from equimorph.study.prepare import Problem, SetTask, Task, at_key, prepare
from equimorph.study.problem import Study, parse_study, read_study_text
from equimorph.study.report import report
from equimorph.tasks import plan


def run_study(
    path: Path, out: Path, *, replace: bool = False, progress: Progress | None = None
) -> Outcome:
    """Run a study file into a results folder.

    Every answer (the set, the equilibria at a point, a route) and every figure is stored as soon as
    it is known. A run that was interrupted, however abruptly, is continued by running it again.

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
        For a wrong study file, one that needs more memory than there is, a start or goal that is no
        stable equilibrium, or a folder that cannot be written, is in use, or holds something else.
    """
    sink = MemoryWatch(progress or Silent())
    text, study, problem = read_problem(path)
    with open_results_folder(out, study, replace=replace) as folder:
        outcome = solve(study, problem, folder, sink)
        same_words = folder.holds([INPUT_COPY]) and read_text(out / INPUT_COPY) == text
        _store(outcome, folder, text)
        with _timed(outcome.seconds, "figures"):
            draw_figures(outcome, folder, sink)
        # The page of a run that had finished tells how long the answers took.
        if not (same_words and folder.holds([REPORT])):
            with folder.adding() as staging:
                page = report(outcome, folder.path, text, study.title or path.stem)
                (staging / REPORT).write_text(page, encoding="utf-8")
    return outcome


def read_problem(path: Path) -> tuple[str, Study, Problem]:
    """Read a study file that can be run here.

    Returns
    -------
    Its text, what it says, and the objects that it stands for.

    Raises
    ------
    InputError
        For a wrong study file, or one that needs more memory than there is.
    """
    text = read_study_text(path)
    study = parse_study(text, path.name)
    try:
        problem = prepare(study)
        check_memory(problem)
    except InputError as error:
        raise InputError(f"{path.name}: {error}") from error
    return text, study, problem


def solve(study: Study, problem: Problem, folder: ResultsFolder, progress: Progress) -> Outcome:
    """Answer everything that a study asks for.

    Parameters
    ----------
    study, problem
        What is asked, as written and as objects.
    folder
        Where answers are kept, and where earlier ones may be.
    progress
        Told how far the run is.
    """
    seconds: dict[str, float] = {}
    answers = Checkpoints(folder, problem.structure)
    eset: EquilibriumSet | None = None
    reused = False
    points: tuple[States, ...] = ()
    routes: list[RouteOutcome] = []
    if problem.equilibrium_set is not None:
        with _timed(seconds, "equilibrium set"):
            eset = _equilibrium_set(study, problem, problem.equilibrium_set, answers, progress)
        reused = bool(answers.found)
        with _timed(seconds, "equilibria"):
            points = tuple(_equilibria(study, eset, point, answers) for point in problem.points)
        for i, task in enumerate(problem.tasks):
            progress.report("routes", i, len(problem.tasks))
            with _timed(seconds, f"route {task.section.name}"):
                routes.append(_route(study, problem, eset, task, answers))
        progress.report("routes", len(routes), len(routes))
    maps = []
    for map_task in problem.maps:
        with _timed(seconds, f"map {map_task.section.name}"):
            maps.append(answered_map(problem.structure, map_task, answers, progress))
    answers.forget_others()
    return Outcome(study, problem, eset, points, tuple(routes), tuple(maps), reused, seconds)


def _set_question(study: Study) -> dict[str, Any]:
    """Return all that the equilibrium set depends on."""
    asked = study.model_dump(mode="json", by_alias=True)
    return {"version": version("equimorph"), "structure": asked["structure"], "set": asked["set"]}


def _equilibrium_set(
    study: Study, problem: Problem, wanted: SetTask, answers: Checkpoints, progress: Progress
) -> EquilibriumSet:
    def compute() -> EquilibriumSet:
        with at_key("set"):
            return equilibrium_set(
                problem.structure,
                wanted.box,
                fixed=wanted.fixed,
                within=wanted.constraints,
                intervals=wanted.intervals,
                progress=progress,
            )

    return answers.answer(_set_question(study), set_part(problem.height), compute)


def _equilibria(
    study: Study, eset: EquilibriumSet, point: dict[str, float], answers: Checkpoints
) -> States:
    question = {**_set_question(study), "at": point}
    return answers.answer(question, STATES_PART, lambda: eset.at(**point))


def _route(
    study: Study, problem: Problem, eset: EquilibriumSet, task: Task, answers: Checkpoints
) -> RouteOutcome:
    section = task.section

    def compute() -> Journey:
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
        return start, goal, route

    asked = section.model_dump(mode="json", exclude={"name"})
    question = {**_set_question(study), "route": asked}
    return RouteOutcome(task, *answers.answer(question, JOURNEY_PART, compute))


def _store(outcome: Outcome, folder: ResultsFolder, text: str) -> None:
    """Put the answers into the folder, as data for people and programs."""
    with folder.adding() as staging:
        (staging / INPUT_COPY).write_text(text, encoding="utf-8")
        for each in outcome.routes:
            if each.route.schedule is not None:
                write_schedule(each.route.schedule, staging / schedule_table(each.name))
        for amap in outcome.maps:
            write_map(amap.map, staging / f"{map_files(amap.name)}.csv")
        if not folder.holds([RESULTS]):
            maps = {amap.name: amap.map for amap in outcome.maps}
            routes = {each.name: each.route for each in outcome.routes}
            eset, height = outcome.equilibrium_set, outcome.problem.height
            write_results(staging / RESULTS, eset, height, routes, outcome.points, maps)


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Generator[None]:
    start = perf_counter()
    yield
    seconds[stage] = perf_counter() - start

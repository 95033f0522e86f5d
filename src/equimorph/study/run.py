"""Run a study: compute, store, draw, report."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar, cast

from pydantic import ValidationError

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.logs import log_of
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Descriptor, Progress, Silent, Workers
from equimorph.storage import write_results
from equimorph.storage.files import checksum, fingerprint, link_file, move_whole, read_text
from equimorph.storage.records import content_of, load_record
from equimorph.structures import States, Structure
from equimorph.study.complaint import StudyError, lines_of
from equimorph.study.folder import ResultsFolder, open_results_folder, writable
from equimorph.study.lookup import Extent, Ground, at_key
from equimorph.study.memory import MemoryWatch, check_memory
from equimorph.study.prepare import Answered, Outcome, Problem, prepare
from equimorph.study.problem import Study, parse_study, read_study_text, sound_part
from equimorph.study.question import GRID, INPUT_COPY, REPORT, RESULTS, Question, route_name
from equimorph.study.report import draw_figures, report
from equimorph.tasks.route import Route

LOG = log_of(__name__)
Answer = TypeVar("Answer")


@dataclass
class Checkpoints:
    """Answers in a hidden part of a results folder, to go on from after any interruption.

    An answer's file is named after a fingerprint of its question and a checksum of its content. It
    is found by asking the same question again, in this study or an edited one; a damaged file is
    not read.
    """

    results: ResultsFolder
    """The results folder, open."""
    structure: Structure
    """To which the answers belong."""
    descriptors: Mapping[str, Descriptor] = field(default_factory=dict)
    """Beside those of the structure, by name."""
    asked: set[str] = field(default_factory=set)
    """Fingerprints of the questions of this run so far."""
    found: set[str] = field(default_factory=set)
    """Those whose answers were there already."""

    def answer(self, question: dict[str, Any], compute: Callable[[], Answer]) -> Answer:
        """Return the stored answer to a question; without one, compute it and store it.

        The answer is always the one read from the file, so that a run that was interrupted goes on
        from the very numbers that it would have had.

        `question`: all that the answer depends on, as plain data. `compute`: finds the answer.
        Raises `InputError` if the folder cannot be written.
        """
        key = fingerprint(question)
        self.asked.add(key)
        for file in self.results.checkpoints.glob(f"{key}-*"):
            found = self._load(file)
            if found is not None:
                self.found.add(key)
                LOG.info("answer %s read from an earlier run", file.name)
                (kept,) = found
                return cast(Answer, kept)
            file.unlink()
        file = self._store(key, content_of(compute()))
        return cast(Answer, load_record(file, self.structure, self.descriptors))

    def forget_others(self) -> None:
        """Remove answers to questions that this run did not ask."""
        for file in self.results.checkpoints.iterdir():
            if file.name.partition("-")[0] not in self.asked:
                file.unlink()

    def _store(self, key: str, content: bytes) -> Path:
        file = self.results.checkpoints / f"{key}-{checksum(content)}"
        partial = self.results.checkpoints / "partial"
        with writable(self.results.path):
            partial.write_bytes(content)
            move_whole(partial, file)
        return file

    def _load(self, file: Path) -> tuple[Any] | None:
        """Return the answer in a file, unless it is damaged or of another release."""
        if not file.name.endswith(checksum(file.read_bytes())):
            return None
        try:
            return (load_record(file, self.structure, self.descriptors),)
        except InputError:
            return None


@check_arguments
def run_study(
    path: Path,
    out: Path,
    *,
    replace: bool = False,
    progress: Progress | None = None,
    workers: Workers | None = None,
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
        Receives the progress of the run.
    workers
        Who lifts the tiles of the set, and computes the rays of maps and the trials; see `Workers`.

    Returns
    -------
    All answers; a route that is refused is an answer.

    Raises
    ------
    InputError
        If the study file is wrong or needs more memory than there is, a start or goal is not a
        stable equilibrium, or the folder cannot be written, is in use, or holds something else.
    """
    sink = MemoryWatch(progress or Silent())
    text, study, problem = read_problem(path)
    with open_results_folder(out, study, replace=replace) as folder:
        outcome = solve(study, problem, folder, sink, workers)
        same_words = folder.holds([INPUT_COPY]) and read_text(out / INPUT_COPY) == text
        _store(outcome, folder, text)
        with _measure_time(outcome.seconds, "figures"):
            draw_figures(outcome, folder, sink)
        # The page of a finished run gives the times of the answers.
        if not (same_words and folder.holds([REPORT])):
            with folder.adding() as staging:
                page = report(outcome, folder.path, text, study.title or path.stem)
                (staging / REPORT).write_text(page, encoding="utf-8")
    return outcome


@check_arguments
def read_problem(path: Path) -> tuple[str, Study, Problem]:
    """Read a study file that can be run here.

    Returns
    -------
    Its text, what it says, and the objects that it stands for.

    Raises
    ------
    InputError
        If the study file cannot be read or needs more memory than there is.
    StudyError
        If the study is wrong: with a line for every mistake.
    """
    text = read_study_text(path)
    try:
        study = parse_study(text, path.name, path.parent)
    except StudyError as error:
        raise StudyError([*error.lines, *_further_mistakes(text, path, error)]) from error
    return text, study, _prepare(study, path.name)


def _prepare(study: Study, name: str, places: Mapping[str, Sequence[int]] | None = None) -> Problem:
    """Look up all names of a study that fits into memory; mistakes begin with the file."""
    try:
        problem = prepare(study, places)
        check_memory(problem)
    except InputError as error:
        raise StudyError([f"{name}: {line}" for line in lines_of(error)]) from error
    return problem


def _further_mistakes(text: str, path: Path, error: StudyError) -> Sequence[str]:
    """Mistakes in those tables whose keys and types are right."""
    assert isinstance(error.__cause__, ValidationError)
    sound = sound_part(text, error.__cause__, path.parent)
    try:
        if sound is not None:
            _prepare(sound.study, path.name, sound.places)
    except StudyError as further:
        return further.lines
    return ()


def solve(
    study: Study,
    problem: Problem,
    folder: ResultsFolder,
    progress: Progress,
    workers: Workers | None = None,
) -> Outcome:
    """Answer everything that a study asks for.

    Answers are kept in the folder, where earlier ones may be. Workers lift the tiles of the set,
    and compute the rays of maps and the trials.
    """
    seconds: dict[str, float] = {}
    checkpoints = Checkpoints(folder, problem.structure)
    eset: EquilibriumSet | None = None
    reused = False
    points: tuple[States, ...] = ()
    ground = problem.ground
    if ground.extent is not None:
        with _measure_time(seconds, "equilibrium set"):
            compute = partial(_lift_set, ground, ground.extent, progress, workers)
            eset = checkpoints.answer(_question(study, of_set=True), compute)
        reused = bool(checkpoints.found)
        problem = problem.on(eset)
        checkpoints = replace(checkpoints, descriptors=problem.ground.descriptors)
        with _measure_time(seconds, "equilibria"):
            points = tuple(_equilibria(study, eset, at, checkpoints) for at in problem.points)
    answers = []
    count = len(problem.questions)
    for done, question in enumerate(problem.questions):
        progress.report("questions", done, count)
        with _measure_time(seconds, f"{question.kind.table} {question.name}"):
            compute = partial(question.answer, progress, workers)
            answers.append(_answer(study, question, checkpoints, compute))
    progress.report("questions", count, count)
    checkpoints.forget_others()
    return Outcome(study, problem, eset, points, tuple(answers), reused, seconds)


def _question(study: Study, *, of_set: bool) -> dict[str, Any]:
    """Return what an answer depends on: the structure, and the set if the question needs it."""
    asked = study.model_dump(mode="json", by_alias=True)
    base = {"version": version("equimorph"), "structure": asked["structure"]}
    return base | {"set": asked["set"]} if of_set else base


def _lift_set(
    ground: Ground, extent: Extent, progress: Progress, workers: Workers | None
) -> EquilibriumSet:
    with at_key("set"):
        return equilibrium_set(
            ground.structure,
            extent.box,
            fixed=extent.fixed,
            within=extent.constraints,
            intervals=extent.intervals,
            **extent.options,
            progress=progress,
            workers=workers,
        )


def _equilibria(
    study: Study, eset: EquilibriumSet, point: dict[str, float], checkpoints: Checkpoints
) -> States:
    question = {**_question(study, of_set=True), "at": point}
    return checkpoints.answer(question, lambda: eset.at(**point))


def _answer(
    study: Study,
    question: Question,
    checkpoints: Checkpoints,
    compute: Callable[[], Any],
) -> Answered:
    kind, section = question.kind, question.section
    words = section.model_dump(mode="json", exclude={"name"})
    asked = {**_question(study, of_set=kind.needs_set(section)), kind.table: words}
    return Answered(question, checkpoints.answer(asked, compute))


def _store(outcome: Outcome, folder: ResultsFolder, text: str) -> None:
    """Put the answers into the folder, as data for people and programs."""
    with folder.adding() as staging:
        (staging / INPUT_COPY).write_text(text, encoding="utf-8")
        for each in outcome.answers:
            each.question.kind.write_files(each.question, each.answer, staging)
        names = [RESULTS] if outcome.equilibrium_set is None else [RESULTS, GRID]
        if not folder.holds(names):
            _write_results(outcome, staging / RESULTS)
            for name in names[1:]:
                link_file(staging / RESULTS, staging / name)


def _write_results(outcome: Outcome, path: Path) -> None:
    """Write all answers as one file: routes and maps in separate groups."""
    routes: dict[str, Route] = {}
    for name, found in outcome.of("route").items():
        routes |= {route_name(name, k): each for k, each in enumerate(found, 1)}
    answers: dict[str, dict[str, Any]] = {}
    for each in outcome.answers:
        table = each.question.kind.table
        if table not in ("route", "map"):
            answers.setdefault(table, {})[each.name] = each.answer
    write_results(
        path,
        outcome.equilibrium_set,
        outcome.problem.ground.height,
        routes,
        outcome.points,
        outcome.of("map"),
        answers=answers,
        structure=outcome.problem.structure,
    )


@contextmanager
def _measure_time(seconds: dict[str, float], stage: str) -> Generator[None]:
    LOG.info("%s: begun", stage)
    start = perf_counter()
    yield
    seconds[stage] = perf_counter() - start
    LOG.info("%s: done in %.2f s", stage, seconds[stage])

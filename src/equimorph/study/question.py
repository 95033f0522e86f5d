"""Questions of a study: sections and look-ups come from the signature of a task.

A kind of question names its task and says what was found; where there is more to show, it draws
figures and gives tables. What a user may write, the defaults, and how names become objects follow
from the task's signature, see `arguments`; what each key means, from its docstring. Page, screen
and files follow from what the kind says.
"""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from html import escape
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawn
from pydantic import create_model, model_validator
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Progress, Schedule, Workers
from equimorph.plotting.film import convert, suffixes
from equimorph.storage import write_schedule
from equimorph.storage.files import write_csv
from equimorph.structures import Structure
from equimorph.study import html
from equimorph.study.arguments import Argument
from equimorph.study.complaint import Findings
from equimorph.study.fields import TaskSection
from equimorph.study.lookup import Extent, Ground, Later, at_key
from equimorph.study.signatures import arguments_of
from equimorph.tables import Table

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


A = TypeVar("A")
Drawing = Axes | Drawn


@dataclass(frozen=True)
class Figure:
    """A figure of a study."""

    files: tuple[str, ...]
    """Names of its files; the page shows the first."""
    draw: Callable[[Path], None]
    """Draws it into a folder."""
    caption: str
    """What the page says below it, as plain text."""
    wide: bool = False
    """Whether it takes a whole row of the page."""


def still(name: str, draw: Callable[[], Drawing], caption: str, *, wide: bool = False) -> Figure:
    """Figure that does not move, as PNG and SVG."""
    return Figure((f"{name}.png", f"{name}.svg"), partial(_save, draw, name), caption, wide)


def _save(draw: Callable[[], Drawing], name: str, folder: Path) -> None:
    plotting.save(draw(), folder, name)


def moving(name: str, draw: Callable[[Path], object], caption: str) -> Figure:
    """Figure that moves, as GIF and, where ffmpeg is there, as MP4; it takes a whole row."""
    files = tuple(name + suffix for suffix in suffixes())
    return Figure(files, partial(_film, draw, files), caption, wide=True)


def _film(draw: Callable[[Path], object], files: tuple[str, ...], folder: Path) -> None:
    gif, *others = (folder / each for each in files)
    draw(gif)
    for other in others:
        convert(gif, other)


def pictures(folder: Path, figures: Sequence[Figure]) -> list[str]:
    """Pieces of the page with those of some figures that are in the folder."""
    wide = {each.files[0]: each.caption for each in figures if each.wide}
    small = {each.files[0]: each.caption for each in figures if not each.wide}
    return [html.pictures(folder, wide, small)] if figures else []


@dataclass(frozen=True)
class DataTable:
    """A table for other programs: name of its file, what it holds, and the table itself."""

    file: str
    content: str
    table: Table


@dataclass(frozen=True)
class Question:
    """A question of a study, with its names looked up."""

    kind: "Kind[Any]"
    """Kind of the question."""
    key: str
    """Of its section in the file, for messages."""
    section: Any
    """As it is written."""
    ground: Ground
    """What all questions share."""
    values: Mapping[str, Any]
    """Arguments of the task, by name; states are chosen when the set is there."""
    extra: Any = None
    """Further objects that the kind looks up."""

    def __getitem__(self, name: str) -> Any:
        """Argument of the task; states are chosen from the set."""
        value = self.values[name]
        return value.on(self.ground) if isinstance(value, Later) else value

    @property
    def name(self) -> str:
        """Name in the file; files of the answer begin with it."""
        return str(self.section.name)

    @property
    def title(self) -> str:
        """Kind and name, as the page and the screen begin."""
        return f"{self.kind.table.replace('_', ' ').capitalize()} {self.name}"

    @property
    def files(self) -> str:
        """Beginning of the names of its files."""
        return task_files(self.kind.table, self.name)

    @property
    def structure(self) -> Structure:
        """Of the whole study."""
        return self.ground.structure

    @property
    def within(self) -> tuple[Constraint, ...]:
        """Constraints of this question alone."""
        return tuple(self.values["within"])

    @property
    def free(self) -> tuple[str, ...]:
        """Free parameters of the set."""
        return self.ground.box.names

    @property
    def eset(self) -> EquilibriumSet | None:
        """Set of the study, as soon as it is there."""
        return self.ground.eset

    def answer(self, sink: Progress, workers: Workers | None = None) -> Any:
        """Compute the answer; `InputError` names the key."""
        arguments = self._arguments(sink)
        arguments["workers"] = workers
        with at_key(self.key):
            return self.kind.answer(self, arguments)

    def _arguments(self, sink: Progress) -> "Arguments":
        """All arguments, with states and constraints of the set."""
        values = {name: self[name] for name in self.values}
        if self.kind.within_set and not isinstance(values.get("schedule"), Schedule):
            bounds = () if self.eset is None else self.eset.constraints
            values["within"] = tuple(dict.fromkeys((*bounds, *self.within)))
        monitor: list[Descriptor] = [self.ground.height]
        given = {
            "eset": self.eset, "structure": self.structure, "progress": sink, "monitor": monitor,
        }  # fmt: skip
        return Arguments(given | values)


class Arguments(dict[str, Any]):
    """Arguments by the names that tasks give them."""

    def of(self, task: Callable[..., Any]) -> dict[str, Any]:
        """Those that a task takes."""
        return {name: self[name] for name in inspect.signature(task).parameters if name in self}

    @property
    def eset(self) -> EquilibriumSet:
        """Set of the study, which there is where a question needs it."""
        assert isinstance(self["eset"], EquilibriumSet)
        return self["eset"]


class Kind(ABC, Generic[A]):
    """A kind of question: its task, and how an answer of type A is drawn and reported."""

    table: ClassVar[str]
    """Its tables in the file are ``[[table]]``."""
    tasks: ClassVar[tuple[Callable[..., Any], ...]]
    """What is computed; the section has a key for each argument of each."""
    names: ClassVar[Mapping[str, str]] = {}
    """Keys of arguments that are called otherwise in studies."""
    left_out: ClassVar[Sequence[str]] = ()
    """Arguments that no key gives."""
    own: ClassVar[Mapping[str, Any]] = {}
    """Further keys, or keys with other types, as pydantic takes them: (type, default)."""
    natural: ClassVar[bool] = False
    """Whether states come from natural ones, not from the set."""
    within_set: ClassVar[bool] = False
    """Whether constraints of the set hold, too, where the task does not get the set itself."""

    @cached_property
    def arguments(self) -> tuple[Argument, ...]:
        """Arguments of its tasks that a study gives."""
        found: dict[str, Argument] = {}
        for task in self.tasks:
            for each in arguments_of(task, self.names, self.left_out, natural=self.natural):
                found.setdefault(each.name, each)
        return tuple(found.values())

    @cached_property
    def section(self) -> type[TaskSection]:
        """What may be written."""
        keys: dict[str, Any] = {}
        for each in self.arguments:
            keys |= each.keys()
        keys |= self.own

        def check(section: Any) -> Any:
            for each in self.arguments:
                each.check(section)
            self.check(section)
            return section

        hooks: dict[str, Any] = {"_go_together": model_validator(mode="after")(check)}
        section: type[TaskSection] = create_model(
            f"{self.table}_section", __base__=TaskSection, __doc__=self.__doc__,
            __validators__=hooks, **keys,
        )  # fmt: skip
        return section

    @cached_property
    def takes_set(self) -> bool:
        """Whether a task takes the set itself."""
        parameters = [each for task in self.tasks for each in inspect.signature(task).parameters]
        return "eset" in parameters

    def needs_set(self, section: Any) -> bool:
        """Whether it needs the set of the study."""
        return self.takes_set or any(each.needs_set(section) for each in self.arguments)

    def stems(self, section: Any) -> list[str]:
        """Beginnings of the names of its files, which no other question may have."""
        return [task_files(self.table, section.name)]

    def check(self, section: Any) -> None:  # for kinds with keys that depend on each other
        """Refuse values of several keys that do not go together."""

    def look_up(self, ground: Ground, section: Any, key: str) -> Question:
        """Look up all names of a section; `InputError` names the key of what does not fit."""
        findings, values = Findings(), dict[str, Any]()
        for each in self.arguments:
            with findings.collect():
                values[each.name] = each.look_up(ground, section, key)
        findings.refuse()
        question = Question(self, key, section, ground, values)
        return replace(question, extra=self.look_up_more(question))

    def look_up_more(self, question: Question) -> Any:
        """Look up, or refuse, what follows from no type."""
        return None

    def extent(self, question: Question) -> Extent | None:  # of kinds with a separate grid
        """Grid that the answer needs in addition to that of the set."""
        return None

    def answer(self, question: Question, arguments: Arguments) -> A:
        """Compute the answer."""
        task = self.tasks[0]
        answer: A = task(**arguments.of(task))
        return answer

    def figures(self, question: Question, answer: A) -> Sequence[Figure]:
        """Figures of the answer."""
        return ()

    def tables(self, question: Question, answer: A) -> Sequence[DataTable]:
        """What people open with other programs."""
        return ()

    def schedules(self, question: Question, answer: A) -> Mapping[str, Schedule]:
        """Schedules by what the names of their files begin with."""
        found = getattr(answer, "schedule", None)
        return {} if found is None else {question.files: found}

    @abstractmethod
    def words(self, question: Question, answer: A) -> str:
        """Say what was found, in one paragraph for page and screen; ``**found**`` is bold there."""

    def details(self, question: Question, answer: A) -> list[str]:
        """Further pieces of the page, like tables."""
        return []

    def refusal(self, question: Question, answer: A) -> str:
        """Say why the question was refused; empty if it was answered."""
        status = getattr(answer, "status", "")  # maps have one for each setting
        is_refused = isinstance(status, str) and status == "refused"
        return str(getattr(answer, "why", "")) if is_refused else ""

    def write_files(self, question: Question, answer: A, folder: Path) -> None:
        """Write tables and schedules."""
        for table in self.tables(question, answer):
            write_csv(folder / table.file, table.table.rows())
        for name, schedule in self.schedules(question, answer).items():
            write_schedule(schedule, folder / schedule_table(name))

    def report(self, question: Question, answer: A, folder: Path) -> list[str]:
        """Pieces of the page; the figures are in the folder."""
        why = self.refusal(question, answer)
        return [
            f"<h2>{escape(question.title)}</h2>",
            html.refusal_line(why) if why else html.answer_line(self.words(question, answer)),
            *map(html.schedule_links, map(schedule_table, self.schedules(question, answer))),
            *pictures(folder, self.figures(question, answer)),
            *self.details(question, answer),
            *html.table_links({x.file: x.content for x in self.tables(question, answer)}),
        ]

    def line(self, question: Question, answer: A) -> str:
        """Return what was found or the refusal as one line for the screen, in rich's markup."""
        why = self.refusal(question, answer)
        words = f"**refused**. {why}" if why else self.words(question, answer)
        colour = "red" if why else "green"
        bold = rf"[bold {colour}]\1[/]"
        return f"{question.title}: {html.BOLD.sub(bold, plain(words), count=1)}"

"""What a kind of question of a study is: looked up, answered, kept, drawn and told."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawn

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.study.lookup import Extent, Ground
from equimorph.study.sections.fields import TaskSection

S = TypeVar("S", bound=TaskSection)
T = TypeVar("T")
A = TypeVar("A")
Drawing = Axes | Drawn


@dataclass(frozen=True)
class Figure:
    """A figure of a study: its files, and how they get into a folder."""

    files: tuple[str, ...]
    draw: Callable[[Path], None]


class Kind(ABC, Generic[S, T, A]):
    """A kind of question: from its section in the file to what the page says of the answer.

    S is its section, T its task (the section with all names looked up), A its answer.
    """

    table: ClassVar[str]
    """Its tables in the file are ``[[table]]``."""

    @abstractmethod
    def prepared(self, ground: Ground, section: S, key: str) -> T:
        """Look up the names of a section; `InputError` names the key of what does not fit."""

    def extent(self, task: T) -> Extent | None:  # of kinds with a grid of their own
        """Grid that the answer needs beside that of the set."""
        return None

    @abstractmethod
    def answer(self, ground: Ground, eset: EquilibriumSet | None, task: T, sink: Progress) -> A:
        """Compute the answer."""

    def write_tables(self, task: T, answer: A, folder: Path) -> None:
        """Write what people open with other programs."""

    @abstractmethod
    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: T, answer: A
    ) -> Sequence[Figure]:
        """Figures of the answer."""

    @abstractmethod
    def report(self, task: T, answer: A, folder: Path) -> list[str]:
        """Pieces of the page; the figures are in the folder."""

    @abstractmethod
    def verdict(self, task: T, answer: A) -> str:
        """Return one line for the screen, in rich's markup."""


@dataclass(frozen=True)
class Asked:
    """A question of a study."""

    kind: Kind[Any, Any, Any]
    key: str
    section: TaskSection
    task: Any

    @property
    def name(self) -> str:
        """Name in the file."""
        return self.section.name


def still(name: str, draw: Callable[[], Drawing]) -> Figure:
    """Figure that does not move, as PNG and SVG."""
    return Figure((f"{name}.png", f"{name}.svg"), partial(_save, draw, name))


def _save(draw: Callable[[], Drawing], name: str, folder: Path) -> None:
    plotting.save(draw(), folder, name)

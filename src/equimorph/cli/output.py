"""What a command writes where: answers on stdout, progress and logs on stderr."""

import json
import logging
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import typer
from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress as Bars,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from equimorph.logs import PACKAGE, log_of
from equimorph.model import Progress, Silent

LOG = log_of(__name__)


class LoggedProgress:
    """Progress sink that logs each stage when it begins."""

    def __init__(self) -> None:
        self._current: str | None = None

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Log a stage that another one did not precede."""
        if stage != self._current:
            self._current = stage
            LOG.info("%s: %d of %s", stage, done, "unknown" if total is None else total)


class ScreenProgress:
    """Progress sink that draws one bar per stage on stderr while a ``with`` block lasts."""

    def __init__(self) -> None:
        self._bars = Bars(
            SpinnerColumn(finished_text="✓"),
            TextColumn("{task.description:<24}"),
            BarColumn(bar_width=30),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=Console(stderr=True),
        )
        self._tasks: dict[str, TaskID] = {}
        self._current: str | None = None

    def __enter__(self) -> "ScreenProgress":
        """Draw from the first report on: a mistake found before leaves only its line."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the last state of the bars on the screen."""
        if self._tasks:
            self._bars.stop()

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Move the bar of a stage; another stage that begins ends it, until it goes on."""
        if stage not in self._tasks:
            if not self._tasks:
                self._bars.start()
            self._tasks[stage] = self._bars.add_task(stage, total=total)
        if stage != self._current:
            self._end(self._current)
            self._current = stage
        # A stage may find more to do than it first said, or only know in the end.
        known = self._bars.tasks[self._tasks[stage]].total if total is None else total
        reached = None if known is None else max(known, done)
        self._bars.update(self._tasks[stage], completed=done, total=reached)

    def _end(self, stage: str | None) -> None:
        if stage is not None:
            task = self._bars.tasks[self._tasks[stage]]
            total = task.completed if task.total is None else task.total
            self._bars.update(task.id, completed=total, total=total)


FORM = "%(asctime)s %(name)s: %(message)s"
"""Form of a line of the log."""


@dataclass(frozen=True)
class Output:
    """How much a command says.

    Parameters
    ----------
    as_json
        Whether the answers on stdout are data for programs instead of text.
    quiet
        Whether nothing but data and mistakes is shown.
    verbose
        Whether stages are logged on stderr, instead of bars.
    """

    as_json: bool = False
    quiet: bool = False
    verbose: bool = False

    def show(self, text: RenderableType) -> None:
        """Write text for people on stdout, in rich's markup."""
        if not (self.as_json or self.quiet):
            Console(highlight=False).print(text, soft_wrap=isinstance(text, str))

    def write_data(self, content: dict[str, Any]) -> None:
        """Write one line of JSON on stdout, if that was asked for."""
        if self.as_json:
            typer.echo(json.dumps(content, allow_nan=False))

    @contextmanager
    def progress(self) -> Generator[Progress]:
        """Give a sink for progress while a block lasts."""
        if self.quiet:
            yield Silent()
        elif self.verbose:
            with _show_log():
                yield LoggedProgress()
        else:
            with ScreenProgress() as bars:
                yield bars


@contextmanager
def _show_log() -> Generator[None]:
    """Show the logs of the package on stderr while a block lasts."""
    log, handler = logging.getLogger(PACKAGE), logging.StreamHandler()
    handler.setFormatter(logging.Formatter(FORM))
    level = log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)

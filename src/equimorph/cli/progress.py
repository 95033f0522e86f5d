"""Progress of a run on the screen."""

from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from equimorph.logs import log_of

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
        self._bars = Progress(
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

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
        """Move the bar of a stage; a stage that begins ends the one before it."""
        if stage not in self._tasks:
            self._finish_stage()
            self._tasks[stage] = self._bars.add_task(stage, total=total)
        self._bars.update(self._tasks[stage], completed=done, total=total)

    def _finish_stage(self) -> None:
        if not self._tasks:
            self._bars.start()
            return
        last = self._bars.tasks[-1]
        total = last.completed if last.total is None else last.total
        self._bars.update(last.id, completed=total, total=total)

"""Bars that show how far a computation is, in a terminal and in a notebook.

In notebooks they are elements of HTML, because rich draws live there with ipywidgets only.
"""

import sys
import time
from html import escape
from importlib import import_module
from types import TracebackType
from typing import Any, NamedTuple

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress as Bars,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

EVERY = 0.2
"""Seconds between two pictures in a notebook."""


class Reached(NamedTuple):
    """How far a stage is; `total` is None where it is not known."""

    done: int
    total: int | None


class ProgressBars:
    """Progress sink with one bar a stage: on stderr, or below the cell of a notebook.

    What takes `progress` reports to it. In a ``with`` block the last state stays when it ends.

    Examples
    --------
    >>> import equimorph as em
    >>> with em.ProgressBars() as bars:
    ...     eset = em.equilibrium_set(
    ...         em.Spring(), em.Box(x_l=(0.6, 1.4), F=(-0.3, 0.3)), progress=bars
    ...     )
    >>> eset.audit.clean
    True
    """

    def __init__(self) -> None:
        self._drawn: _Screen | _Cell = _Cell() if in_notebook() else _Screen()
        self._reached: dict[str, Reached] = {}
        self._current: str | None = None

    def __enter__(self) -> "ProgressBars":
        """Draw from the first report on: a mistake found before leaves only its line."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the last state of the bars."""
        self._drawn.stop()

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Move the bar of a stage; another stage that begins ends it, until it goes on."""
        before = self._current
        if before is not None and before != stage:
            reached, known = self._reached[before]
            end = reached if known is None else known
            self._move(before, end, end)
        self._current = stage
        # A stage may find more to do than it first said, or only know in the end.
        known = self._reached.get(stage, Reached(0, None)).total if total is None else total
        self._move(stage, done, None if known is None else max(known, done))

    def _move(self, stage: str, done: int, total: int | None) -> None:
        self._reached[stage] = Reached(done, total)
        self._drawn.show(self._reached, stage)


class _Screen:
    """Bars on stderr."""

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

    def show(self, reached: dict[str, Reached], stage: str) -> None:
        """Move the bar of a stage."""
        done, total = reached[stage]
        if stage not in self._tasks:
            if not self._tasks:
                self._bars.start()
            self._tasks[stage] = self._bars.add_task(stage, total=total)
        self._bars.update(self._tasks[stage], completed=done, total=total)

    def stop(self) -> None:
        """Leave the bars as they are."""
        if self._tasks:
            self._bars.stop()


class _Cell:
    """Bars in the output of a cell, as elements of HTML that every notebook shows."""

    def __init__(self) -> None:
        self._handle: Any = None
        self._html, self._shown, self._time = "", "", 0.0

    def show(self, reached: dict[str, Reached], stage: str) -> None:
        """Draw all bars, not too often."""
        self._html = table_of(reached)
        if time.monotonic() - self._time > EVERY:
            self._draw()

    def stop(self) -> None:
        """Draw the last state."""
        if self._html != self._shown:
            self._draw()

    def _draw(self) -> None:
        notebook: Any = import_module("IPython.display")  # only notebooks have it
        self._time, self._shown = time.monotonic(), self._html
        picture = notebook.HTML(self._html)
        if self._handle is None:
            self._handle = notebook.display(picture, display_id=True)
        else:
            self._handle.update(picture)


def table_of(reached: dict[str, Reached]) -> str:
    """Return a table in HTML: a row a stage, with its bar and numbers.

    >>> print(table_of({"seeds": Reached(1, 2)}).replace("<td>", " "))
    <table><tr> seeds</td> <progress value="1" max="2"></progress></td> 1/2</td></tr></table>
    """
    rows = [
        f'<tr><td>{escape(stage)}</td><td><progress value="{done}" max="{total or done or 1}">'
        f"</progress></td><td>{done}/{'?' if total is None else total}</td></tr>"
        for stage, (done, total) in reached.items()
    ]
    return f"<table>{''.join(rows)}</table>"


def in_notebook() -> bool:
    """Whether a kernel of Jupyter runs this program."""
    shell = sys.modules.get("IPython")
    kernel = None if shell is None else shell.get_ipython()
    return kernel is not None and "IPKernelApp" in kernel.config

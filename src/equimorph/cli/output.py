"""What a command writes where: answers on stdout, progress and logs on stderr."""

import json
import logging
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import typer
from rich.console import Console, RenderableType

from equimorph.logs import PACKAGE, log_of
from equimorph.model import Progress, Silent
from equimorph.progress import ProgressBars

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


FORM = "%(asctime)s %(name)s: %(message)s"
"""Form of a line of the log."""


@dataclass(frozen=True)
class Output:
    """How much a command says."""

    as_json: bool = False
    """Whether the answers on stdout are data for programs instead of text."""
    quiet: bool = False
    """Whether nothing but data and mistakes is shown."""
    verbose: bool = False
    """Whether stages are logged on stderr, instead of bars."""

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
            with ProgressBars() as bars:
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

"""All that is wrong with a study at once."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager

from equimorph.errors import InputError


class StudyError(InputError):
    """What is wrong with a study: its text names the first mistake and counts the others.

    Parameters
    ----------
    lines
        One line for each mistake.
    """

    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = tuple(dict.fromkeys(lines))
        more = f" ({len(self.lines) - 1} more after this.)" if len(self.lines) > 1 else ""
        super().__init__(f"{self.lines[0]}{more}")


class Findings:
    """Mistakes that are collected instead of raised one by one."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    @contextmanager
    def collect(self) -> Generator[None]:
        """Keep the lines of an `InputError` that the block raises, and end the block there."""
        try:
            yield
        except InputError as error:
            self._lines += lines_of(error)

    def refuse(self) -> None:
        """Raise one `StudyError` of all lines, if there are any."""
        if self._lines:
            raise StudyError(self._lines)


def lines_of(error: InputError) -> Sequence[str]:
    """Return the lines of an error: all mistakes of a study, or the one that it names."""
    return error.lines if isinstance(error, StudyError) else (str(error),)

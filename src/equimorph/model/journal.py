"""Sinks that long computations are given: progress reports, journals; and what files leave out.

A deterministic computation asks the same questions in the same order each time. It hands each
answer to a journal; begun again with that journal, it is given the answers back.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Shaped

Findings: TypeAlias = tuple[Shaped[np.ndarray, "..."], ...]
"""Arrays of numbers that a step has found."""


@runtime_checkable
class Journal(Protocol):
    """Keeps what the steps of a computation find, and gives it back in the same order."""

    def begin(self, question: str) -> None:
        """Begin at the first step of the computation that answers a question.

        Raises
        ------
        InputError
            If the journal is that of another question.
        """

    def recall(self, step: str) -> Findings | None:
        """Findings of the next step, if they are kept; from the first that is not, none are."""

    def keep(self, step: str, found: Findings) -> None:
        """Keep the findings of a step that was not recalled."""


def recalled(journal: Journal, step: str, compute: Callable[[], Findings]) -> Findings:
    """Findings of a step: from the journal, else computed and kept there."""
    found = journal.recall(step)
    if found is None:
        found = compute()
        journal.keep(step, found)
    return found


@runtime_checkable
class Progress(Protocol):
    """Receives the progress of a computation."""

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Take note that `done` of `total` units (unknown if None) of `stage` are finished."""


class Silent:
    """The sink that ignores everything."""

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Do nothing."""


NOT_KEPT: Mapping[str, bool] = MappingProxyType({"kept": False})
"""Metadata of a dataclass's field that files leave out; it needs a default."""

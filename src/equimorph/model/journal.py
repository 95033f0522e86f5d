"""Journals: what a long computation has found so far, to go on from after an interruption.

A deterministic computation asks the same questions in the same order each time. Its costly steps
hand their findings to a journal; begun again with that journal, it is given them back, and goes on
where it was.
"""

import zlib
from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Shaped

from equimorph.linalg.lanes import results_of

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


class Forgetful:
    """The journal that keeps nothing."""

    def begin(self, question: str) -> None:
        """Do nothing."""

    def recall(self, step: str) -> Findings | None:
        """Return nothing."""

    def keep(self, step: str, found: Findings) -> None:
        """Do nothing."""


def step_of(kind: str, *given: Shaped[np.ndarray, "..."]) -> str:
    """Name of a step: its kind, and a checksum of what it works on.

    Examples
    --------
    >>> step_of("lift", np.arange(3)) == step_of("lift", np.arange(4))
    False
    """
    check = 0
    for array in given:
        check = zlib.crc32(np.ascontiguousarray(array).tobytes(), check)
    return f"{kind} {check:08x}"


def recalled(journal: Journal, step: str, compute: Callable[[], Findings]) -> Findings:
    """Findings of a step: from the journal, else computed and kept there."""
    found = journal.recall(step)
    if found is None:
        found = compute()
        journal.keep(step, found)
    return found


def all_recalled(
    journal: Journal, steps: Sequence[str], compute: Sequence[Callable[[], Findings]]
) -> list[Findings]:
    """Findings of steps that do not depend on each other: from the journal as far as it goes.

    The others are computed, several at the same time, and kept in their order.
    """
    out: list[Findings] = []
    for step in steps:
        found = journal.recall(step)
        if found is None:
            break
        out.append(found)
    known = len(out)
    for step, found in zip(steps[known:], results_of(compute[known:]), strict=True):
        journal.keep(step, found)
        out.append(found)
    return out

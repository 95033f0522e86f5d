"""Progress sinks: passed into long computations, which never print by themselves."""

from typing import Protocol, runtime_checkable


@runtime_checkable
class Progress(Protocol):
    """Receives how far a computation is."""

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Take note that `done` of `total` units (unknown if None) of `stage` are finished."""


class Silent:
    """The sink that ignores everything."""

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Do nothing."""

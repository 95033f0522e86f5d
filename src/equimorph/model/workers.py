"""Workers: whoever computes the chunks of a large batch elsewhere, by something like `map`.

See docs/decisions.md, "Workers are shaped like map".
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Protocol, TypeVar, runtime_checkable

from equimorph.columns import Columns

PARTS = 32
"""Chunks of a batch, unless they became too small or too large."""
LEAST, MOST = 512, 16384
"""Rows of a chunk: so many that it takes longer than its journey, so few that it fits anywhere."""

Rows = TypeVar("Rows", bound=Columns)
Found = TypeVar("Found", bound=Columns)


@runtime_checkable
class Workers(Protocol):
    """Computes a function on chunks: in other processes, or on other machines.

    A `concurrent.futures.ProcessPoolExecutor` is one, `cluster.dask` makes one of a client of Dask.
    Functions, chunks and results go through pickles. Every row is computed alone, so that results
    have the same bits with any workers and with none.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> import equimorph as em
    >>> isinstance(ThreadPoolExecutor(2), em.Workers)
    True
    """

    def map(self, function: Callable[[Any], Any], chunks: Iterable[Any], /) -> Iterator[Any]:
        """Return the results of a function on chunks, in the order of the chunks.

        What is not yet computed when the iterator is closed is dropped.
        """


def cut_rows(count: int, workers: Workers | None) -> list[slice]:
    """Return the chunks into which a batch is cut: all of it where nobody else computes."""
    if workers is None or count == 0:
        return [slice(0, count)]
    size = min(MOST, max(LEAST, -(-count // PARTS)))
    return [slice(first, first + size) for first in range(0, count, size)]


def map_rows(
    function: Callable[[Rows], Found],
    rows: Rows,
    cuts: Sequence[slice],
    workers: Workers | None,
    finished: Callable[[int], None] = lambda _: None,
) -> Found:
    """Compute a function of a batch, chunk by chunk where there are workers.

    Parameters
    ----------
    function
        It treats rows independently, and goes through a pickle where there are workers.
    rows
        The batch.
    cuts
        Its chunks, of `cut_rows`.
    workers
        Who computes them; None: this process.
    finished
        Called with the number of finished chunks; what it raises cancels the others.
    """
    chunks = (rows.take(cut) for cut in cuts)
    results = map(function, chunks) if workers is None else workers.map(function, chunks)
    found: list[Found] = []
    try:
        for done, each in enumerate(results, 1):
            found.append(each)
            finished(done)
    finally:
        getattr(results, "close", lambda: None)()
    joined: Found = type(found[0]).concatenate(found)
    return joined

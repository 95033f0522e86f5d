"""Workers of a Dask cluster: processes on this machine, or on many.

Every chunk is computed by one thread of a worker.

See docs/decisions.md, "Workers are shaped like map".
"""

import hashlib
import pickle
import platform
import re
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError, LostWorkersError, load_package
from equimorph.linalg.lanes import one_thread
from equimorph.model import Workers

AHEAD = 2
"""Chunks in the cluster for each of its threads: one is computed, one is on its way."""
LEAST_AHEAD = 4
"""Chunks in the cluster at least, also of one whose workers have not yet come."""
COMPARED = ("equimorph", "numba", "numpy", "scipy")
"""Packages whose versions decide on the last bits of results."""
FINISHED = "finished"
"""Status of a chunk whose result is in the cluster."""
ADDRESS = re.compile(r"local(?::([1-9]\d{0,3}))?|(?:tcp|tls)://\S+")
"""Clusters on the command line."""


@check_arguments
def dask(client: Any) -> "DaskWorkers":
    """Workers of a Dask cluster, for all functions that take ``workers=``.

    Results have the same bits as without workers. If a worker is lost, its chunk is computed by
    another one, as often as the scheduler allows (``distributed.scheduler.allowed-failures``, 3
    unless it is configured otherwise).

    Parameters
    ----------
    client
        A `distributed.Client` that is connected to a scheduler; workers may come and go.

    Raises
    ------
    InputError
        If it is no such client, or the package is not installed (extra ``cluster``).

    Examples
    --------
    >>> import equimorph as em
    >>> from distributed import Client, LocalCluster  # doctest: +SKIP
    >>> with Client(LocalCluster(n_workers=4, threads_per_worker=1)) as client:  # doctest: +SKIP
    ...     lmap = em.limit_load_map(arch, grid, "q", workers=em.cluster.dask(client))
    """
    distributed = load_package("distributed", "cluster", "cluster.dask")
    if not isinstance(client, distributed.Client) or client.asynchronous:
        raise InputError(
            "`client` must be a client of Dask, like `distributed.Client(address)`; got "
            f"{client!r}."
        )
    return DaskWorkers(client)


@dataclass(frozen=True)
class _Chunk:
    """A chunk in the cluster: its place among all, its question, and its result to come."""

    number: int
    key: str
    future: Any


class DaskWorkers:
    """Computes chunks on the workers of a Dask cluster; see `dask`.

    Chunks that are finished when another one cannot be finished are kept here until a computation
    succeeds: the same question is answered with them.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._kept: dict[str, Any] = {}

    def map(
        self, function: Callable[[Any], Any], chunks: Iterable[Any], /
    ) -> Generator[Any, None, None]:
        """Return the results of a function on chunks, in their order, as soon as they are there.

        Raises `InputError` if a worker has other versions of what computes than this process.
        Raises `LostWorkersError` if the workers that computed a chunk were lost too often.
        """
        lost = load_package("distributed", "cluster", "cluster.dask").KilledWorker
        begun = (self._begin(function, k, each) for k, each in enumerate(chunks))
        running, found = deque[_Chunk](), dict[str, Any]()
        try:
            while running or (running := deque(islice(begun, self._room()))):
                chunk = running[0]
                found[chunk.key] = self._result(chunk)
                running.popleft()
                running.extend(islice(begun, max(0, self._room() - len(running))))
                yield found[chunk.key]
            self._kept = {}
        except lost as error:
            for each in running:
                if each.future is not None and each.future.status == FINISHED:
                    with suppress(lost):  # the only copy may be lost with its worker
                        found[each.key] = self._result(each)
            self._kept = found
            raise LostWorkersError(
                f"`workers` must stay alive: those that computed chunk {running[0].number} were "
                f"lost more often than the scheduler allows. {len(self._kept)} finished chunks are "
                "kept: ask again with these workers once the cause is mended, such as too little "
                "memory."
            ) from error
        finally:
            self._client.cancel([each.future for each in running if each.future])

    def _room(self) -> int:
        """Chunks that may be in the cluster at once."""
        threads: int = sum(self._client.nthreads().values())
        return max(LEAST_AHEAD, AHEAD * threads)

    def _begin(self, function: Callable[[Any], Any], number: int, chunk: Any) -> _Chunk:
        """Submit a chunk, unless its result is kept."""
        task = pickle.dumps((function, chunk))
        key = f"equimorph-{hashlib.sha256(task).hexdigest()}"
        if key in self._kept:
            return _Chunk(number, key, None)
        return _Chunk(number, key, self._client.submit(compute, task, versions(), pure=False))

    def _result(self, chunk: _Chunk) -> Any:
        if chunk.future is None:
            return self._kept[chunk.key]
        return pickle.loads(chunk.future.result())


def compute(task: bytes, expected: dict[str, str]) -> bytes:
    """Compute a chunk, the pickle of a function and of its argument, on a worker.

    Refused if the worker has other versions than the process that asks.
    """
    found = versions()
    for name, wanted in expected.items():
        if found[name] != wanted:
            raise InputError(
                f"`workers` must have the same {name} as the client, {wanted}; got {found[name]}."
            )
    with one_thread():
        function, chunk = pickle.loads(task)
        return pickle.dumps(function(chunk))


@cache
def versions() -> dict[str, str]:
    """Versions of Python, of packages, and of the sources of this one."""
    content = hashlib.sha256()
    folder = Path(__file__).parent
    for path in sorted(folder.rglob("*.py")):
        content.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    sources = {"sources of equimorph": content.hexdigest()[:12]}
    packages = {name: version(name) for name in COMPARED}
    return {"Python": platform.python_version(), **packages, **sources}


@contextmanager
def connect(text: str) -> Generator[Workers]:
    """Give the workers of a cluster while a block lasts.

    `text`: ``local`` or ``local:n`` for processes on this machine, one for each processor unless a
    number is given, or the address of a scheduler, like ``tcp://host:8786``. Raises `InputError` if
    it is neither, or nobody answers at the address.
    """
    found = ADDRESS.fullmatch(text)
    if not found:
        raise InputError(f"`cluster` must be local, local:n or tcp://host:port; got {text!r}.")
    distributed = load_package("distributed", "cluster", "cluster")
    if not text.startswith("local"):
        with _client_at(distributed, text) as client:
            yield dask(client)
        return
    number = int(found[1]) if found[1] else None
    with (
        distributed.LocalCluster(
            n_workers=number, threads_per_worker=1, dashboard_address=None
        ) as local,
        distributed.Client(local) as client,
    ):
        yield dask(client)


def _client_at(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address)
    except (OSError, ValueError) as error:
        raise InputError(
            f"`cluster` must be the address of a scheduler that answers; got {address}: {error}."
        ) from error

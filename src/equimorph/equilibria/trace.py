"""`trace`: follow many curves in lanes, locate their events, and report how each ended.

See docs/decisions.md, "Two engines trace".
"""

import threading
import time
from collections.abc import Callable
from concurrent.futures import wait
from dataclasses import dataclass, field

import numpy as np

from equimorph.arrays import Bool, Lanes, Numbers, Some, Values
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.events import Events, locate_all
from equimorph.equilibria.inside_steps import inside_last_steps, within_ends
from equimorph.equilibria.march import Block, Loss
from equimorph.equilibria.steps import Points
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.errors import CancelledError
from equimorph.linalg.lanes import in_background, threads
from equimorph.model import Constraint, Progress, Silent

Names = Numbers

LANES_PER_THREAD = 128
"""A second thread is not worth its start for fewer lanes than this on each."""
EVENTS_AT_ONCE, OF_A_LANE = 768, 16
"""Most brackets of events that are located together, over all lanes and of one lane."""
REPORT_EVERY = 0.2
"""Seconds."""


@dataclass(frozen=True)
class Batching:
    """How many lanes march side by side on how many threads; no result depends on it.

    capacity: lanes of a thread, enough to make the cost of calls small; threads: as many as
    there are processors if None.
    """

    capacity: int = 512
    threads: int | None = None


@dataclass(frozen=True)
class Onwards:
    """Lanes that begin where others end: none waits until all of those have ended.

    first: number of lanes that begin at once; follow: given lanes that ended with their codes and
    last states, further lanes and their starts, each once. Threads call it at the same time.
    """

    first: int
    follow: Callable[[Numbers, Names, Lanes], tuple[Some, Lanes]]


@dataclass(frozen=True)
class Traces:
    """How each lane ended, the events on its way, and its points if they were recorded."""

    code: Names
    z: Lanes
    t: Values
    index: Names
    travelled: Values
    why: dict[int, str]
    passed: Events
    points: Points


def trace(
    curve: Curve,
    z: Lanes,
    constraints: tuple[Constraint, ...] = (),
    options: TraceOptions | None = None,
    *,
    batching: Batching | None = None,
    progress: Progress | None = None,
    onwards: Onwards | None = None,
) -> Traces:
    """Trace every lane from t = 0 until it arrives, returns or something ends it.

    Lanes wait in a queue; each thread takes as many as march well together and fills up from the
    queue as lanes finish. Of the events in the last step of a lane the first along the curve is its
    end. Lanes whose events could not be located are traced again with finer steps. Every lane is
    treated by itself: its result is the same, bit for bit, independent of the other lanes, their
    order and the threads.

    Whatever `progress` raises stops all threads and reaches the caller; only after
    `CancelledError` lanes that were not finished have the code `EventCode.CANCELLED`, and the
    rest are returned.

    With `onwards` only the first lanes begin, and others where these end; see `Onwards`.
    """
    options, batching = options or TraceOptions(), batching or Batching()
    first = len(z) if onwards is None else onwards.first
    count = max(1, min(batching.threads or threads(), first // LANES_PER_THREAD))
    queue = _Queue(first)
    ledger = _Ledger.of(z)
    capacity = max(1, min(batching.capacity, -(-first // count)))
    at_once = min(EVENTS_AT_ONCE, OF_A_LANE * first)
    start = np.array(z)  # starts of further lanes are written there
    jobs = [
        _Job(Block(curve, start, constraints, options, capacity, at_once), queue, ledger, onwards)
        for _ in range(count)
    ]
    try:
        _run(jobs, queue, progress or Silent())
    except CancelledError:
        ledger.code[ledger.code == EventCode.LOST] = EventCode.CANCELLED
        ledger.code[list(ledger.why)] = EventCode.LOST
    return _outcome(ledger, jobs)


@dataclass
class _Queue:
    """Lanes that wait, handed out in order; how many are finished; whether to stop."""

    total: int
    handed: int = 0
    finished: int = 0
    stopped: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def take(self, most: int) -> Some:
        """Return the next lanes."""
        with self.lock:
            start, self.handed = self.handed, min(self.handed + most, self.total)
            return np.arange(start, self.handed)

    def finish(self, lanes: int) -> None:
        """Count finished lanes."""
        with self.lock:
            self.finished += lanes


@dataclass(frozen=True)
class _Ledger:
    """How each lane ended, written by the job that traced it, and how often it was retried."""

    code: Names
    z: Lanes
    t: Values
    index: Names
    travelled: Values
    retries: Names
    why: dict[int, str] = field(default_factory=dict)

    @classmethod
    def of(cls, z: Lanes) -> "_Ledger":
        """Nothing known yet."""
        lanes = len(z)
        code, index, retries = (np.zeros(lanes, int) for _ in range(3))
        return cls(code, z.copy(), np.zeros(lanes), index, np.zeros(lanes), retries)


@dataclass
class _Job:
    """What one thread does: march, locate events, note how lanes ended, trace some again."""

    block: Block
    queue: _Queue
    ledger: _Ledger
    onwards: Onwards | None = None
    again: list[int] = field(default_factory=list)
    passed: list[tuple[Events, Some]] = field(default_factory=list)
    missed: dict[int, str] = field(default_factory=dict)

    def run(self, report: Callable[[], None] = lambda: None) -> None:
        """Work until the queue is empty and everything is located, or until stopped."""
        try:
            report()
            while not self.queue.stopped and self._round():
                report()
        except BaseException:
            self.queue.stopped = True
            raise

    def _round(self) -> bool:
        """One round of all lanes in the block; whether there is more to do."""
        block = self.block
        if room := block.wanted:
            self._fill(room)
        if block.busy:
            self._lose(block.run(self._more))
        waiting = block.rows.events.count + len(block.rare.hidden)
        if waiting and (waiting >= self._patience or not block.busy):
            self._locate()
        return block.busy or self._more

    @property
    def _patience(self) -> int:
        """Events that wait until they are located together: those of most lanes, if others wait."""
        block = self.block
        return block.most_events if self.onwards is None else max(block.rows.active, 1)

    @property
    def _more(self) -> bool:
        """Whether further lanes may come."""
        return bool(self.again) or self.queue.handed < self.queue.total

    def _fill(self, room: int) -> None:
        old, self.again = self.again[:room], self.again[room:]
        lanes = self.queue.take(room - len(old))
        if old:
            lanes = np.concatenate([np.array(old), lanes])
        if len(lanes):
            self.block.admit(lanes, self.ledger.retries[lanes])

    def _lose(self, lost: list[Loss]) -> None:
        """Note lanes that cannot go on."""
        ledger = self.ledger
        for loss in lost:
            lane, front = loss.lane, loss.front
            ledger.z[lane], ledger.t[lane] = front.z[0], front.t[0]
            ledger.index[lane], ledger.why[lane] = front.index[0], loss.why
            ledger.travelled[lane] = loss.travelled
        self.queue.finish(len(lost))

    def _locate(self) -> None:
        """Locate everything that is pending; settle lanes that ended, retry where it failed."""
        block, ledger = self.block, self.ledger
        curve, options = block.curve, block.options
        bracket, determinants = block.rows.events.drain()
        shown = locate_all(curve, [bracket], block.constraints, options)
        last = inside_last_steps(curve, bracket, determinants, options)
        hidden = [within_ends(each) for each in (*block.rare.hidden, *last)]
        events = Events.join([shown, *hidden], curve.metric.size)
        block.rare.hidden = []
        again = events.lanes[~events.found]
        if len(again):
            again = np.unique(again)
            again = again[ledger.retries[again] < block.options.retries]
        if len(again):
            ledger.retries[again] += 1
            block.drop(again)
            for lane in again:
                ledger.why.pop(int(lane), None)
            self.again.extend(again.tolist())
            events = events.take(~np.isin(events.lanes, again))
        self._settle(events)

    def _settle(self, events: Events) -> None:
        """Each lane's end is its first terminal event; what lies before was passed."""
        ledger, stop = self.ledger, self.block.options.stops
        terminal = np.flatnonzero(events.code & stop)
        first = terminal[np.unique(events.lanes[terminal], return_index=True)[1]]
        at = events.lanes[first]
        ledger.code[at], ledger.z[at], ledger.t[at] = (
            events.code[first],
            events.z[first],
            events.t[first],
        )
        ledger.index[at], ledger.travelled[at] = events.near_side(first), events.travelled[first]
        for i in first[~events.found[first]]:
            kind = EventCode(int(events.code[i])).kind
            self.missed[int(events.lanes[i])] = f"the {kind} could not be located"
        last = np.full(len(events.lanes), np.inf)
        if len(at):
            which = np.minimum(np.searchsorted(at, events.lanes), len(at) - 1)
            ended = at[which] == events.lanes
            last[ended] = events.travelled[first][which[ended]]
        passing = ((events.code & ~stop) != 0) & (events.travelled < last)
        for i in np.flatnonzero(passing & ~events.found):
            kind = EventCode(int(events.code[i])).kind
            self.missed[int(events.lanes[i])] = f"a {kind} on the way could not be located"
        some = events.take(passing)
        self.passed.append((some, ledger.retries[some.lanes]))
        self.queue.finish(len(at))
        if self.onwards is not None and len(at):
            further, start = self.onwards.follow(at, ledger.code[at], ledger.z[at])
            self.block.begin_at(further, start)
            self.again.extend(further.tolist())


def _run(jobs: list[_Job], queue: _Queue, progress: Progress) -> None:
    """Run jobs, the only one in this thread, and report their progress from this thread."""
    shown = time.monotonic()

    def report() -> None:
        nonlocal shown
        if time.monotonic() - shown > REPORT_EVERY:
            shown = time.monotonic()
            progress.report("tracing lanes", queue.finished, queue.total)

    if len(jobs) == 1:
        jobs[0].run(report)
        return
    futures = in_background([job.run for job in jobs])
    try:
        while wait(futures, REPORT_EVERY).not_done:
            report()
    finally:
        queue.stopped = True
        wait(futures)
    for future in futures:
        future.result()


def _outcome(ledger: _Ledger, jobs: list[_Job]) -> Traces:
    """Put together what the jobs left; first tries of lanes that were retried are dropped."""
    for lane, reason in (pair for job in jobs for pair in job.missed.items()):
        ledger.code[lane], ledger.why[lane] = EventCode.LOST, reason
    size = ledger.z.shape[1]
    passed = [part.take(_last(ledger, part, t)) for job in jobs for part, t in job.passed]
    parts = [part for job in jobs for part in job.block.rows.points.parts()]
    points = [
        part if (last := _last(ledger, part, tries)).all() else part.take(last)
        for part, tries in parts
    ]
    joined = Points.join(points, size)
    # an event that the first step hid is known after the second
    beyond = (joined.travelled > ledger.travelled[joined.lanes]) & (ledger.code[joined.lanes] > 0)
    return Traces(
        ledger.code,
        ledger.z,
        ledger.t,
        ledger.index,
        ledger.travelled,
        ledger.why,
        Events.join(passed, size),
        joined.take(~beyond) if beyond.any() else joined,
    )


def _last(ledger: _Ledger, part: Points | Events, tries: Some) -> Bool[np.ndarray, " some"]:
    """Which entries belong to the last try of a lane that was finished."""
    of_last = ledger.retries[part.lanes] == tries
    return np.asarray(of_last & (ledger.code[part.lanes] != EventCode.CANCELLED))

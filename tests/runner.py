"""Runs studies in processes that may be killed.

A program that loads the package once, then forks a child for each job on its standard input. It
answers with the child's number, and once the child has ended, with its exit code or minus a signal.
"""

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

READY = 0
PACKAGE = str(Path(__file__).parents[1] / "src")


class Runner:
    """The program, as tests use it."""

    def __init__(self) -> None:
        paths = os.pathsep.join([PACKAGE, str(Path(__file__).parent)])
        self._program = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "PYTHONPATH": paths},
        )
        assert self._answer() == READY

    def close(self) -> None:
        """End the program."""
        self._program.communicate()

    def start(self, study: Path, out: Path, **end: float) -> int:
        """Begin to run a study; return the number of the process.

        `end`: ``at``, operation on files at which the process kills itself; ``after``, seconds
        after which it gets the signal ``by``. ``dots``: put dots in place of figures.
        """
        job = {"study": str(study), "out": str(out), **end}
        assert self._program.stdin is not None
        self._program.stdin.write(json.dumps(job) + "\n")
        self._program.stdin.flush()
        return self._answer()

    def wait(self) -> int:
        """Wait for the end of the process: 0, an exit code, or minus the signal that killed it."""
        return self._answer()

    def run(self, study: Path, out: Path, **end: float) -> int:
        """Run a study to its end, whatever that is."""
        self.start(study, out, **end)
        return self.wait()

    def _answer(self) -> int:
        assert self._program.stdout is not None
        return int(self._program.stdout.readline())


def _serve() -> None:
    import studies  # noqa: F401, PLC0415  # loads the package, in the program only, and once

    _say(READY)
    for line in sys.stdin:
        job = json.loads(line)
        child = os.fork()
        if child == 0:
            _run(**job)
        _say(child)
        _say(_end(child, **job))


def _end(child: int, after: float | None = None, by: int = signal.SIGKILL, **_: object) -> int:
    """Signal a child when its time has come; its number is its own until we have waited for it."""
    deadline = None if after is None else time.monotonic() + after
    while deadline is not None and time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.001)
    if after is not None:
        os.kill(child, by)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _run(study: str, out: str, at: int | None = None, dots: bool = False, **_: object) -> None:
    import pytest  # noqa: PLC0415

    from equimorph import plotting  # noqa: PLC0415
    from equimorph.study import run_study  # noqa: PLC0415
    from faults import Operations  # noqa: PLC0415
    from studies import draw_dots  # noqa: PLC0415

    patch = pytest.MonkeyPatch()
    patch.setattr(plotting, "film", partial(plotting.film, frames=4))
    if dots:
        draw_dots(patch)
    if at is not None:
        Operations(Path(out), at, partial(os.kill, os.getpid(), signal.SIGKILL)).install(patch)
    try:
        run_study(Path(study), Path(out))
    except KeyboardInterrupt:
        os._exit(130)
    except BaseException:
        os._exit(1)
    os._exit(0)


def _say(number: int) -> None:
    sys.stdout.write(f"{number}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    _serve()

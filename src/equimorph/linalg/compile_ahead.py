"""Kernels compiled before they are called, each once, by as many processes as there are cores.

`kernel_calls.txt` lists the calls of kernels from Python, those that take longest to compile first:
name of the kernel, types of its arguments, and a mark of calls that every study makes. What kernels
call is compiled with them. ``python -m equimorph.linalg.compile_ahead`` compiles all of them.

See docs/decisions.md, "Kernels are compiled ahead, from a list" and "Kernels assign entries, not
slices".
"""

import gc
import os
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from inspect import isfunction, ismethod, ismodule
from pathlib import Path
from subprocess import DEVNULL, Popen
from typing import Any

from numba.core.dispatcher import Dispatcher
from numba.core.sigutils import normalize_signature

from equimorph.linalg.compiled import AWAITED, is_being_compiled, kept_signatures
from equimorph.linalg.lanes import cores

LIST = Path(__file__).with_name("kernel_calls.txt")
PACKAGE = __name__.partition(".")[0]
LOOPS = "march_kernels"
"""End of the names of modules whose kernels are loops made of others: without them results are the
same, later."""
BEHIND = "behind"
"""First word to a process that compiles while others have something better to do."""


@dataclass(frozen=True)
class KernelCall:
    """A call of a kernel from Python."""

    number: int
    """Its line in the list."""
    name: str
    """Of the kernel, with its module."""
    arguments: str
    """Their types, as numba reads them."""
    is_common: bool
    """Whether every study makes it."""

    @property
    def is_loop(self) -> bool:
        """Whether the smaller kernels that it is made of do the same."""
        return self.name.rpartition(".")[0].endswith(LOOPS)

    @cached_property
    def kernel(self) -> Any:
        """The compiled function."""
        module, _, name = self.name.rpartition(".")
        return getattr(import_module(module), name)

    @cached_property
    def types(self) -> tuple[Any, ...]:
        """Types of the arguments."""
        return tuple(normalize_signature(self.arguments)[0])

    @property
    def is_kept(self) -> bool:
        """Whether its code is on disk."""
        return self.types in kept_signatures(self.kernel)


def known_calls() -> list[KernelCall]:
    """Every call of a kernel from Python, in the order in which they are compiled."""
    rows = [line.split("\t") for line in LIST.read_text().splitlines()]
    return [
        KernelCall(number, name, arguments, is_common=bool(mark))
        for number, (name, arguments, mark) in enumerate(rows)
    ]


def calls_of(root: object) -> list[KernelCall]:
    """Calls that every study makes, and those of the kernels that an object's parts use.

    The modules that its attributes come from tell.
    """
    kernels = {
        f"{each.py_func.__module__}.{each.py_func.__name__}"
        for name in {_module(each) for each in _parts(root)}
        for each in _members(sys.modules[name])
        if isinstance(each, Dispatcher)
    }
    return [each for each in known_calls() if each.is_common or each.name in kernels]


def _members(module: object) -> Iterator[object]:
    for each in vars(module).values():
        if ismodule(each) and each.__name__.endswith("kernels"):
            yield from vars(each).values()
        yield each


def _module(thing: object) -> str:
    return getattr(thing, "__module__", None) or ""


def _parts(root: object) -> Iterator[object]:
    """Classes and functions of ours that an object and its attributes are made of."""
    seen: dict[int, object] = {}
    open_ends = [root]
    while open_ends:
        each = open_ends.pop()
        if id(each) in seen:
            continue
        seen[id(each)] = each
        if isinstance(each, list | tuple):
            open_ends += each
        elif isinstance(each, dict):
            open_ends += each.values()
        elif ismethod(each):
            open_ends += [each.__self__, each.__func__]
        elif _module(each).startswith(PACKAGE):
            yield from (kind for kind in type(each).__mro__ if _module(kind).startswith(PACKAGE))
            open_ends += vars(each).values() if hasattr(each, "__dict__") else []
            if isfunction(each):
                yield each
                open_ends += [cell.cell_contents for cell in each.__closure__ or ()]


def compile_ahead(calls: Iterable[KernelCall]) -> None:
    """Compile what is not on disk; processes that do so at the same time share the work."""
    missing = [each for each in calls if not each.is_kept]
    command = _command(missing)
    helpers = [
        Popen(command, stdout=DEVNULL, stderr=DEVNULL)
        for _ in range(min(cores(), len(missing)) - 1)
    ]
    collects = gc.isenabled()
    gc.disable()  # compiling makes many objects that live on
    try:
        _share(missing)
        for each in missing:  # what a helper has not finished, or failed to do
            each.kernel.compile(each.types)
    finally:
        if collects:
            gc.enable()
        for helper in helpers:
            helper.terminate()
            helper.wait()


def compile_behind(calls: Iterable[KernelCall]) -> None:
    """Let a process that outlives this one compile what is not on disk; do without it meanwhile.

    The calls are those of loops.
    """
    missing = [each for each in calls if not each.is_kept]
    if missing:
        AWAITED.update(each.name for each in missing)
        command, none = _command(missing, BEHIND), DEVNULL
        _BEHIND.append(Popen(command, stdin=none, stdout=none, stderr=none, start_new_session=True))


_BEHIND: list[Popen[bytes]] = []
"""Kept, for a process that is forgotten while it runs gives a warning."""


def _command(calls: list[KernelCall], *words: str) -> list[str]:
    module = __name__ if __name__ != "__main__" else __spec__.name
    return [sys.executable, "-m", module, *words, *(str(each.number) for each in calls)]


def _share(calls: Iterable[KernelCall]) -> None:
    for each in calls:
        if not each.is_kept and not is_being_compiled(each.kernel):
            each.kernel.compile(each.types)


def main() -> None:
    """Compile all calls, or, as a helper, a share of those whose numbers are given."""
    known = known_calls()
    gc.disable()  # as in `compile_ahead`
    numbers = [each for each in sys.argv[1:] if each != BEHIND]
    if len(numbers) < len(sys.argv) - 1:
        os.nice(19)
    if numbers:
        _share([known[int(each)] for each in numbers])
    else:
        compile_ahead(known)


if __name__ == "__main__":
    main()

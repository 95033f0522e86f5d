"""Random equilibrium sets of all specimens: how many are clean, how long they take, what fails.

``python benchmarks/soak_sets.py FILE 0 1000`` lifts the sets with numbers 0 to 999 one after the
other in one process and appends a line for each to a file: number, specimen, outcome, vertices,
processor time, memory, and the question itself, so that it can be asked again alone. Every set is
determined by its number; those in the file are not lifted again, so that a run that was interrupted
goes on. A summary follows; ``python benchmarks/soak_sets.py summary FILES`` adds up the lines of
several runs, and repeats those that are not clean.

Specimens are those of the tests of the contract: rods, frames, trusses, chains, springs, with as
many elements as their bound of the curvature needs (`resolving`). Boxes, grids, values of the other
parameters and constraints are random; symmetric values, zero, are as frequent as others. Half of
the boxes are most of the range of their parameters. Bounds are such that up to some tens of states
lie over a point: a portal with |κ| ≤ 8 has over a hundred, a chain whose links may turn as often as
they like has endlessly many, and a truss with Green strain and no bound up to two hundred.
"""

import ctypes
import gc
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from equimorph.errors import InputError  # noqa: E402  # after the path of the specimens
from equimorph.linalg.compile_ahead import calls_of  # noqa: E402
from equimorph.manifold import EquilibriumSet, equilibrium_set  # noqa: E402
from equimorph.model import Box, Constraint, Descriptor, Progress, Silent  # noqa: E402
from equimorph.structures import (  # noqa: E402
    Frame,
    Rod,
    SpatialFrame,
    SpatialRod,
    Structure,
    Truss,
)
from oracles.specimens import LINKS, Specimen, specimens  # noqa: E402

SPECIMENS = specimens(fine=True)
COLUMNS = 7
"""Of a line."""
LONGEST = 60.0
"""Seconds of processor time that no set may take."""
GIVEN_UP = 240.0
"""Seconds of processor time after which a set is cancelled."""
RANGES = {
    "Theta": (0.2, 2.0),
    "Delta": (-0.6, 0.6),
    "nu": (0.65, 0.9),
    "reach": (0.3, 0.48),
    "rod q": (-6.0, 9.0),
    "x_l": (0.6, 1.3),
    "spring F": (-0.3, 0.3),
    "k": (0.8, 1.5),
    "span": (0.55, 0.95),
    "chain a": (0.0, 0.8),
    "w": (-0.4, 0.9),
    "truss": (-0.3, 0.3),
    "toggle a": (-0.9, 0.9),
    "toggle P": (-1.8, 1.7),
    "frame k": (-1.0, 1.0),
    "frame d": (-0.3, 0.3),
    "frame P": (-5.0, 5.0),
    "frame q": (-2.0, 2.0),
}
"""Ranges of parameters by name, or by structure and name; of others the centre of the specimen and
`AROUND` both ways."""
AROUND = 0.4
DIMENSIONS, INTERVALS = (1, 2, 2, 2, 2, 2, 2, 2, 2, 3), {1: (20, 200), 2: (4, 18), 3: (2, 4)}
"""Numbers of free parameters to choose from, and fewest and most intervals along each."""
CAPS = {
    "frame of two members": (4.0, 16.0),
    "frame": (2.0, 5.0),
    "frame, inextensible in part": (2.0, 5.0),
    "everything in a frame in space": (1.0, 2.0),
    "bend in space": (4.0, 12.0),
}
"""Bounds of the curvature of frames, by name of the specimen."""
CAPS_OF_RODS = (8.0, 24.0)
PLACES, FARTHEST = ("nu", "rise", "sideways"), 0.99
"""Parameters that hold the ends of a rod apart, and the largest distance for which it has elements:
beyond it waves become flat without end."""
ANGLES, SHORTENINGS, HALF = (1.5, 3.5), (0.05, 0.5), 0.5
"""Bounds of the angles of a chain, of shortenings, and the share of trusses that have one."""
WIDE, MOST = 0.5, 0.7
"""Share of boxes that are wide, and the part of the ranges of their parameters that these cover at
least."""
SYMMETRIC = 0.3
"""Share of fixed parameters that are zero, where zero is in their range."""


@dataclass(frozen=True)
class Question:
    """A set to be lifted."""

    name: str
    structure: Structure
    box: Box
    fixed: dict[str, float]
    within: tuple[Constraint, ...]
    intervals: tuple[int, ...]

    def lifted(self, seed: int = 0, progress: Progress | None = None) -> EquilibriumSet:
        """The set."""
        return equilibrium_set(
            self.structure,
            self.box,
            fixed=self.fixed,
            within=list(self.within),
            intervals=self.intervals,
            seed=seed,
            progress=progress,
        )

    def __str__(self) -> str:
        sides = ", ".join(
            f"{name}=({low:.4f}, {high:.4f})"
            for name, low, high in zip(self.box.names, self.box.lower, self.box.upper, strict=True)
        )
        fixed = ", ".join(f"{name}={value:.4f}" for name, value in self.fixed.items())
        within = " and ".join(map(str, self.within))
        return f"Box({sides}); fixed {fixed or '-'}; within {within or '-'}; {self.intervals}"


class OutOfTimeError(Exception):
    """Raised where a set takes too long."""


class Deadline(Silent):
    """Progress that cancels after some processor time."""

    def __init__(self) -> None:
        self._start = time.process_time()

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Cancel if it is late."""
        if time.process_time() - self._start > GIVEN_UP:
            raise OutOfTimeError(f"{stage}, {done} of {total}")


def _range(specimen: Specimen, name: str) -> tuple[float, float]:
    """Values that a parameter of a specimen may take."""
    toggle = specimen.name == "frame of two members"
    family = "toggle" if toggle else specimen.name.split()[0].rstrip(",")
    for key in (f"{family} {name}", family if family == "truss" else name):
        if key in RANGES:
            return RANGES[key]
    centre = specimen.centre[[p.name for p in specimen.structure.parameters].index(name)]
    return centre - AROUND, centre + AROUND


def _reach(structure: Rod | SpatialRod, sides: Mapping[str, Sequence[float]]) -> float | None:
    """How far apart both ends of a rod are held, at most; None if they may move.

    `sides`: values of each parameter between which it lies.
    """
    held = [each for each in PLACES if each in sides]
    if len(held) < (3 if isinstance(structure, SpatialRod) else 1) or held[0] != "nu":
        return None
    return min(max(map(np.linalg.norm, product(*(sides[each] for each in held)))), FARTHEST)


def _bounded(
    specimen: Specimen, sides: Mapping[str, Sequence[float]], generator: np.random.Generator
) -> tuple[Structure, tuple[Constraint, ...]]:
    """The structure under a cap of its curvature, with the elements that this needs, or others.

    Else a cap of the angles of a chain, or of shortenings: for half of the trusses with engineering
    strain, whose bars may not collapse anyway.
    """
    structure, share = specimen.structure, generator.random()
    if isinstance(structure, Rod | SpatialRod | Frame | SpatialFrame):
        bound = round(_share(CAPS.get(specimen.name, CAPS_OF_RODS), share), 2)
        held = isinstance(structure, Rod | SpatialRod)
        fine = structure.resolving(bound, _reach(structure, sides) if held else None)
        return fine, (fine.max_curvature <= bound,)
    return structure, _within(specimen, share)


def _within(specimen: Specimen, share: float) -> tuple[Constraint, ...]:
    structure = specimen.structure
    if specimen.name.startswith("chain"):
        largest = Descriptor("largest_angle", "1", lambda z, p: np.abs(z[:, :LINKS]).max(axis=1))
        return (largest <= round(_share(ANGLES, share), 2),)
    if isinstance(structure, Truss) and (share < HALF or structure.energies.green):
        return (structure.max_shortening <= round(_share(SHORTENINGS, share), 2),)
    return ()


def _share(span: tuple[float, float], share: float) -> float:
    return span[0] + share * (span[1] - span[0])


def question(number: int) -> Question:
    """Return the question with a number."""
    generator = np.random.default_rng([16, number])
    specimen = SPECIMENS[number % len(SPECIMENS)]
    names = [parameter.name for parameter in specimen.structure.parameters]
    d = min(int(generator.choice(DIMENSIONS)), len(names))
    free = sorted(generator.choice(len(names), d, replace=False).tolist())
    ranges = {name: _range(specimen, name) for name in names}
    sides, wide = {}, generator.random() < WIDE
    for name in (names[k] for k in free):
        low, high = np.sort(generator.uniform(*ranges[name], 2))
        width = 0.05 * (ranges[name][1] - ranges[name][0])
        if wide:
            least, most = ranges[name]
            spare = generator.uniform(0.0, 0.5 * (1.0 - MOST), 2) * (most - least)
            low, high = least + spare[0], most - spare[1]
        sides[name] = (round(low, 4), round(max(high, low + width), 4))
    fixed = {}
    for name in names:
        low, high = ranges[name]
        zero = low <= 0.0 <= high and generator.random() < SYMMETRIC
        if name not in sides:
            fixed[name] = 0.0 if zero else round(generator.uniform(low, high), 4)
    values = {name: (value,) for name, value in fixed.items()}
    structure, within = _bounded(specimen, sides | values, generator)
    fewest, most = INTERVALS[d]
    intervals = tuple(generator.integers(fewest, most + 1, d).tolist())
    return Question(specimen.name, structure, Box(**sides), fixed, within, intervals)


def outcome(asked: Question) -> tuple[str, int]:
    """Whether a set is clean, or what fails; and its vertices."""
    try:
        eset = asked.lifted(progress=Deadline())
    except InputError as error:
        return f"refused: {error}", 0
    except OutOfTimeError as error:
        return f"out of time: {error}", 0
    audit = eset.audit
    if audit.clean:
        return "clean", audit.vertices
    faults = ", ".join(f"{name} {count}" for name, count in audit.faults.items())
    return f"named: {faults}", audit.vertices


def compile_kernels(asked: Question) -> None:
    """Compile what a question needs in another process: it is neither time nor memory of a set.

    After a change of kernels it took up to 70 seconds of a set, and 530 MB of forty sets.
    """
    calls = calls_of((asked.structure, *asked.within))
    missing = [str(each.number) for each in calls if not each.is_kept]
    if missing:
        command = [sys.executable, "-m", "equimorph.linalg.compile_ahead", *missing]
        subprocess.run(command, check=True)


def memory() -> int:
    """Memory of this process in MB, without what its libraries keep for the next set."""
    gc.collect()
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):
        libc.malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 // 2**20


def run(numbers: Iterable[int]) -> Iterable[str]:
    """Lines of the sets with these numbers."""
    for number in numbers:
        asked = question(number)
        compile_kernels(asked)
        start = time.process_time()
        try:
            said, vertices = outcome(asked)
        except Exception as error:  # what a soak is for
            said, vertices = f"error: {type(error).__name__}: {error}", 0
        spent = time.process_time() - start
        yield "\t".join(
            [str(number), asked.name, said, str(vertices), f"{spent:.1f} s",
             f"{memory()} MB", str(asked)]
        )  # fmt: skip


def summary(lines: Iterable[str]) -> str:
    """Counts, time and memory of some lines."""
    rows = [line.split("\t") for line in lines if line.count("\t") == COLUMNS - 1]
    kinds = Counter(row[2].split(":")[0] for row in rows)
    seconds = np.array([float(row[4].split()[0]) for row in rows])
    megabytes = [int(row[5].split()[0]) for row in rows]
    counts = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    faults = "".join("\n" + "\t".join(row) for row in rows if row[2] != "clean")
    return (
        f"{len(rows)} sets: {counts}; median {np.median(seconds):.1f} s, longest "
        f"{seconds.max():.1f} s, {int((seconds > LONGEST).sum())} over {LONGEST:.0f} s; memory "
        f"{megabytes[len(rows) // 4]} MB after a quarter, {megabytes[-1]} MB at the end{faults}"
    )


def main(arguments: list[str]) -> None:
    """Lift sets, or add up what was printed before."""
    if arguments[:1] == ["summary"]:
        texts = [Path(name).read_text(encoding="utf-8") for name in arguments[1:]]
        print(summary(line for text in texts for line in text.splitlines()))  # noqa: T201
        return
    file, first, count = Path(arguments[0]), int(arguments[1]), int(arguments[2])
    known = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    done = {int(line.split("\t")[0]) for line in known if line.count("\t") == COLUMNS - 1}
    with file.open("a", encoding="utf-8") as out:
        for line in run(number for number in range(first, first + count) if number not in done):
            out.write(line + "\n")
            out.flush()
    print(summary(file.read_text(encoding="utf-8").splitlines()))  # noqa: T201


if __name__ == "__main__":
    main(sys.argv[1:])

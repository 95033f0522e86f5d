"""Load cycles: quasi-static motions around a closed way of parameters, with the snaps on it.

See docs/barriers.md, "Load cycles".
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from equimorph.argument_checks import check_arguments
from equimorph.equilibria.lift import Path, check_start, lift
from equimorph.equilibria.snap import Landing, snap_landing
from equimorph.errors import InputError
from equimorph.structures import State
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_SOLUTION

CRITICAL = ("fold", "branch point", "multiple point")
"""Ends of lifts from which a structure snaps."""
MOST_SNAPS = 100
"""In one cycle."""


@dataclass(frozen=True, eq=False)
class LoadCycle:
    """A quasi-static motion around a closed way of parameters.

    Parameters
    ----------
    status
        "closed": the last cycle ends in the state in which it began; "open": none of the cycles
        did; "ended": the motion could not go on, as where no state stops a snap.
    paths
        Quasi-static parts of the last cycle; a snap lies between two of them.
    snaps
        Landings of the snaps of the last cycle, in order.
    cycles
        Number of cycles until the motion repeats itself.
    detail
        What ended the motion, if anything did.
    """

    status: Literal["closed", "open", "ended"]
    paths: tuple[Path, ...]
    snaps: tuple[Landing, ...]
    cycles: int
    detail: str = ""

    @property
    def lost(self) -> float:
        """Energy that the snaps of the last cycle release.

        In a closed cycle this is the work of all parameters, the area of the hysteresis loop:
        Σ ∮ ∂L/∂pᵢ dpᵢ = Σ released.
        """
        return float(sum(each.released for each in self.snaps))

    def __repr__(self) -> str:
        """One line."""
        why = f": {self.detail}" if self.detail else ""
        return (
            f"LoadCycle({self.status}{why}; {len(self.snaps)} snaps release {self.lost:.6g} in "
            f"cycle {self.cycles})"
        )


@check_arguments
def load_cycle(
    state: State, way_points: Sequence[Mapping[str, float]], *, cycles: int = 10
) -> LoadCycle:
    """Move a state around a closed way of its parameters, again and again until that repeats.

    Between way-points equilibria are lifted along straight moves. Where stability is lost the
    structure snaps (`snap_landing`), and the motion goes on from where it lands. It ends where a
    snap may lead to several states, as from a symmetric branch point.

    Parameters
    ----------
    state
        A stable state, where the first cycle begins.
    way_points
        Corners of the way; the last one has the parameters of `state`.
    cycles
        Largest number of cycles.

    Raises
    ------
    InputError
        If the state is not stable, there is no way-point, or the way is not closed.
    """
    check_start(state)
    if state.index != 0:
        raise InputError(f"`state` must be stable; got one of index {state.index}.")
    if not way_points:
        raise InputError("`way_points` must have at least one corner; got none.")
    last = {**state.parameters}
    for corner in way_points:
        last |= corner
    if last != state.parameters:
        raise InputError(
            f"`way_points` must end at the parameters of `state` ({state.parameters}); "
            f"got a way to {last}."
        )
    here = state
    for number in range(1, cycles + 1):
        paths, snaps, detail = _around(here, list(way_points))
        if detail:
            return LoadCycle("ended", paths, snaps, number, detail)
        end = paths[-1].end.state
        if _same(end, here):
            return LoadCycle("closed", paths, snaps, number)
        here = end
    return LoadCycle("open", paths, snaps, cycles)


def _same(one: State, other: State) -> bool:
    n = one.structure.unknowns
    return bool(metric_length(one.structure, (one.z - other.z)[None, :n])[0] <= SAME_SOLUTION)


def _around(
    here: State, corners: list[Mapping[str, float]]
) -> tuple[tuple[Path, ...], tuple[Landing, ...], str]:
    """Quasi-static parts and landings of one cycle, and why it ended before its last corner."""
    paths, snaps = list[Path](), list[Landing]()
    for _ in range(MOST_SNAPS):
        path = lift(here, corners)
        paths.append(path)
        end = path.end
        if end.kind == "arrived":
            return tuple(paths), tuple(snaps), ""
        if end.kind not in CRITICAL:
            return tuple(paths), tuple(snaps), f"{end.kind} {end.detail}".strip()
        ways = [each for each in snap_landing(end.state) if each.status != "held"]
        lost = ", ".join(each.status for each in ways if not each.landed)
        if lost or not ways:
            why = f"the snap from a {end.kind} did not land: {lost or 'held'}"
            return tuple(paths), tuple(snaps), why
        if not all(_same(each.state, ways[0].state) for each in ways):
            why = f"the snap from a {end.kind} may land at either of two states"
            return tuple(paths), tuple(snaps), why
        snaps.append(ways[0])
        here, corners = ways[0].state, corners[int(end.at) :]
    return tuple(paths), tuple(snaps), f"more than {MOST_SNAPS} snaps in one cycle"

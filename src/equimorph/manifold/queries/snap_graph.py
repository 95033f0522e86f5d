"""Where snaps lead: from each piece of stability boundary to the stratum where it lands.

See docs/decisions.md, "Snaps at folds and barriers are two questions".
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Facets, Int, Items
from equimorph.equilibria import Landing
from equimorph.equilibria.snap import snap_landings
from equimorph.errors import InputError
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.manifold.geometry.topology import facets_of, flags_of, pieces
from equimorph.model import Progress, Silent
from equimorph.structures import join_states
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_SOLUTION

NOWHERE = -1
"""Instead of a stratum: the landing is not in the set, or does not exist."""


@dataclass(frozen=True, eq=False)
class Snap:
    """A run of the stability boundary from which all snaps lead to one stratum.

    Parameters
    ----------
    source, target
        Numbers of strata; `target` is −1 where the snap lands nowhere in the set.
    status
        How the snaps end: see `Landing`; "held" where nothing moves, as at cusps.
    vertices
        Vertices of the boundary that were tried, in order along it.
    landings
        Where each of them lands.
    along
        All vertices of the boundary from the first that was tried to the last; over three
        parameters, where they have no order, those that were tried.
    """

    source: int
    target: int
    status: str
    vertices: Int[np.ndarray, " tried"]
    landings: tuple[Landing, ...]
    along: Items

    @property
    def released(self) -> tuple[float, float]:
        """Least and greatest energy released."""
        values = [landing.released for landing in self.landings]
        return min(values), max(values)


@dataclass(frozen=True, eq=False)
class SnapGraph:
    """Stable strata as nodes, snaps between them as edges.

    Parameters
    ----------
    eset
        The set.
    strata
        Numbers of the stable strata.
    snaps
        Runs of the stability boundary with their landings.
    """

    eset: EquilibriumSet
    strata: tuple[int, ...]
    snaps: tuple[Snap, ...]

    @check_arguments
    def leaving(self, stratum: int) -> tuple[Snap, ...]:
        """Snaps that leave a stratum.

        Raises
        ------
        InputError
            If it is no stable stratum.
        """
        if stratum not in self.strata:
            names = ", ".join(map(str, self.strata)) or "none"
            raise InputError(f"`stratum` must be a stable one ({names}); got {stratum!r}.")
        return tuple(snap for snap in self.snaps if snap.source == stratum)

    def __repr__(self) -> str:
        """One line per stratum and per snap."""
        lines = [f"SnapGraph over {self.eset.box}: {len(self.strata)} stable strata"]
        for stratum in self.strata:
            lines.append(f"  stratum {stratum} ({self.eset.strata[stratum].cells} cells)")
            lines.extend(f"    {_in_words(self.eset, snap)}" for snap in self.leaving(stratum))
        return "\n".join(lines)


@check_arguments
def snap_graph(
    eset: EquilibriumSet, *, samples: int = 9, progress: Progress | None = None
) -> SnapGraph:
    """Follow snaps from all pieces of the stability boundary.

    Snaps start at sampled vertices of the boundary between a stable stratum and a stratum of index
    one (`snap_landing`). Along curves, the places where the landing changes are bisected until they
    lie between neighbouring vertices.

    Parameters
    ----------
    samples
        Number of vertices tried first on each piece.
    progress
        Sink for progress reports.

    Raises
    ------
    InputError
        If `samples` is not a whole number of at least two.
    """
    progress = progress or Silent()
    stable = tuple(k for k, stratum in enumerate(eset.strata) if stratum.index == 0)
    edges = [(k, piece) for k in stable for piece in _pieces(eset, k)]
    snaps = []
    for number, (source, piece) in enumerate(edges):
        progress.report("snaps", number, len(edges))
        snaps.extend(_Edge(eset, source, piece).snaps(samples))
    return SnapGraph(eset, stable, tuple(snaps))


def stability_boundary(eset: EquilibriumSet, stratum: int) -> Facets:
    """Facets of the folds around a stratum, one a row."""
    return from_cache(eset, ("boundary", stratum), lambda: _boundary(eset, stratum))


def _boundary(eset: EquilibriumSet, stratum: int) -> Facets:
    whole = eset.adjacency
    folded = flags_of(whole.facets, facets_of(eset.folds, len(eset.names)))
    a, b = whole.links.T
    side_a, side_b = eset.stratum[a] == stratum, eset.stratum[b] == stratum
    own = np.unique(whole.across[(side_a != side_b) & folded[whole.across]])
    return np.asarray(whole.facets[own])


def _pieces(eset: EquilibriumSet, stratum: int) -> Iterator[Items]:
    """Vertices of the pieces of the folds around a stable stratum, in order along curves."""
    for piece in pieces(stability_boundary(eset, stratum)):
        yield piece if len(eset.names) < 3 else np.unique(piece)


class _Edge:
    """A piece of the stability boundary, and what is known of the snaps from its vertices."""

    def __init__(self, eset: EquilibriumSet, source: int, vertices: Items) -> None:
        self.eset, self.source, self.vertices = eset, source, vertices
        self.known: dict[int, tuple[Landing, int]] = {}

    def snaps(self, samples: int) -> list[Snap]:
        """Runs of vertices with the same landing."""
        count = len(self.vertices)
        tried = sorted({round(k) for k in np.linspace(0, count - 1, min(samples, count))})
        self._try(tried)
        pairs = list(pairwise(tried)) if len(self.eset.names) == 2 else []
        while pairs := [each for each in pairs if self._changes(*each)]:
            middles = [(low + high) // 2 for low, high in pairs]
            self._try(middles)
            halves = zip(pairs, middles, strict=True)
            pairs = [each for (low, high), mid in halves for each in ((low, mid), (mid, high))]
        out: list[Snap] = []
        run: list[int] = []
        order = sorted(self.known)
        if len(self.eset.names) == 3:  # vertices of a surface have no order along it
            order.sort(key=self._outcome)
        for place in order:
            if run and self._outcome(place) != self._outcome(run[-1]):
                out.append(self._snap(run))
                run = []
            run.append(place)
        return [*out, self._snap(run)] if run else out

    def _snap(self, run: list[int]) -> Snap:
        landings = tuple(self.known[place][0] for place in run)
        status, target = self._outcome(run[0])
        ordered = len(self.eset.names) < 3
        along = self.vertices[run[0] : run[-1] + 1] if ordered else self.vertices[run]
        return Snap(self.source, target, status, self.vertices[run], landings, along)

    def _changes(self, low: int, high: int) -> bool:
        """Whether the outcome changes between two places that are no neighbours."""
        return high - low > 1 and self._outcome(low) != self._outcome(high)

    def _outcome(self, place: int) -> tuple[str, int]:
        landing, stratum = self.known[place]
        return landing.status, stratum

    def _try(self, places: list[int]) -> None:
        """Follow the snaps from vertices; at most one of the two directions leads away."""
        states = self.eset.points[self.vertices[places]]
        landings = [
            next((each for each in ways if each.status != "held"), ways[0])
            for ways in snap_landings(states)
        ]
        found = zip(landings, self._strata(landings), strict=True)
        self.known.update(zip(places, found, strict=True))

    def _strata(self, landings: list[Landing]) -> list[int]:
        """Strata on which landings lie."""
        eset, structure = self.eset, self.eset.structure
        out = [NOWHERE] * len(landings)
        landed = [k for k, each in enumerate(landings) if each.landed]
        if not landed:
            return out
        ends = join_states(structure, [landings[k].state.batch for k in landed])
        over = eset.over(**{name: ends[name] for name in eset.names})
        gap = metric_length(structure, over.states.z - ends.z[over.point])
        near = np.flatnonzero(gap < SAME_SOLUTION)
        for row in near[::-1].tolist():  # the first one counts
            out[landed[over.point[row]]] = int(over.stratum[row])
        return out


def _in_words(eset: EquilibriumSet, snap: Snap) -> str:
    """A snap in one line."""
    points = eset.coordinates[snap.vertices]
    low, high = points.min(axis=0), points.max(axis=0)
    ranges = zip(eset.names, low, high, strict=True)
    where = ", ".join(f"{name} {a:.3g} … {b:.3g}" for name, a, b in ranges)
    if snap.status == "held":
        return f"no snap at {where}: nothing moves"
    if snap.target == NOWHERE:
        return f"snaps out of the set ({snap.status}) from {where}"
    least, most = snap.released
    return f"snaps to stratum {snap.target}, releases {least:.3g} … {most:.3g}, from {where}"

"""Curves on which a map is not smooth: their kinds and exact places.

See docs/decisions.md, "Curves of maps are found edge by edge".
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Bool, Float, Int, Settings
from equimorph.columns import Columns
from equimorph.equilibria.natural_sheet import NaturalSheet
from equimorph.structures import States
from equimorph.tasks.maps.brackets import (
    Brackets,
    Samples,
    cells_beside,
    divide,
    edges_ahead,
    grid_edges,
    narrow,
    sample_distance,
    suspicious_edges,
)
from equimorph.tasks.maps.causes import BESIDE, Paths, Start, candidates, is_sharp
from equimorph.tolerances import SAME_PLACE

ROUNDS = 3
"""How often causes are looked for, in parts of parts of a pair."""
DIVISIONS = 1
"""Of what remains without a cause: it is known to 8⁻⁴ of an edge."""
EXACT = 1e-10
"""Error of places that have a cause, in units of the parameters' scales: Newton's method ends with
a correction of 1e-9, and is linear with a rate of 1e-6."""

EDGE_DIVISIONS = 14
"""Down to round-off."""

Points = Float[np.ndarray, "points 2"]


@dataclass(frozen=True, eq=False, repr=False)
class MapCurve:
    """A curve on which a map is not smooth.

    Attributes
    ----------
    kind
        What happens there; each map says which kinds it knows.
    states
        States on the curve, in order, at its crossings with grid lines: exact where the kind has a
        cause, else one side of a narrow bracket.
    points
        Settings of these states.
    values
        Lower and higher value of the map on both sides, close to the curve; NaN where the map is
        not defined.
    errors
        Bound of the error of each point along its grid line, in the unit of the parameter.
    """

    kind: str
    states: States
    points: Float[np.ndarray, "points 2"]
    values: Float[np.ndarray, "points 2"]
    errors: Float[np.ndarray, " points"]

    def __repr__(self) -> str:
        """Kind, size, and the largest error."""
        points = len(self.points)
        return f"MapCurve({self.kind}: {points} points, within {self.errors.max(initial=0.0):.1g})"


@dataclass(frozen=True)
class Places(Columns):
    """Places at which a map is not smooth, with their kinds, errors, states and brackets."""

    brackets: Brackets
    kind: np.ndarray
    error: Float[np.ndarray, " brackets"]
    setting: Float[np.ndarray, "brackets 2"]
    z: Float[np.ndarray, "brackets size"]
    p: Float[np.ndarray, "brackets parameters"]


def explain(paths: Paths, pairs: Brackets) -> tuple[Places, Brackets, Brackets]:
    """Places with brackets around them; pairs without a cause; rest of the explained pairs.

    A cause counts if Newton's method finds its state inside the pair, and the map differs on both
    sides close to it. All causes that the ends allow are tried, one after the other. The rest of a
    pair are its parts on both sides of the place whose ends differ in kind.
    """
    found = candidates(paths, pairs)
    moving = np.argmax(np.abs(pairs.b.setting - pairs.a.setting), axis=1)
    error = EXACT * paths.sheet.structure.scales[paths.sheet.places[moving]]
    setting = found.p[:, paths.sheet.places]
    places = Places(pairs, found.kind, error, setting, found.z, found.p)
    return _confirm(paths, pairs, places, found.found)


def _confirm(
    paths: Paths, pairs: Brackets, places: Places, found: Bool[np.ndarray, " pairs"]
) -> tuple[Places, Brackets, Brackets]:
    """Look at the map close to places on both sides; see `explain`."""
    structure = paths.sheet.structure
    at = np.flatnonzero(found)
    here, wide = places.take(at), pairs.take(at)
    room = BESIDE * (wide.b.setting - wide.a.setting)
    beside = paths(np.concatenate([here.setting - room, here.setting + room]))
    left, right = beside.take(np.arange(len(at))), beside.take(np.arange(len(at), 2 * len(at)))
    # at an end of the pair the map is known
    low = np.abs(here.setting - wide.a.setting).sum(axis=1) < np.abs(room).sum(axis=1)
    high = np.abs(here.setting - wide.b.setting).sum(axis=1) < np.abs(room).sum(axis=1)
    left, right = wide.a.where(low, left), wide.b.where(high, right)
    sure = is_sharp(paths, left, right, wide, BESIDE)
    sure &= paths.is_known(left) & paths.is_known(right)
    rest = Brackets.concatenate(
        [Brackets(wide.a, left, wide.edge), Brackets(right, wide.b, wide.edge)]
    )
    again = np.isinf(sample_distance(structure, rest.a, rest.b)) & np.tile(sure, 2)
    narrow = Brackets(left, right, wide.edge)
    confirmed = replace(here, brackets=narrow).take(np.flatnonzero(sure))
    open_ = np.setdiff1d(np.arange(len(pairs)), at[sure])
    return confirmed, pairs.take(open_), rest.take(np.flatnonzero(again))


def places_on(paths: Paths, vertices: Samples, shape: tuple[int, int]) -> tuple[Places, Places]:
    """Places on grid edges at which the map is not smooth: with their causes, and without.

    Suspicious edges are examined first. Where a line of places ends inside the grid, the remaining
    edges of the cell that it enters are examined, too, until nothing new is found.
    """
    structure, edges = paths.sheet.structure, grid_edges(shape)
    ends = (vertices.take(edges[:, k]) for k in (0, 1))
    # beyond the edge of definition, and where paths were lost, there is nothing to compare
    known = paths.is_known(vertices)[edges].all(axis=1)
    differences = np.where(known, sample_distance(structure, *ends), 0.0)
    fresh = np.flatnonzero(suspicious_edges(differences, shape) | paths.suspects(vertices, edges))
    tried, seen = np.zeros(len(edges), bool), np.zeros(0, int)
    found: list[Places] = []
    left: list[Places] = []
    while len(fresh):
        tried[fresh] = True
        pairs = (vertices.take(edges[fresh, 0]), vertices.take(edges[fresh, 1]), fresh)
        sure, open_ = _resolve(paths, Brackets(*pairs))
        found += sure
        left.append(unexplained_places(paths, open_))
        seen = np.concatenate([seen, *(each.brackets.edge for each in (*sure, left[-1]))])
        ahead = edges_ahead(seen, shape)
        fresh = ahead[~tried[ahead] & (differences[ahead] > 0.0)]
    none = np.zeros(0, int)
    nothing = unexplained_places(paths, Brackets(vertices.take(none), vertices.take(none), none))
    return _together([nothing, *found]), _together([nothing, *left])


def _resolve(paths: Paths, pairs: Brackets) -> tuple[list[Places], Brackets]:
    """Look for causes and divide in turn; what is never explained is divided further."""
    structure = paths.sheet.structure
    found: list[Places] = []
    for _ in range(ROUNDS):
        if not len(pairs):
            return found, pairs
        places, rest, more = explain(paths, pairs)
        found.append(places)
        pairs = Brackets.concatenate([divide(structure, paths, rest), more]) if len(rest) else more
    return found, narrow(structure, paths, pairs, DIVISIONS)


def _together(parts: list[Places]) -> Places:
    whole = parts[0]
    for part in parts[1:]:
        whole = Places.concatenate([whole, part])
    return whole


def unexplained_places(paths: Paths, pairs: Brackets) -> Places:
    """Places in the middle of pairs, with kinds by what their ends show."""
    kind = paths.unexplained_kinds(pairs)
    some = np.flatnonzero(kind != "")
    pairs = pairs.take(some)
    a, b = pairs.a, pairs.b
    middle = 0.5 * (a.setting + b.setting)
    return Places(pairs, kind[some], half_length(pairs), middle, a.z, a.p)


def half_length(pairs: Brackets) -> Float[np.ndarray, " brackets"]:
    """How far the middle of a pair is at most from any place in it."""
    return np.asarray(0.5 * np.abs(pairs.b.setting - pairs.a.setting).sum(axis=1))


def curves_through(
    sheet: NaturalSheet, groups: Sequence[Places], shape: tuple[int, int]
) -> tuple[MapCurve, ...]:
    """Connect places of each kind to curves across the cells of the grid."""
    structure = sheet.structure
    scales = structure.scales[sheet.places]
    curves = []
    for places in groups:
        for kind in dict.fromkeys(places.kind.tolist()):
            some = places.take(np.flatnonzero(places.kind == kind))
            # a vertex on a curve belongs to two edges, and was found from both
            rounded = np.round(some.setting / (SAME_PLACE * scales))
            some = some.take(np.sort(np.unique(rounded, axis=0, return_index=True)[1]))
            ends = np.stack([some.brackets.a.value, some.brackets.b.value], axis=1)
            for line in polylines(some.setting / scales, some.brackets.edge, shape):
                states = States(structure, some.z[line], some.p[line])
                values, errors = np.sort(ends[line]), some.error[line]
                curves.append(MapCurve(kind, states, some.setting[line], values, errors))
    return tuple(curves)


def edge_of_definition(paths: Paths, settings: Settings, shape: tuple[int, int]) -> Places:
    """Places on grid edges at only one end of which a path can start."""
    start, edges = paths.natural_samples(settings), grid_edges(shape)
    out = start.kind[edges] != Start.LOST
    at = np.flatnonzero(out[:, 0] != out[:, 1])
    pairs = Brackets(start.take(edges[at, 0]), start.take(edges[at, 1]), at)
    found = narrow(paths.sheet.structure, paths.natural_samples, pairs, EDGE_DIVISIONS)
    middle = 0.5 * (found.a.setting + found.b.setting)
    inside = found.a.where(found.a.kind == Start.LOST, found.b)
    kind = np.full(len(found), "edge", dtype=object)
    return Places(found, kind, half_length(found), middle, inside.z, inside.p)


def polylines(
    points: Points, edge: Int[np.ndarray, " points"], shape: tuple[int, int]
) -> list[Int[np.ndarray, " _"]]:
    """Connect points on edges of a grid of ``shape`` vertices across its cells.

    Within a cell the closest points on different edges are connected first, in pairs;
    unpaired points are ends of curves.

    Returns numbers of the points along each polyline; a closed one repeats its first.
    """
    inside: dict[int, list[int]] = {}
    for k, cells in enumerate(cells_beside(edge, shape).tolist()):
        for cell in cells:
            if cell >= 0:
                inside.setdefault(cell, []).append(k)
    links: dict[int, list[int]] = {k: [] for k in range(len(points))}
    for members in inside.values():
        for one, other in _pairs(points, edge, members):
            links[one].append(other)
            links[other].append(one)
    return _walks(links)


def _pairs(
    points: Points, edge: Int[np.ndarray, " points"], members: list[int]
) -> list[tuple[int, int]]:
    """Closest pairs of points on different edges of one cell, each point once."""
    choices = [
        (a, b) for n, a in enumerate(members) for b in members[n + 1 :] if edge[a] != edge[b]
    ]
    choices.sort(key=lambda pair: float(np.hypot(*(points[pair[0]] - points[pair[1]]))))
    used: set[int] = set()
    found = []
    for a, b in choices:
        if a not in used and b not in used:
            found.append((a, b))
            used |= {a, b}
    return found


def _walks(links: dict[int, list[int]]) -> list[Int[np.ndarray, " _"]]:
    """Follow links from loose ends, then around what is closed."""
    left = set(links)
    order = sorted(links, key=lambda k: len(links[k]))  # loose ends first
    found = []
    for start in order:
        if start not in left:
            continue
        walk, here = [start], start
        left.discard(start)
        while ahead := [k for k in links[here] if k in left]:
            here = ahead[0]
            walk.append(here)
            left.discard(here)
        if len(walk) > 2 and start in links[here]:
            walk.append(start)
        found.append(np.array(walk))
    return found

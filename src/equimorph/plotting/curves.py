"""Curves of an equilibrium set and of a route that several figures draw."""

from itertools import pairwise

import numpy as np

from equimorph.arrays import Bool, Float, Int, Shaped
from equimorph.equilibria import Path, settle
from equimorph.errors import InputError
from equimorph.manifold import Division, EquilibriumSet
from equimorph.manifold.geometry.topology import pieces
from equimorph.model import position
from equimorph.structures import States
from equimorph.structures.metric import metric_length
from equimorph.tasks.route import Route
from equimorph.tolerances import ON_SIDE

# Relative to the width of the box: boundary vertices lie on it to rounding.


def fold_pieces(eset: EquilibriumSet) -> list[tuple[Int[np.ndarray, " _"], int]]:
    """Fold curves, cut where the index of their sides changes.

    Vertices of each piece in order, and the lower index of its two sides: 0 on the boundary of
    stability.
    """
    return _cut_by_index(eset, eset.folds)


def crossing_pieces(eset: EquilibriumSet) -> list[tuple[Int[np.ndarray, " _"], int]]:
    """Curves of branch points, cut where the lowest adjacent index changes, with that index."""
    return _cut_by_index(eset, eset.crossings)


def _cut_by_index(
    eset: EquilibriumSet, curves: tuple[Int[np.ndarray, "..."], ...]
) -> list[tuple[Int[np.ndarray, " _"], int]]:
    found = []
    for curve in curves:
        low = _lowest_index_beside(eset, curve)
        found += [(curve[a : b + 1], int(low[a])) for a, b in _runs(low)]
    return found


def boundary_pieces(eset: EquilibriumSet, *, box: bool) -> list[tuple[Int[np.ndarray, " _"], int]]:
    """Boundary curves, either those on the box or those on a cap, where a constraint cuts the set.

    Vertices of each piece in order, and the index of the adjacent cells.
    """
    found = []
    for boundary in eset.boundaries:
        vertices = boundary.vertices
        on_box = _along_box(eset, vertices)
        index = _lowest_index_beside(eset, vertices)
        for a, b in _runs(2 * index + on_box):
            if bool(on_box[a]) is box:
                found.append((vertices[a : b + 1], int(index[a])))
    return found


def limit_pieces(division: Division) -> list[tuple[Int[np.ndarray, " _"], int]]:
    """Bound along which a set was divided, cut where the index of its sides changes.

    Vertices of each piece in order, and the lower index of its two sides.
    """
    facets = division.eset.adjacency.facets
    found = []
    for line in pieces(facets[division.on_level[facets].all(axis=1)]):
        low = _lowest_index_beside(division.eset, line)
        found += [(line[a : b + 1], int(low[a])) for a, b in _runs(low)]
    return found


def track(eset: EquilibriumSet, states: States) -> Float[np.ndarray, "points 2"]:
    """Free parameters of the set at states, in order."""
    columns = [position(states.structure.parameters, name) for name in eset.names]
    return np.asarray(states.p[:, columns])


def way_points(eset: EquilibriumSet, route: Route) -> Float[np.ndarray, "corners 2"]:
    """Free parameters at the corners of a route, start and goal included; none without a path."""
    if route.path is None:
        return np.empty((0, 2))
    if route.schedule is None:
        return track(eset, route.path.states)[[0, -1]]
    columns = [route.schedule.names.index(name) for name in eset.names]
    return np.asarray(route.schedule.values[corner_steps(route)][:, columns])


def legs(eset: EquilibriumSet, route: Route) -> list[Float[np.ndarray, "_ 2"]]:
    """Free parameters along a route from corner to corner; nothing of one that did not arrive."""
    if route.path is None or route.schedule is None:
        return []
    places = track(eset, route.path.states)
    return [places[first : last + 1] for first, last in pairwise(corner_steps(route))]


def way_points_of(eset: EquilibriumSet, route: Route) -> Float[np.ndarray, "corners 2"]:
    """Free parameters at the way points of a route, whether it reaches them or not."""
    if route.path is None:
        return np.empty((0, 2))
    corners = [dict(zip(eset.names, track(eset, route.path.states)[0].tolist(), strict=True))]
    for corner in route.way_points:  # each changes some parameters and keeps the rest
        corners.append(corners[-1] | corner)
    return np.array([[corner[name] for name in eset.names] for corner in corners])


def corner_steps(route: Route) -> Int[np.ndarray, " corners"]:
    """Steps of the schedule at the corners of a route, first and last included."""
    assert route.schedule is not None
    last = len(route.schedule.progress) - 1
    return np.unique(np.concatenate([[0], route.schedule.way_points, [last]])).astype(int)


def snap_steps(route: Route) -> Int[np.ndarray, " snaps"]:
    """Steps of the path of a route from which it snaps: to the next one, at the same parameters."""
    if route.path is None:
        return np.zeros(0, int)
    z = route.path.states.z
    landed = [np.flatnonzero((z == snap.state.z).all(axis=1)) for snap in route.snaps]
    return np.array([int(steps[0]) - 1 for steps in landed], dtype=int)


def path_of(path_or_route: Path | Route) -> Path:
    """Path of a route, or the path itself; a route without one is refused with its reason."""
    if isinstance(path_or_route, Path):
        return path_or_route
    if path_or_route.path is None:
        raise InputError(f"`route` must have a path; got a refused route: {path_or_route.why}")
    return path_or_route.path


def states_along(path: Path, count: int) -> States:
    """Equilibria at even distances along a path, its first and last state among them.

    Interpolated between its states and corrected by Newton's method at fixed parameters; where that
    leaves the interval (next to a fold), the nearest state of the path is taken.
    """
    structure, known = path.states.structure, path.states
    length = np.linspace(path.length[0], path.length[-1], count)
    after = np.clip(np.searchsorted(path.length, length), 1, len(path.length) - 1)
    width = path.length[after] - path.length[after - 1]
    share = (length - path.length[after - 1]) / np.where(width > 0, width, 1.0)
    z = known.z[after - 1] + share[:, None] * (known.z[after] - known.z[after - 1])
    p = known.p[after - 1] + share[:, None] * (known.p[after] - known.p[after - 1])
    solved = settle(structure, z, p)
    found = solved.found & (metric_length(structure, solved.z - z) <= 0.5 * width)
    found &= (share > 0) & (share < 1)  # known states stay as they are
    nearest = np.where(share < 0.5, after - 1, after)
    z = np.where(found[:, None], solved.z, known.z[nearest])
    p = np.where(found[:, None], p, known.p[nearest])
    return States(structure, z, p)


def _lowest_index_beside(
    eset: EquilibriumSet, line: Int[np.ndarray, " vertices"]
) -> Int[np.ndarray, " edges"]:
    """Lowest index of the cells at each edge of a polyline of vertices."""
    count = len(eset.coordinates)
    sides = np.concatenate([eset.cells[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    keys = _edge_keys(sides[:, 0], sides[:, 1], count)
    wanted = _edge_keys(line[:-1], line[1:], count)
    names, place = np.unique(wanted, return_inverse=True)
    at = np.minimum(np.searchsorted(names, keys), len(names) - 1)
    hit = names[at] == keys
    lowest = np.full(len(names), np.iinfo(int).max)
    np.minimum.at(lowest, at[hit], np.tile(eset.cell_index, 3)[hit])
    # An edge that no cell has (a fold seen from outside the set) takes the index of its ends.
    ends = np.minimum(eset.index[line[:-1]], eset.index[line[1:]])
    return np.where(lowest[place] == np.iinfo(int).max, ends, lowest[place])


def _edge_keys(
    a: Int[np.ndarray, " edges"], b: Int[np.ndarray, " edges"], count: int
) -> Int[np.ndarray, " edges"]:
    """One number per undirected edge."""
    return np.asarray(np.minimum(a, b).astype(np.int64) * count + np.maximum(a, b))


def _along_box(
    eset: EquilibriumSet, vertices: Int[np.ndarray, " vertices"]
) -> Bool[np.ndarray, " edges"]:
    """Whether each edge of a polyline lies on one side of the box."""
    slack = ON_SIDE * (eset.box.upper - eset.box.lower)
    places = eset.coordinates[vertices]
    on_side = np.stack(
        [np.abs(places - eset.box.lower) <= slack, np.abs(places - eset.box.upper) <= slack]
    )
    return np.asarray((on_side[:, :-1] & on_side[:, 1:]).any(axis=(0, 2)))


def _runs(values: Shaped[np.ndarray, " edges"]) -> list[tuple[int, int]]:
    """First and last-plus-one place of every run of equal values."""
    if not len(values):
        return []
    cuts = np.flatnonzero(values[1:] != values[:-1]) + 1
    ends = [0, *cuts.tolist(), len(values)]
    return list(pairwise(ends))

"""How far a stable state is from the edge of stability: in the parameters, and along the set."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Facets, Float, Int, Items, ItemValues, Lanes, Pairs, Parameters, Some
from equimorph.equilibria import lift
from equimorph.equilibria.critical import Critical, null_border
from equimorph.errors import InputError
from equimorph.linalg.graphs import graph_of, walk_back
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache, places_of
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import distinct, faces_of
from equimorph.manifold.queries.geodesics import Chains
from equimorph.manifold.queries.least_squares import nearest as nearest_points
from equimorph.manifold.queries.locate import pieces_of
from equimorph.manifold.queries.nearest import Ground, SetPoints, local_minima, points_at_vertices
from equimorph.manifold.queries.snap_graph import stability_boundary
from equimorph.structures import State, States
from equimorph.structures.metric import metric_length

CANDIDATES = 12
"""Places of the boundary from which the nearest one is searched."""
BEYOND = 1.001
"""How far a straight move to the boundary is lifted, relative to the way there."""
SHORT_OF = 1e-7
"""Part of the way to a cusp that is left out."""
APART = 2.0
"""Distance from a cusp, relative to that of its reduced equation, within which a state belongs to
it."""
ROUND_OFF = 1e-9
"""Part of the way to the limit of a parameter that is left out, as the limit itself may be."""
LONGER = 1.1
"""Ways along edges of the complex are up to a tenth too long: so much longer ones are tried."""
LINKS = (8, 16)
"""Links of the chains along the set whose lengths are extrapolated."""


@dataclass(frozen=True, eq=False)
class StabilityDistance:
    """Distances of a stable state from the boundary of its stratum where stability is lost.

    Parameters
    ----------
    in_parameters
        Length of the shortest straight change of the free parameters, in their scales, that leads
        to a loss of stability; ∞ if none is known in the box.
    nearest
        Fold that this change leads to.
    along_the_set
        Length of the shortest curve on the set to the boundary, in the metric: configuration and
        scaled parameters; ∞ if the stratum has no such boundary in the box.
    way
        States along that curve, the last one a fold.
    """

    in_parameters: float
    nearest: State | None
    along_the_set: float
    way: States

    def __repr__(self) -> str:
        """Both lengths."""
        return (
            f"StabilityDistance({self.in_parameters:.6g} in scaled parameters, "
            f"{self.along_the_set:.6g} along the set)"
        )


@check_arguments
def stability_distance(eset: EquilibriumSet, state: State) -> StabilityDistance:
    """Distance of a stable state from the loss of stability, within the box of a set.

    In the parameters: the nearest points of the folds around the stratum, polished on the fold by
    Newton, nearest first, until the straight move to one of them can be lifted. Along the set: the
    shortest paths over the edges of the complex, straightened on the set, with their lengths
    extrapolated from chains of 8 and 16 links (fourth order).

    Raises
    ------
    InputError
        If the state is unstable or does not belong to the set.
    """
    stratum = _stratum_of(eset, state)
    boundary = stability_boundary(eset, stratum)
    if len(boundary) == 0:
        return StabilityDistance(np.inf, None, np.inf, state.batch)
    length, nearest = _in_parameters(eset, state, boundary)
    along, way = _along_the_set(eset, state, stratum, boundary)
    return StabilityDistance(length, nearest, along, way)


def _stratum_of(eset: EquilibriumSet, state: State) -> int:
    values = {name: state[name] for name in eset.names}
    if not np.allclose(eset.parameters_at(values), state.p, rtol=0, atol=1e-9):
        raise InputError(
            f"`state` must have the fixed parameters of the set ({dict(eset.fixed)}); "
            f"got {state.parameters}."
        )
    stratum, _ = pieces_of(eset, state)
    if stratum < 0:
        raise InputError(f"`state` must be a state of the set; got {state}, which is not.")
    if eset.strata[stratum].index != 0:
        raise InputError(f"`state` must be stable; got one of index {eset.strata[stratum].index}.")
    return stratum


def _in_parameters(
    eset: EquilibriumSet, state: State, boundary: Facets
) -> tuple[float, State | None]:
    """Shortest straight change to the boundary that can be lifted, and where it ends."""
    setting = eset.setting
    free, scales = setting.free, setting.scales

    def change(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes d"]:
        return np.asarray((p - state.p)[:, free] / scales)

    far = np.linalg.norm(change(eset.points.z, eset.points.p), axis=1)
    starts = _nearest_of_each_part(boundary, far)
    found, length, _ = nearest_points(
        Ground(setting, eset, fold=True), points_at_vertices(eset, starts), change
    )
    best, nearest = np.inf, None
    for lane in np.argsort(length, kind="stable"):
        if length[lane] >= best:
            break
        end = _reached(eset, state, State(eset.structure, found.z[lane], found.p[lane]))
        if end is None:
            continue
        gone = float(np.linalg.norm(change(end.z[None], end.p[None])))
        if gone < best:
            best, nearest = gone, end
    return best, nearest


def _nearest_of_each_part(boundary: Facets, far: Float[np.ndarray, " V"]) -> Some:
    """Vertices of the boundary nearer than their neighbours on it, the nearest first."""
    if boundary.shape[1] == 1:
        minima = boundary[np.argsort(far[boundary[:, 0]], kind="stable"), 0]
    else:
        minima = local_minima(faces_of(boundary, 2), far)
    return np.asarray(minima[:CANDIDATES])


def _reached(eset: EquilibriumSet, state: State, fold: State) -> State | None:
    """State in which a straight change towards and just beyond a fold loses stability, if it does.

    A change that goes on is on another sheet than the fold, or leads through a cusp.
    """
    end = lift(state, to=_towards(eset, state, fold.p, BEYOND)).end
    if end.kind in {"fold", "branch point"}:
        return end.state
    near = lift(state, to=_towards(eset, state, fold.p, 1.0 - SHORT_OF)).end
    return fold if near.kind == "arrived" and _is_beside_cusp(near.state, fold) else None


def _towards(
    eset: EquilibriumSet, state: State, p: Float[np.ndarray, " P"], share: float
) -> dict[str, float]:
    """Values of the free parameters at a share of a change, within the limits of all."""
    change = p - state.p
    for k in eset.setting.free.tolist():
        one = eset.structure.parameters[k]
        limit = one.upper if change[k] > 0.0 else one.lower
        if change[k] != 0.0 and np.isfinite(limit):
            share = min(share, (1.0 - ROUND_OFF) * (limit - state.p[k]) / change[k])
    goal = state.p + share * change
    return {name: float(goal[k]) for name, k in zip(eset.names, eset.setting.free, strict=True)}


def _is_beside_cusp(near: State, cusp: State) -> bool:
    """Whether a state is as near to a singular one as the reduced equation of cusps says.

    ``c ξ³/6 = vᵀF_p dp`` for a change dp of the parameters, ξv that of the state.
    """
    structure, z, p = cusp.structure, cusp.z[None], cusp.p[None]
    at = Critical(structure, z, p, null_border(structure, z, p))
    share = np.cbrt(6.0 * np.abs(at.along(near.p[None] - p)) / np.abs(at.cubic))
    reach = metric_length(structure, share[:, None] * at.v)
    return bool(metric_length(structure, near.z[None] - z)[0] <= APART * reach[0])


def _along_the_set(
    eset: EquilibriumSet, state: State, stratum: int, boundary: Facets
) -> tuple[float, States]:
    """Length of the shortest curve on the set to the boundary, and states along it."""
    best: tuple[float, States] = (np.inf, state.batch)
    chains = Chains(eset, _ways(eset, state, stratum, boundary))
    few, many = LINKS
    chains.straighten(few)
    before = chains.lengths
    kept = chains.straighten(many)
    for chain, i, long in zip(chains.chains, kept, chains.lengths, strict=True):
        # chords fall short of arcs by the square of their length
        length = (4.0 * long - before[i]) / 3.0
        if length < best[0]:
            best = (length, States(eset.structure, chain.z, chain.p))
    return best


def _ways(eset: EquilibriumSet, state: State, stratum: int, boundary: Facets) -> list[SetPoints]:
    """Shortest ways over the edges of a stratum from a state to different parts of its boundary."""
    setting = eset.setting
    pairs, length, used = from_cache(eset, ("edges", stratum), lambda: _edges(eset, stratum))
    place, own = places_of(eset), embed(setting, state.z[None], state.p[None])
    # the vertices around the state are those of the cells over it that it lies on
    around = _corners_around(eset, state, stratum, used, place, own)
    count = len(eset.points)
    ends = np.concatenate([pairs, np.stack([np.full(len(around), count), around], axis=1)])
    to_them = np.linalg.norm(place[around] - own, axis=1)
    graph = graph_of(count + 1, ends, np.concatenate([length, to_them]))
    far, before = dijkstra(graph, directed=False, indices=count, return_predecessors=True)
    chosen = _nearest_of_each_part(boundary, far)
    chosen = chosen[far[chosen] <= LONGER * far[chosen[0]]]
    ways = []
    for goal in chosen:
        path = walk_back(before, count, int(goal))
        assert path is not None
        ways.append(_from_state(eset, state, path[1:]))
    return ways


def _edges(eset: EquilibriumSet, stratum: int) -> tuple[Pairs, ItemValues, Some]:
    """Edges of a stratum, their lengths, and its vertices."""
    cells, place = eset.cells[eset.stratum == stratum], places_of(eset)
    pairs = faces_of(cells, 2) if len(eset.names) > 1 else cells
    length = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
    return pairs, length, distinct(cells.ravel())


def _corners_around(
    eset: EquilibriumSet,
    state: State,
    stratum: int,
    used: Some,
    place: Float[np.ndarray, "V coordinates"],
    own: Float[np.ndarray, "1 coordinates"],
) -> Int[np.ndarray, " corners"]:
    """Vertices of the cell on which a state lies; the nearest one if there is no such cell."""
    at = {name: np.array([state[name]]) for name in eset.names}
    here = eset.over(**at)
    gap = np.abs(here.states.z - state.z).max(axis=1)
    cell = here.cell[gap.argmin()]
    if cell >= 0 and eset.stratum[cell] == stratum:
        return np.asarray(eset.cells[cell])
    return np.asarray(used[[np.linalg.norm(place[used] - own, axis=1).argmin()]])


def _from_state(eset: EquilibriumSet, state: State, path: Items) -> SetPoints:
    """A state, and vertices after it."""
    on = points_at_vertices(eset, path)
    z, p = np.concatenate([state.z[None], on.z]), np.concatenate([state.p[None], on.p])
    return SetPoints(z, p, np.concatenate([on.rows[:1], on.rows]))

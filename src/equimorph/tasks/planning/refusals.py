"""Refusals that say more: which demand binds, how far it had to give way, and what is reached."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from equimorph.equilibria.soft_modes import metric_length
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, eased
from equimorph.structures import State, margin_of
from equimorph.tasks.planning.bottlenecks import find_bottleneck
from equimorph.tasks.planning.free_routes import free_route, route_with_reserve
from equimorph.tasks.planning.network import (
    Demands,
    Ends,
    end_links,
    explain_no_route,
    network_of,
    nodes_with_ends,
)
from equimorph.tasks.planning.objectives import Extreme, least, peak
from equimorph.tasks.route import Relaxation, Route, refusal

SLACK = 0.01
"""Share of a bound, or of its difference to an end, within which a route verifies it."""


def explained_refusal(
    eset: EquilibriumSet, ends: Ends, demands: Demands, monitor: Sequence[Descriptor]
) -> Route:
    """Return a refusal, with the least relaxation of each demand that would do by itself.

    A relaxation is the lowest peak of what is bounded within the other demands, and verified by
    a route. Where start and goal lie on different stable components, nothing relaxes that. The
    refusal carries the state nearest to the goal that a route reaches.
    """
    refused = refusal(explain_no_route(eset, ends, demands))
    relaxed = tuple(_relaxations(eset, ends, demands))
    nearest = _nearest(eset, ends, demands)
    if nearest is not None:
        stays = np.array_equal(nearest.p, ends[0].p) and np.allclose(nearest.z, ends[0].z)
        route = None if stays else free_route(eset, (ends[0], nearest), demands, monitor)
        if stays or (route is not None and route.arrived):
            refused = replace(refused, nearest=nearest)
    return replace(refused, relaxations=relaxed)


def _relaxations(eset: EquilibriumSet, ends: Ends, demands: Demands) -> Iterator[Relaxation]:
    """Of the demands in addition to those of the set, those that give way alone."""
    for extreme, words, others in _demands(eset, demands):
        found = find_bottleneck(eset, ends, extreme, others.beyond(eset), others.margin)
        if found is not None:
            best, bounds = found.bottleneck, (*others.constraints, eased(found.bound))
            relaxed = replace(others, constraints=bounds)
            route = route_with_reserve(eset, ends, (relaxed, relaxed), (), found)
            attained = np.nan
            if route is not None and route.arrived and route.states is not None:
                attained = extreme.along(route.states)
            yield Relaxation(f"{words} {best.value:.8g}", best.value, attained, best.state)


def _demands(eset: EquilibriumSet, demands: Demands) -> Iterator[tuple[Extreme, str, Demands]]:
    """What each demand bounds, in words, and the others."""
    for each in demands.beyond(eset):
        rest = tuple(other for other in demands.constraints if replace(other, ease=0.0) != each)
        others, name = replace(demands, constraints=rest), f"{each.descriptor.name} {each.sense}"
        if each.sense == "<=":
            yield peak(each.descriptor, SLACK), name, others
        elif each.descriptor.branches is None:
            yield least(each.descriptor, SLACK), name, others
    if demands.margin > 0.0:
        yield least(margin_of(eset.structure), SLACK), "margin >=", replace(demands, margin=0.0)


def _nearest(eset: EquilibriumSet, ends: Ends, demands: Demands) -> State | None:
    """Vertex joined to the start within the demands that is nearest to the goal in the metric."""
    network, count = network_of(eset), len(eset.points)
    allowed = network.admissible(eset, demands)
    broken, _ = network.verdicts(demands)
    own, _ = end_links(eset, ends, demands)
    inner = network.pairs[allowed[network.pairs].all(axis=1) & ~broken]
    pairs = np.concatenate([inner, own])
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(count + 2, count + 2))
    _, label = connected_components(graph, directed=False)
    some = np.flatnonzero(label[:count] == label[count])
    if len(some) == 0:
        return None
    states, structure = nodes_with_ends(eset, ends)[some], eset.structure
    gap = metric_length(structure, (states.z - ends[1].z)[:, : structure.unknowns])
    gap = np.hypot(gap, np.linalg.norm((states.p - ends[1].p) / structure.scales, axis=1))
    return states[int(gap.argmin())]

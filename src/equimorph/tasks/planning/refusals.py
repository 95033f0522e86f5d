"""Where the network has no path: over an exact pass, or a refusal that says what binds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.equilibria.soft_modes import metric_length
from equimorph.linalg.graphs import components
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, ease
from equimorph.structures import State, margin_of
from equimorph.tasks.planning.bottlenecks import Passing, find_bottleneck
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

NEARLY = 0.9
"""Share of the room between a pass and a limit that routes over it use."""
SLACK = 0.01
"""Share of a bound, or of its difference to an end, within which a route verifies it."""


@dataclass(frozen=True)
class _Demand:
    """What a demand bounds, in words, its limit, the other demands, and the pass within these."""

    extreme: Extreme
    words: str
    limit: float
    others: Demands
    found: Passing | None

    @classmethod
    def of(
        cls, eset: EquilibriumSet, ends: Ends, extreme: Extreme, limit: float, others: Demands
    ) -> "_Demand":
        """The lowest peak of what is bounded, within the others."""
        found = find_bottleneck(eset, ends, extreme, others.beyond(eset), others.margin)
        if found is not None:
            # routes over the pass stay within the limit, if there is room
            room = extreme.sign * (found.bound.bound - found.bottleneck.value)
            left = extreme.sign * (limit - found.bottleneck.value)
            if 0.0 < left < room:
                near = replace(extreme, slack=extreme.slack * NEARLY * left / room)
                found = find_bottleneck(eset, ends, near, others.beyond(eset), others.margin)
        words = f"{extreme.descriptor.name} {'<=' if extreme.sign > 0.0 else '>='}"
        return cls(extreme, words, limit, others, found)

    @property
    def holds(self) -> bool:
        """Whether the pass obeys the limit."""
        found, sign = self.found, self.extreme.sign
        return found is not None and sign * found.bottleneck.value < sign * self.limit


def free_or_over_a_pass(
    eset: EquilibriumSet,
    ends: Ends,
    demands: Demands,
    monitor: Sequence[Descriptor],
    given: Route | None,
) -> Route:
    """Return a given route of the network that arrived, one over an exact pass, or a refusal.

    Ways between a bound and a fold may be thinner than the cells. Where the lowest peak of what is
    bounded obeys the bound, a route leads over that pass. The refusal of a given route, the best
    one over the network, stands if there is none.

    A refusal has the least relaxation of each demand that would do by itself: the lowest peak of
    what is bounded within the other demands, verified by a route. Where start and goal lie on
    different stable components, nothing relaxes that. The refusal carries the state nearest to the
    goal that a route reaches.
    """
    if given is not None and given.arrived:
        return given
    bounded = list(_demands(eset, ends, demands))
    for each in bounded:
        route = free_route(eset, ends, demands, monitor, each.found) if each.holds else None
        if route is not None and route.arrived:
            return route
    if given is not None:
        return given
    refused = refusal(explain_no_route(eset, ends, demands))
    relaxed = tuple(_relaxations(eset, ends, bounded))
    nearest = _nearest(eset, ends, demands)
    if nearest is not None:
        stays = np.array_equal(nearest.p, ends[0].p) and np.allclose(nearest.z, ends[0].z)
        route = None if stays else free_route(eset, (ends[0], nearest), demands, monitor)
        if stays or (route is not None and route.arrived):
            refused = replace(refused, nearest=nearest)
    return replace(refused, relaxations=relaxed)


def _relaxations(
    eset: EquilibriumSet, ends: Ends, demands: Sequence[_Demand]
) -> Iterator[Relaxation]:
    """Of the demands in addition to those of the set, those that give way alone."""
    for each in demands:
        if each.found is not None:
            best = each.found.bottleneck
            bounds = (*each.others.constraints, ease(each.found.bound))
            relaxed = replace(each.others, constraints=bounds)
            route = route_with_reserve(eset, ends, (relaxed, relaxed), (), each.found)
            attained = np.nan
            if route is not None and route.arrived and route.states is not None:
                attained = each.extreme.along(route.states)
            yield Relaxation(f"{each.words} {best.value:.8g}", best.value, attained, best.state)


def _demands(eset: EquilibriumSet, ends: Ends, demands: Demands) -> Iterator[_Demand]:
    """What each demand bounds, and the others."""
    for each in demands.beyond(eset):
        rest = tuple(other for other in demands.constraints if replace(other, ease=0.0) != each)
        others = replace(demands, constraints=rest)
        if each.sense == "<=":
            yield _Demand.of(eset, ends, peak(each.descriptor, SLACK), each.bound, others)
        elif each.descriptor.branches is None:
            yield _Demand.of(eset, ends, least(each.descriptor, SLACK), each.bound, others)
    if demands.margin > 0.0:
        margin = least(margin_of(eset.structure), SLACK)
        others = replace(demands, margin=0.0)
        yield _Demand.of(eset, ends, margin, demands.margin, others)


def _nearest(eset: EquilibriumSet, ends: Ends, demands: Demands) -> State | None:
    """Vertex joined to the start within the demands that is nearest to the goal in the metric."""
    network, count = network_of(eset), len(eset.points)
    allowed = network.admissible(eset, demands)
    broken, _ = network.verdicts(demands)
    own, _ = end_links(eset, ends, demands)
    inner = network.pairs[allowed[network.pairs].all(axis=1) & ~broken]
    pairs = np.concatenate([inner, own])
    label = components(count + 2, pairs)
    some = np.flatnonzero(label[:count] == label[count])
    if len(some) == 0:
        return None
    states, structure = nodes_with_ends(eset, ends)[some], eset.structure
    gap = metric_length(structure, (states.z - ends[1].z)[:, : structure.unknowns])
    gap = np.hypot(gap, np.linalg.norm((states.p - ends[1].p) / structure.scales, axis=1))
    return states[int(gap.argmin())]

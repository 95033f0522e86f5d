"""Which folds of a polygon belong together, where they could be joined in several ways.

See docs/decisions.md, "Folds are followed through their triangles".
"""

import numpy as np

from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.crossing_discs import Ways
from equimorph.manifold.lifting.fold_walks import fold_exits, nearest_at
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import (
    MEETING,
    TURN,
    Plan,
    chord_of,
    match_around_hub,
    match_folds,
)


def ways_to_join(pairing: Pairing, plan: Plan) -> Ways:
    """Ways to join the folds of a polygon, around a hub if there are no others."""
    index = pairing.points.index.__getitem__
    ways = match_folds(plan.points, plan.singular, index)
    crossed = not ways and plan.those(MEETING) and plan.those(TURN)
    return match_around_hub(plan.points, plan.singular, index) if crossed else ways


def followed_ways(pairing: Pairing, plans: list[Plan], choices: list[Ways]) -> list[Ways]:
    """Ways that join every fold with the one to which it leads through the triangle.

    A fold that is lost on the way, or leaves where none is known, leaves the choice open. Where
    there are too many folds for a choice, it is made when these are known.
    """
    kinds = pairing.points.kind
    pairs = [
        (plan.polygon.triangle, fold)
        for plan in plans
        for fold in plan.those(TURN)
        if kinds[fold] == VertexKind.FOLD  # corners lie inside, where no fold begins
    ]
    exits = dict(zip(pairs, fold_exits(pairing, pairs), strict=True))
    followed = []
    for plan, ways in zip(plans, choices, strict=True):
        folds = plan.those(TURN)
        known = {fold: exits.get((plan.polygon.triangle, fold)) for fold in folds}
        left = {fold: exit_ for fold, exit_ in known.items() if exit_ is not None}
        ends = dict(
            zip(left, nearest_at(pairing, list(left.values()), np.array(folds, int)), strict=True)
        )
        chords = {chord_of(fold, end) for fold, end in ends.items() if end >= 0}
        own = ways or match_folds(
            plan.points, plan.singular, pairing.points.index.__getitem__, chords
        )
        followed.append([way for way in own if chords <= set(way)])
    return followed

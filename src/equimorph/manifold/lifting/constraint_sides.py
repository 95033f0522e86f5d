"""Sides of polygons on constraints: with a corner where a fold leaves, or another point between.

See docs/decisions.md, "Folds and constraints are built into the cells".
"""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.cap_walks import cap_at, cap_exits, passed_on_the_way, turns_of
from equimorph.manifold.lifting.crossing_discs import Group, pin_ends
from equimorph.manifold.lifting.fold_walks import fold_exits
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.pins import pin_groups
from equimorph.manifold.lifting.polygon_cuts import MEETING, TURN, Chord, Plan, chord_of

MANY = -1
"""Kind of a side on which there are several corners."""
Points = tuple[int, ...]


class _Side(NamedTuple):
    """A side of a polygon on a constraint: where it ends among the points, and its end points.

    kind: of the point to be inserted, 0 for none.
    """

    plan: Plan
    place: int
    ends: Chord
    kind: int

    @property
    def alone(self) -> bool:
        """Whether it closes the only chain of its polygon."""
        return not self.plan.polygon.gaps


@dataclass
class ClosedSides:
    """Edges on constraints, undecided triangles, and what leads out of these; see `Discs`."""

    caps: set[Chord] = field(default_factory=set)
    undecided: set[int] = field(default_factory=set)
    astray: list[tuple[int, int, int, int]] = field(default_factory=list)


def close_along_constraints(pairing: Pairing, plans: list[Plan]) -> ClosedSides:
    """Close open polygons along constraints, through a corner if a singular curve leaves there.

    That is a fold, or where another sheet crosses.
    """
    closed = ClosedSides()
    sides = [side for plan in plans for side in _sides(pairing, plan)]
    closed.caps.update(chord_of(*side.ends) for side in sides if not side.kind)
    sides = [side for side in sides if side.kind]
    groups = [Group(side.plan.polygon.triangle, side.ends) for side in sides]
    pinned = pin_groups(pairing, groups, [side.kind for side in sides])
    extra: list[Points | None] = [None if each is None else (each,) for each in pinned]
    crossing = [k for k, side in enumerate(sides) if side.kind == VertexKind.CROSSING]
    met = pin_ends(pairing, [sides[k].plan for k in crossing])
    for k, point in zip(crossing, met, strict=True):
        extra[k] = None if point is None else (point,)
    _add_corners(pairing, sides, extra)
    _add_passed(pairing, sides, extra, closed)
    # from the last side of a polygon on: places before it stay what they are
    for side, points in zip(reversed(sides), reversed(extra), strict=True):
        plan, (first, last) = side.plan, side.ends
        if points is None:
            closed.undecided.add(plan.polygon.triangle)
            if side.alone and len(folds := plan.those(TURN)) == 1:
                closed.astray.append((plan.polygon.triangle, folds[0], first, last))
            continue
        line = (first, *points, last)
        closed.caps.update(chord_of(*each) for each in pairwise(line))
        plan.insert(side.place, points, pairing.points.kind[list(points)].tolist())
    return closed


def _sides(pairing: Pairing, plan: Plan) -> list[_Side]:
    """Sides of a polygon on a constraint, in order, from the end of one chain to the next."""
    points = plan.points
    if not plan.polygon.open:
        return []
    if not plan.polygon.gaps:
        return [_Side(plan, len(points), (points[-1], points[0]), _through(plan))]
    places = (*plan.polygon.gaps, len(points))
    ends = [(points[place - 1], points[place % len(points)]) for place in places]
    exits = cap_exits(pairing, [(plan.polygon.triangle, first) for first, _ in ends])
    turns = [0 if each is None else turns_of(each) for each in exits]
    kinds = [
        (VertexKind.CAP if _same_side(plan, own) else 0, VertexKind.CORNER)[number]
        if number < 2
        else MANY
        for own, number in zip(ends, turns, strict=True)
    ]
    return [_Side(plan, *each) for each in zip(places, ends, kinds, strict=True)]


def _same_side(plan: Plan, chord: Chord) -> bool:
    """Whether two points lie on one side of the grid triangle."""
    first, second = plan.on(chord)
    return bool(first & second)


def _add_corners(pairing: Pairing, sides: list[_Side], extra: list[Points | None]) -> None:
    """Corners that were not found between the ends of polygons, along their folds."""
    folds = [side.plan.those(TURN) if side.alone else [] for side in sides]
    lost = [k for k, own in enumerate(folds) if extra[k] is None and len(own) == 1]
    pairs = [(sides[k].plan.polygon.triangle, folds[k][0]) for k in lost]
    for k, exit_ in zip(lost, fold_exits(pairing, pairs), strict=True):
        if exit_ is not None and exit_.edge < 0:
            low = int(pairing.points.index[folds[k][0]])
            extra[k] = (pairing.points.add(exit_.z, exit_.p, low, VertexKind.CORNER),)


def _add_passed(
    pairing: Pairing, sides: list[_Side], extra: list[Points | None], closed: ClosedSides
) -> None:
    """Points that were not found between the ends of sides, where the constraint leads there."""
    lost = [
        k for k, side in enumerate(sides) if extra[k] is None and side.kind != VertexKind.CROSSING
    ]
    pairs = [(sides[k].plan.polygon.triangle, sides[k].ends[0]) for k in lost]
    exits = cap_exits(pairing, pairs)
    for k, (triangle, end), exit_ in zip(lost, pairs, exits, strict=True):
        other = cap_at(pairing, exit_) if exit_ else end
        if other < 0:
            closed.astray.append((triangle, end, end, end))
        if exit_ and other == sides[k].ends[1]:
            extra[k] = passed_on_the_way(pairing, triangle, exit_)


def _through(plan: Plan) -> int:
    """Kind of the point through which an open polygon is closed; 0 for none.

    Where the ends of a fold and of a crossing are both missing, no point is found.
    """
    if len(plan.those(TURN)) % 2:
        return VertexKind.CORNER
    if len(plan.those(MEETING)) % 2:
        return VertexKind.CROSSING
    return VertexKind.CAP if _same_side(plan, (plan.points[0], plan.points[-1])) else 0

"""Chains around triangles that a layer between a fold and a constraint passes.

A chain with one fold ends on the constraint on both sides of it. Either the fold meets the
constraint inside the triangle, in a corner that closes the chain, or both lead on to another chain
with one fold: on both sides of the fold, the constraint joins their ends.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.fold_walks import fold_at, fold_exits
from equimorph.manifold.lifting.pairing import FoldExit, Pairing
from equimorph.manifold.lifting.polygons import Polygon


@dataclass
class Layers:
    """Chains of a triangle: told from others, all other polygons, and folds that lead out of it.

    told: joined pairs, and chains whose fold ends in a corner; left: those about which nothing is
    said; astray: triangle, fold and both ends of chains whose fold leads to where no curve is
    known; unclear: whether folds and ends contradict each other.
    """

    told: list[Polygon] = field(default_factory=list)
    left: list[Polygon] = field(default_factory=list)
    astray: list[tuple[int, int, int, int]] = field(default_factory=list)
    unclear: bool = False


def join_layers(pairing: Pairing, polygons: Mapping[int, Sequence[Polygon]]) -> dict[int, Layers]:
    """Join the chains with one fold each that lie over one triangle, by where their folds lead."""
    folds = {triangle: _folds_of(pairing, own) for triangle, own in polygons.items()}
    folds = {
        triangle: own
        for triangle, own in folds.items()
        if sum(polygon.open for polygon in polygons[triangle]) > 1
    }
    pairs = [(triangle, fold) for triangle, own in folds.items() for fold in own]
    exits = dict(zip(pairs, fold_exits(pairing, pairs), strict=True)) if pairs else {}
    return {
        triangle: _join(pairing, own, folds.get(triangle, {}), exits)
        for triangle, own in polygons.items()
    }


def _folds_of(pairing: Pairing, polygons: Sequence[Polygon]) -> dict[int, Polygon]:
    """Open chains with one fold and no crossing, by their folds."""
    kinds, found = pairing.points.kind, {}
    for polygon in polygons:
        own = [point for point in polygon.points if kinds[point] == VertexKind.FOLD]
        crossed = VertexKind.CROSSING in kinds[list(polygon.points)]
        if polygon.open and len(own) == 1 and not crossed:
            found[own[0]] = polygon
    return found


def _join(
    pairing: Pairing,
    polygons: Sequence[Polygon],
    folds: Mapping[int, Polygon],
    exits: Mapping[tuple[int, int], FoldExit | None],
) -> Layers:
    """Join the chains of one triangle."""
    out, partner, ended = Layers(), dict[int, int](), list[int]()
    for fold, chain in folds.items():
        exit_ = exits[chain.triangle, fold]
        if exit_ is None:
            continue
        if exit_.edge < 0:
            ended.append(fold)
            continue
        other = fold_at(pairing, exit_)
        if other < 0:
            out.astray.append((chain.triangle, fold, chain.points[0], chain.points[-1]))
        elif other in folds:
            partner[fold] = other
    pairs = {(min(pair), max(pair)) for pair in partner.items()}
    told = [*ended, *(fold for pair in pairs for fold in pair)]
    joined = {pair: _joined(pairing, *(folds[fold] for fold in pair)) for pair in pairs}
    if len(set(told)) < len(told) or None in joined.values():
        return Layers([], list(polygons), out.astray, unclear=True)
    out.told = [each for _, each in sorted(joined.items()) if each is not None]
    out.told += [folds[fold] for fold in ended]
    paired = {id(folds[fold]) for fold in told}
    out.left = [polygon for polygon in polygons if id(polygon) not in paired]
    return out


def _joined(pairing: Pairing, first: Polygon, second: Polygon) -> Polygon | None:
    """Two chains joined at those ends that have one index, if they have such."""
    index = pairing.points.index
    one, other = first.points, second.points
    ends = [(int(index[chain[0]]), int(index[chain[-1]])) for chain in (one, other)]
    if ends[0] == ends[1] and ends[0][0] != ends[0][1]:
        other = other[::-1]
    elif ends[0] != ends[1][::-1] or ends[0][0] == ends[0][1]:
        return None
    return Polygon(first.triangle, (*one, *other), True, gap=len(one))

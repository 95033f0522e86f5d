"""Better tetrahedra between the same vertices: edges are taken out, or put through a facet.

What is around an edge is filled anew without it: three tetrahedra become two, four become four
others, and so on [Freitag1997]_. An edge on a fold, on a constraint, or on a side of the box gives
way to the other diagonal of the two marked facets beside it. Nothing may fold over in the tangent
spaces at the vertices.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.marked_complex import Fabric, squared_sides
from equimorph.manifold.geometry.topology import among, distinct, keys_of, rows_of
from equimorph.manifold.refining.deviations import deviations
from equimorph.manifold.refining.rings import MOST, Rings, fill, rings_around
from equimorph.manifold.refining.tetrahedra import (
    POOR,
    Judge,
    Tetrahedra,
    Values,
    beside,
    dihedrals,
)

GAIN = np.radians(0.2)
"""Least gain of the smallest angle."""
PASSES = 20

Keys = Int[np.ndarray, " n"]
Ends = Int[np.ndarray, "m 2"]
Near = Bool[np.ndarray, " V"]


@dataclass(frozen=True)
class _Moves:
    """Cells that go and come, with their index; so facets, with their mark.

    keys: of edges and facets that come, different for both. −1: none.
    """

    gone: Int[np.ndarray, "n _"]
    come: Int[np.ndarray, "n _ 4"]
    index: Int[np.ndarray, "n _"]
    lost: Int[np.ndarray, "n 2 3"]
    new: Int[np.ndarray, "n 2 3"]
    mark: Int[np.ndarray, " n"]
    chords: Int[np.ndarray, "n _ 2"]
    gain: Values

    def take(self, some: Keys | Bool[np.ndarray, " n"]) -> "_Moves":
        """Return some of the moves."""
        return _Moves(*(column[some] for column in vars(self).values()))


def reconnect(fabric: Fabric, judge: Judge, near: Near, but: Ends, limit: float) -> Fabric:
    """Reconnect vertices as long as poor tetrahedra with a corner near get better.

    Edges between the pairs of vertices `but` do not come into being, nor such as deviate from the
    set by more than `limit`.
    """
    quality = judge.of(fabric, beside(fabric.cells, near))
    for _ in range(PASSES):
        poor = (quality < POOR) & near[fabric.cells].any(axis=1)
        moves = _moves(fabric, judge, (quality, poor), (but, limit))
        moves = _apart(moves, len(fabric.cells), len(fabric.vertices))
        if len(moves.gain) == 0:
            break
        near = np.zeros(len(fabric.vertices), bool)
        near[fabric.cells[moves.gone[moves.gone >= 0]]] = True
        fabric, quality = _applied(fabric, judge, quality, moves)
    return fabric


def _applied(fabric: Fabric, judge: Judge, quality: Values, moves: _Moves) -> tuple[Fabric, Values]:
    """Complex and qualities after some moves."""
    base = len(fabric.vertices)
    stays = np.ones(len(fabric.cells), bool)
    stays[moves.gone[moves.gone >= 0]] = False
    real = moves.come[:, :, 0] >= 0
    come, index = moves.come[real], moves.index[real]
    on = moves.mark > 0
    left = ~np.isin(keys_of(fabric.facets, base), keys_of(moves.lost[on].reshape(-1, 3), base))
    fabric = replace(
        fabric,
        cells=np.concatenate([fabric.cells[stays], come]),
        cell_index=np.concatenate([fabric.cell_index[stays], index]),
        squared=np.concatenate([fabric.squared[stays], squared_sides(judge.place, come)]),
        facets=np.concatenate([fabric.facets[left], moves.new[on].reshape(-1, 3)]),
        marks=np.concatenate([fabric.marks[left], np.repeat(moves.mark[on], 2)]),
    )
    return fabric, np.concatenate([quality[stays], judge.qualities(come, index)])


def _moves(
    fabric: Fabric,
    judge: Judge,
    given: tuple[Values, Bool[np.ndarray, " T"]],
    rules: tuple[Ends, float],
) -> _Moves:
    """All moves that take poor cells apart and let angles grow; `given` are qualities and these."""
    (quality, poor), base = given, len(fabric.vertices)
    near = np.zeros(base, bool)
    near[fabric.cells[poor]] = True
    around = np.flatnonzero(near[fabric.cells].sum(axis=1) > 1)
    own = fabric.cells[around]
    known = _known(fabric, own, rules[0])
    sides = [fabric.cells[poor][:, list(k)] for k in combinations(range(4), 2)]
    wanted = distinct(np.concatenate([keys_of(side, base) for side in sides]))
    rings = rings_around(
        replace(fabric, cells=own, cell_index=fabric.cell_index[around]),
        rows_of(wanted, base, 2),
    )
    rings = replace(rings, cells=np.where(rings.cells >= 0, around[rings.cells], -1))
    both = [
        _without_edges(fabric, judge, quality, rings, known),
        _through_facets(fabric, judge, given, around, known[0]),
    ]
    parts = (np.concatenate([getattr(each, name) for each in both]) for name in vars(both[0]))
    moves = _Moves(*parts)
    return moves.take(_within(fabric, moves, rules[1]))


def _known(fabric: Fabric, around: Tetrahedra, but: Ends) -> tuple[Keys, Keys]:
    """Keys, in order, of edges and facets between corners of some cells; `but` are no edges."""
    base = len(fabric.vertices)
    near = np.zeros(base, bool)
    near[around] = True
    cells = fabric.cells[near[fabric.cells].sum(axis=1) > 1]
    edges = [keys_of(cells[:, list(k)], base) for k in combinations(range(4), 2)]
    cells = cells[near[cells].sum(axis=1) > 2]
    facets = [keys_of(cells[:, list(k)], base) for k in combinations(range(4), 3)]
    barred = distinct(np.concatenate([*edges, keys_of(but, base)]))
    return barred, distinct(np.concatenate(facets))


def _without_edges(
    fabric: Fabric, judge: Judge, quality: Values, rings: Rings, known: tuple[Keys, Keys]
) -> _Moves:
    """Moves that take edges out."""
    (barred, facets), base = known, len(fabric.vertices)
    before = _worth(np.where(rings.cells >= 0, quality[rings.cells], np.inf))
    # on surfaces the other diagonal is new, unless one side of the edge has a single cell
    chord = rings.chord
    flat = (_sizes(rings.first) == 2) | (_sizes(rings.second) == 2)
    free = (rings.mark == 0) | flat | ~among(keys_of(chord, base), barred)
    rings, before = rings.take(free), before[free]
    fillings = [fill(judge, rings.ends, each, barred) for each in (rings.first, rings.second)]
    after = np.minimum(fillings[0].quality, fillings[1].quality)
    good = np.flatnonzero((after - before > GAIN) & np.isfinite(before))
    rings, before = rings.take(good), before[good]
    come = np.concatenate([each.cells[good] for each in fillings], axis=1)
    index = np.repeat(rings.index, fillings[0].cells.shape[1], axis=1)
    chord, on = rings.chord, rings.mark > 0
    flat = (_sizes(rings.first) == 2) | (_sizes(rings.second) == 2)
    made = np.where((on & ~flat)[:, None], chord, -1)
    chords = np.concatenate([*(each.chords[good] for each in fillings), made[:, None]], axis=1)
    lost = np.stack([np.concatenate([rings.ends, chord[:, [k]]], axis=1) for k in range(2)], 1)
    new = np.stack([np.concatenate([rings.ends[:, [k]], chord], axis=1) for k in range(2)], 1)
    ended = _Moves(rings.cells, come, index, lost, new, rings.mark, chords, before)
    between = come[:, :, 1:].reshape(-1, 3)
    old = among(keys_of(between, base), facets) & (between[:, 0] >= 0)
    kept = ~old.reshape(come.shape[:2]).any(axis=1)
    kept &= ~_marked(fabric, new).any(axis=1) | ~on
    return _gaining(judge, ended.take(kept))


def _sizes(polygons: Int[np.ndarray, "n ring"]) -> Keys:
    return np.asarray((polygons >= 0).sum(axis=1))


def _marked(fabric: Fabric, facets: Int[np.ndarray, "n 2 3"]) -> Bool[np.ndarray, "n 2"]:
    """Which facets are marked already."""
    base = len(fabric.vertices)
    known = keys_of(fabric.facets, base)
    return np.isin(keys_of(facets.reshape(-1, 3), base), known).reshape(-1, 2)


def _gaining(judge: Judge, moves: _Moves) -> _Moves:
    """Those moves, given with the quality before, that leave a better one, with their gain."""
    real = moves.come[:, :, 0] >= 0
    each = np.full(real.shape, np.inf)
    each[real] = judge.qualities(moves.come[real], moves.index[real])
    # whatever goes without anything in its place is worth as much as what is good
    after = np.minimum(_worth(each), np.pi / 2)
    moves = replace(moves, gain=after - moves.gain)
    return moves.take(moves.gain > GAIN)


def _worth(qualities: Float[np.ndarray, "n cells"]) -> Values:
    """What groups of tetrahedra are worth, see `worth`; infinite where there is none."""
    worst = qualities.min(axis=1, initial=np.inf)
    return np.asarray(np.where(worst < 0.0, np.minimum(qualities, 0.0).sum(axis=1), worst))


def _through_facets(
    fabric: Fabric,
    judge: Judge,
    known: tuple[Values, Bool[np.ndarray, " T"]],
    around: Keys,
    barred: Keys,
) -> _Moves:
    """Moves that put edges through facets: two cells become three."""
    (quality, poor), base = known, len(fabric.vertices)
    own = fabric.cells[around]
    # facets so ordered that the corner opposite sees them turn to the left
    order = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
    facets = np.concatenate([own[:, list(each)] for each in order])
    tips, owner = np.concatenate(list(own.T)), np.tile(around, 4)
    keys = keys_of(facets, base)
    by_key = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[by_key[1:]] == keys[by_key[:-1]])
    one, other = by_key[same], by_key[same + 1]
    new = keys_of(np.stack([tips[one], tips[other]], axis=1), base)
    wanted = poor[owner[one]] | poor[owner[other]]
    wanted &= ~among(new, barred) & ~among(keys[one], np.sort(keys_of(fabric.facets, base)))
    one, other = one[wanted], other[wanted]
    (i, j, k), low, high = facets[one].T, tips[one], tips[other]
    come = np.stack(
        [np.stack([low, high, *pair], axis=1) for pair in ((i, j), (j, k), (k, i))], axis=1
    )
    before = _worth(np.stack([quality[owner[one]], quality[owner[other]]], axis=1))
    after = dihedrals(judge.place, come.reshape(-1, 4)).reshape(-1, 3).min(axis=1, initial=np.inf)
    good = np.flatnonzero(after - before > GAIN)
    one, other, come, before = one[good], other[good], come[good], before[good]
    count = len(good)
    gone, more = np.full((count, MOST), -1), np.full((count, 4 * (MOST - 2), 4), -1)
    gone[:, 0], gone[:, 1], more[:, :3] = owner[one], owner[other], come
    index = np.repeat(fabric.cell_index[owner[one]][:, None], more.shape[1], axis=1)
    none = np.full((count, 2, 3), -1)
    chords = np.full((count, 2 * (MOST - 3) + 1, 2), -1)
    chords[:, 0] = np.stack([tips[one], tips[other]], axis=1)
    alike = fabric.cell_index[owner[one]] == fabric.cell_index[owner[other]]
    moves = _Moves(gone, more, index, none, none, np.zeros(count, int), chords, before)
    return _gaining(judge, moves.take(alike))


def _within(fabric: Fabric, moves: _Moves, limit: float) -> Bool[np.ndarray, " n"]:
    """Whether no edge that comes deviates by more than a limit."""
    good = np.ones(len(moves.gain), bool)
    if not np.isfinite(limit):
        return good
    row, column = np.nonzero(moves.chords[:, :, 0] >= 0)
    chords = np.sort(moves.chords[row, column], axis=1)
    marks = np.where(column == moves.chords.shape[1] - 1, moves.mark[row], 0)
    good[row[deviations(fabric, chords, marks) > limit]] = False
    return good


def _apart(moves: _Moves, count: int, base: int) -> _Moves:
    """Moves, best first, that neither share a cell nor make the same edge or facet."""
    moves = moves.take(np.argsort(-moves.gain, kind="stable"))
    chords = moves.chords
    edges = np.where(chords[:, :, 0] >= 0, keys_of(chords.reshape(-1, 2), base).reshape(
        chords.shape[:2]), -1)  # fmt: skip
    # without a chord three cells become two on both sides of a facet
    facet = np.sort(moves.come[:, :, 1:], axis=2).max(axis=1, initial=-1)
    bare = (edges < 0).all(axis=1)
    key = np.where(bare, -2 - keys_of(facet, base), -1)
    taken, kept = np.zeros(count + 1, bool), []
    made: set[int] = set()
    rows = zip(moves.gone.tolist(), edges.tolist(), key.tolist(), strict=True)
    for number, (gone, new, alone) in enumerate(rows):
        own = [cell for cell in gone if cell >= 0]
        keys = {each for each in (*new, alone) if each != -1}
        if taken[own].any() or not keys.isdisjoint(made):
            continue
        taken[own] = True
        made |= keys
        kept.append(number)
    return moves.take(np.array(kept, int))

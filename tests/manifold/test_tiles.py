"""Sets in tiles: the same as whole, whoever lifts the tiles and whatever is lost on the way."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

import equimorph as em
from equimorph.errors import InputError, LostWorkersError
from equimorph.manifold import VertexKind, build
from equimorph.manifold.lifting.grid import grid_mesh
from equimorph.manifold.lifting.tile_floods import Flooded
from equimorph.manifold.lifting.tile_rounds import Closed
from equimorph.manifold.lifting.tiles import cuts_between, mesh_of_tile, tiles_of
from same_records import assert_equal
from typecheck import unchecked

ARCH, SPRING = em.Rod(load="uniform"), em.Spring()
TRUSS = em.Truss(
    {"A": (-1.0, 0.0), "P": (0.0, 0.5), "B": (1.0, 0.0)},
    [("A", "P"), ("P", "B")],
    {"A": "xy", "B": "xy"},
    {"F": {"P": (0.0, -1.0)}},
    {"a": {"A-P": 1.0}},
)
BOUND = {"within": [ARCH.max_curvature <= 20]}
SETS = {
    "arch over one": (ARCH, {"Theta": (0.2, 2.5)}, (40,), {"fixed": {"q": 2.5, "Delta": 0.3}}),
    "arch": (ARCH, {"Theta": (0.2, 2.5), "Delta": (-2, 2)}, (16, 15), {"fixed": {"q": 2.5}}),
    "arch with crossings": (ARCH, {"Theta": (0.4, 2.0), "q": (0.0, 9.0)}, (6, 9), {}),
    "arch over three": (
        ARCH, {"Theta": (0.6, 1.4), "Delta": (-0.6, 0.6), "q": (0, 3)}, (5, 6, 4), {},
    ),
    "spring": (SPRING, {"x_l": (0.4, 1.4), "F": (-0.3, 0.3)}, (12, 12), {}),
    "spring with crossings": (
        SPRING, {"x_l": (0.5, 1.3), "k": (1, 2)}, (8, 6), {"fixed": {"F": 0.0}},
    ),
    "spring over three": (
        SPRING, {"x_l": (0.4, 1.4), "F": (-0.3, 0.3), "k": (1, 2)}, (6, 6, 4), {},
    ),
    "truss": (TRUSS, {"F": (-0.2, 0.2), "a": (-0.2, 0.2)}, (12, 9), {}),
}  # fmt: skip
TILES = {1: [(2,), (4,), (8,)], 2: [(2, 1), (2, 2), (4, 2)], 3: [(2, 1, 1), (1, 2, 2), (2, 2, 2)]}
LONG = ("arch with crossings", "arch over three")
CASES = [
    pytest.param(
        name,
        tiles,
        marks=() if tiles == TILES[len(tiles)][-1] and name not in LONG else pytest.mark.slow,
    )
    for name, each in SETS.items()
    for tiles in TILES[len(each[1])]
]


def lift(name, **options):
    structure, box, intervals, more = SETS[name]
    more = more | (BOUND if structure is ARCH else {})
    given = {"intervals": intervals, "checks": 0, **more, **options}
    with unchecked():
        return em.equilibrium_set(structure, em.Box(**box), **given)


@pytest.fixture(scope="module")
def whole():
    return lru_cache(lift)


def place(eset):
    return np.concatenate([eset.points.z, eset.points.p], axis=1)


def assert_same_set(one, other):
    """Whether two sets have the same vertices, cells, facets and audit, in any order."""
    assert replace(one.audit, largest_residual=0.0) == replace(other.audit, largest_residual=0.0)
    assert other.audit.largest_residual < 1e-9
    gap, number = cKDTree(place(one)).query(place(other))
    np.testing.assert_array_equal(np.sort(number), np.arange(len(one.points)))
    np.testing.assert_array_equal(one.kinds[number], other.kinds)
    np.testing.assert_array_equal(one.index[number], other.index)
    # between two folds of an edge, a step that nothing else depends on lies anywhere
    anywhere = other.kinds == VertexKind.BETWEEN
    assert gap[~anywhere].max() <= 1e-12
    assert gap.max() <= 1e-10
    for mine, theirs in ((one.cells, number[other.cells]), (rims(one), number[rims(other)])):
        np.testing.assert_array_equal(in_order(mine), in_order(theirs))


def rims(eset):
    vertices = np.concatenate([each.vertices for each in eset.boundaries])
    return vertices.reshape(len(vertices), -1)


def in_order(rows):
    rows = np.sort(rows, axis=1)
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize(("name", "tiles"), CASES)
def test_a_set_in_tiles_is_that_of_the_whole(whole, name, tiles):
    """Up to order and round-off; audits agree in all counts."""
    assert_same_set(whole(name), lift(name, tiles=tiles))


@pytest.mark.slow
def test_checks_and_refinement_are_those_of_a_whole_set():
    """Random checks take other cells, but miss nothing; refined, the deviation is as small."""
    eset = lift("arch", tiles=(2, 2), checks=2, accuracy=0.005)
    assert eset.audit.clean, eset.audit
    assert eset.audit.deviation <= 0.005
    assert eset.audit.checked > 0


class Backwards:
    """Workers that compute the last chunk first; results come in order all the same."""

    def map(self, function, chunks) -> Iterator:
        yield from reversed([function(chunk) for chunk in reversed(list(chunks))])


@pytest.mark.parametrize("name", ["arch", "spring over three"])
def test_a_set_does_not_depend_on_who_lifts_its_tiles(name):
    """Bit for bit, vertex by vertex: one tile after the other, three at once, and backwards."""
    tiles = TILES[len(SETS[name][1])][-1]
    here = lift(name, tiles=tiles)
    with ThreadPoolExecutor(3) as pool:
        for workers in (pool, Backwards()):
            assert_equal(lift(name, tiles=tiles, workers=workers), here)


class Losing:
    """Workers that are lost at some tile; they note the kinds of what they computed."""

    def __init__(self, last) -> None:
        self.last, self.found = last, []

    def map(self, function, chunks) -> Iterator:
        for chunk in chunks:
            if len(self.found) == self.last:
                raise LostWorkersError("all are lost")
            self.found.append(function(chunk))
            yield self.found[-1]


@pytest.mark.parametrize("last", [2, 6])
def test_finished_tiles_are_kept_when_workers_are_lost(whole, tmp_path, last):
    """The journal has them, one entry a tile and round; in the end it has the set alone."""
    path, lost, others = tmp_path / "set.journal", Losing(last), Losing(100)
    all_of_them = Losing(100)
    assert_same_set(whole("arch"), lift("arch", tiles=(2, 2), workers=all_of_them))
    with em.storage.open_journal(path) as journal:
        with pytest.raises(LostWorkersError):
            lift("arch", tiles=(2, 2), workers=lost, journal=journal)
        # the round is not over: what came after the last entry is gone
        eset = lift("arch", tiles=(2, 2), workers=others, journal=journal)
        assert len(others.found) == len(all_of_them.found) - last
        size = path.stat().st_size
        again = lift("arch", tiles=(2, 2), workers=Losing(0), journal=journal)
    assert_equal(again, eset)
    assert path.stat().st_size == size
    with em.storage.open_journal(tmp_path / "other.journal") as journal:
        assert_equal(lift("arch", tiles=(2, 2), journal=journal), eset)
    assert (tmp_path / "other.journal").read_bytes() == path.read_bytes()


class Blind:
    """Workers of whom the first overlooks the points inside all edges that it lifts at first."""

    def __init__(self) -> None:
        self.blind = True

    def map(self, function, chunks) -> Iterator:
        for chunk in chunks:
            found = function(chunk)
            if isinstance(found, Flooded) and self.blind:
                closed = found.curves[:, 2] >= 0
                amount = np.where(closed, 0, found.amount)
                inner = found.inner[np.repeat(closed, found.amount) == 0]
                found, self.blind = replace(found, amount=amount, inner=inner), False
            yield found


def test_edges_of_two_tiles_are_traced_again_where_they_differ(monkeypatch):
    """A fold on a shared edge that one tile overlooks: a contradiction, which finer steps mend."""
    seen = []
    trace_rays = build.flood.__globals__["trace_rays"]
    monkeypatch.setitem(
        build.flood.__globals__,
        "trace_rays",
        lambda pairing, rays: (
            seen.append(pairing.effort[rays.edges].max()),
            trace_rays(pairing, rays),
        ),
    )
    eset = lift("spring", tiles=(1, 2), workers=Blind())
    assert eset.audit.retraced > 0
    assert max(seen) > 0


class Different:
    """Workers of whom one closes a triangle on a cut otherwise than the other does."""

    def __init__(self) -> None:
        self.rounds = 0

    def map(self, function, chunks) -> Iterator:
        for chunk in chunks:
            found = function(chunk)
            if isinstance(found, Closed):
                self.rounds += 1
                if self.rounds == 2:
                    corners = np.roll(found.discs.corners, 1, axis=1)
                    found = replace(found, discs=replace(found.discs, corners=corners))
            yield found


def test_triangles_of_two_tiles_that_are_closed_otherwise_are_divided():
    """They count as undecided; after bisection the set is whole."""
    eset = lift("spring over three", tiles=(2, 1, 1), workers=Different())
    assert eset.audit.clean, eset.audit
    assert eset.audit.bisected > lift("spring over three", tiles=(2, 1, 1)).audit.bisected


@pytest.mark.parametrize(
    ("tiles", "told"),
    [
        ((13, 1), r"at most the intervals \(12, 12\); got \(13, 1\)"),
        (
            (2,),
            r"one whole number for each parameter, at most the intervals \(12, 12\); got \(2,\)",
        ),
        ((0, 1), r"whole numbers >= 1; got 0"),
        (2, r"whole numbers >= 1; got 2"),
    ],
)
def test_wrong_tiles_are_refused_in_one_line(tiles, told):
    with pytest.raises(InputError, match=f"^`tiles` must be .*{told}[^\n]*$"):
        em.equilibrium_set(SPRING, em.Box(**SETS["spring"][1]), intervals=(12, 12), tiles=tiles)


def test_tiles_fill_the_grid_and_share_what_lies_on_cuts():
    """Every cell belongs to one tile; a tile's mesh has its own places, and the box's corners."""
    rng = np.random.default_rng(3)
    lines = tuple(np.sort(rng.uniform(-1.0, 1.0, count)) for count in (7, 6, 5))
    mesh = grid_mesh(lines)
    cuts = cuts_between(lines, (3, 2, 1))
    tiles = tiles_of(mesh, cuts)
    assert [len(cut) for cut in cuts] == [2, 1, 0]
    cells = np.concatenate([tile.tetrahedra for tile in tiles])
    np.testing.assert_array_equal(np.sort(cells), np.arange(len(mesh.tetrahedra)))
    on_cuts = np.isin(mesh.vertices[:, 0], cuts[0]) | np.isin(mesh.vertices[:, 1], cuts[1])
    for tile in tiles:
        own = mesh_of_tile(mesh, tile)
        np.testing.assert_array_equal(
            own.vertices[own.tetrahedra], mesh.vertices[mesh.tetrahedra[tile.tetrahedra]]
        )
        np.testing.assert_array_equal(np.ptp(own.vertices, axis=0), np.ptp(mesh.vertices, axis=0))
        shared = mesh.edges[tile.edges[tile.shared]]
        assert on_cuts[shared].all()
        # an edge with both ends on cuts may still lead through the inside
        assert tile.shared.sum() < on_cuts[mesh.edges[tile.edges]].all(axis=1).sum() + 1

"""Topology of triangulated surfaces that are known by name."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from equimorph.linalg.graphs import components
from equimorph.manifold.complex.pinches import pinched_vertices
from equimorph.manifold.geometry.facet_kernels import join_triangles
from equimorph.manifold.geometry.kernels import cut_rows
from equimorph.manifold.geometry.topology import (
    adjacency,
    chains,
    euler_characteristic,
    flags_of,
    labels,
    orientation,
    projected_volume,
)

OCTAHEDRON = np.array(
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
)
STRIP = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]])


def moebius(length=5):
    """Triangles k, k + 1, k + 2 of a ring with an odd number of vertices."""
    k = np.arange(length)
    return np.stack([k, (k + 1) % length, (k + 2) % length], axis=1)


def torus(n=5, m=6):
    i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))

    def at(i, j):
        return (i % n) * m + j % m

    one = np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], 1)
    return np.concatenate([one, np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], 1)])


@pytest.mark.parametrize(
    ("cells", "chi"), [(OCTAHEDRON, 2), (STRIP, 1), (moebius(), 0), (torus(), 0)]
)
def test_euler_characteristic_of_known_surfaces(cells, chi):
    assert euler_characteristic(cells) == chi


@pytest.mark.parametrize("cells", [OCTAHEDRON, STRIP, torus()])
def test_orientable_surface_is_oriented_without_contradiction(cells):
    """However the cells are turned, the signs undo it."""
    turned = cells.copy()
    flipped = np.random.default_rng(3).random(len(cells)) < 0.5
    turned[flipped] = turned[flipped][:, [0, 2, 1]]
    signs, contradictions = orientation(turned, adjacency(turned))
    assert contradictions == 0
    want = np.where(flipped, -1, 1)
    assert np.array_equal(signs, want) or np.array_equal(signs, -want)


@pytest.mark.parametrize("length", [5, 7, 21])
def test_moebius_strip_contradicts_every_orientation(length):
    cells = moebius(length)
    assert orientation(cells, adjacency(cells))[1] == 1


def test_adjacency_counts_the_cells_of_every_edge():
    whole = adjacency(STRIP)
    assert len(whole.facets) == 9
    assert sorted(whole.counts.tolist()) == [1] * 6 + [2] * 3
    assert np.array_equal(np.sort(STRIP[:, [0, 1]], axis=1), whole.facets[whole.cell_facets[:, 2]])
    for (a, b), edge in zip(whole.links, whole.across, strict=True):
        assert set(whole.facets[edge]) <= set(STRIP[a]) & set(STRIP[b])


def test_edge_of_three_cells_links_them_but_is_no_manifold():
    book = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    whole = adjacency(book)
    assert whole.counts.max() == 3
    assert labels(3, whole.links).tolist() == [0, 0, 0]
    assert not whole.manifold.any()


@pytest.mark.parametrize(("d", "cells"), [(1, 300), (2, 1), (2, 500), (3, 500), (3, 0)])
def test_facets_of_random_cells_are_those_of_a_table(d, cells):
    generator = np.random.default_rng(d)
    corners = [generator.permutation(60)[: d + 1] for _ in range(cells)]
    given = np.array(corners, int).reshape(-1, d + 1)
    table: dict[tuple[int, ...], list[int]] = {}
    for place in range(given.size):
        cell, corner = divmod(place, d + 1)
        table.setdefault(tuple(sorted(np.delete(given[cell], corner))), []).append(place)
    whole, facets = adjacency(given), sorted(table)
    assert list(map(tuple, whole.facets)) == facets
    assert whole.counts.tolist() == [len(table[facet]) for facet in facets]
    of_cells = [[whole.cell_facets.flat[at] for at in table[facet]] for facet in facets]
    assert of_cells == [[k] * len(table[facet]) for k, facet in enumerate(facets)]
    links = [pair for facet in facets for pair in pairwise(table[facet])]
    assert list(map(tuple, whole.places)) == links
    beside = [[place // (d + 1) for place in table[facet]] for facet in facets]
    assert [row[row >= 0].tolist() for row in whole.beside] == beside


def test_pieces_of_random_graphs_are_those_of_a_library():
    generator = np.random.default_rng(7)
    for count, links in ((1, 0), (40, 15), (1000, 480), (1000, 2000)):
        pairs = generator.integers(0, count, (links, 2))
        graph = coo_array((np.ones(links), pairs.T), shape=(count, count))
        wanted = connected_components(graph, directed=False)[1]
        assert np.array_equal(components(count, pairs), wanted)


@pytest.mark.parametrize("count", [0, 1, 60])
def test_triangles_of_an_owner_are_joined_at_their_sides(count):
    """Side by side, against a library; sides of different sheets are different."""
    rng = np.random.default_rng(count)
    corners = np.ascontiguousarray(np.argsort(rng.random((count, 7)), axis=1)[:, :3])
    sheets, owner = rng.integers(0, 2, (count, 3)), np.sort(rng.integers(0, 12, count))
    sides = [
        [(own, sheet, frozenset(pair)) for sheet, pair in zip(row, pairs, strict=True)]
        for own, row, pairs in zip(
            owner.tolist(),
            sheets.tolist(),
            np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).tolist(),
            strict=True,
        )
    ]
    every = [side for row in sides for side in row]
    shares, piece = np.empty((count, 3), int), np.empty(count, int)
    join_triangles(corners, sheets, owner, shares, piece)
    assert shares.tolist() == [[every.count(side) for side in row] for row in sides]
    joined = [[bool(set(one) & set(other)) for other in sides] for one in sides]
    assert np.array_equal(piece, connected_components(np.array(joined).reshape(count, count))[1])


def test_labels_number_the_pieces_by_size():
    cells = np.concatenate([[[10, 11, 12]], STRIP])
    assert labels(5, adjacency(cells).links).tolist() == [1, 0, 0, 0, 0]


def test_labels_stop_at_edges_that_are_not_to_be_crossed():
    whole = adjacency(STRIP)
    crossed = ~flags_of(whole.facets, np.array([[3, 2]]))[whole.across]
    assert labels(4, whole.links[crossed]).tolist() == [0, 0, 1, 1]


def test_labels_of_nothing_are_empty():
    none = np.zeros((0, 3), int)
    assert len(labels(0, adjacency(none).links)) == 0


def test_flags_ignore_pairs_that_are_no_edges():
    whole = adjacency(STRIP)
    flags = flags_of(whole.facets, np.array([[1, 2], [0, 5], [77, 99]]))
    assert whole.facets[flags].tolist() == [[1, 2]]


def test_chains_join_edges_to_open_and_closed_lines():
    pairs = np.array([[3, 4], [1, 2], [0, 1], [5, 6], [4, 5], [3, 6]])
    lines = sorted((line.tolist() for line in chains(pairs)), key=len)
    assert lines[0] in ([0, 1, 2], [2, 1, 0])
    assert lines[1][0] == lines[1][-1]
    assert sorted(lines[1][:-1]) == [3, 4, 5, 6]


def test_chains_are_split_where_three_lines_meet():
    lines = chains(np.array([[0, 1], [1, 2], [1, 3], [3, 4]]))
    ends = sorted(sorted((int(line[0]), int(line[-1]))) for line in lines)
    assert ends == [[0, 1], [1, 2], [1, 4]]


def test_chains_use_every_edge_once():
    generator = np.random.default_rng(0)
    pairs = np.unique(np.sort(generator.integers(0, 25, (60, 2)), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    lines = chains(pairs)
    used = np.concatenate([np.sort(np.stack([x[:-1], x[1:]], 1), axis=1) for x in lines])
    assert sorted(used.tolist()) == pairs.tolist()


def _one_by_one(pairs):
    """The lines of `chains`, in the same order, edge by edge."""
    around = {}
    for number, pair in enumerate(pairs.tolist()):
        for end in pair:
            around.setdefault(end, []).append(number)
    used, lines = set(), []
    forks = [v for v, edges in around.items() if len(edges) != 2]
    for start, closed in [*((v, False) for v in forks), *((v, True) for v in around)]:
        for edge in around[start]:
            if edge in used or (closed and around[start][0] in used):
                continue
            line, onward = [start], [edge]
            while onward:
                used.add(onward[0])
                line.append(int(pairs[onward[0]].sum()) - line[-1])
                here = around[line[-1]]
                onward = [e for e in here if e not in used] if len(here) == 2 else []
            lines.append(line)
    return lines


@pytest.mark.parametrize("edges", [1, 12, 40, 200])
def test_chains_are_those_that_are_walked_one_by_one(edges):
    generator = np.random.default_rng(edges)
    pairs = np.unique(np.sort(generator.integers(0, 2 * edges, (edges, 2)), axis=1), axis=0)
    pairs = generator.permutation(pairs[pairs[:, 0] != pairs[:, 1]])
    ring = np.stack([np.arange(5), np.roll(np.arange(5), 1)], axis=1) + 2 * edges
    for some in (pairs, np.concatenate([pairs, ring])):
        assert [line.tolist() for line in chains(some)] == _one_by_one(some)


def test_chains_of_nothing_are_none():
    assert chains(np.zeros((0, 2), int)) == []


def test_projected_area_is_signed():
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]])
    cells = np.array([[0, 1, 2], [0, 2, 1]])
    assert projected_volume(corners, cells).tolist() == [3.0, -3.0]


def test_many_cells_around_one_edge_are_cut_in_two_each():
    """Every triangle (0, 1, k) gives (new, 1, k) and, behind all of them, (0, new, k)."""
    count = 300
    rows = np.stack([np.zeros(count), np.ones(count), np.arange(2, count + 2)], axis=1).astype(int)
    base = count + 2
    cut, owner = cut_rows(rows, np.array([[0, 1]]), base)
    assert len(cut) == len(owner) == 2 * count
    assert owner.tolist() == 2 * list(range(count))
    assert {frozenset(row) for row in cut.tolist()} == {
        frozenset((base, end, k)) for end in (0, 1) for k in range(2, base)
    }


def test_vertices_are_pinched_where_cells_around_them_are_no_ball():
    """Two triangles or tetrahedra that share one corner; a void in a ball that touches its hull."""
    lone = np.array([[0, 1, 2], [0, 3, 4]])
    np.testing.assert_array_equal(pinched_vertices(lone, adjacency(lone), 5), [0])
    pair = np.array([[0, 1, 2, 3], [0, 4, 5, 6]])
    np.testing.assert_array_equal(pinched_vertices(pair, adjacency(pair), 7), [0])
    cone = np.concatenate([OCTAHEDRON, np.full((8, 1), 6)], axis=1)
    for whole in (OCTAHEDRON, torus(), moebius(), STRIP, cone, cone[1:]):
        assert len(pinched_vertices(whole, adjacency(whole), 42)) == 0
    # the middle of a ball without two opposite cells is on its hull twice
    np.testing.assert_array_equal(np.intersect1d(cone[0], cone[6]), [6])
    twice = np.delete(cone, [0, 6], axis=0)
    np.testing.assert_array_equal(pinched_vertices(twice, adjacency(twice), 7), [6])
    # one of the cells around a vertex inside another is left out, with an edge on the hull
    around = [[*np.delete(cone[0], k), 7] for k in range(1, 4)]
    void = np.concatenate([cone[1:], around])
    assert euler_characteristic(void) == 2
    on_hull = np.delete(cone[0], [0, 3])
    np.testing.assert_array_equal(pinched_vertices(void, adjacency(void), 8), np.sort(on_hull))

from heapq import heappop, heappush

import numpy as np
import pytest

from equimorph.tasks.planning.kernels import search_classes


def plain_search(links, start, goal, count, visits_at_most, turns):
    """Paths of the best classes, by the plain algorithm on a heap of tuples."""
    holes = len(next(iter(links.values()))[0][2])
    queue, done, before, found = [(0.0, start, (0,) * holes, -1)], set(), [], []
    visits = dict.fromkeys(links, 0)
    while queue and len(found) < count:
        cost, node, own, parent = heappop(queue)
        if (node, own) in done or visits[node] >= visits_at_most:
            continue
        visits[node] += 1
        done.add((node, own))
        before.append((node, parent))
        if node == goal:
            way, last = [], len(before) - 1
            while last >= 0:
                node, last = before[last]
                way.append(node)
            found.append((own, cost, way[::-1]))
            continue
        for other, step, change in links[node]:
            new = tuple(a + b for a, b in zip(own, change, strict=True))
            if max(map(abs, new), default=0) <= turns and (other, new) not in done:
                heappush(queue, (cost + step, other, new, len(before) - 1))
    return found


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("holes", [0, 1, 3])
@pytest.mark.parametrize("wanted", [0, 2])
def test_the_compiled_search_finds_the_paths_of_the_plain_one(seed: int, holes: int, wanted: int):
    """Equal costs, of which there are many, are resolved alike; long paths are left out."""
    rng, nodes = np.random.default_rng(seed), 60
    pairs = rng.integers(0, nodes, (240, 2))
    pairs = np.concatenate([pairs[pairs[:, 0] != pairs[:, 1]], [[0, 1], [0, nodes - 1]]])
    costs = rng.integers(1, 4, len(pairs)).astype(float)
    values = rng.integers(-1, 2, (len(pairs), holes)) * (rng.random((len(pairs), 1)) < 0.2)
    both, steps = np.concatenate([pairs, pairs[:, ::-1]]), np.tile(costs, 2)
    changes = np.concatenate([values, -values])
    order = np.argsort(both[:, 0], kind="stable")
    both, steps, changes = both[order], steps[order], np.ascontiguousarray(changes[order])
    links = {node: [] for node in range(nodes)}
    for (a, b), step, change in zip(both.tolist(), steps.tolist(), changes.tolist(), strict=True):
        links[a].append((b, step, tuple(change)))
    found, labels, classes = search_classes(
        np.searchsorted(both[:, 0], np.arange(nodes + 1)),
        np.ascontiguousarray(both[:, 1]),
        steps,
        changes,
        np.array([0, nodes - 1]),
        np.array([5, 40, 2, wanted]),
        1.5,
    )
    expected = plain_search(links, 0, nodes - 1, 5, 40, 2)
    if 0 < wanted <= len(expected):
        longest = 1.5 * expected[wanted - 1][1]
        expected = [each for each in expected if each[1] <= longest]
    assert len(found) == len(expected)
    for label, (own, _, way) in zip(found.tolist(), expected, strict=True):
        assert tuple(classes[labels[label, 1]].tolist()) == own
        path, last = [], label
        while last >= 0:
            node, _, last = labels[last].tolist()
            path.append(node)
        assert path[::-1] == way

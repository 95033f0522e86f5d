"""Polylines through points on grid edges: what crosses a cell enters and leaves it on its edges."""

import numpy as np
from jaxtyping import Float, Int

from equimorph.tasks.maps.brackets import cells_beside

Points = Float[np.ndarray, "points 2"]


def chains(
    points: Points, edge: Int[np.ndarray, " points"], shape: tuple[int, int]
) -> list[Int[np.ndarray, " _"]]:
    """Connect points on edges of a grid of ``shape`` vertices across its cells.

    Within a cell the closest points on different edges are connected first, each to one other;
    what is left over ends there.

    Returns
    -------
    Numbers of the points along each polyline; a closed one repeats its first.
    """
    inside: dict[int, list[int]] = {}
    for k, cells in enumerate(cells_beside(edge, shape).tolist()):
        for cell in cells:
            if cell >= 0:
                inside.setdefault(cell, []).append(k)
    links: dict[int, list[int]] = {k: [] for k in range(len(points))}
    for members in inside.values():
        for one, other in _pairs(points, edge, members):
            links[one].append(other)
            links[other].append(one)
    return _walks(links)


def _pairs(
    points: Points, edge: Int[np.ndarray, " points"], members: list[int]
) -> list[tuple[int, int]]:
    """Closest pairs of points on different edges of one cell, each point once."""
    choices = [
        (a, b) for n, a in enumerate(members) for b in members[n + 1 :] if edge[a] != edge[b]
    ]
    choices.sort(key=lambda pair: float(np.hypot(*(points[pair[0]] - points[pair[1]]))))
    used: set[int] = set()
    found = []
    for a, b in choices:
        if a not in used and b not in used:
            found.append((a, b))
            used |= {a, b}
    return found


def _walks(links: dict[int, list[int]]) -> list[Int[np.ndarray, " _"]]:
    """Follow links from loose ends, then around what is closed."""
    left = set(links)
    order = sorted(links, key=lambda k: len(links[k]))  # loose ends first
    found = []
    for start in order:
        if start not in left:
            continue
        walk, here = [start], start
        left.discard(start)
        while ahead := [k for k in links[here] if k in left]:
            here = ahead[0]
            walk.append(here)
            left.discard(here)
        if len(walk) > 2 and start in links[here]:
            walk.append(start)
        found.append(np.array(walk))
    return found

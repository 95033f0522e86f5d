"""Compiled kernels of sheet lifting."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import SUMS
from equimorph.linalg.row_kernels import rows_with_room, with_room
from equimorph.manifold.geometry.kernels import nearest_in_list


@njit(nogil=True, fastmath=SUMS)
def match_rays(
    n, weights, scales, head, following, z, index, tangents, counted, longest, reach, cosine,
    points, targets, spans, guesses, lengths, partners,
):  # fmt: skip
    """Predict where rays end, and find the known points there.

    From point to point of a ray's `points` over the vertices `targets`; `spans` are the changes of
    the free parameters. head, following: linked lists of the points over each vertex; tangents
    (points, d, size): changes of z for unit changes of the free parameters; counted: index of each
    point, counted where its tangents were computed; weights: of squared changes of z in the length
    of corrections, the first n in that of steps.

    Fills predictions, the lengths of steps in the metric, and partners: −2 where a step is too
    long, or the index is not what was counted; −1 where no point matches: of all points the nearest
    must have the same index, lie within a share `reach` of the step from the prediction, be
    predicted as well from there, and have a tangent whose cosine with that of the ray is `cosine`
    at least.
    """
    size, d = z.shape[1], spans.shape[1]
    step, other = np.empty(size), np.empty(size)
    for i in range(points.shape[0]):
        here, weight = points[i], 0.0
        for k in range(d):
            weight += (spans[i, k] / scales[k]) ** 2
        _step_along(tangents, here, spans, i, step)
        length = weight
        for j in range(n):
            length += weights[j] * step[j] * step[j]
        for j in range(size):
            guesses[i, j] = z[here, j] + step[j]
        lengths[i] = length**0.5
        partners[i] = -2
        if not lengths[i] < longest or counted[here] != index[here]:
            continue
        partners[i] = -1
        best, _ = nearest_in_list(
            head[targets[i]], following, z, guesses[i], weights, reach**2 * length
        )
        if best < 0 or index[best] != index[here] or counted[best] != index[here]:
            continue
        _step_along(tangents, best, spans, i, other)
        back, product, there = 0.0, weight, weight
        for j in range(size):
            back += weights[j] * (z[best, j] - other[j] - z[here, j]) ** 2
        for j in range(n):
            there += weights[j] * other[j] * other[j]
            product += weights[j] * other[j] * step[j]
        if back < reach**2 * there and product >= cosine * (length * there) ** 0.5:
            partners[i] = best


@njit(nogil=True, fastmath=SUMS)
def _step_along(tangents, point, spans, i, step):
    """Change of z along tangents of a point, for a change of the free parameters."""
    for j in range(step.shape[0]):
        step[j] = spans[i, 0] * tangents[point, 0, j]
    for k in range(1, spans.shape[1]):
        for j in range(step.shape[0]):
            step[j] += spans[i, k] * tangents[point, k, j]


@njit(nogil=True)
def flag_first_of_alike(mass, order, targets, index, guesses, lengths, reach, first):
    """Flag rays whose predictions are not those of earlier ones; `order` sorts them by target.

    Predictions over one vertex with the same index are alike if they are nearer to each other than
    the share `reach` of the step.
    """
    n, start = mass.shape[0], 0
    for at in range(order.shape[0]):
        i = order[at]
        if targets[i] != targets[order[start]]:
            start = at
        first[i] = True
        for before in range(start, at):
            other = order[before]
            if not first[other] or index[other] != index[i]:
                continue
            distance = 0.0
            for j in range(n):
                distance += mass[j] * (guesses[i, j] - guesses[other, j]) ** 2
            if distance < (reach * lengths[i]) ** 2:
                first[i] = False
                break


@njit(nogil=True)
def square_gaps(mass, z, one, other, squared):
    """Squared distances between points in the metric."""
    for i in range(one.shape[0]):
        total = 0.0
        for j in range(mass.shape[0]):
            total += mass[j] * (z[one[i], j] - z[other[i], j]) ** 2
        squared[i] = total


@njit(nogil=True)
def slope_squares(mass, z, tangents, one, other, slopes):
    """Derivatives of squared distances between points along the free parameters.

    tangents: see `match_rays`.
    """
    for i in range(one.shape[0]):
        a, b = one[i], other[i]
        for k in range(slopes.shape[1]):
            total = 0.0
            for j in range(mass.shape[0]):
                step = tangents[a, k, j] - tangents[b, k, j]
                total += mass[j] * (z[a, j] - z[b, j]) * step
            slopes[i, k] = 2.0 * total


@njit(nogil=True)
def find_plain_loops(
    wanted, triangles, sides, edges, vertex, head, following, rays, slots, start, end, plain
):
    """Loops of three curves that go straight across, their triangles, and where other ones exist.

    plain: which curves have no inner points; the rest as in `close_loops`. The last are flags of
    the wanted triangles.
    """
    loops = np.empty((wanted.shape[0] + 64, 3), np.int64)
    owners = np.empty(loops.shape[0], np.int64)
    count, special = 0, np.zeros(wanted.shape[0], np.bool_)
    mesh, known = edges, (vertex, rays, slots, start, end, plain)
    for i in range(wanted.shape[0]):
        t = wanted[i]
        before, a = count, head[triangles[t, 0]]
        amount = 0
        while a >= 0:
            amount += 1
            b = _straight_across(a, sides[t, 0], mesh, known)
            c = _straight_across(a, sides[t, 2], mesh, known)
            if b >= 0 and c >= 0 and _straight_across(b, sides[t, 1], mesh, known) == c:
                if count == loops.shape[0]:
                    loops = rows_with_room(loops, 2 * count)
                    owners = with_room(owners, 2 * count)
                loops[count, 0], loops[count, 1], loops[count, 2] = a, b, c
                owners[count] = t
                count += 1
            a = following[a]
        special[i] = amount > count - before
        for k in range(1, 3):
            node, amount = head[triangles[t, k]], 0
            while node >= 0:
                amount += 1
                node = following[node]
            special[i] |= amount > count - before
    return loops[:count].copy(), owners[:count].copy(), special


@njit(nogil=True)
def _straight_across(point, edge, edges, known):
    """Point at the other end of a curve that goes straight across an edge; −1 if there is none."""
    vertex, rays, slots, start, end, plain = known
    curve = _ray(point, edge, edges, vertex, rays, slots)
    if curve < 0 or end[curve] < 0 or not plain[curve]:
        return -1
    other = end[curve] if start[curve] == point else start[curve]
    return other if vertex[other] != vertex[point] else -1


@njit(nogil=True)
def close_loops(
    wanted, triangles, sides, edges, vertex, head, following, rays, slots, start, end,
    inner_first, inner_points, plain, plain_rows,
):  # fmt: skip
    """Close the curves around some triangles into polygons, but for plain loops.

    head, following: linked lists of the points over each vertex; rays, slots: see `Pairing`; start,
    end: of the curves; the inner points of curve c are those from ``inner_first[c]`` to
    ``inner_first[c + 1]``; plain_rows: which rows of `plain` are loops of each wanted triangle,
    whose points are left out.

    Returns the points of all polygons, where those of each begin, their triangles, which are open,
    and which triangles have curves that do not close, or close only after going around twice.
    """
    points, used = np.empty(1024, np.int64), 0
    firsts, owners, opens = (
        np.empty(256, np.int64),
        np.empty(256, np.int64),
        np.empty(256, np.int64),
    )
    count, broken = 0, np.zeros(wanted.shape[0], np.bool_)
    mesh, known = (triangles, sides, edges), (vertex, rays, slots, start, end)
    inner = (inner_first, inner_points)
    for i in range(wanted.shape[0]):
        t = wanted[i]
        own = plain[plain_rows[i, 0] : plain_rows[i, 1]]
        todo, corners = _points_over(triangles[t], head, following, own)
        done = np.zeros(todo.shape[0], np.bool_)
        count_before, used_before = count, used
        for rule in range(2):  # first those that begin at an exit
            for j in range(todo.shape[0]):
                for came_by in range(2) if rule == 0 else range(-1, 0):
                    if done[j] or (
                        rule == 0 and not _leaves(t, todo[j], corners[j], came_by, mesh, known)
                    ):
                        continue
                    points, stop, state = _walk(
                        t, j, came_by, todo, corners, done, mesh, known, inner, points, used
                    )
                    broken[i] |= state == BROKEN
                    firsts, owners, opens = (
                        with_room(firsts, count + 2),
                        with_room(owners, count + 1),
                        with_room(opens, count + 1),
                    )
                    firsts[count], owners[count], opens[count] = used, t, state == OPEN
                    count, used = count + 1, stop
        if broken[i]:
            count, used = count_before, used_before
    firsts[count] = used
    return points[:used], firsts[: count + 1], owners[:count], opens[:count], broken


CLOSED, OPEN, BROKEN = 0, 1, 2
"""How walks along the curves around a triangle end."""
LONGEST_WALK = 64
"""Points over corners after which a walk counts as broken."""


@njit(nogil=True)
def _points_over(corners, head, following, plain):
    """Points over the corners of a triangle, sorted, and over which; none of its plain loops."""
    points, where = np.empty(16, np.int64), np.empty(16, np.int64)
    count = 0
    for k in range(3):
        node = head[corners[k]]
        while node >= 0:
            known = False
            for row in range(plain.shape[0]):
                known |= plain[row, k] == node
            if not known:
                points, where = with_room(points, count + 1), with_room(where, count + 1)
                at = count
                while at > 0 and points[at - 1] > node:
                    points[at], where[at] = points[at - 1], where[at - 1]
                    at -= 1
                points[at], where[at] = node, k
                count += 1
            node = following[node]
    return points[:count], where[:count]


@njit(nogil=True)
def _ray(point, edge, edges, vertex, rays, slots):
    """Curve at a point along an edge; see `Pairing.ray`."""
    side = 1 if edges[edge, 1] == vertex[point] else 0
    return rays[point, slots[edge, side]]


@njit(nogil=True)
def _side(t, corner, which, sides):
    """One of the two sides of a triangle that meet at a corner."""
    return sides[t, corner if which == 0 else (corner + 2) % 3]


@njit(nogil=True)
def _leaves(t, point, corner, which, mesh, known):
    """Whether a curve along a side leaves through a constraint."""
    _, sides, edges = mesh
    vertex, rays, slots, _, end = known
    curve = _ray(point, _side(t, corner, which, sides), edges, vertex, rays, slots)
    return curve >= 0 and end[curve] < 0


@njit(nogil=True)
def _walk(t, j, came_by, todo, corners, done, mesh, known, inner, points, used):
    """Follow curves from the point ``todo[j]``, from an exit if `came_by` names the side of it.

    Appends to `points`; returns these, how many there are, and how the walk ended.
    """
    triangles, sides, edges = mesh
    vertex, rays, slots, start, end = known
    first, stop, point, corner = inner[0], used, todo[j], corners[j]
    visited, count = np.empty(LONGEST_WALK + 1, np.int64), 0
    if came_by >= 0:
        curve = _ray(point, _side(t, corner, came_by, sides), edges, vertex, rays, slots)
        points, stop = _append(points, stop, curve, False, inner)
    way = 1 if came_by == 0 else 0
    while True:
        points = with_room(points, stop + 1)
        points[stop] = visited[count] = point
        stop, count = stop + 1, count + 1
        for k in range(todo.shape[0]):
            done[k] |= todo[k] == point
        edge = _side(t, corner, way, sides)
        curve = _ray(point, edge, edges, vertex, rays, slots)
        if curve < 0 or count > LONGEST_WALK:
            return points, stop, BROKEN
        forward = start[curve] == point
        points, stop = _append(points, stop, curve, forward, inner)
        point = end[curve] if forward else start[curve]
        if point < 0:
            return points, stop, OPEN if came_by >= 0 else BROKEN
        if point == visited[0] and came_by < 0:
            break
        for k in range(count):
            if visited[k] == point:
                return points, stop, BROKEN
        corner = 0
        while triangles[t, corner] != vertex[point]:
            corner += 1
        way = 1 if _side(t, corner, 0, sides) == edge else 0
    once, bent = True, False
    for k in range(count):
        for m in range(k):
            once &= vertex[visited[m]] != vertex[visited[k]]
        for corner in range(3):
            for way in range(2):
                if triangles[t, corner] == vertex[visited[k]]:
                    edge = _side(t, corner, way, sides)
                    curve = _ray(visited[k], edge, edges, vertex, rays, slots)
                    bent |= curve >= 0 and first[curve + 1] > first[curve]
    # a loop without folds or exits that passes over a corner more than once goes around twice
    return points, stop, CLOSED if once or bent else BROKEN


@njit(nogil=True)
def _append(points, stop, curve, forward, inner):
    """Append the inner points of a curve."""
    first, own = inner
    count = first[curve + 1] - first[curve]
    points = with_room(points, stop + count)
    for k in range(count):
        points[stop + k] = own[first[curve] + k if forward else first[curve + 1] - 1 - k]
    return points, stop + count

"""Compiled kernels of the recovery, a vector of lanes at a time; at least eight lanes.

From a vertex, where θ and κ are superconvergent, the rod's equation ``κ' = 4π² f`` with
``f = −λ sin θ + (μ − qρ) cos θ`` is followed by Taylor series. With ``κ = Σ c_k τ^k`` the series
of the waves obey ``k S_k = Σ_j c_{j−1} C_{k−j}`` and ``k C_k = −Σ_j c_{j−1} S_{k−j}``, j = 1 … k.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, write_lanes
from equimorph.linalg.simd import (
    LANES,
    absolute,
    lanes_less,
    larger,
    load,
    load2,
    repeat2,
    row_of,
    sincos,
    spread,
    stack2,
    store,
    where_less,
    work_rows,
)
from equimorph.structures.rod.clamped_kernels import LAMBDA, MU, Q, read_state

FOUR_PI_SQUARED = 4.0 * np.pi**2
ORDER = np.int64(16)
"""Terms of the series of sin θ and cos θ; κ has one more, θ two."""
REACH = 0.6
"""Longest step, times the rate at which the series grow: its last term is below 1e-13."""
MOST_STEPS = 12
THETA, KAPPA, X, Y = range(4)
"""Rows of a local state."""
DISTANCE, WIDTH, CENTRE, STEPS, PART = range(5)
"""Rows of the moves: from a vertex to a place, how far off this may be, its arclength; steps."""
NEWTON = 4
"""Iterations from a secant's root of κ' to round-off in κ, which is stationary there."""
TIE = 1e-9
"""Extrema that differ by less, relatively, are equal: the first one counts. Where no load acts all
interior extrema of an inflectional rod are equal, and round-off would choose."""


@njit(**INNER)
def _expand(state, pull, terms, lam, waves, slopes):
    """Series about a local state: rows (sin, cos) of waves, κ in slopes; pull holds μ − qρ."""
    sine, cosine = sincos(load(state, THETA))
    store(waves, 0, stack2(sine, cosine))
    store(slopes, 0, load(state, KAPPA))
    for k in range(ORDER):
        if k > 0:
            total = repeat2(spread(0.0))
            for j in range(k):
                total = total + repeat2(load(slopes, j)) * load2(waves, 2 * (k - 1 - j))
            inverse = spread(1.0 / k)
            sine, cosine = row_of(total, 1) * inverse, spread(0.0) - row_of(total, 0) * inverse
            store(waves, 2 * k, stack2(sine, cosine))
        force = spread(0.0) - lam * sine
        for j in range(min(k + 1, terms)):
            force = force + load(pull, j) * load(waves, 2 * (k - j) + 1)
        store(slopes, k + 1, force * spread(FOUR_PI_SQUARED / (k + 1)))


@njit(**INNER)
def _step(state, pull, terms, waves, slopes, distance):
    """Move a local state, and the centre of the load's polynomial, along its series."""
    kappa, turned = load(slopes, ORDER), load(slopes, ORDER) * spread(1.0 / (ORDER + 1))
    along = repeat2(spread(0.0))
    for k in range(ORDER - 1, -1, -1):
        kappa = load(slopes, k) + distance * kappa
        turned = load(slopes, k) * spread(1.0 / (k + 1)) + distance * turned
        along = load2(waves, 2 * k) * repeat2(spread(1.0 / (k + 1))) + repeat2(distance) * along
    store(state, THETA, load(state, THETA) + distance * turned)
    store(state, KAPPA, kappa)
    store(state, X, load(state, X) + distance * row_of(along, 1))
    store(state, Y, load(state, Y) + distance * row_of(along, 0))
    for i in range(terms - 1):
        for j in range(terms - 2, i - 1, -1):
            store(pull, j, load(pull, j) + distance * load(pull, j + 1))


@njit(**{**INNER, "forceinline": True})
def _follow(state, pull, terms, lam, waves, slopes, moves):
    """Move a local state over the distance of each lane, in equal steps that its series can take.

    Lanes that need fewer steps than others stay where they are in the last ones: what happens to a
    lane never depends on those beside it.
    """
    distance = load(moves, DISTANCE)
    forces = spread(2.0 * FOUR_PI_SQUARED) * (absolute(lam) + absolute(load(pull, 0)))
    kappa = load(state, KAPPA)
    store(moves, STEPS, distance * distance * (kappa * kappa + forces))
    most = 1
    for k in range(LANES):
        steps = min(max(np.ceil(np.sqrt(moves[STEPS, k]) / REACH), 1.0), MOST_STEPS)
        moves[STEPS, k], moves[PART, k] = steps, moves[DISTANCE, k] / steps
        most = max(most, np.int64(steps))
    for i in range(most):
        part = where_less(spread(i + 0.0), load(moves, STEPS), load(moves, PART), spread(0.0))
        _expand(state, pull, terms, lam, waves, slopes)
        _step(state, pull, terms, waves, slopes, part)


@njit(**INNER)
def _vertex_curvature(stiffness, pressures, e, side, theta, force):
    """κ at the left (side 0) or right vertex of an element, by balance of its moment.

    `force` is f there, `pressures` the quadrature weight of a vertex in each element.
    """
    order = stiffness.shape[1]
    base, own = e * (order - 1), side * (order - 1)
    moment = spread(pressures[e]) * force
    for i in range(order):
        moment = moment + spread(stiffness[e, own, i]) * load(theta, base + i)
    return spread((2.0 * side - 1.0) * FOUR_PI_SQUARED) * moment


@njit(**FLAGS)
def fields_lanes(stiffness, pressures, weights, rho, rises, element, side, distance, z, p, out):
    """θ, κ, x and y at points of every lane; out (lanes, 4 · points).

    A point lies at `distance` from the left (side 0) or right vertex of its `element`. weights
    (elements, degree + 1); rho at the nodes; rises (elements, 2, terms): Taylor coefficients of ρ
    about both vertices.
    """
    elements, degree, terms = stiffness.shape[0], stiffness.shape[1] - 1, rises.shape[2]
    n, points = z.shape[1] - 2, len(element)
    theta, scalars, nodal = work_rows(n + 3), work_rows(4), work_rows(2 * (n + 2))
    places, results = work_rows(2 * (elements + 1)), work_rows(4 * points)
    state, pull, moves = work_rows(4), work_rows(terms), work_rows(5)
    waves, slopes = work_rows(2 * ORDER), work_rows(ORDER + 1)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, n, theta, scalars)
        lam, mu, q = load(scalars, LAMBDA), load(scalars, MU), load(scalars, Q)
        for i in range(n + 2):
            sine, cosine = sincos(load(theta, i))
            store(nodal, 2 * i, stack2(sine, cosine))
        _vertex_places(weights, nodal, places)
        for point in range(points):
            e, right = element[point], side[point]
            vertex = e + right
            node = vertex * degree
            sine, cosine = load(nodal, 2 * node), load(nodal, 2 * node + 1)
            force = (mu - q * spread(rho[node])) * cosine - lam * sine
            store(state, THETA, load(theta, node))
            kappa = _vertex_curvature(stiffness, pressures, e, right, theta, force)
            store(state, KAPPA, kappa)
            store(state, X, load(places, 2 * vertex + 1))
            store(state, Y, load(places, 2 * vertex))
            if distance[point] != 0.0:
                store(pull, 0, mu - q * spread(rises[e, right, 0]))
                for j in range(1, terms):
                    store(pull, j, spread(0.0) - q * spread(rises[e, right, j]))
                store(moves, DISTANCE, spread(distance[point]))
                _follow(state, pull, terms, lam, waves, slopes, moves)
            for row in range(4):
                store(results, 4 * point + row, load(state, row))
        write_lanes(results, 0, 1, out, start * 4 * points, 4 * points, 4 * points)


@njit(**INNER)
def _vertex_places(weights, nodal, places):
    """(y, x) of every vertex: quadrature of (sin θ, cos θ) over the elements before it."""
    degree = weights.shape[1] - 1
    total = repeat2(spread(0.0))
    store(places, 0, total)
    for e in range(weights.shape[0]):
        for i in range(degree + 1):
            total = total + repeat2(spread(weights[e, i])) * load2(nodal, 2 * (e * degree + i))
        store(places, 2 * (e + 1), total)


@njit(**FLAGS)
def largest_lanes(stiffness, pressures, breaks, nodes, integral, rho, rises, z, p, largest, place):
    """Largest |κ| over s of each lane and where."""
    work = largest_work(stiffness, rises)
    largest_in(
        work, stiffness, pressures, breaks, nodes, integral, rho, rises, z, p, largest, place
    )


@njit(**FLAGS)
def largest_work(stiffness, rises):
    """Work arrays of `largest_in`."""
    elements, order, terms = stiffness.shape[0], stiffness.shape[1], rises.shape[2]
    n = elements * (order - 1) - 1
    found = np.empty((LANES, elements * order, 3))
    return (
        work_rows(n + 3), work_rows(4), work_rows(n + 2), work_rows(2 * elements), work_rows(2),
        work_rows(4), work_rows(terms), work_rows(5), work_rows(2 * ORDER), work_rows(ORDER + 1),
        found, np.empty(LANES, np.int64),
    )  # fmt: skip


@njit(**INNER)
def largest_in(
    work, stiffness, pressures, breaks, nodes, integral, rho, rises, z, p, largest, place
):
    """`largest_lanes` in work arrays: vertices, then every extremum that may exceed.

    Where κ' changes sign between nodes an extremum is sought from the nearer vertex, the most
    promising of each lane first.
    """
    theta, scalars, forces, ends, best, state, pull, moves, waves, slopes, found, count = work
    elements, order, terms = stiffness.shape[0], stiffness.shape[1], rises.shape[2]
    n = z.shape[1] - 2
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, n, theta, scalars)
        lam, mu, q = load(scalars, LAMBDA), load(scalars, MU), load(scalars, Q)
        for i in range(n + 2):
            sine, cosine = sincos(load(theta, i))
            store(forces, i, (mu - q * spread(rho[i])) * cosine - lam * sine)
        _vertex_maximum(stiffness, pressures, breaks, theta, forces, ends, best)
        count[:] = 0
        for e in range(elements):
            _note_extrema(e, breaks, nodes, integral, forces, ends, best, found, count, moves)
        state[:] = 0.0
        pull[:] = 0.0
        while _next_extrema(
            breaks, order, rises, theta, scalars, ends, best, found, count, state, pull, moves
        ):
            _follow(state, pull, terms, lam, waves, slopes, moves)
            _expand(state, pull, terms, lam, waves, slopes)
            _take_extremum(slopes, moves, best)
        for k in range(LANES):
            largest[start + k], place[start + k] = best[0, k], best[1, k]


@njit(**INNER)
def _vertex_maximum(stiffness, pressures, breaks, theta, forces, ends, best):
    """κ of both vertices of every element; the largest |κ| and its arclength into best."""
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    most, where = spread(0.0), spread(0.0)
    for e in range(elements):
        for side in range(2):
            force = load(forces, (e + side) * degree)
            kappa = _vertex_curvature(stiffness, pressures, e, side, theta, force)
            store(ends, 2 * e + side, kappa)
            value = absolute(kappa)
            where = where_less(most * spread(1.0 + TIE), value, spread(breaks[e + side]), where)
            most = larger(most, value)
    store(best, 0, most)
    store(best, 1, where)


@njit(**{**INNER, "forceinline": True})
def _note_extrema(e, breaks, nodes, integral, forces, ends, best, found, count, spill):
    """Append the extrema in an element that may exceed the best: bound, element + t, width.

    κ' changes sign between two nodes; from the left one |κ| can grow by the width times the slope
    there, twice what a straight slope would give.
    """
    order, base, length = len(nodes), e * (len(nodes) - 1), breaks[e + 1] - breaks[e]
    limit = load(best, 0) * spread(1.0 + 1e-12)
    for i in range(order - 1):
        left, right = load(forces, base + i), load(forces, base + i + 1)
        turning = lanes_less(left * right, spread(0.0))
        if turning == 0:
            continue
        kappa = spread(0.0)
        for j in range(order):
            kappa = kappa + spread(integral[i, j]) * load(forces, base + j)
        kappa = load(ends, 2 * e) + spread(FOUR_PI_SQUARED * length) * kappa
        width = (nodes[i + 1] - nodes[i]) * length
        bound = absolute(kappa) + spread(FOUR_PI_SQUARED * width) * absolute(left)
        store(spill, 0, bound)
        store(spill, 1, left / (left - right))
        turning &= lanes_less(limit, bound)
        for k in range(LANES):
            if turning >> k & 1:
                t = nodes[i] + spill[1, k] * (nodes[i + 1] - nodes[i])
                found[k, count[k], 0], found[k, count[k], 1] = spill[0, k], e + t
                found[k, count[k], 2] = width
                count[k] += 1


@njit(**INNER)
def _next_extrema(
    breaks, order, rises, theta, scalars, ends, best, found, count, state, pull, moves
):
    """Set out from the vertex nearest to each lane's most promising extremum; whether any is left.

    Lanes without one stay where they are, with nothing to move.
    """
    some = False
    for k in range(LANES):
        top, bound = -1, best[0, k] * (1.0 + 1e-12)
        for c in range(count[k]):
            if found[k, c, 0] > bound:
                top, bound = c, found[k, c, 0]
        moves[DISTANCE, k] = moves[WIDTH, k] = 0.0
        if top < 0:
            continue
        some, found[k, top, 0] = True, 0.0
        e = np.int64(found[k, top, 1])
        t = found[k, top, 1] - e
        side = np.int64(t > 0.5)
        q = scalars[Q, k]
        moves[DISTANCE, k] = (t - side) * (breaks[e + 1] - breaks[e])
        moves[WIDTH, k] = found[k, top, 2]
        moves[CENTRE, k] = breaks[e + side] + moves[DISTANCE, k]
        state[THETA, k], state[KAPPA, k] = theta[(e + side) * (order - 1), k], ends[2 * e + side, k]
        pull[0, k] = scalars[MU, k] - q * rises[e, side, 0]
        for j in range(1, rises.shape[2]):
            pull[j, k] = -q * rises[e, side, j]
    return some


@njit(**INNER)
def _take_extremum(slopes, moves, best):
    """Newton on the series of κ' from its centre, kept within the width; κ there into best."""
    at, width = spread(0.0), load(moves, WIDTH)
    for _ in range(NEWTON):
        slope, bend = spread(0.0), spread(0.0)
        for k in range(ORDER, 0, -1):
            bend = slope + at * bend
            slope = spread(k) * load(slopes, k) + at * slope
        moved = at - slope / bend
        at = where_less(absolute(moved), width, moved, at)
    kappa = spread(0.0)
    for k in range(ORDER, -1, -1):
        kappa = load(slopes, k) + at * kappa
    most, old = load(best, 0), load(best, 1)
    new = load(moves, CENTRE) + at
    kappa = where_less(spread(0.0), width, absolute(kappa), spread(0.0))
    first = where_less(most * spread(1.0 - TIE), kappa, where_less(new, old, new, old), old)
    store(best, 1, where_less(most * spread(1.0 + TIE), kappa, new, first))
    store(best, 0, larger(most, kappa))

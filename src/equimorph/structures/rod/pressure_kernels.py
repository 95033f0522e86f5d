"""Compiled kernels of pressure on a rod: its part of F, F_p·dp, D²F and of the diagonal of F_z.

The area is that of `pressure.EnclosedArea` with a symmetric part of zero and real weights m. With
tangents u = c + i s at the nodes, d = Σ m u, and p the pressure, ``∂V/∂θ_i = −c_i (W c)_i −
s_i (W s)_i − m_i Im(q d u_i)``. Between elements ``W_ij = ½ sign(e − f) m_i m_j``: what they add to
(W c)_i is half of ``Σ m c`` before the element less what follows it. The other entries of F_z are
those of `linalg.condensed.Coupling`.

See docs/decisions.md, "Pressure on a rod is a chain with two sums".
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, sincos, spread, store


@njit(**INNER)
def dot(row, scalars):
    """Pressure, or its change, of scalars."""
    total = spread(0.0)
    for j in range(len(row)):
        total = total + spread(row[j]) * load(scalars, j)
    return total


@njit(**INNER)
def _times(re, im, x, y):
    """Product of a number and vectors, as real and imaginary part."""
    return spread(re) * x - spread(im) * y, spread(re) * y + spread(im) * x


@njit(**INNER)
def _add(target, row, value):
    store(target, row, load(target, row) + value)


@njit(**INNER)
def _sums(weights, e, cosine, sine):
    """Σ m c and Σ m s of an element."""
    x, y, start = spread(0.0), spread(0.0), e * (weights.shape[1] - 1)
    for i in range(weights.shape[1]):
        x = x + spread(weights[e, i]) * load(cosine, start + i)
        y = y + spread(weights[e, i]) * load(sine, start + i)
    return x, y


@njit(**INNER)
def _turn(inside, weights, e, i, c, s, cosine, sine, ends):
    """Change of ∂V/∂θ at a node as an element sees it, as the ends of the rod turn, but for q."""
    last, degree, total = inside.shape[0] - 1, inside.shape[1] - 1, spread(0.0)
    for k in range(2):
        far, at = k * last, k * (last + 1) * degree
        entry = 0.5 * weights[e, i] * weights[far, k * degree] * (1.0 - 2.0 * k)
        if e == far:
            entry = inside[e, i, k * degree]
        arm = c * load(sine, at) - s * load(cosine, at)
        total = total + spread(entry) * load(ends, k) * arm
    return total


@njit(**INNER)
def press_block(
    coupling, pressure, theta, scalars, velocity, ends, cosine, sine, pull, force, turn, curved
):
    """Add pressure's part of a block of lanes to F, F_p·dp and the diagonal of F_z, by node.

    ends (2): velocities of the ends of the rod, zero where they are unknown. Filled: cosine and
    sine by node, pull (1). The share of q in the diagonal is left to the `Coupling`.
    """
    inside, weights, closed = coupling
    (elements, order), half, zero = weights.shape, spread(0.5), spread(0.0)
    last, degree = theta.shape[0] - 1, order - 1
    for i in range(last + 1):
        s, c = sincos(load(theta, i))
        store(sine, i, s)
        store(cosine, i, c)
    press, growth = dot(pressure, scalars), dot(pressure, velocity)
    store(pull, 0, press)
    x, y = zero, zero
    for e in range(elements):
        own_x, own_y = _sums(weights, e, cosine, sine)
        x, y = x + own_x, y + own_y
    first, final = spread(weights[0, 0]) * load(ends, 0), load(ends, 1)
    final = spread(weights[elements - 1, degree]) * final
    d_x = zero - first * load(sine, 0) - final * load(sine, last)
    d_y = first * load(cosine, 0) + final * load(cosine, last)
    re, im = _times(closed[0], closed[1], x, y)
    d_re, d_im = _times(closed[0], closed[1], d_x, d_y)
    past_x, past_y = zero, zero
    for e in range(elements):
        own_x, own_y = _sums(weights, e, cosine, sine)
        side_x, side_y = past_x + half * (own_x - x), past_y + half * (own_y - y)
        past_x, past_y = past_x + own_x, past_y + own_y
        for i in range(order):
            node, weight = e * degree + i, spread(weights[e, i])
            c, s = load(cosine, node), load(sine, node)
            along, across = weight * side_x, weight * side_y
            for j in range(order):
                along = along + spread(inside[e, i, j]) * load(cosine, e * degree + j)
                across = across + spread(inside[e, i, j]) * load(sine, e * degree + j)
            work = zero - c * along - s * across - weight * (re * s + im * c)
            bend = s * along - c * across - weight * (re * c - im * s)
            more = _turn(inside, weights, e, i, c, s, cosine, sine, ends)
            more = more - weight * (d_re * s + d_im * c)
            _add(force, node, zero - press * work)
            _add(turn, node, zero - press * more - growth * work)
            _add(curved, node, zero - press * bend)


@njit(**INNER)
def enclosed_area(coupling, theta, cosine, sine):
    """V of a block of lanes: ``cos θ · W sin θ + ½ Re(q d²)``."""
    inside, weights, closed = coupling
    (elements, order), half = weights.shape, spread(0.5)
    for i in range(theta.shape[0]):
        s, c = sincos(load(theta, i))
        store(sine, i, s)
        store(cosine, i, c)
    x, y, total = spread(0.0), spread(0.0), spread(0.0)
    for e in range(elements):
        # half of what lies before less what follows: of sums before, and of their products
        own_x, own_y = _sums(weights, e, cosine, sine)
        total = total + half * (own_x * y - x * own_y)
        x, y = x + own_x, y + own_y
        for i in range(order):
            across = spread(0.0)
            for j in range(order):
                across = across + spread(inside[e, i, j]) * load(sine, e * (order - 1) + j)
            total = total + load(cosine, e * (order - 1) + i) * across
    re, im = _times(closed[0], closed[1], x, y)
    return total + half * (x * re - y * im)


@njit(**INNER)
def _add_moved(factor, at, cosine, sine, v, w, totals):
    """Add an entry of W, or a weight, times u, u v, u w and u v w of a node; real parts first."""
    dv, dw = load(v, at), load(w, at)
    c, s = factor * load(cosine, at), factor * load(sine, at)
    for k in range(0, 4, 2):
        _add(totals, 2 * k, c)
        _add(totals, 2 * k + 1, s)
        _add(totals, 2 * k + 2, c * dv)
        _add(totals, 2 * k + 3, s * dv)
        c, s = c * dw, s * dw


@njit(**INNER)
def press_second(coupling, theta, v, w, pulls, cosine, sine, work, force):
    """Subtract pressure's part of D²F[v, w] of a block of lanes from forces by node.

    v and w: turns of all nodes; pulls (3): pressure, and its changes along v and w. work (32 rows)
    holds sums of u, u v, u w and u v w, real and imaginary parts: of the rod, of what lies before
    an element, of the element, and times a row of W.
    """
    inside, weights, closed = coupling
    (elements, order), half = weights.shape, spread(0.5)
    degree, zero = order - 1, spread(0.0)
    whole, past, own, at_node = work[:8], work[8:16], work[16:24], work[24:32]
    for i in range(theta.shape[0]):
        s, c = sincos(load(theta, i))
        store(sine, i, s)
        store(cosine, i, c)
    whole[:] = 0.0
    past[:] = 0.0
    for e in range(elements):
        for i in range(order):
            _add_moved(spread(weights[e, i]), e * degree + i, cosine, sine, v, w, whole)
    for e in range(elements):
        own[:] = 0.0
        for i in range(order):
            _add_moved(spread(weights[e, i]), e * degree + i, cosine, sine, v, w, own)
        for i in range(order):
            node, weight = e * degree + i, spread(weights[e, i])
            for k in range(8):
                side = load(past, k) + half * (load(own, k) - load(whole, k))
                store(at_node, k, weight * side)
            for j in range(order):
                entry = spread(inside[e, i, j])
                _add_moved(entry, e * degree + j, cosine, sine, v, w, at_node)
            total = _second_at(node, weight, closed, cosine, sine, v, w, pulls, whole, at_node)
            _add(force, node, zero - total)
        for k in range(8):
            _add(past, k, load(own, k))


@njit(**INNER)
def _second_at(node, weight, closed, cosine, sine, v, w, pulls, whole, at_node):
    """Share of one node, as an element sees it, in `press_second`.

    With y, d: what W and the weights make of u, u v, u w and u v w. Along v and w ∂V/∂θ changes by
    ``−Re(ū (v y_w + w y_v − v w y − y_vw)) + Im(q m u (d_vw + w d_v + v d_w + v w d))``, along v by
    ``Im(ū (y_v − v y)) − Re(q m u (d_v + v d))``.
    """
    c, s, dv, dw = load(cosine, node), load(sine, node), load(v, node), load(w, node)
    x, x_v, x_w, x_vw = load(at_node, 0), load(at_node, 2), load(at_node, 4), load(at_node, 6)
    y, y_v, y_w, y_vw = load(at_node, 1), load(at_node, 3), load(at_node, 5), load(at_node, 7)
    re = dv * x_w + dw * x_v - dv * dw * x - x_vw
    im = dv * y_w + dw * y_v - dv * dw * y - y_vw
    both = spread(0.0) - c * re - s * im
    by_v = c * (y_v - dv * y) - s * (x_v - dv * x)
    by_w = c * (y_w - dw * y) - s * (x_w - dw * x)
    arm_re, arm_im = _times(closed[0], closed[1], weight * c, weight * s)
    x, x_v, x_w, x_vw = load(whole, 0), load(whole, 2), load(whole, 4), load(whole, 6)
    y, y_v, y_w, y_vw = load(whole, 1), load(whole, 3), load(whole, 5), load(whole, 7)
    re = x_vw + dw * x_v + dv * x_w + dv * dw * x
    im = y_vw + dw * y_v + dv * y_w + dv * dw * y
    both = both + arm_re * im + arm_im * re
    by_v = by_v - arm_re * (x_v + dv * x) + arm_im * (y_v + dv * y)
    by_w = by_w - arm_re * (x_w + dw * x) + arm_im * (y_w + dw * y)
    return load(pulls, 0) * both + load(pulls, 1) * by_w + load(pulls, 2) * by_v

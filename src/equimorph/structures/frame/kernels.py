"""Compiled forces and stiffness of frames, a vector of lanes at a time."""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import LANES, load, sincos, spread, store, work_rows


@njit(**INNER)
def _add(target, row, value):
    store(target, row, load(target, row) + value)


@njit(**INNER)
def _combined(table, row, scalars):
    """Row of a table times the scalars."""
    total = spread(0.0)
    for j in range(table.shape[1]):
        if table[row, j] != 0.0:
            total = total + spread(table[row, j]) * load(scalars, j)
    return total


@njit(**INNER)
def _bend(stiffness, nodes, e, psi, force):
    """Add the forces of bending in an element."""
    order = nodes.shape[1]
    for i in range(order):
        total = spread(0.0)
        for j in range(order):
            total = total + spread(stiffness[e, i, j]) * load(psi, nodes[e, j])
        _add(force, nodes[e, i], total)


@njit(**INNER)
def _bend_with_member(
    m, elements, nodes, held, stiffness, softness, sine, cosine, which, ties, diagonal, edges,
    corners, psi, scalars, dpsi, velocity, own, force, turn, matrix, strain, rate,
):  # fmt: skip
    """Add what one member contributes to forces, their change, and the matrix; see `Tables`."""
    order, count = nodes.shape[1], len(psi)
    for e in range(m * elements, (m + 1) * elements):
        for i in range(order):
            node, at = nodes[e, i], e * order + i
            s, c = sincos(load(psi, node))
            a, b, da, db = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
            for r in range(ties[m, 1]):
                across, along = spread(sine[at, r]), spread(cosine[at, r])
                y = load(scalars, which[m, r])
                a, b = a + across * y, b + along * y
                if r >= ties[m, 0]:
                    dy = load(velocity, which[m, r])
                    da, db = da + across * dy, db + along * dy
            k = spread(softness[at])
            pull, shear = a * s + b * c, a * c - b * s
            stretch = strain + k * pull
            change = rate + k * (da * s + db * c)
            _add(force, node, spread(0.0) - stretch * shear)
            _add(turn, node, spread(0.0) - change * shear - stretch * (da * c - db * s))
            if diagonal[node] >= 0:
                _add(matrix, diagonal[node], stretch * pull - k * shear * shear)
            for r in range(ties[m, 0]):
                across, along = spread(sine[at, r]), spread(cosine[at, r])
                part = across * s + along * c
                slope = stretch * (across * c - along * s) + k * shear * part
                row = count + which[m, r]
                _add(force, row, spread(0.0) - stretch * part)
                _add(turn, row, spread(0.0) - change * part - slope * load(dpsi, node))
                if edges[at, r] >= 0:
                    _add(matrix, edges[at, r], spread(0.0) - slope)
                if softness[at] != 0.0:
                    store(own, r, part)
                    for q in range(r + 1):
                        _add(matrix, corners[m, r, q], spread(0.0) - k * part * load(own, q))
        _bend(stiffness, nodes, e, psi, force)
        if held[e]:
            _bend(stiffness, nodes, e, dpsi, turn)


@njit(**FLAGS)
def linearise_lanes(
    nodes, held, place, stiffness, springs, softness, sine, cosine, which, ties, diagonal, edges,
    corners, stretch, turned, slope_at, slope_by, quadratic, constant, z, p, dp, residual, column,
    entries,
):  # fmt: skip
    """F, F_p·dp and the entries of F_z; see `Tables`."""
    lanes, size = z.shape
    members, elements = len(which), len(nodes) // len(which)
    count, scalars, length = len(place), quadratic.shape[1], entries.shape[1]
    multipliers, given = quadratic.shape[0], p.shape[1]
    y, dy, rows = work_rows(scalars), work_rows(scalars), work_rows(size)
    psi, dpsi, own = work_rows(count), work_rows(count), work_rows(multipliers + 1)
    force, turn = work_rows(count + multipliers), work_rows(count + multipliers)
    matrix = work_rows(length)
    for block in range(0, lanes, LANES):
        lane = min(block, lanes - LANES)
        read_lanes(z, lane * size, size, size, rows, 0, 1)
        dy[:] = 0.0
        read_lanes(p, lane * given, given, given, y, multipliers, 1)
        read_lanes(dp, lane * given, given, given, dy, multipliers, 1)
        for c in range(multipliers):
            store(y, c, load(rows, size - multipliers + c))
        store(y, scalars - 1, spread(1.0))
        for i in range(count):
            store(dpsi, i, spread(0.0))
            if place[i] >= 0:
                store(psi, i, load(rows, place[i]))
            else:
                store(psi, i, _combined(turned, i, y))
                store(dpsi, i, _combined(turned, i, dy))
        force[:] = 0.0
        turn[:] = 0.0
        for e in range(length):
            store(matrix, e, spread(constant[e]))
        for m in range(members):
            strain = spread(1.0) + _combined(stretch, m, y)
            rate = _combined(stretch, m, dy)
            _bend_with_member(
                m, elements, nodes, held, stiffness, softness, sine, cosine, which, ties, diagonal,
                edges, corners, psi, y, dpsi, dy, own, force, turn, matrix, strain, rate,
            )  # fmt: skip
        for i in range(count):
            if springs[i] != 0.0:
                _add(force, i, spread(springs[i]) * load(psi, i))
        for i in range(len(slope_by)):
            node, j = slope_at[i, 0], slope_at[i, 1]
            _add(force, node, spread(0.0) - spread(slope_by[i]) * load(y, j))
            _add(turn, node, spread(0.0) - spread(slope_by[i]) * load(dy, j))
        for c in range(multipliers):
            _add(force, count + c, _combined(quadratic, c, y))
            _add(turn, count + c, _combined(quadratic, c, dy))
        _write(place, force, rows, residual, lane)
        _write(place, turn, rows, column, lane)
        write_lanes(matrix, 0, 1, entries, lane * length, length, length)


@njit(**INNER)
def _read_state(z, p, lane, constant, turned, place, rows, y, psi):
    """Scalars, the last of which is given, and turns of all nodes, of a vector of lanes."""
    size, given, scalars = z.shape[1], p.shape[1], len(y)
    multipliers = scalars - 1 - given
    read_lanes(z, lane * size, size, size, rows, 0, 1)
    read_lanes(p, lane * given, given, given, y, multipliers, 1)
    for c in range(multipliers):
        store(y, c, load(rows, size - multipliers + c))
    store(y, scalars - 1, spread(constant))
    for i in range(len(place)):
        if place[i] >= 0:
            store(psi, i, load(rows, place[i]))
        else:
            store(psi, i, _combined(turned, i, y))


@njit(**INNER)
def _bent_twice(
    m, elements, nodes, softness, sine, cosine, which, ties, turns, scalars, strains, force
):
    """Add what one member contributes to D²F[v, w].

    turns, scalars, strains: of the state, of v and of w.
    """
    order, count = nodes.shape[1], len(turns[0])
    e, ev, ew = strains
    for at in range(m * elements * order, (m + 1) * elements * order):
        node = nodes[at // order, at % order]
        s, c = sincos(load(turns[0], node))
        dv, dw = load(turns[1], node), load(turns[2], node)
        none = spread(0.0)
        a, b, av, bv, aw, bw = none, none, none, none, none, none
        for r in range(ties[m, 1]):
            across, along = spread(sine[at, r]), spread(cosine[at, r])
            own = which[m, r]
            y, yv, yw = load(scalars[0], own), load(scalars[1], own), load(scalars[2], own)
            a, b = a + across * y, b + along * y
            av, bv = av + across * yv, bv + along * yv
            aw, bw = aw + across * yw, bw + along * yw
        k = spread(softness[at])
        pull, shear = a * s + b * c, a * c - b * s
        pull_v, shear_v = av * s + bv * c, av * c - bv * s
        pull_w, shear_w = aw * s + bw * c, aw * c - bw * s
        # first changes of P and P', and second ones
        first_v, first_w = ev + k * (pull_v + shear * dv), ew + k * (pull_w + shear * dw)
        both = dv * dw
        twice = k * (shear_v * dw + shear_w * dv - pull * both)
        bent = spread(0.0) - pull_v * dw - pull_w * dv - shear * both
        stretch = e + k * pull
        moment = stretch * bent + twice * shear
        moment = moment + first_v * (shear_w - pull * dw) + first_w * (shear_v - pull * dv)
        _add(force, node, spread(0.0) - moment)
        # a multiplier's P = along cos ψ + across sin ψ, its first and second changes
        twice, once = twice - stretch * both, first_v * dw + first_w * dv
        by_sine, by_cosine = twice * s + once * c, twice * c - once * s
        for r in range(ties[m, 0]):
            part = spread(sine[at, r]) * by_sine + spread(cosine[at, r]) * by_cosine
            _add(force, count + which[m, r], spread(0.0) - part)


@njit(**FLAGS)
def second_lanes(
    nodes, place, softness, sine, cosine, which, ties, stretch, turned, z, p, vz, vp, wz, wp, out
):
    """D²F[v, w] without pressures; see `Tables`."""
    lanes, size = z.shape
    members, elements = len(which), len(nodes) // len(which)
    count, scalars = len(place), turned.shape[1]
    multipliers = scalars - 1 - p.shape[1]
    y, yv, yw = work_rows(scalars), work_rows(scalars), work_rows(scalars)
    psi, dv, dw = work_rows(count), work_rows(count), work_rows(count)
    rows, force = work_rows(size), work_rows(count + multipliers)
    for block in range(0, lanes, LANES):
        lane = min(block, lanes - LANES)
        _read_state(z, p, lane, 1.0, turned, place, rows, y, psi)
        _read_state(vz, vp, lane, 0.0, turned, place, rows, yv, dv)
        _read_state(wz, wp, lane, 0.0, turned, place, rows, yw, dw)
        force[:] = 0.0
        for m in range(members):
            strains = (
                spread(1.0) + _combined(stretch, m, y),
                _combined(stretch, m, yv),
                _combined(stretch, m, yw),
            )
            _bent_twice(
                m, elements, nodes, softness, sine, cosine, which, ties, (psi, dv, dw), (y, yv, yw),
                strains, force,
            )  # fmt: skip
        _write(place, force, rows, out, lane)


@njit(**INNER)
def _point_forces(m, at, node, softness, sine, cosine, which, ties, psi, scalars, strain, density):
    """Add (1 + e + γP) P' at a point of a member to a density; the strain is 1 + e."""
    s, c = sincos(load(psi, node))
    a, b = spread(0.0), spread(0.0)
    for r in range(ties[m, 1]):
        y = load(scalars, which[m, r])
        a, b = a + spread(sine[at, r]) * y, b + spread(cosine[at, r]) * y
    stretch = strain + spread(softness[at]) * (a * s + b * c)
    _add(density, at, stretch * (a * c - b * s))


@njit(**INNER)
def _integrate(e, order, first, last, lengths, integral, shares, weights, density, moments):
    """Moments in an element between those at its ends, from the density of their change."""
    for i in range(order):
        change = spread(0.0)
        for j in range(order):
            at = e * order + j
            change = change - spread(integral[i, j] * lengths[e] / weights[at]) * load(density, at)
        store(moments, e * order + i, first + change)
    gap = last - load(moments, e * order + order - 1)
    for i in range(order):
        _add(moments, e * order + i, gap * spread(shares[i]))


@njit(**FLAGS)
def moments_lanes(
    nodes, place, softness, sine, cosine, which, ties, stretch, turned, stiffness, actuated,
    weights, lengths, integral, shares, z, p, pressed, out,
):  # fmt: skip
    """Bending moments at the nodes of every element; see `FrameFields._moments`.

    actuated: moments of each member that are held free of stress, by scalar; pressed, none or at
    each point: what pressures add to the nodal moments, and to the density of their change.
    """
    lanes, size = z.shape
    members, (count, order) = len(which), nodes.shape
    elements, points, scalars = count // members, count * order, turned.shape[1]
    y, psi, rows = work_rows(scalars), work_rows(len(place)), work_rows(size)
    density, moments = work_rows(points), work_rows(points)
    loaded = work_rows(max(pressed.shape[1], 1))
    for block in range(0, lanes, LANES):
        lane = min(block, lanes - LANES)
        _read_state(z, p, lane, 1.0, turned, place, rows, y, psi)
        width = pressed.shape[1]
        read_lanes(pressed, lane * width, width, width, loaded, 0, 1)
        density[:] = 0.0
        for e in range(count):
            m, begin, end = e // elements, e * order, e * order + order - 1
            strain = spread(1.0) + _combined(stretch, m, y)
            for i in range(order):
                _point_forces(
                    m, begin + i, nodes[e, i], softness, sine, cosine, which, ties, psi, y, strain,
                    density,
                )  # fmt: skip
            held = _combined(actuated, m, y)
            first, last = load(density, begin) - held, spread(0.0) - load(density, end) - held
            for j in range(order):
                turn = load(psi, nodes[e, j])
                first = first - spread(stiffness[e, 0, j]) * turn
                last = last + spread(stiffness[e, order - 1, j]) * turn
            if width > 0:
                first, last = first - load(loaded, begin), last + load(loaded, end)
                for at in range(begin, end + 1):
                    _add(density, at, load(loaded, points + at))
            _integrate(e, order, first, last, lengths, integral, shares, weights, density, moments)
        write_lanes(moments, 0, 1, out, lane * points, points, points)


@njit(**INNER)
def _write(place, values, rows, target, lane):
    """Write values at the unknown nodes and of the multipliers behind the nodes."""
    count, size = len(place), target.shape[1]
    for i in range(count):
        if place[i] >= 0:
            store(rows, place[i], load(values, i))
    multipliers = len(values) - count
    for c in range(multipliers):
        store(rows, size - multipliers + c, load(values, count + c))
    write_lanes(rows, 0, 1, target, lane * size, size, size)

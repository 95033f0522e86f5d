"""Compiled forces and stiffness of bars, a vector of lanes at a time."""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import LANES, load, spread, square_root, store, work_rows


@njit(**INNER)
def slopes(squared, rest, stiffness, green):
    """∂W/∂g, ∂²W/∂g² and ∂²W/∂g∂l₀ of a bar's energy W(g, l₀), g the square of its length."""
    inverse = spread(1.0) / rest
    if green:
        factor = spread(0.25 * stiffness) * inverse * inverse * inverse
        by_rest = spread(0.25 * stiffness) * inverse * inverse
        by_rest = by_rest - spread(3.0) * factor * squared * inverse
        return factor * (squared - rest * rest), factor, by_rest
    length = square_root(squared)
    half = spread(0.5 * stiffness)
    first = half * (inverse - spread(1.0) / length)
    return first, half * spread(0.5) / (length * squared), spread(0.0) - half * inverse * inverse


@njit(**FLAGS)
def linearise_lanes(
    unknowns, slots, drawn, stiffness, rest, rates, pulls, green, z, p, dp, residual, column,
    entries,
):  # fmt: skip
    """F, F_p·dp and the entries of F_z; see `Truss`.

    unknowns (bars, 2 · space): of both ends, −1 where held; slots (bars, 2 · space, 2 · space): the
    entry of each pair, −1 where there is none; drawn (bars, space): from end to end; rates (bars,
    parameters): of the rest lengths; pulls (parameters, n): forces.
    """
    lanes, n = z.shape
    bars, space = drawn.shape
    count, length = p.shape[1], entries.shape[1]
    u, at, along = work_rows(n), work_rows(count), work_rows(count)
    force, slope, matrix = work_rows(n), work_rows(n), work_rows(length)
    d, stretch = work_rows(space), work_rows(space * space)
    for block in range(0, lanes, LANES):
        lane = min(block, lanes - LANES)
        read_lanes(z, lane * n, n, n, u, 0, 1)
        read_lanes(p, lane * count, count, count, at, 0, 1)
        read_lanes(dp, lane * count, count, count, along, 0, 1)
        matrix[:] = 0.0
        for i in range(n):
            total, change = spread(0.0), spread(0.0)
            for k in range(count):
                if pulls[k, i] != 0.0:
                    total = total - spread(pulls[k, i]) * load(at, k)
                    change = change - spread(pulls[k, i]) * load(along, k)
            store(force, i, total)
            store(slope, i, change)
        for bar in range(bars):
            l0, dl0 = spread(rest[bar]), spread(0.0)
            for k in range(count):
                if rates[bar, k] != 0.0:
                    l0 = l0 + spread(rates[bar, k]) * load(at, k)
                    dl0 = dl0 + spread(rates[bar, k]) * load(along, k)
            squared = spread(0.0)
            for c in range(space):
                x = spread(drawn[bar, c])
                if unknowns[bar, c] >= 0:
                    x = x - load(u, unknowns[bar, c])
                if unknowns[bar, space + c] >= 0:
                    x = x + load(u, unknowns[bar, space + c])
                store(d, c, x)
                squared = squared + x * x
            first, second, mixed = slopes(squared, l0, stiffness[bar], green)
            first, second, mixed = first + first, spread(4.0) * second, (mixed + mixed) * dl0
            for c in range(space):
                x = load(d, c)
                for e in range(c + 1):
                    value = second * x * load(d, e)
                    if e == c:
                        value = value + first
                    store(stretch, c * space + e, value)
                    store(stretch, e * space + c, value)
            for a in range(2 * space):
                i, c = unknowns[bar, a], a % space
                if i < 0:
                    continue
                x = load(d, c)
                if a < space:
                    x = spread(0.0) - x
                store(force, i, load(force, i) + first * x)
                store(slope, i, load(slope, i) + mixed * x)
                for b in range(2 * space):
                    slot = slots[bar, a, b]
                    if slot < 0:
                        continue
                    value = load(stretch, c * space + b % space)
                    if (a < space) == (b < space):
                        store(matrix, slot, load(matrix, slot) + value)
                    else:
                        store(matrix, slot, load(matrix, slot) - value)
        write_lanes(force, 0, 1, residual, lane * n, n, n)
        write_lanes(slope, 0, 1, column, lane * n, n, n)
        write_lanes(matrix, 0, 1, entries, lane * length, length, length)

"""Check a route certificate without the package that wrote it: ``python check_route.py FILE``.

A certificate says of a structure with the energy L(y), y = (z, p), z the unknowns and multipliers:
while the parameters p run straight from corner to corner, there is, for every p on the way, exactly
one z with F = ∂L/∂z = 0 in a tube around the straight line between the states z of the corners; it
is continuous, and a stable equilibrium, with a margin: all eigenvalues of the Hessian on the null
space of the constraints, in the given mass, are larger than that. Hence the motion does not snap.

The energy is differentiated twice, in interval arithmetic with outward rounding. With A about the
inverse of F_z, T(z) = z − A F(z; p) then maps the tube into itself and contracts (Krawczyk), and
F_z − margin · mass is regular in the tube and has as many negative eigenvalues as there are
multipliers (Sylvester). Functions of numpy are trusted to four units in the last place.
"""

import json
import sys

import numpy as np

MORE, TINY = 1.0 + 1e-12, 1e-300  # for rounding and underflow of sums without negative terms


class Interval:
    """Arrays between two bounds, rounded outward by four units in the last place."""

    __array_ufunc__ = None

    def __init__(self, low, high=None):
        self.low = np.array(low, dtype=float)
        self.high = self.low if high is None else np.array(high, dtype=float)
        self.middle = 0.5 * self.low + 0.5 * self.high
        self.radius = np.maximum(self.high - self.middle, self.middle - self.low) * MORE
        self.size = np.maximum(np.abs(self.low), np.abs(self.high))

    def each(self, change):
        return Interval(change(self.low), change(self.high))

    def __getitem__(self, key):
        return self.each(lambda x: x[key])

    def __neg__(self):
        return Interval(-self.high, -self.low)

    def __add__(self, other):
        y = exact(other)
        return outward(self.low + y.low, self.high + y.high)

    def __sub__(self, other):
        return self + -exact(other)

    def __mul__(self, other):
        y = exact(other)
        corners = [a * b for a in (self.low, self.high) for b in (y.low, y.high)]
        return outward(np.minimum.reduce(corners), np.maximum.reduce(corners))

    __radd__, __rmul__ = __add__, __mul__


def exact(x):
    return x if isinstance(x, Interval) else Interval(x)


def outward(low, high):
    room = 4 * np.spacing(np.maximum(np.abs(low), np.abs(high)))
    return Interval(low - room, high + room)


def dot(matrix, x):
    """An exact matrix times intervals, with the a-priori bound of rounding errors."""
    unit = (matrix.shape[-1] + 4) * 2.0**-53 * MORE
    room = np.abs(matrix) @ (x.radius + unit * np.abs(x.middle)) * MORE + TINY
    return outward(matrix @ x.middle - room, matrix @ x.middle + room)


def rising(function, x):
    return outward(function(x.low), function(x.high))


def inverse(x):
    require(((x.low > 0) | (x.high < 0)).all(), "a division by zero in a tube")
    return outward(1.0 / x.high, 1.0 / x.low)


def wave(function, top, x):
    """Sine or cosine, which is 1 at `top` and after whole turns, -1 half a turn before."""
    ends, turn = (function(x.low), function(x.high)), 2 * np.pi
    least, most = (
        (np.floor((x.high - at) / turn) >= np.ceil((x.low - at) / turn)) | ~(x.size < 1e7)
        for at in (top - np.pi, top)
    )
    return outward(np.where(least, -1.0, np.minimum(*ends)), np.where(most, 1.0, np.maximum(*ends)))


def value_and_slopes(name, x):
    """A function with its first and second derivative over intervals."""
    if name in {"sin", "cos"}:
        s, c = wave(np.sin, 0.5 * np.pi, x), wave(np.cos, 0.0, x)
        return (s, c, -s) if name == "sin" else (c, -s, -c)
    if name == "exp":
        return (rising(np.exp, x),) * 3
    f = inverse(x) if name == "inv" else rising(np.sqrt, x)
    third = f * f * f
    return (
        (f, -(f * f), 2.0 * third)
        if name == "inv"
        else (f, 0.5 * inverse(f), -0.25 * inverse(third))
    )


class Jet:
    """Values (terms), gradients (terms, k) and Hessians (terms, k, k) in k local variables."""

    def __init__(self, value, gradient, hessian):
        self.value, self.gradient, self.hessian = value, gradient, hessian

    def jet(self, other):
        if isinstance(other, Jet):
            return other
        constant = Interval(other + np.zeros_like(self.value.low))
        return Jet(constant, 0.0 * self.gradient, 0.0 * self.hessian)

    def of(self, name):
        f, f1, f2 = value_and_slopes(name, self.value)
        g = self.gradient
        both = g[:, :, None] * g[:, None]
        return Jet(f, f1[:, None] * g, f1[:, None, None] * self.hessian + f2[:, None, None] * both)

    def __add__(self, other):
        y = self.jet(other)
        return Jet(self.value + y.value, self.gradient + y.gradient, self.hessian + y.hessian)

    def __mul__(self, other):
        y = self.jet(other)
        a, b = self.value, y.value
        cross = self.gradient[:, :, None] * y.gradient[:, None]
        cross = cross + cross.each(lambda x: x.transpose(0, 2, 1))
        hessian = a[:, None, None] * y.hessian + b[:, None, None] * self.hessian + cross
        return Jet(a * b, a[:, None] * y.gradient + b[:, None] * self.gradient, hessian)

    __radd__, __rmul__ = __add__, __mul__


# Energies: groups of equal terms in local variables A(y, 1), or quadratic forms xᵀKx/2 of these.


def planar(data, size, count):
    """θᵀKθ/2 - θᵀSw + Σ ((1 + e)N - γ(N + T)²/2) + wᵀQw/2 - Σ pV, N = a sin θ + b cos θ at points.

    w = (multipliers, p, 1); θ of a node is an entry of z, or prescribed: a row of `turned` times w.
    """
    t = {name: np.array(each) for name, each in data.items() if name != "kind"}
    y, (scalars, nodes) = np.eye(size + count + 1), t["slope"].shape
    w, place = y[len(y) - scalars :], t["place"]
    angles = np.where(place[:, None] < 0, t["turned"] @ w, y[place])
    work = np.zeros((nodes + scalars, nodes + scalars))
    work[:nodes, :nodes], work[nodes:, nodes:] = np.diag(t["springs"]), t["quadratic"]
    work[:nodes, nodes:], work[nodes:, :nodes] = -t["slope"].T, -t["slope"]
    fields = [t[name].T @ w for name in ("sine", "cosine", "stretch", "tension")]

    def point(theta, a, b, stretch, pull):
        normal = a * theta.of("sin") + b * theta.of("cos")
        both = normal + pull
        return normal + stretch * normal + both * both * (-0.5 * t["softness"])

    groups = [
        (angles[t["elements"]], t["stiffness"]),
        (np.concatenate([angles, w])[None], work[None]),
        (np.stack([angles[t["points"]], *fields], axis=1), point),
    ]
    first, last = np.divmod(np.arange(nodes * nodes), nodes)
    names = ("area", "even", "weights", "across", "closing", "pressure")
    if np.ndim(t.get("area")) == 2:  # files that know one pressure, on a rod
        t |= {"even": np.zeros((nodes, nodes)), "across": np.zeros(nodes)}
        t |= {name: t[name][None] for name in names}
    for *tables, pressure in zip(*(t.get(name, ()) for name in names), strict=True):
        pull = np.tile(pressure @ w, (len(first), 1))
        pairs = np.stack([angles[first], angles[last], pull], axis=1)
        groups.append((pairs, area_pairs(*tables)))
    return groups


def area_pairs(matrix, even, weights, across, closing):
    """Pairs of -pV, V = Σ cos θᵢ Wᵢⱼ sin θⱼ + (Σ Eᵢⱼ cos (θᵢ - θⱼ) + dᵀQd)/2.

    d = Σ (m + ik) (cos θ + i sin θ) in complex numbers.
    """
    nodes = len(weights)
    first, last = np.divmod(np.arange(nodes * nodes), nodes)
    (xx, xy), (yx, yy) = closing

    def chord(c, s, at):
        m, k = weights[at], across[at]
        return c * m + s * (-k), s * m + c * k

    def area(one, other, pressure):
        (c, s), (x, y) = ((each.of("cos"), each.of("sin")) for each in (one, other))
        (c0, s0), (x0, y0) = chord(c, s, first), chord(x, y, last)
        closed = c0 * x0 * xx + s0 * y0 * yy + c0 * y0 * xy + s0 * x0 * yx
        half = (closed + (c * x + s * y) * even.ravel()) * 0.5
        return pressure * (c * y * matrix.ravel() + half) * -1.0

    return area


def constant(size):
    """The variables themselves, and no constant."""
    return np.eye(size, size + 1)


def truss(data, size, count):
    """EA l₀ ε²/2 with Green (l²/l₀² - 1)/2 or engineering strain l/l₀ - 1; less work of loads."""
    y, stiffness, ends = constant(size + count), np.array(data["stiffness"]), np.array(data["ends"])
    moves = np.concatenate([y[:size], np.zeros((1, y.shape[1]))])  # the last one is held
    rest, pulls = np.array(data["rates"]) @ y[size:], np.array(data["pulls"])
    local = np.concatenate([moves[ends[:, 1]] - moves[ends[:, 0]], rest[:, None]], axis=1)
    local[:, :, -1] = np.column_stack([np.array(data["chords"]), data["lengths"]])
    work = np.zeros((size + count, size + count))
    work[size:, :size], work[:size, size:] = -pulls, -pulls.T

    def bar(*x):
        squared, shorter = sum((each * each for each in x[1:-1]), x[0] * x[0]), x[-1].of("inv")
        if data["strain"] == "green":
            strain = (squared * shorter * shorter + -1.0) * 0.5
        else:
            strain = squared.of("sqrt") * shorter + -1.0
        return x[-1] * strain * strain * (0.5 * stiffness)

    return [(local, bar), (y[None], work[None])]


def spring(data, size, count):
    """k (1 - x/cos δ)²/2 + F x tan δ; p = (x, F, k)."""

    def energy(delta, x, force, k):
        longer = x * delta.of("cos").of("inv")
        strain = longer + -1.0
        return k * strain * strain * 0.5 + force * longer * delta.of("sin")

    return [(constant(4)[None], energy)]


OPERATIONS = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a + b * -1.0,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a * b.of("inv"),
    "assign": lambda a: a,
    "neg": lambda a: a * -1.0,
    "twice": lambda a: a * 2.0,
    "sq": lambda a: a * a,
}


def program(data, size, count):
    """Instructions [operation, operands]: numbers of variables or of instructions before."""

    def energy(*y):
        done = []
        for name, *operands in data["instructions"]:
            if name in {"variable", "constant"}:
                x = operands[0]
                done.append(y[x] if name == "variable" else y[0].jet(x))
                continue
            given = [done[each] for each in operands]
            done.append(OPERATIONS[name](*given) if name in OPERATIONS else given[0].of(name))
        return done[-1]

    return [(constant(size + count)[None], energy)]


KINDS = {"planar": planar, "truss": truss, "spring": spring, "program": program}


def reshape(x, *shape):
    return Interval(x.low.reshape(shape), x.high.reshape(shape))


def derivatives(groups, y):
    """Gradient and Hessian of the energy over a box of y."""
    size = len(y.low)
    gradient, hessian = Interval(np.zeros(size)), Interval(np.zeros((size, size)))
    for local, energy in groups:
        terms, k, _ = local.shape
        forms = local[:, :, :-1]
        x = reshape(dot(forms.reshape(-1, size), y[:, None]), terms, k) + local[:, :, -1]
        if callable(energy):
            none = Interval(np.zeros((terms, k, k)))
            units = (Interval(np.tile(each, (terms, 1))) for each in np.eye(k))
            jet = energy(*(Jet(x[:, i], unit, none) for i, unit in enumerate(units)))
            g, h = jet.gradient, jet.hessian
        else:
            g, h = dot(energy, x[:, :, None]), Interval(energy)
        flat, half = forms.reshape(-1, size).T, dot(forms.transpose(0, 2, 1), h)
        half = reshape(half.each(lambda x: x.transpose(0, 2, 1)), -1, size)
        gradient = gradient + dot(flat, reshape(g, -1, 1))[:, 0]
        hessian = hessian + dot(flat, half)
    both = np.minimum(hessian.low, hessian.low.T), np.maximum(hessian.high, hessian.high.T)
    return gradient, Interval(*both)


def up(matrix, x):
    return matrix @ x * MORE


def negatives(matrix):
    """Negative eigenvalues of a symmetric matrix: Gershgorin's discs of VᵀMV avoid zero."""
    values, vectors = np.linalg.eigh(matrix)
    v = vectors / np.sqrt(np.abs(values))
    turned = dot(v.T, dot(matrix, Interval(v)))
    discs = turned.size.sum(axis=1) * MORE - turned.size.diagonal()
    below, above = turned.high.diagonal() < -discs, turned.low.diagonal() > discs
    return below.sum() if (below | above).all() else None


def require(condition, why):
    if not condition:
        raise ValueError(why)


def check_segment(groups, one, other, tube, margin, mass):
    """Reach of the equilibria from the states at both ends; an error if nothing is proved."""
    size, count = len(tube), len(tube) - np.count_nonzero(mass)
    inner, rooms = slice(0, size), np.concatenate([tube, np.zeros(len(one) - len(tube))])
    chord = Interval(np.minimum(one, other), np.maximum(one, other))
    matrix = derivatives(groups, Interval(0.5 * (one + other)))[1].middle[inner, inner]
    turn = np.linalg.inv(matrix)
    ends = [
        dot(turn, derivatives(groups, Interval(y))[0][inner, None]).size[:, 0] for y in (one, other)
    ]
    near = derivatives(groups, chord)[1].radius[inner]
    sag = 0.5 * up(np.abs(turn), up(near, (Interval(other) - one).size)) * MORE
    inside = derivatives(groups, chord + Interval(-rooms, rooms))[1][inner, inner]
    change = up((Interval(np.eye(size)) - dot(turn, inside)).size, tube)
    require((np.maximum(*ends) + sag + change < tube * (1 - 1e-12)).all(), "no contraction")
    left = 1.0 - (change / tube).max() * MORE
    shifted = inside - Interval(margin) * np.diag(mass)
    gap = (Interval(np.eye(size)) - dot(np.linalg.inv(shifted.middle), shifted)).size
    weights = np.ones(size)
    for _ in range(20):
        weights = np.maximum(gap @ weights, 1e-3 * (gap @ weights).max() + TINY)
    require((up(gap, weights) < weights).all(), "the margin is not kept")
    require(negatives(shifted.middle) == count, "the index is not 0")
    return [(end / tube).max() / left * MORE * tube for end in ends]


def check(certificate):
    """The statement that is proved; ValueError says why there is none."""
    names = ("z", "p", "tubes", "mass")
    z, p, tubes, mass = (np.array(certificate[each], dtype=float) for each in names)
    margin = float(certificate["margin"])
    require(all(np.isfinite(x).all() for x in (z, p, tubes, mass)), "numbers are not finite")
    require(len(z) == len(p) == len(tubes) + 1 >= 2, "corners and tubes do not match")
    require(tubes.shape[1:] == z.shape[1:] == mass.shape, "states and tubes do not match")
    require((tubes > 0).all() and (mass >= 0).all() and margin > 0, "a number is not positive")
    require(certificate["index"] == 0, "only index 0 is stable")
    data, y = certificate["structure"], np.concatenate([z, p], axis=1)
    groups = list(KINDS[data["kind"]](data, z.shape[1], p.shape[1]))
    before = None
    for k, tube in enumerate(tubes):
        try:
            first, last = check_segment(groups, y[k], y[k + 1], tube, margin, mass)
            apart = before is not None and not (
                (before <= tube).all() or (first <= tubes[k - 1]).all()
            )
            require(not apart, "it does not continue the one before")
        except (ValueError, np.linalg.LinAlgError) as error:
            raise ValueError(f"segment {k}: {error}") from None
        before = last
    return f"{len(tubes)} segments, margin {margin!r}, from p = {p[0]} to p = {p[-1]}"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print("usage: check_route.py CERTIFICATE", file=sys.stderr)
        sys.exit(2)
    try:
        with open(sys.argv[1], encoding="utf-8") as file, np.errstate(all="ignore"):
            print("accepted:", check(json.load(file)))
    except OSError as error:
        print(f"{sys.argv[1]} cannot be read: {error.strerror}", file=sys.stderr)
        sys.exit(2)
    except KeyError as error:
        sys.exit(f"refused: {error} is missing")
    except (ValueError, IndexError, TypeError, AttributeError) as error:
        sys.exit(f"refused: {error}")

"""Whether an energy bounds its states, or repeats them, and where constraints become dependent.

A polynomial energy bounds its states if its leading form is positive definite. The gradients of the
constraints, in the metric and each relative to its typical size, span what constraint forces can
do. Where their smallest singular value vanishes, as in a chain whose links lie in one line, the
multipliers grow without bound, and equilibria with forces of opposite sign meet at infinity: no
equilibrium is there, and sets end.

See docs/decisions.md, "Structures say where their energy ends".
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from equimorph.arrays import Entries, Float, Int, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.structures.contract import Growth
from equimorph.structures.energy.declarations import Unknown, periods_of
from equimorph.structures.energy.kernels import OPERATIONS
from equimorph.structures.energy.tape import Tape

Exponents = tuple[int, ...]
Polynomial = Mapping[Exponents, float]
Bounds = Float[np.ndarray, "boxes unknowns"]
Halves = Float[np.ndarray, "halves unknowns"]

FACTORS = {"assign": 1.0, "neg": -1.0, "twice": 2.0}
"""Operations that multiply by a number."""
MOST_TERMS, MOST_PRODUCTS = 3000, 200_000
"""Terms of a polynomial, and products of terms in one operation, beyond which none is expanded."""
MOST_BOXES = 50_000
"""Boxes on the sides of a cube in which the sign of a form is looked for."""
VANISHING = 1e-12
"""Coefficient, relative to the largest one, that is round-off."""
PERIODIC = 1e-8
"""Change of a force over a period, relative to 1 + its size, that is round-off."""
CLEAR = 1e-9
"""Value of a form on the cube, relative to its largest coefficient, that is surely positive."""


def growth_of(
    energy: Tape,
    unknowns: Sequence[Unknown],
    constraints: int,
    promised: bool,
    p: Float[np.ndarray, " parameters"],
) -> Growth:
    """Whether an energy grows at infinity: shown for polynomials, or promised."""
    bounded = [each.name for each in unknowns if np.isfinite([each.lower, each.upper]).any()]
    if constraints or bounded:
        why = "constraints" if constraints else f"limits of {', '.join(bounded)}"
        return Growth(False, f"the configurations have {why}")
    if promised:
        total = int(not any(np.isfinite(each.period) for each in unknowns))
        return Growth(True, "the author promises that the energy grows at infinity", True, total)
    known = grows(energy, len(unknowns), p)
    if known is None:
        return Growth(False, "the energy is no polynomial, and `coercive=True` is not promised")
    if not known:
        return Growth(False, "the leading form of the energy is not shown positive definite")
    return Growth(True, "a polynomial with a positive definite leading form")


def check_periods(
    forces: Callable[[Lanes, Parameters], Lanes],
    unknowns: Sequence[Unknown],
    z: Lanes,
    p: Parameters,
) -> None:
    """Refuse periods after which forces are others."""
    turns, before = periods_of(unknowns, z.shape[1]), forces(z, p)
    named = [each.name for each in unknowns if np.isfinite(each.period)]
    for name, turn in zip(named, turns, strict=True):
        if (np.abs(forces(z + turn, p) - before) > PERIODIC * (1.0 + np.abs(before))).any():
            raise InputError(
                f"`period` of {name} must leave all forces unchanged; got {turn.max():g}. Of two "
                "angles joined by a spring, let one unknown be the difference, without a period."
            )


def grows(tape: Tape, unknowns: int, p: Float[np.ndarray, " parameters"]) -> bool | None:
    """Whether an energy is a polynomial in the unknowns whose leading form is positive definite.

    None if it is no polynomial, or not a short one.
    """
    energy = _expand(tape, unknowns, p)
    if energy is None:
        return None
    largest = max((abs(value) for value in energy.values()), default=0.0)
    kept = {powers: value for powers, value in energy.items() if abs(value) > VANISHING * largest}
    degree = max((sum(powers) for powers in kept), default=0)
    form = {powers: value for powers, value in kept.items() if sum(powers) == degree}
    return degree > 0 and degree % 2 == 0 and positive_definite(form, unknowns)


def _expand(tape: Tape, unknowns: int, p: Float[np.ndarray, " parameters"]) -> Polynomial | None:
    """The first output as a polynomial in the unknowns at given parameters."""
    unit = tuple(0 for _ in range(unknowns))
    work: dict[int, Polynomial | None] = {}
    result: Polynomial | None = None
    for code, first, second, place in tape.code.tolist():
        name = OPERATIONS[code]
        if name == "input":
            powers = tuple(int(i == first) for i in range(unknowns))
            inside = first < unknowns
            work[place] = {powers: 1.0} if inside else {unit: float(p[first - unknowns])}
        elif name == "constant":
            work[place] = {unit: float(tape.constants[first])}
        elif name == "output":
            result = work[first]
        else:
            a, b = work[first], work.get(second)
            work[place] = None if a is None else _operation(name, a, b, unit)
    return result


def _operation(
    name: str, a: Polynomial, b: Polynomial | None, unit: Exponents
) -> Polynomial | None:
    """One instruction of the tape; None where it leads out of the polynomials."""
    if name in FACTORS:
        return _sum(a, {}, FACTORS[name], 0.0)
    if name == "sq":
        return _product(a, a)
    if b is None:
        return None
    if name in {"add", "sub"}:
        return _sum(a, b, 1.0, 1.0 if name == "add" else -1.0)
    if name == "mul":
        return _product(a, b)
    return _by_constant(name, a, b[unit], unit) if set(b) == {unit} else None


def _by_constant(name: str, a: Polynomial, constant: float, unit: Exponents) -> Polynomial | None:
    """A polynomial over a number, or to the power of a whole one."""
    if name == "div" and constant != 0.0:
        return _sum(a, {}, 1.0 / constant, 0.0)
    if name != "pow" or constant < 0.0 or constant != int(constant):
        return None
    power: Polynomial | None = {unit: 1.0}
    for _ in range(int(constant)):
        power = None if power is None else _product(power, a)
    return power


def _sum(a: Polynomial, b: Polynomial, first: float, second: float) -> Polynomial:
    return {
        each: first * a.get(each, 0.0) + second * b.get(each, 0.0) for each in a.keys() | b.keys()
    }


def _product(a: Polynomial, b: Polynomial) -> Polynomial | None:
    if len(a) * len(b) > MOST_PRODUCTS:
        return None
    out: dict[Exponents, float] = {}
    for one, x in a.items():
        for other, y in b.items():
            powers = tuple(i + j for i, j in zip(one, other, strict=True))
            out[powers] = out.get(powers, 0.0) + x * y
    return out if len(out) <= MOST_TERMS else None


def positive_definite(form: Polynomial, unknowns: int) -> bool:
    """Whether a form of even degree is positive everywhere but at zero.

    Enclosures over boxes on the sides xᵢ = 1 of a cube, the longest edges bisected until every
    value is certain; what is not certain within `MOST_BOXES` boxes counts as not definite.
    """
    powers, factors = np.array(list(form)), np.array(list(form.values()))
    enough = CLEAR * np.abs(factors).max()
    side = np.eye(unknowns)
    low, high = np.where(side == 1.0, 1.0, -1.0), np.ones((unknowns, unknowns))
    looked_at = 0
    while len(low):
        looked_at += len(low)
        if looked_at > MOST_BOXES:
            return False
        middle = 0.5 * (low + high)
        values = np.prod(middle[:, None] ** powers, axis=2) @ factors
        if not (values > enough).all():
            return False
        unsure = _least(powers, factors, low, high) <= enough
        low, high = _halves(low[unsure], high[unsure])
    return True


def _least(
    powers: Int[np.ndarray, "terms unknowns"],
    factors: Float[np.ndarray, " terms"],
    low: Bounds,
    high: Bounds,
) -> Float[np.ndarray, " boxes"]:
    """Lower bounds of a form over boxes."""
    ends = low[:, None] ** powers, high[:, None] ** powers
    least, most = np.minimum(*ends), np.maximum(*ends)
    around_zero = ((low < 0.0) & (high > 0.0))[:, None]
    across = around_zero & (powers % 2 == 0) & (powers > 0)
    least = np.where(across, 0.0, least)
    below, above = least[:, :, 0], most[:, :, 0]
    for i in range(1, least.shape[2]):
        corners = [a * b for a in (below, above) for b in (least[:, :, i], most[:, :, i])]
        below, above = np.minimum.reduce(corners), np.maximum.reduce(corners)
    return np.asarray(np.where(factors > 0.0, below * factors, above * factors).sum(axis=1))


def _halves(low: Bounds, high: Bounds) -> tuple[Halves, Halves]:
    """Both halves of boxes, cut across their longest edges."""
    rows = np.arange(len(low))
    longest = (high - low).argmax(axis=1)
    middle = 0.5 * (low + high)[rows, longest]
    upper, lower = low.copy(), high.copy()
    upper[rows, longest], lower[rows, longest] = middle, middle
    return np.concatenate([low, upper]), np.concatenate([lower, high])


DEPENDENT = 0.02
"""Smallest singular value of the gradients below which constraints count as dependent."""
SAMPLES = 64
"""Random configurations that tell the typical size of a gradient."""


class Independence:
    """Smallest singular value of the gradients of constraints.

    Parameters
    ----------
    entries
        Entries of F_z of states.
    places
        Row and column in F_z of each entry: of the gradients those with row − n ≥ 0 > column − n.
    mass
        Mass matrix of the n unknowns.
    z, p
        Random configurations with their parameters.
    """

    def __init__(
        self,
        entries: Callable[[Lanes, Parameters], Entries],
        places: Int[np.ndarray, "2 entries"],
        mass: Float[np.ndarray, " n"],
        z: Lanes,
        p: Parameters,
    ) -> None:
        rows, columns = places
        self._entries, self._mass = entries, mass
        self._own = np.flatnonzero((rows >= len(mass)) & (columns < len(mass)))
        self._at = rows[self._own] - len(mass), columns[self._own]
        self._count = int(rows.max()) + 1 - len(mass)
        sizes = np.linalg.norm(self._gradients(z, p), axis=2)
        usable = np.isfinite(sizes).all(axis=1)
        self._typical = np.sqrt((sizes[usable] ** 2).mean(axis=0))

    def __call__(self, z: Lanes, p: Parameters) -> Values:
        """Return it for each state; 0 where a gradient is not finite."""
        gradients = self._gradients(z, p) / self._typical[:, None]
        gradients[~np.isfinite(gradients).all(axis=(1, 2))] = 0.0
        least = np.linalg.eigvalsh(gradients @ np.swapaxes(gradients, 1, 2))[:, 0]
        return np.asarray(np.sqrt(np.maximum(least, 0.0)))

    def _gradients(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes constraints n"]:
        out = np.zeros((len(z), self._count, len(self._mass)))
        out[:, *self._at] = self._entries(z, p)[:, self._own]
        return np.asarray(out / np.sqrt(self._mass))

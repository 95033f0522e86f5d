"""Natural states of rods: unloaded, continued from the straight or the stress-free rod."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.polynomial import legendre

from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Parameters, Values
from equimorph.structures.newton import Limits, Steps, Through, newton
from equimorph.structures.rod.discretisation import reference_element
from equimorph.structures.rod.general import GeneralMechanics
from equimorph.structures.rod.mechanics import PlanarMechanics
from equimorph.structures.rod.model import RodModel

FIRST_STEP = 0.25
"""First step of the continuation, as a share of the whole way."""
SMALLEST_STEP = 1e-8
"""Smallest step: below it the continuation has met a fold."""
FIRST = Limits(iterations=1, longest=np.inf, converged=1e-6, multipliers=1.0)
SHRINKING = Limits(
    iterations=6, longest=np.inf, converged=1e-6, contraction=0.5, free=1, multipliers=1.0
)
"""Newton's method in one step: the first correction, and the others, which tell whether it leads
to the branch; the last one leaves an error below 1e-11."""
SMALL = 1e-6
"""First correction from which on the second one tells nothing."""
BEND = 0.5
"""Largest second Newton correction relative to the first: beyond, the step may change branches."""


@dataclass(frozen=True, eq=False)
class Part:
    """One part of the way, from `start` to `stop`: with λ = 0 and the span free, or prescribed.

    `sharpening` lanes end where the elements no longer resolve them; span: number of the parameter
    that is the span; multiplier: place of λ in z.
    """

    start: Parameters
    stop: Parameters
    free: bool
    sharpening: Flags
    span: int = 3
    multiplier: int = -2


@dataclass(frozen=True, eq=False)
class Point:
    """Lanes on the way: share t of the part, x = (z, span), and dx/dt where the span is held."""

    t: Values
    x: Float[np.ndarray, "lanes extended"]
    slope: Float[np.ndarray, "lanes extended"]

    def __getitem__(self, lanes: np.ndarray) -> "Point":
        """Some lanes."""
        return Point(self.t[lanes], self.x[lanes], self.slope[lanes])

    def put(self, lanes: np.ndarray, other: "Point") -> None:
        """Overwrite some lanes."""
        self.t[lanes], self.x[lanes], self.slope[lanes] = other.t, other.x, other.slope


@runtime_checkable
class Continued(Steps, Protocol):
    """PlanarMechanics that can be continued."""

    @property
    def size(self) -> int:
        """Length of z."""

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the discretisation represents states."""


def follow(
    rod: Continued, part: Part, x: Float[np.ndarray, "lanes extended"]
) -> tuple[Values, Float[np.ndarray, "lanes extended"]]:
    """Move x = (z, span) along a part: the share of it that was reached, 1 if all, and x there."""
    here = correct_at_share(rod, part, np.arange(len(x)), np.zeros(len(x)), x)[0]
    before = Point(here.t.copy(), here.x.copy(), here.slope.copy())
    step = np.full(len(x), FIRST_STEP)
    for _ in range(400):
        active = np.flatnonzero((here.t < 1.0) & (step > SMALLEST_STEP))
        if len(active) == 0:
            break
        old = here[active]
        target = np.minimum(old.t + step[active], 1.0)
        guess = old.x if part.free else _predict(before[active], old, target)
        new, bend = correct_at_share(rod, part, active, target, guess)
        if not part.free:
            way, off = (np.abs(new.x - x).max(axis=1) for x in (old.x, guess))
            bend = np.maximum(bend, off / np.maximum(way, 1e-6))
        good = bend <= BEND
        before.put(active[good], old[good])
        here.put(active[good], new[good])
        step[active] *= np.clip(np.sqrt(0.5 * BEND / np.maximum(bend, 1e-12)), 0.3, 3.0)
    return here.t, here.x


def _predict(before: Point, here: Point, t: Values) -> Float[np.ndarray, "lanes extended"]:
    """Cubic through two points with their slopes; the line where there is one point only."""
    width = here.t - before.t
    alone = width == 0.0
    width = np.where(alone, 1.0, width)[:, None]
    s = (t[:, None] - before.t[:, None]) / width
    cubic = before.x + s * s * (3.0 - 2.0 * s) * (here.x - before.x)
    cubic += width * s * (s - 1.0) * ((s - 1.0) * before.slope + s * here.slope)
    line = here.x + (t - here.t)[:, None] * here.slope
    return np.asarray(np.where(alone[:, None], line, cubic))


def correct_at_share(
    rod: Continued,
    part: Part,
    lanes: Int[np.ndarray, " lanes"],
    t: Values,
    guess: Float[np.ndarray, "lanes extended"],
) -> tuple[Point, Values]:
    """Solve at share t of the part; the point, and the second correction relative to the first.

    Infinite where Newton does not converge, the equilibrium is not stable (the free span also needs
    dν/dλ < 0), or the elements no longer resolve it.
    """
    change = part.stop[lanes] - part.start[lanes]
    p, z = part.start[lanes] + t[:, None] * change, np.ascontiguousarray(guess[:, :-1])
    through = Through(change, np.zeros_like(z), np.ones(len(z)))
    if part.free:  # λ stays zero
        p[:, part.span], velocity = guess[:, -1], np.zeros_like(p)
        row = np.zeros_like(z)
        velocity[:, part.span], row[:, part.multiplier] = 1.0, 1.0
        through = Through(velocity, row, np.zeros(len(z)))
    once = newton(rod, z, p, FIRST, through)
    more = once if once.found.all() else newton(rod, once.z, once.p, SHRINKING, through)
    good = more.found & (more.index == 0)
    if part.free:
        good &= more.tangents[:, 0, -1] < 0.0
    if part.sharpening[lanes].any():
        good &= rod.resolved(more.z, more.p) | ~part.sharpening[lanes]
    bend = np.full(len(z), np.inf)
    bend[good] = np.where(once.found, 0.0, more.first)[good] / np.maximum(once.first, SMALL)[good]
    slope = np.zeros_like(guess)
    if not part.free:  # the last matrix is that of the point, but for a small correction
        slope[:, :-1] = more.tangents[:, 0, :-1]
        slope[:, -1] = change[:, part.span]
    return Point(t, np.concatenate([more.z, more.p[:, [part.span]]], axis=1), slope), bend


Pulls = Callable[[Parameters, Parameters], Flags]


@runtime_checkable
class AnyGeneral(Continued, Protocol):
    """Mechanics of a rod in the plane or in space, whose Lagrangian is a model."""

    model: Any
    unknowns: int


SMALLEST = 1e-3
"""End angles, √(Θ² + Δ²), below which the way leads over larger ones with the same ratio: the rod
buckles at once, within round-off of the straight one, and small ones are regular afterwards."""
BLOCK = 1024
"""Lanes continued together: their arrays stay in the cache."""


class Outcome(IntEnum):
    """How the continuation to a natural state ended."""

    FOUND = 0
    NOT_UPRIGHT = 1
    FREE_FOLD = 2
    SPAN_FOLD = 3
    UNRESOLVED = 4


@dataclass(frozen=True, eq=False)
class Natural:
    """Natural states, how each was met, and where the continuation ended.

    `scale` is the share of the end angles that the free rod has borne, `span` the last span.
    """

    z: Lanes
    outcome: Int[np.ndarray, " lanes"]
    scale: Values
    span: Values


def natural_arch(rod: PlanarMechanics, p: Parameters) -> Natural:
    """State at q = 0 reached from the straight rod, per lane.

    First λ = 0 and ν free while (Θ, Δ) grow from 0 to their values; then ν moves to its value with
    (Θ, Δ) held. Very small (Θ, Δ) are enlarged on this way, and reached from there with ν held.
    Lanes with Θ ≤ 0 (no upright side) have none, nor those where either part meets a fold or loses
    stability, nor those whose bends become too sharp for the elements.
    """
    lanes = len(p)
    out = Natural(
        np.full((lanes, rod.size), np.nan), np.zeros(lanes, int), np.zeros(lanes), np.ones(lanes)
    )
    upright = p[:, 0] > 0.0
    out.outcome[~upright] = Outcome.NOT_UPRIGHT
    for block in np.array_split(np.flatnonzero(upright), lanes // BLOCK + 1):
        _continue(rod, p, block, out)
    return out


def _continue(
    rod: PlanarMechanics, p: Parameters, lanes: Int[np.ndarray, " some"], out: Natural
) -> None:
    """Fill in the natural states of some lanes."""
    size, goal = np.hypot(p[lanes, 0], p[lanes, 1]), p[lanes] * [1.0, 1.0, 0.0, 1.0]
    stop = goal.copy()
    stop[:, :2] *= np.maximum(1.0, SMALLEST / size)[:, None]
    x = np.zeros((len(lanes), rod.size + 1))
    x[:, -1] = 1.0
    out.scale[lanes], x = follow(rod, free_part(stop), x)
    out.span[lanes], free = x[:, -1], out.scale[lanes] >= 1.0
    out.outcome[lanes[~free]] = Outcome.FREE_FOLD
    lanes, x, stop, goal = lanes[free], x[free], stop[free], goal[free]
    start = stop.copy()
    start[:, 3] = x[:, -1]
    # a rod that is pulled straighter cannot fold, but bends within ever shorter ends
    stretched = stop[:, 3] > start[:, 3]
    sharpening = stretched & rod.resolved(x[:, :-1], start)
    last = Part(start, stop, free=False, sharpening=sharpening)
    t, x = follow(rod, last, x)
    out.span[lanes], there = x[:, -1], t >= 1.0
    out.outcome[lanes[~there]] = np.where(stretched, Outcome.UNRESOLVED, Outcome.SPAN_FOLD)[~there]
    small = np.flatnonzero(there & (stop != goal).any(axis=1))
    if len(small):
        none = np.zeros(len(small), bool)
        t, x[small] = follow(rod, Part(stop[small], goal[small], False, none), x[small])
        there[small] = t >= 1.0
        out.outcome[lanes[small[t < 1.0]]] = Outcome.SPAN_FOLD
    last = Part(start, goal, free=False, sharpening=sharpening)
    reached = np.flatnonzero(there)
    exact = correct_at_share(rod, last, reached, np.ones(len(reached)), x[reached])[0].x[:, :-1]
    out.z[lanes[reached]] = exact


def free_part(stop: Parameters) -> Part:
    """From the straight rod to the end angles, with the span free."""
    still = np.zeros(len(stop), bool)
    return Part(stop * [0.0, 0.0, 0.0, 1.0], stop, free=True, sharpening=still)


def natural_rod(rod: GeneralMechanics, p: Parameters) -> Natural:
    """Unloaded states continued from the stress-free shape, per lane.

    `rod` is in the parameters of `model.raw_names`. The stress-free rod lies with its chord along
    the line between the supports, or as its only clamped end says. Its ends are then moved to
    where they belong: with held spans first with λ = 0 and the span free, then the span. A straight
    rod between pins that are nearer than its length has no natural state: it may buckle either
    way.
    """
    start, z = _stress_free(rod, p)
    return continue_ends(rod, z, start, p, lambda before, after: np.ones(len(before), bool))


def continue_ends(
    rod: AnyGeneral, z: Lanes, start: Parameters, p: Parameters, pulls: Pulls
) -> Natural:
    """States of stress-free rods, whose ends are then moved to where they belong.

    With held spans first with λ = 0 and the span free, then the span. pulls: whether a change of
    parameters may pull the rod straighter: it then bends within ever shorter ends, until the
    elements no longer resolve it.
    """
    names, here = rod.model.names, np.arange(len(p))
    span = names.index("nu") if "nu" in names else None
    out = Natural(np.full_like(z, np.nan), np.zeros(len(p), int), *np.ones((2, len(p))))
    x = np.concatenate([z, start[:, [span or 0]]], axis=1)
    if span is not None and rod.model.quadratic[0, 0] == 0.0:
        still = np.zeros(len(p), bool)
        turn = Part(start, p, free=True, sharpening=still, span=span, multiplier=rod.unknowns)
        out.scale[:], x = follow(rod, turn, x)
        out.span[:] = x[:, -1]
        reached = out.scale >= 1.0
        out.outcome[~reached] = Outcome.FREE_FOLD
        here, x, start = here[reached], x[reached], p[reached]
        start[:, span] = x[:, -1]
    sharpening = pulls(start, p[here]) & rod.resolved(x[:, :-1], start)
    last = Part(start, p[here], free=False, sharpening=sharpening, span=span or 0)
    share, x = follow(rod, last, x)
    out.span[here] = x[:, -1]
    out.outcome[here[share < 1.0]] = Outcome.SPAN_FOLD
    there = np.flatnonzero(share >= 1.0)
    exact = correct_at_share(rod, last, there, np.ones(len(there)), x[there])[0].x[:, :-1]
    out.z[here[there]] = exact
    return out


def _stress_free(rod: GeneralMechanics, p: Parameters) -> tuple[Parameters, Lanes]:
    """Stress-free shape: the places of its ends as parameters, and its state."""
    model, lanes, start = rod.model, len(p), p.copy()
    fine = reference_element(model.fine.along.shape[2] - 1)
    start[:, _forces(rod)] = 0.0
    y = np.concatenate([np.zeros((lanes, rod.constraints)), start, np.ones((lanes, 1))], axis=1)
    kappa = np.einsum("lj,jei->lei", y, model.fine.bending) / model.fine.rigidity
    lengths = model.mesh.lengths[:, None]
    theta = lengths * np.einsum("ij,lej->lei", fine.integral, kappa)
    before = np.cumsum(theta[:, :, -1], axis=1) - theta[:, :, -1]
    theta += before[:, :, None]
    weights = lengths * fine.weights
    chord = np.stack([(weights * f(theta)).sum(axis=(1, 2)) for f in (np.cos, np.sin)], axis=1)
    turn = _orientation(model, p, theta[:, -1, -1], chord)
    theta += turn[:, None, None]
    basis = legendre.legvander(2.0 * model.mesh.reference.nodes - 1.0, fine.degree)
    local = np.einsum("ki,lei->lek", basis @ fine.to_legendre, theta)
    nodal = np.concatenate([local[:, :, :-1].reshape(lanes, -1), local[:, -1:, -1]], axis=1)
    z = np.zeros((lanes, rod.size))
    z[:, : rod.unknowns] = nodal[:, rod.unknown_nodes]
    places = {
        "theta_A": theta[:, 0, 0],
        "theta_B": theta[:, -1, -1],
        "nu": (weights * np.cos(theta)).sum(axis=(1, 2)),
        "rise": (weights * np.sin(theta)).sum(axis=(1, 2)),
    }
    if "offset" in model.names:
        across = model.nodal.along[0, 0, 0], model.nodal.across[0, 0, 0]
        places["offset"] = across[0] * places["nu"] + across[1] * places["rise"]
    for i, name in enumerate(model.names):
        start[:, i] = places.get(name, start[:, i])
    return start, z


def _forces(rod: GeneralMechanics) -> Bool[np.ndarray, " parameters"]:
    """Which parameters are forces or couples, that a stress-free rod lacks."""
    model = rod.model
    couples = model.slope.copy()
    for e, nodes in enumerate(model.mesh.element_nodes):
        couples[:, nodes] -= model.element_slope[:, e]
    some = np.concatenate([model.sine, model.cosine, model.tension, couples], axis=1)
    large = np.abs(some).max(axis=1) > 1e-12 * max(np.abs(some).max(), 1.0)
    large |= model.pressure != 0.0
    return np.asarray(large[model.multipliers : -1])


def _orientation(
    model: RodModel, p: Parameters, turning: Values, chord: Float[np.ndarray, "lanes 2"]
) -> Values:
    """Angle of the stress-free shape at end A; `chord` and `turning` are those from angle 0."""
    value = dict(zip(model.names, p.T, strict=True))
    if "theta_A" in value and "theta_B" not in value:
        return np.asarray(value["theta_A"])
    if "theta_B" in value and "theta_A" not in value:
        return np.asarray(value["theta_B"] - turning)
    length = np.maximum(np.hypot(*chord.T), 1e-12)
    if "nu" in value and "rise" in value:
        wanted = np.arctan2(value["rise"], value["nu"])
    elif "theta_A" in value:
        return np.asarray(0.5 * (value["theta_A"] + value["theta_B"] - turning))
    elif "offset" in value:  # sin(angle − slide) times the length
        slide = np.arctan2(-model.nodal.along[0, 0, 0], model.nodal.across[0, 0, 0])
        wanted = slide + np.arcsin(np.clip(value["offset"] / length, -1.0, 1.0))
    elif "nu" in value:
        wanted = np.arccos(np.clip(value["nu"] / length, -1.0, 1.0))
    else:
        wanted = np.arcsin(np.clip(value["rise"] / length, -1.0, 1.0))
    return np.asarray(wanted - np.arctan2(chord[:, 1], chord[:, 0]))

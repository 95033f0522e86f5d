"""Least shocks: the smallest impulse, force or kick that takes a stable state out of its basin.

See docs/barriers.md, "Least shock".
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Values
from equimorph.dynamics.outcomes import Clock, Launches, Outcome, least_force, play, relax
from equimorph.dynamics.own_equations import Motion, OwnModel
from equimorph.dynamics.replay import ReplaySettings
from equimorph.equilibria import EnergyBarrier, TransitionNetwork, lift, transition_network
from equimorph.equilibria.gradient_flow import implicit_step
from equimorph.equilibria.lift import check_start
from equimorph.errors import InputError
from equimorph.model import Descriptor, Parameter, parameter_vector
from equimorph.structures import State, States
from equimorph.structures.added_load import Pushed
from equimorph.structures.vibration import vibrations

TRIED = 12
"""Sizes of each sign that are tried first."""
LARGEST = 6.0
"""Largest impulse tried, in units of the bound by the energy."""
SMALLEST = 0.01
"""Smallest share of a kick that is tried first."""
REFINED = 8
"""Sizes in each round of refinement."""
CLOSE = 1e-3
"""Relative distance of the largest size that holds from the least one that snaps."""
NEARLY = 1e-6
"""Share by which an impulse must exceed the bound to be worth a motion."""

Kind = Literal["impulse over the saddle", "point impulse", "point force", "kick"]
Found = Literal["landed", "escaped", "came back", "undecided", "none found"]


@dataclass(frozen=True, eq=False)
class Shock:
    """The least disturbance of one kind that takes a state out of its basin.

    Parameters
    ----------
    kind
        "impulse over the saddle": all velocities along the straight line to the saddle, in units of
        energy; "point impulse": momentum along a descriptor; "point force": a dead load along it,
        applied slowly and let go; "kick": a sudden change of parameters, which then stay, as a
        share of the change that was asked for.
    status
        "landed" at another stable state; "escaped": no state stops it; "came back" after it had
        left; "undecided": where it comes to rest was not seen; "none found" up to the largest size
        tried.
    value
        Least size found that does; negative against the descriptor or change. Not a number without
        one. Impulses and kicks are found by dynamics with the given damping, forces by lifts.
    unit
        Of `value`.
    bound
        No smaller size can, by the energy alone, with whatever damping; zero without a bound.
    holds
        Largest size tried, of the same sign, up to which none snaps.
    landing
        Stable state where it comes to rest: the gradient flow leads there once the energy is below
        that of the saddle.
    """

    kind: Kind
    status: Found
    value: float
    unit: str
    bound: float = 0.0
    holds: float = 0.0
    landing: State | None = None

    def __repr__(self) -> str:
        """One line."""
        if self.status == "none found":
            return f"Shock({self.kind}: none found up to {self.holds:.4g} {self.unit})"
        return f"Shock({self.kind}: {self.value:.6g} {self.unit}, {self.status})"


@dataclass(frozen=True, eq=False)
class LeastShock:
    """Least disturbances of a stable state: the energy barrier, and each kind that was tried.

    Parameters
    ----------
    state
        The state.
    barrier
        Its energy barrier: no disturbance of less energy can take it out of its basin.
    push
        Displacements of the points of the shape from the state to the saddle: where and in which
        direction to push on purpose.
    shocks
        Least shocks by kind, as far as they were asked for.
    """

    state: State
    barrier: EnergyBarrier
    push: Float[np.ndarray, "points space"]
    shocks: tuple[Shock, ...]

    def __getitem__(self, kind: Kind) -> Shock:
        """Shock of one kind."""
        return next(each for each in self.shocks if each.kind == kind)

    def __repr__(self) -> str:
        """One line per shock."""
        lines = [f"LeastShock of {self.state}", f"  {self.barrier}"]
        return "\n".join([*lines, *(f"  {each}" for each in self.shocks)])


@check_arguments
def least_shock(
    state: State,
    *,
    at: Descriptor | None = None,
    kick: Mapping[str, float] | None = None,
    modes: int = 6,
    network: TransitionNetwork | None = None,
    settings: ReplaySettings | None = None,
) -> LeastShock:
    """Smallest disturbances that take a stable state out of its basin.

    The energy barrier bounds all of them from below. Impulses are tried by the structure's own
    equations of motion: `TRIED` sizes of either sign from that bound on, then ever closer between
    the first one that snaps and the one before, to 0.1 %. Sizes between those tried may snap, too:
    edges of basins of moving structures are folded. A motion is decided when its energy is below
    that of the lowest saddle. Forces are followed as loads (`lift`) and let go.

    Parameters
    ----------
    state
        A stable state.
    at
        Descriptor, such as a displacement, along which an impulse and a force act.
    kick
        Changes of parameters: the largest sudden step that is tried, in either direction.
    modes
        Lowest free vibrations that an impulse excites where the structure is discretised: a blow is
        about as long as the period of the last one. One without any width and length would excite
        all, and its energy in a continuum is infinite.
    network
        Transition network of the setting of the state; computed by default.
    settings
        Step and damping of the motions, as for `replay`.

    Raises
    ------
    InputError
        If the state is not stable, the structure has no mass, or the damping is zero.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> coarse = em.ReplaySettings(step=0.1)
    >>> shock = em.least_shock(spring.natural_state(x_l=0.8), settings=coarse)
    >>> round(shock["impulse over the saddle"].bound, 6)  # ½ (1 − 0.8)²
    0.02
    """
    check_start(state)
    used = settings or ReplaySettings()
    if state.index != 0:
        raise InputError(f"`state` must be stable; got one of index {state.index}.")
    if not used.damping > 0.0:
        raise InputError("`settings` must have a damping; got none, and nothing comes to rest.")
    structure = state.structure
    if kick is not None:
        if not kick:
            raise InputError("`kick` must name at least one parameter; got none.")
        parameter_vector(structure.parameters, kick, state.p)
    slope = np.zeros(0) if at is None else _slope(state, at)
    network = network or transition_network(structure, state.parameters)
    barrier = network.barrier(state)
    if barrier.saddle is None:
        return LeastShock(state, barrier, np.zeros_like(state.shape()), ())
    trial = _Trial(state, barrier.saddle, used, modes)
    shocks = [trial.over_the_saddle()]
    if at is not None:
        shocks += [trial.impulse(at, slope), _force(state, barrier, at)]
    if kick is not None:
        shocks.append(trial.kick(kick, network))
    return LeastShock(state, barrier, barrier.saddle.shape() - state.shape(), tuple(shocks))


def _force(state: State, barrier: EnergyBarrier, along: Descriptor) -> Shock:
    """Least dead load along a descriptor after which the structure lands elsewhere."""
    found = least_force(state, barrier, along)
    scale, unit = state.structure.energy_scale, found.unit
    if found.landing is None:
        return Shock("point force", "none found", np.nan, unit, holds=scale * found.holds)
    value = scale * found.value
    return Shock("point force", "landed", value, unit, 0.0, value, found.landing)


@dataclass(frozen=True)
class _Sizes:
    """Sizes that are tried: from, to, the bound by the energy, and how motions begin."""

    first: float
    last: float
    bound: float
    launch: Callable[[Values], Launches]


class _Trial:
    """Motions from one state over one saddle."""

    def __init__(self, state: State, saddle: State, used: ReplaySettings, modes: int) -> None:
        self.state, self.saddle, self.structure = state, saddle, state.structure
        model = OwnModel(state.structure, state)
        rate = model.damping_rate(used.damping)
        structure, z, p = self.structure, state.z[None], state.p[None]
        self.mass = structure.inertia(z, p)[0]
        free = structure.unknowns - structure.constraints
        count = min(modes, free) if structure.is_discretised else free
        free_vibrations = vibrations(structure, z, p, count)
        self._modes = free_vibrations.modes[0]
        step = used.step * model.unit
        self.clock = Clock.resolving(free_vibrations.frequencies[0], step, rate, model.unit)
        self.level = float(structure.energy(saddle.z[None], p)[0])
        self.height = self.level - float(structure.energy(z, p)[0])

    def _velocity(self, momentum: Float[np.ndarray, " unknowns"]) -> np.ndarray:
        """Rates of the modes that a momentum gives; these obey the constraints."""
        return np.asarray(self._modes.T @ (self._modes @ momentum))

    def _push_off(self, sizes: Values, velocity: np.ndarray) -> Launches:
        """The state with multiples of velocities."""
        many = np.ones((len(sizes), 1))
        home, level = many * self.state.z, np.full(len(sizes), self.level)
        return Launches(home.copy(), many * self.state.p, sizes[:, None] * velocity, home, level)

    def _impulse(self, velocity: np.ndarray) -> tuple[_Sizes, float]:
        """Impulses in units of the one that gives a velocity, from the bound on; its energy."""
        energy = 0.5 * float(velocity @ self.mass @ velocity)
        bound = float(np.sqrt(self.height / energy))
        sizes = _Sizes(bound, LARGEST * bound, bound, lambda a: self._push_off(a, velocity))
        return sizes, energy

    def over_the_saddle(self) -> Shock:
        """Velocities along the straight line to the saddle."""
        n = self.structure.unknowns
        ahead = self._velocity(self.mass @ (self.saddle.z - self.state.z)[:n])
        sizes, energy = self._impulse(ahead)
        found, scale = self._least("impulse over the saddle", sizes, (1,)), energy * self.energy
        return replace(
            found, value=scale * found.value**2, bound=scale * found.bound**2,
            holds=scale * found.holds**2, unit=self.structure.energy_unit,
        )  # fmt: skip

    @property
    def energy(self) -> float:
        """Value of one unit of the structure's energy."""
        return self.structure.energy_scale

    def impulse(self, along: Descriptor, slope: Float[np.ndarray, " unknowns"]) -> Shock:
        """Momentum along a descriptor, whose derivative by the unknowns is its slope."""
        structure = self.structure
        force = structure.effort_unit(Parameter("along", along.unit, 1.0, "load"))
        found = self._least("point impulse", self._impulse(self._velocity(slope))[0], (1, -1))
        scale, unit = self.energy, f"{force} {structure.time_unit}"
        return replace(
            found, value=scale * found.value, bound=scale * found.bound,
            holds=scale * found.holds, unit=unit,
        )  # fmt: skip

    def kick(self, changes: Mapping[str, float], network: TransitionNetwork) -> Shock:
        """Parameters that change at once, and stay."""
        state, structure = self.state, self.structure
        to = {name: state[name] + change for name, change in changes.items()}
        step = parameter_vector(structure.parameters, to, state.p) - state.p
        number = network.number_of(state)
        around = sorted({saddle for saddle, start, _ in network.ways if start == number})
        known = network.states[np.array([number, *around])]

        def launch(sizes: Values) -> Launches:
            many = np.repeat(np.arange(len(known)), len(sizes))
            shares = np.tile(sizes, len(known))
            target = {name: state[name] + shares * change for name, change in changes.items()}
            led = lift(States(structure, known.z[many], known.p[many]), target)
            there = led.arrived.reshape(len(known), -1)
            energy = structure.energy(led.states.z, led.states.p).reshape(len(known), -1)
            top = np.where(there[1:], energy[1:], np.inf).min(axis=0)
            home, p = led.states.z[: len(sizes)], state.p + sizes[:, None] * step
            start = np.repeat(state.z[None], len(sizes), axis=0)
            short = np.full(len(sizes), 1e-4 * self.clock.unit)
            z, found = implicit_step(structure, start, p, short)
            z = np.where(found[:, None], z, start)
            # beyond a fold of its own there is no home to come back to: it leaves however slowly
            level = np.where(there[0] & np.isfinite(top), top, -np.inf)
            return Launches(z, p, np.zeros_like(z[:, : structure.unknowns]), home, level)

        found = self._least("kick", _Sizes(SMALLEST, 1.0, 0.0, launch), (1, -1))
        return replace(found, unit="of " + ", ".join(f"{k} {v:+g}" for k, v in changes.items()))

    def _least(self, kind: Kind, sizes: _Sizes, signs: tuple[int, ...]) -> Shock:
        """Least size that leads elsewhere, of the signs tried, in units of the launch.

        Motions that only just leave the basin stay away where they have no other way to move, and
        the sizes that do so may be few; where they come back, larger ones are tried by their ends.
        """
        found = self._search(kind, sizes, signs, watch=True)
        if found.status not in {"came back", "undecided"}:
            return found
        larger = replace(sizes, first=abs(found.value))
        return replace(self._search(kind, larger, signs, watch=False), bound=found.bound)

    def _search(self, kind: Kind, sizes: _Sizes, signs: tuple[int, ...], *, watch: bool) -> Shock:
        """Least size that leaves the basin, or that ends elsewhere without `watch`."""
        grid = np.geomspace(sizes.first * (1.0 + NEARLY), sizes.last, TRIED)
        every = np.array(signs)[:, None] * grid
        left, bound = self._leave(sizes, every.ravel(), watch)
        gone = left.reshape(every.shape)
        if not gone.any():
            return Shock(kind, "none found", np.nan, "", bound, grid[-1])
        first = np.where(gone.any(axis=1), gone.argmax(axis=1), TRIED)
        edges = np.concatenate([[bound], grid])[first.min() : first.min() + 2]
        found = [
            self._refine(sizes, float(sign), edges, watch)
            for sign, place in zip(signs, first, strict=True)
            if place == first.min()
        ]
        low, high, held = min(found, key=lambda each: abs(each[1]))
        end, landing = self._landing(sizes.launch(np.array([high])))
        return Shock(kind, end, high, "", max(bound, held), low, landing)

    def _refine(
        self, sizes: _Sizes, sign: float, edges: Float[np.ndarray, "2"], watch: bool
    ) -> tuple[float, float, float]:
        """Sizes that hold and leave, close together, and one that the energy does not suffice for.

        The second one has the sign.
        """
        low, high = edges.tolist()
        held = 0.0
        while high - low > CLOSE * high:
            inner = np.linspace(low, high, REFINED + 2)
            left, short = self._leave(sizes, sign * inner[1:-1], watch)
            held = max(held, short)
            k = int(np.append(left, True).argmax())
            low, high = inner[k : k + 2].tolist()
        return low, sign * high, held

    def _leave(self, sizes: _Sizes, tried: Values, watch: bool) -> tuple[Flags, float]:
        """Which sizes leave, and the largest one below which the energy suffices for none."""
        given = sizes.launch(tried)
        homeless = np.isneginf(given.level)
        start = Motion.of(given.z, given.velocity).energy(self.structure, given.p)
        able = start >= given.level
        some = np.flatnonzero(able & ~homeless)
        code = np.where(homeless, Outcome.LEFT, Outcome.HELD)
        code[some] = play(self.structure, given.take(some), self.clock, watch=watch).code
        least = np.abs(tried)[able].min(initial=np.inf)
        short = np.abs(tried)[np.abs(tried) < least]
        left = np.isin(code, (Outcome.LEFT, Outcome.ESCAPED))
        return left, max(sizes.bound, float(short.max(initial=0.0)))

    def _landing(self, given: Launches) -> tuple[Found, State | None]:
        """What becomes of a single motion that leaves."""
        z, found = given.z, Outcome.LEFT
        if np.isfinite(given.level[0]):
            end = play(self.structure, given, self.clock, watch=False)
            z, found = end.z, Outcome(int(end.code[0]))
        if found in (Outcome.LEFT, Outcome.HELD):
            ends, landed = relax(self.structure, z, given.p)
            if landed[0]:
                word: Found = "came back" if found == Outcome.HELD else "landed"
                return word, State(self.structure, ends[0], given.p[0])
        return ("escaped" if found == Outcome.ESCAPED else "undecided"), None


def _slope(state: State, along: Descriptor) -> Float[np.ndarray, " unknowns"]:
    """Derivative of a descriptor by the unknowns."""
    pushed = Pushed(state.structure, along, 1.0, 1.0)
    slope = pushed.gradient(state.z[None], np.append(state.p, 0.0)[None])[0]
    if not np.abs(slope).any():
        raise InputError(f"`at` must move with the unknowns; got {along!r}, which does not.")
    return np.asarray(slope)

"""The largest box, or ellipsoid, of parameters around states that stays stable."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int, Parameters, Values
from equimorph.equilibria import ParameterLine, TraceOptions, trace
from equimorph.equilibria.legs import check_starts
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.model import Box, Constraint, position
from equimorph.structures import State, States

Directions = Float[np.ndarray, "directions d"]
Shape = Literal["box", "ellipsoid"]

RANDOM = 64
"""Random directions in addition to axes and corners."""
MOST_CORNERS = 64
"""Largest number of corners of the box that are tried; of more corners a random sample."""
ROUNDS, AROUND = 10, 12
"""Rounds in which the worst directions of each state are searched around, and how many each."""


@dataclass(frozen=True, eq=False)
class Room:
    """The largest box or ellipsoid of parameters around states that stays stable.

    Parameters
    ----------
    states
        States at the centres.
    scale
        Largest multiple of the tolerances that stays stable and within the constraints, of each
        state: exact along the rays that were lifted, an upper bound otherwise. At least
        `most` where nothing was met.
    met
        Where the worst ray of each state ended.
    kind
        Kind of the `Event` that it met; "arrived" if there was none.
    boxes
        The boxes, or those around the ellipsoids.
    """

    shape: Shape
    states: States
    scale: Float[np.ndarray, " states"]
    met: States
    kind: tuple[str, ...]
    boxes: tuple[Box, ...]

    def __repr__(self) -> str:
        """Smallest scale and what bounds it."""
        end = self.kind[int(np.argmin(self.scale))]
        return f"Room({self.shape}: {self.least:.6g} tolerances, then {end})"

    @property
    def status(self) -> Literal["bounded", "open"]:
        """Whether anything was met; "open": nothing up to `most` tolerances."""
        return "open" if set(self.kind) == {"arrived"} else "bounded"

    @property
    def why(self) -> str:
        """What was met first, and where."""
        if self.status == "open":
            return ""
        worst = int(np.argmin(self.scale))
        return f"{self.kind[worst]} at {self.met[worst]}"

    @property
    def least(self) -> float:
        """Smallest scale; for a route, the room along all of it."""
        return float(self.scale.min())


@check_arguments
def stable_room(  # all but two by keyword
    states: State | States,
    tolerances: Mapping[str, float],
    *,
    shape: Shape = "box",
    within: Sequence[Constraint] = (),
    most: float = 100.0,
    seed: int = 0,
) -> Room:
    """Largest box or ellipsoid of parameters around a state, or states of a route, that is stable.

    Rays in many directions are lifted from each state until stability or a constraint is lost; the
    worst directions are searched around with narrower and narrower spread. As all points of a box
    lie on rays from its middle, its states are those that these lifts pass.

    Parameters
    ----------
    states
        Stable equilibria.
    tolerances
        Half widths by parameter, actuators, loads or imperfections: the shape is scaled as a whole.
    shape
        "box": all tolerances at once; "ellipsoid": their squares add up.
    within
        Constraints that have to hold, too.
    most
        Largest multiple of the tolerances that is tried.
    seed
        Seed of the random directions.

    Returns
    -------
    The largest multiple of the tolerances for each state, and what was met there.

    Raises
    ------
    InputError
        If a state is not a stable equilibrium, a name is unknown, or a tolerance is not positive.
    """
    batch = states.batch if isinstance(states, State) else states
    structure = batch.structure
    places = np.array([position(structure.parameters, name) for name in tolerances], dtype=int)
    widths = np.array([float(value) for value in tolerances.values()])
    if len(widths) == 0:
        raise InputError("`tolerances` must name at least one parameter; got none.")
    check_starts(batch)
    if (batch.index != 0).any():
        raise InputError("`states` must be stable; got unstable ones.")
    rays = _Rays(batch, places, widths, shape, tuple(within), most)
    generator = np.random.default_rng(seed)
    rays.try_all(error_directions(len(widths), generator))
    spread = 0.5
    for _ in range(ROUNDS):
        rays.try_around(spread, generator)
        spread *= 0.5
    return rays.room(tuple(tolerances))


def error_directions(d: int, generator: np.random.Generator) -> Directions:
    """Both ways along each parameter, corners of the box, and random ones."""
    units = np.concatenate([np.eye(d), -np.eye(d)])
    if 2**d <= MOST_CORNERS:
        corners = np.array(list(product((-1.0, 1.0), repeat=d)))
    else:
        corners = generator.choice([-1.0, 1.0], (MOST_CORNERS, d))
    return np.concatenate([units, corners, generator.normal(size=(RANDOM, d))])


class _Rays:
    """Rays from states, the worst so far of each, and what it met."""

    def __init__(
        self,
        states: States,
        places: Int[np.ndarray, " d"],
        widths: Float[np.ndarray, " d"],
        shape: Shape,
        within: tuple[Constraint, ...],
        most: float,
    ) -> None:
        self.states, self.within, self.shape, self.most = states, within, shape, most
        self.places, self.widths = places, widths
        count = len(states)
        self.scale = np.full(count, most)
        self.direction = np.zeros((count, len(self.widths)))
        self.z, self.p = states.z.copy(), states.p.copy()
        self.code = np.full(count, EventCode.ARRIVED)

    def try_all(self, directions: Directions) -> None:
        """Lift rays in the same directions from all states."""
        count = len(self.states)
        lanes = np.repeat(np.arange(count), len(directions))
        self._lift(lanes, np.tile(directions, (count, 1)))

    def try_around(self, spread: float, generator: np.random.Generator) -> None:
        """Lift rays in directions near the worst one of each state."""
        lanes = np.repeat(np.flatnonzero(self.scale < self.most), AROUND)
        if len(lanes):
            noise = generator.normal(size=(len(lanes), len(self.widths)))
            self._lift(lanes, self.direction[lanes] + spread * noise)

    def _lift(self, lanes: Int[np.ndarray, " lanes"], directions: Directions) -> None:
        """Lift rays no further than the worst so far, and keep those that end earlier."""
        norm = np.abs(directions).max(axis=1)
        if self.shape == "ellipsoid":
            norm = np.linalg.norm(directions, axis=1)
        directions = directions / norm[:, None]
        start = self.states[lanes]
        velocity = np.zeros_like(start.p)
        velocity[:, self.places] = directions * self.widths
        reach = self._furthest(start.p, velocity, self.scale[lanes])
        velocity *= reach[:, None]
        line = ParameterLine(self.states.structure, start.p.copy(), velocity)
        outcome = trace(line, start.z.copy(), self.within, TraceOptions(record=False))
        ended = np.where(outcome.code == EventCode.ARRIVED, np.inf, outcome.t * reach)
        for lane in np.flatnonzero(ended < self.scale[lanes]):
            owner = lanes[lane]
            if ended[lane] < self.scale[owner]:
                self.scale[owner], self.direction[owner] = ended[lane], directions[lane]
                self.z[owner], self.code[owner] = outcome.z[lane], outcome.code[lane]
                self.p[owner] = start.p[lane] + outcome.t[lane] * velocity[lane]

    def _furthest(
        self,
        p: Parameters,
        velocity: Parameters,
        scale: Values,
    ) -> Values:
        """Multiples of rays that stay within the meaning of all parameters."""
        most = scale.copy()
        for place in self.places:
            parameter = self.states.structure.parameters[place]
            for bound in (parameter.lower, parameter.upper):
                if np.isfinite(bound):
                    with np.errstate(divide="ignore", invalid="ignore"):
                        share = (bound - p[:, place]) / velocity[:, place]
                    most = np.where(share > 0.0, np.minimum(most, (1.0 - 1e-9) * share), most)
        return most

    def room(self, names: tuple[str, ...]) -> Room:
        """What was found."""
        middle, half = self.states.p[:, self.places], self.scale[:, None] * self.widths
        boxes = tuple(
            Box(**{n: (low, high) for n, low, high in zip(names, a, b, strict=True)})
            for a, b in zip((middle - half).tolist(), (middle + half).tolist(), strict=True)
        )
        kinds = tuple(EventCode(int(code)).kind for code in self.code)
        met = States(self.states.structure, self.z, self.p)
        return Room(self.shape, self.states, self.scale, met, kinds, boxes)

"""Coordinates of a chart: parameters and descriptors, and the states that have given values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Frames, Int, Lanes, Numbers, Parameters, Rows, Some
from equimorph.equilibria.point_conditions import Values as TargetValues
from equimorph.equilibria.settle import (
    Guards,
    Held,
    Settled,
    embedded_planes,
    free_directions,
    settle,
)
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import frames_in_embedding, split_step, tangent_frames
from equimorph.model import Descriptor, position
from equimorph.model.families import values_together
from equimorph.structures import value_of
from equimorph.tolerances import METRIC_DIFFERENCE

Values = Float[np.ndarray, "lanes d"]

FORWARD = 1e-6
"""Step of the one-sided differences inside Newton, whose corrections they shrink as much."""
QUICK = Guards(iterations=8, longest=np.inf, too_long=0.3, converged=1e-7, contraction=0.7, free=3)
"""Over parameters: a long step means a fold near by, where this does not work."""
ON_SET = Guards(iterations=20, longest=0.3, converged=1e-7, contraction=0.7, free=3)
"""Along the set, where folds are no obstacle."""
ONTO_SET = Guards(iterations=30, longest=0.3, converged=1e-7)
"""Across the set; the last correction is 1e-7, which leaves an error at round-off."""

Square = Float[np.ndarray, "lanes d d"]


@dataclass(frozen=True, eq=False)
class Scalars:
    """As many scalars of states as a set has free parameters."""

    setting: Setting
    """Structure and free parameters of the set."""
    scalars: tuple[Descriptor, ...]
    """The scalars; free parameters are descriptors that read them."""
    places: Int[np.ndarray, " d"]
    """Place of the parameter that each scalar is, −1 for descriptors."""

    def __call__(self, z: Lanes, p: Parameters) -> Values:
        """Values at states."""
        return values_together([scalar.function for scalar in self.scalars], z, p)


def solve_over_parameters(
    scalars: Scalars, z: Lanes, p: Parameters, wanted: Values, tried: Some
) -> Settled:
    """States by Newton in those free parameters that are not given: quick, and singular at folds.

    `tried`: numbers of the lanes for which it is tried.
    """
    setting, structure = scalars.setting, scalars.setting.structure
    given, asked = scalars.places >= 0, (scalars.places < 0).nonzero()[0]
    unknown = np.array([k for k in setting.free.tolist() if k not in scalars.places.tolist()], int)
    z, p, wanted = z[tried], p[tried], wanted[tried]
    p[:, scalars.places[given]] = wanted[:, given]
    functions = tuple(scalars.scalars[k].function for k in asked)
    values = TargetValues(functions, wanted[:, asked], FORWARD, one_sided=True)
    directions = free_directions(structure, unknown, len(tried))
    return settle(structure, z, p, directions, [values], QUICK, Held(), frames=False)


def solve_on_the_set(
    scalars: Scalars, z: Lanes, p: Parameters, wanted: Values, rows: Rows
) -> Settled:
    """States by Newton along and across the set at once: regular at folds."""
    setting, structure = scalars.setting, scalars.setting.structure
    functions = tuple(scalar.function for scalar in scalars.scalars)
    # far from the set its coordinates may have no meaning
    values = TargetValues(functions, wanted, FORWARD, one_sided=True, reach=ON_SET.longest)
    directions = free_directions(structure, setting.free, len(wanted))
    frame = embedded_planes(structure, setting.free, rows)
    return settle(structure, z, p, directions, [values], ON_SET, frame, frames=False)


def settle_on_set(setting: Setting, z: Lanes, p: Parameters, rows: Rows) -> Settled:
    """States of the set orthogonally above points near it."""
    structure, free = setting.structure, setting.free
    directions = free_directions(structure, free, len(z))
    frame = embedded_planes(structure, free, rows)
    return settle(structure, z, p, directions, [], ONTO_SET, frame)


def frames_anywhere(setting: Setting, z: Lanes, p: Parameters) -> Frames:
    """Orthonormal bases of the tangent spaces of states, without any knowledge of where these are.

    Two rounds: from planes in generic directions, then from the spaces found.
    """
    d, width = len(setting.free), setting.structure.unknowns + len(setting.free)
    generic = np.cos(1.0 + np.arange(d)[:, None] * (1.7 + np.arange(width)) + np.arange(width))
    basis = np.linalg.qr(generic.T)[0].T
    rows = np.ascontiguousarray(np.broadcast_to(basis, (len(z), d, width)))
    frames = np.zeros((len(z), d, z.shape[1] + d))
    for _ in range(2):
        frames = tangent_frames(setting, z, p, rows)
        rows = frames_in_embedding(setting, frames)
    return frames


@dataclass(frozen=True, eq=False)
class Coordinates(Scalars):
    """As many scalars of states as the set has free parameters."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(scalar.name for scalar in self.scalars)

    @property
    def projecting(self) -> bool:
        """Whether they are the free parameters themselves."""
        return bool((self.places >= 0).all())

    def derivative(self, z: Lanes, p: Parameters, frames: Frames) -> Square:
        """Derivatives of the coordinates (rows) along tangents (columns): all from one call."""
        d = frames.shape[1]
        steps = [split_step(self.setting, METRIC_DIFFERENCE * frames[:, k]) for k in range(d)]
        z, p = (
            np.concatenate([here + side * step[k] for step in steps for side in (1.0, -1.0)])
            for k, here in enumerate((z, p))
        )
        ahead, behind = np.moveaxis(self(z, p).reshape(d, 2, len(frames), d), (1, 0), (0, 3))
        return np.asarray((ahead - behind) / (2.0 * METRIC_DIFFERENCE))

    def solve_states(
        self, z: Lanes, p: Parameters, wanted: Values, planes: Callable[[Some], Rows], folded: Flags
    ) -> tuple[Lanes, Parameters, Flags, Numbers]:
        """States with given coordinates near guesses, whether they were found, and their index.

        Parameters
        ----------
        z, p
            The guesses.
        wanted
            The coordinates.
        planes
            Bases of planes near the tangent spaces of some lanes: with these, Newton is regular at
            folds, too.
        folded
            Lanes next to folds.
        """
        regular = (~folded).nonzero()[0]
        quick = solve_over_parameters(self, z, p, wanted, regular)
        z, p, good = z.copy(), p.copy(), np.zeros(len(wanted), bool)
        index = np.full(len(wanted), -1)
        some = quick.found.nonzero()[0]
        own = regular[some]
        z[own], p[own], index[own] = quick.z[some], quick.p[some], quick.index[some]
        good[own] = True
        rest = (~good).nonzero()[0]
        if len(rest) == 0:
            return z, p, good, index
        slow = solve_on_the_set(self, z[rest], p[rest], wanted[rest], planes(rest))
        z[rest], p[rest], good[rest] = slow.z, slow.p, slow.found
        index[rest] = np.where(slow.found, slow.index, -1)
        return z, p, good, index


def coordinates_of(eset: EquilibriumSet, chosen: Sequence[Descriptor | str]) -> Coordinates:
    """Coordinates by descriptors, or by names of free parameters or of descriptors.

    Refused if there are not as many as free parameters, two are equal, or one is a fixed parameter
    or an unknown name.
    """
    d = len(eset.names)
    if isinstance(chosen, str) or len(chosen) != d:
        raise InputError(
            f"`coordinates` must be {d}, one per free parameter of the set; got {chosen!r}."
        )
    scalars, places = zip(*(_scalar(eset, each) for each in chosen), strict=True)
    if len(set(scalars)) < d:
        names = ", ".join(scalar.name for scalar in scalars)
        raise InputError(f"`coordinates` must be different ones; got {names}.")
    return Coordinates(eset.setting, tuple(scalars), np.array(places))


def _scalar(eset: EquilibriumSet, each: Descriptor | str) -> tuple[Descriptor, int]:
    structure = eset.structure
    if isinstance(each, Descriptor):
        return each, -1
    if each in eset.names:
        return value_of(structure, each), position(structure.parameters, each)
    if each in [parameter.name for parameter in structure.parameters]:
        raise InputError(
            f"`coordinates` must be free parameters ({', '.join(eset.names)}) or descriptors; "
            f"got {each!r}, which is fixed."
        )
    return structure.descriptor(each), -1

"""Coordinates of a chart: parameters and descriptors, and the states that have given values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Frames, Lanes, Parameters, Rows
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import border_of, placed_frames, split_step
from equimorph.manifold.lookup.exact_states import exact_states
from equimorph.model import Descriptor, position

Values = Float[np.ndarray, "lanes d"]
Solved = tuple[Lanes, Parameters, Flags, Int[np.ndarray, " lanes"]]

ITERATIONS, QUICK = 20, 8
LONGEST = 0.3
"""Length, in the metric and scaled parameters, to which Newton steps are shortened."""
FORWARD = 1e-6
"""Step of the one-sided differences inside Newton, whose corrections they shrink as much."""
SHRINKING, FREE = 0.7, 3
"""Least shrinking of corrections of lanes that go on, and how many are free of it."""
LAST = 1e-7
"""Correction after which the next one would be round-off."""

Square = Float[np.ndarray, "lanes d d"]

CENTRAL = 1e-5


@dataclass(frozen=True, eq=False)
class Scalars:
    """As many scalars of states as a set has free parameters.

    Parameters
    ----------
    setting
        Structure and free parameters of the set.
    scalars
        The scalars; free parameters are descriptors that read them.
    places
        Place of the parameter that each scalar is, −1 for descriptors.
    """

    setting: Setting
    scalars: tuple[Descriptor, ...]
    places: Int[np.ndarray, " d"]

    def __call__(self, z: Lanes, p: Parameters) -> Values:
        """Values at states."""
        return np.stack([scalar.function(z, p) for scalar in self.scalars], axis=1)


def solved_over_parameters(
    scalars: Scalars,
    guess: tuple[Lanes, Parameters],
    wanted: Values,
    tried: Flags,
) -> Solved:
    """States by Newton in those free parameters that are not given: quick, and singular at folds.

    ``dz = −F_z⁻¹(F + F_p dp)`` with the step dp that takes the scalars to their values.
    """
    setting, structure = scalars.setting, scalars.setting.structure
    given, asked = scalars.places >= 0, np.flatnonzero(scalars.places < 0)
    unknown = [int(k) for k in setting.free if k not in scalars.places]
    z, p = guess[0].copy(), guess[1].copy()
    p[:, scalars.places[given]] = wanted[:, given]
    good, index = np.zeros(len(z), bool), np.full(len(z), -1)
    todo, before = np.flatnonzero(tried), np.full(len(z), np.inf)
    for round_ in range(QUICK):
        if len(todo) == 0:
            break
        own = (z[todo], p[todo])
        dz, dp, found = _parameter_step(scalars, own, wanted[todo], unknown, asked)
        u, a = dz[:, : structure.unknowns], dp[:, setting.free] / setting.scales
        size = np.sqrt(u**2 @ structure.mass + (a**2).sum(axis=1))
        # a long step means a fold nearby: not for this method
        alive = np.isfinite(size) & (size < LONGEST) & _goes_on(round_, size, before[todo])
        before[todo] = size
        z[todo[alive]] += dz[alive]
        p[todo[alive]] += dp[alive]
        done = alive & (size < LAST)
        good[todo[done]], index[todo[done]] = True, found[done]
        todo = todo[alive & ~done]
    return z, p, good, index


def _goes_on(
    round_: int, size: Float[np.ndarray, " lanes"], before: Float[np.ndarray, " lanes"]
) -> Flags:
    """Whether corrections shrink, after the first few."""
    return np.asarray((size <= SHRINKING * before) | (round_ < FREE) | (size < LAST))


def _parameter_step(
    scalars: Scalars,
    at: tuple[Lanes, Parameters],
    wanted: Values,
    unknown: list[int],
    asked: Int[np.ndarray, " k"],
) -> tuple[Lanes, Parameters, Int[np.ndarray, " lanes"]]:
    structure, (z, p) = scalars.setting.structure, at
    still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    tangents, changes = [], []
    for place in unknown:
        change = np.zeros_like(p)
        change[:, place] = structure.scales[place]
        step = structure.advance(z, p, change, still, one, none)
        tangents.append(step.tangent_z)
        changes.append(change)
    dz = step.dz

    def values(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes k"]:
        return np.stack([scalars.scalars[k].function(z, p) for k in asked], axis=1)

    here = values(z + dz, p)
    slopes = np.empty((len(z), len(asked), len(unknown)))
    for k, (tangent, change) in enumerate(zip(tangents, changes, strict=True)):
        ahead = values(z + dz + FORWARD * tangent, p + FORWARD * change)
        slopes[:, :, k] = (ahead - here) / FORWARD
    amount = solved_where_regular(slopes, wanted[:, asked] - here)
    dz = dz + sum(amount[:, k : k + 1] * tangent for k, tangent in enumerate(tangents))
    dp = sum((amount[:, k : k + 1] * change for k, change in enumerate(changes)), np.zeros_like(p))
    return dz, dp, step.index


def full_frames(
    setting: Setting, z: Lanes, p: Parameters, rows: Rows, first: Lanes
) -> tuple[Float[np.ndarray, "lanes full"], Frames]:
    """Newton step orthogonal to planes, and bases of the tangent spaces that project to theirs.

    ``[F_z F_p; R] (x_0, t_1 … t_d) = ((r, 0), (0, e_1) … (0, e_d))`` with r given as `first`.
    """
    lanes, size, d = len(z), z.shape[1], len(setting.free)
    rhs = np.zeros((lanes, d + 1, size + d))
    rhs[:, 0, :size] = first
    rhs[:, 1:, size:] = np.eye(d)
    solved = setting.structure.solve(z, p, rhs, border_of(setting, z, p, rows)).x
    return solved[:, 0], np.ascontiguousarray(solved[:, 1:])


def orthonormal(setting: Setting, frames: Frames) -> Frames:
    """Bases of the same spaces, orthonormal in the metric."""
    placed = placed_frames(setting, frames)
    gram = placed @ np.swapaxes(placed, 1, 2)
    return np.asarray(np.linalg.solve(np.linalg.cholesky(gram), frames))


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
        frames = orthonormal(setting, full_frames(setting, z, p, rows, np.zeros_like(z))[1])
        rows = placed_frames(setting, frames)
    return frames


def solved_on_the_set(
    scalars: Scalars, guess: tuple[Lanes, Parameters], wanted: Values, rows: Rows
) -> Solved:
    """States by Newton along and across the set at once: regular at folds."""
    setting, structure = scalars.setting, scalars.setting.structure
    z, p = (column.copy() for column in guess)
    good, todo = np.zeros(len(z), bool), np.arange(len(z))
    before = np.full(len(z), np.inf)
    for round_ in range(ITERATIONS):
        if len(todo) == 0:
            break
        step = _step(scalars, z[todo], p[todo], rows[todo], wanted[todo])
        size = np.linalg.norm(placed_frames(setting, step[:, None])[:, 0], axis=1)
        alive = np.isfinite(size) & _goes_on(round_, size, before[todo])
        before[todo] = size
        share = np.minimum(1.0, LONGEST / np.maximum(size, 1e-300))[alive, None]
        dz, dp = split_step(setting, share * step[alive])
        z[todo[alive]] += dz
        p[todo[alive]] += dp
        done = alive & (size < LAST)
        good[todo[done]] = True
        todo = todo[alive & ~done]
    index = np.full(len(z), -1)
    index[good] = structure.index(z[good], p[good])
    return z, p, good, index


def _step(
    scalars: Scalars, z: Lanes, p: Parameters, rows: Rows, wanted: Values
) -> Float[np.ndarray, "lanes full"]:
    setting = scalars.setting
    residual = setting.structure.residual(z, p)
    across, along = full_frames(setting, z, p, rows, -residual)
    dz, dp = split_step(setting, across)
    # far from the set its coordinates may have no meaning
    near = np.linalg.norm(placed_frames(setting, across[:, None])[:, 0], axis=1) < LONGEST
    dz, dp = np.where(near[:, None], dz, 0.0), np.where(near[:, None], dp, 0.0)
    here = scalars(z + dz, p + dp)
    slopes = np.empty((*wanted.shape, wanted.shape[1]))
    for k in range(wanted.shape[1]):
        ahead_z, ahead_p = split_step(setting, FORWARD * along[:, k])
        ahead = scalars(z + dz + ahead_z, p + dp + ahead_p)
        slopes[:, :, k] = (ahead - here) / FORWARD
    amount = solved_where_regular(slopes, wanted - here)
    return np.asarray(across + np.einsum("lk,lkf->lf", amount, along))


def solved_where_regular(
    slopes: Float[np.ndarray, "lanes k k"], gap: Float[np.ndarray, "lanes k"]
) -> Float[np.ndarray, "lanes k"]:
    """Solutions of small linear systems; not numbers where they are singular."""
    regular = np.isfinite(slopes).all(axis=(1, 2))
    regular[regular] = np.abs(np.linalg.det(slopes[regular])) > 1e-200
    amount = np.full(gap.shape, np.nan)
    amount[regular] = np.linalg.solve(slopes[regular], gap[regular][:, :, None])[:, :, 0]
    return amount


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
        """Derivatives of the coordinates (rows) along tangents (columns)."""
        columns = []
        for k in range(frames.shape[1]):
            dz, dp = split_step(self.setting, CENTRAL * frames[:, k])
            columns.append((self(z + dz, p + dp) - self(z - dz, p - dp)) / (2.0 * CENTRAL))
        return np.stack(columns, axis=2)

    def solved(
        self,
        guess: tuple[Lanes, Parameters],
        wanted: Values,
        planes: Callable[[Int[np.ndarray, " some"]], Rows],
        folded: Flags,
    ) -> tuple[Lanes, Parameters, Flags, Int[np.ndarray, " lanes"]]:
        """States with given coordinates near guesses, whether they were found, and their index.

        Parameters
        ----------
        guess
            Unknowns and all parameters.
        wanted
            The coordinates.
        planes
            Bases of planes near the tangent spaces of some lanes: with these, Newton is regular at
            folds, too.
        folded
            Lanes next to folds. Where the coordinates are the parameters, that does not matter.
        """
        if self.projecting:
            p = guess[1].copy()
            p[:, self.places] = wanted
            z, good, index = exact_states(self.setting.structure, guess[0], p)
            return z, p, good, index
        z, p, good, index = solved_over_parameters(self, guess, wanted, ~folded)
        rest = np.flatnonzero(~good)
        start = (guess[0][rest], guess[1][rest])
        parts = solved_on_the_set(self, start, wanted[rest], planes(rest))
        z[rest], p[rest], good[rest], index[rest] = parts
        return z, p, good, index


def coordinates_of(eset: EquilibriumSet, chosen: Sequence[Descriptor | str]) -> Coordinates:
    """Coordinates by descriptors, or by names of free parameters or of descriptors.

    Raises
    ------
    InputError
        For another number than that of the free parameters, equal ones, parameters that are not
        free, or unknown names.
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


def parameter_descriptor(eset: EquilibriumSet, name: str) -> Descriptor:
    """Return a parameter as a descriptor."""
    structure = eset.structure
    place = position(structure.parameters, name)
    unit = structure.parameters[place].unit
    return Descriptor(
        name, unit, lambda z, p: p[:, place].copy(), name, ("parameter", structure.signature)
    )


def _scalar(eset: EquilibriumSet, each: Descriptor | str) -> tuple[Descriptor, int]:
    structure = eset.structure
    if isinstance(each, Descriptor):
        return each, -1
    if each in eset.names:
        return parameter_descriptor(eset, each), position(structure.parameters, each)
    if each in [parameter.name for parameter in structure.parameters]:
        raise InputError(
            f"`coordinates` must be free parameters ({', '.join(eset.names)}) or descriptors; "
            f"got {each!r}, which is fixed."
        )
    return structure.descriptor(each), -1

"""Internal coordinates: parameters and descriptors, and the states that have them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Frames, Lanes, Parameters, Rows
from equimorph.charts.solving import Scalars, solved_on_the_set, solved_over_parameters
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.lookup.exact_states import exact_states
from equimorph.manifold.queries.nearest import setting_of
from equimorph.model import Descriptor, position

Values = Float[np.ndarray, "lanes d"]
Square = Float[np.ndarray, "lanes d d"]

CENTRAL = 1e-5


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
    return Coordinates(setting_of(eset), tuple(scalars), np.array(places))


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

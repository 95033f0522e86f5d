"""What a rod is made of, in non-dimensional form, and how its user's parameters enter."""

from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from equimorph.array_types import Float

RESOLUTION = (2, 3)
"""Elements and degree of a mesh that is used for its breaks alone."""


Built_co = TypeVar("Built_co", covariant=True)


class Description(Protocol[Built_co]):
    """What is asked of the description of a rod, in the plane or in space."""

    @property
    def raw_names(self) -> tuple[str, ...]:
        """Raw parameters, in their order."""

    def build(self, elements: int, degree: int) -> Built_co:
        """The rod in non-dimensional form."""

    def raw_model(self, elements: int, degree: int) -> Any:
        """The Lagrangian in the raw parameters."""

    def matrix(self, model: Any) -> Float[np.ndarray, "scalars others"]:
        """Raw scalars as combinations of the user's."""


@dataclass(frozen=True, eq=False)
class Construction(Generic[Built_co]):
    """Profiles, terms and ends of a rod, and its raw parameters by those of its user.

    build: non-dimensional; table: of the raw parameters, times the user's parameters and 1.
    """

    build: Built_co
    names: tuple[str, ...]
    table: Float[np.ndarray, "raw settings"]

    def row(self, name: str) -> Float[np.ndarray, " settings"]:
        """Table of one raw parameter: an end angle, an amplitude, a place of end B."""
        return np.asarray(self.table[self.names.index(name)])


def construction(description: Description[Built_co], parameters: int) -> Construction[Built_co]:
    """Take a description apart.

    Parameters
    ----------
    description
        The rod.
    parameters
        How many parameters its user has; further ones of the description are zero.
    """
    model = description.raw_model(*RESOLUTION)
    first = model.multipliers
    rows = description.matrix(model)[first:-1, first:]
    table = np.concatenate([rows[:, :parameters], rows[:, -1:]], axis=1)
    return Construction(description.build(*RESOLUTION), description.raw_names, table)

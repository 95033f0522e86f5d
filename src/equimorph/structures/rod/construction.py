"""What a planar rod is made of, in non-dimensional form, and how its user's parameters enter."""

from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float
from equimorph.structures.rod.description import PlanarDescription
from equimorph.structures.rod.model import Build

RESOLUTION = (2, 3)
"""Elements and degree of a mesh that is used for its breaks alone."""


@dataclass(frozen=True, eq=False)
class Construction:
    """Profiles, terms and ends of a rod, and its raw parameters by those of its user.

    build: non-dimensional; table: of the raw parameters, times the user's parameters and 1.
    """

    build: Build
    names: tuple[str, ...]
    table: Float[np.ndarray, "raw settings"]

    def row(self, name: str) -> Float[np.ndarray, " settings"]:
        """Table of one raw parameter: an end angle, an amplitude, a place of end B."""
        return np.asarray(self.table[self.names.index(name)])


def construction(description: PlanarDescription, parameters: int) -> Construction:
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

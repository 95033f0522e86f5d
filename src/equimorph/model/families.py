"""Scalars of states that are computed together: members of one family."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values

Evaluate = Callable[[Lanes, Parameters], Values]
Family = Callable[
    [Lanes, Parameters, Float[np.ndarray, " members"]], Float[np.ndarray, "lanes members"]
]
"""Values of members, which numbers name: a field along a rod at arclengths. Equal families are
the same."""


@dataclass(frozen=True, eq=False)
class Member:
    """A scalar that its family computes together with others of its kind."""

    family: Family
    at: Float[np.ndarray, " one"]

    def __call__(self, z: Lanes, p: Parameters) -> Values:
        """Values at states."""
        return self.family(z, p, self.at)[:, 0]


def values_together(
    functions: Sequence[Evaluate], z: Lanes, p: Parameters
) -> Float[np.ndarray, "lanes m"]:
    """Values of scalars at states; of members of one family in one call."""
    members = [each for each in functions if isinstance(each, Member)]
    if len(members) == len(functions) > 0:
        family = members[0].family
        if all(each.family == family for each in members):
            return family(z, p, np.concatenate([each.at for each in members]))
    out = np.empty((len(z), len(functions)))
    for k, function in enumerate(functions):
        out[:, k] = function(z, p)
    return out

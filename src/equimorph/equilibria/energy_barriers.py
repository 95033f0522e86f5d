"""What a transition network tells: energy barriers, minimum-energy paths, merging basins.

See docs/barriers.md.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Values
from equimorph.errors import InputError
from equimorph.structures import State, States
from equimorph.structures.metric import metric_length

Status = Literal[
    "landed",
    "escaped",
    "unresolved",
    "lost",
    "beyond the set",
    "nothing to snap to",
    "unstable",
    "unknown",
]


@dataclass(frozen=True, eq=False)
class EnergyBarrier:
    """The least energy that takes a stable state out of its basin, and what happens then.

    Parameters
    ----------
    status
        "landed": at another stable state; "escaped": no state stops it; "unresolved": where the
        discretisation does not represent states; "lost": the descent failed numerically;
        "beyond the set": at a state that a set lacks, as one beyond its constraints; "nothing to
        snap to": no saddle leads elsewhere; "unstable": the state is no minimum; "unknown": it is
        no state of the set, or the set lacks the saddles between its minima.
    energy
        Of the saddle above the state, in the structure's unit of energy; infinite without one,
        zero for an unstable state, not a number for an unknown one.
    saddle, landing
        The saddle, and the stable state beyond it.
    released
        Energy of the saddle above that of the landing; not a number without one.
    admissible
        Whether saddle and landing obey the constraints of the network.
    """

    status: Status
    energy: float = np.inf
    saddle: State | None = None
    landing: State | None = None
    released: float = np.nan
    admissible: bool = True

    def __repr__(self) -> str:
        """One line."""
        if self.saddle is None:
            return f"EnergyBarrier({self.status})"
        beyond = "" if self.admissible else "; beyond the constraints"
        return (
            f"EnergyBarrier({self.status}: {self.energy:.6g}, released {self.released:.6g}{beyond})"
        )


@dataclass(frozen=True, eq=False)
class Merge:
    """Two basins, or groups of them, that become one where the energy reaches a saddle.

    Parameters
    ----------
    energy
        Of the saddle.
    saddle
        Its number among the states.
    between
        Numbers of two minima, one of each group, that the descents from the saddle join.
    one, other
        Numbers of the minima of the two groups, sorted.
    """

    energy: float
    saddle: int
    between: tuple[int, int]
    one: tuple[int, ...]
    other: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class EnergyPath:
    """A minimum-energy path: from stable state to stable state over saddles.

    Parameters
    ----------
    states
        Configurations along the path; between minima and saddles they are no equilibria.
    minima, saddles
        Those that it meets, in order; one saddle less than minima.
    """

    states: States
    minima: States
    saddles: States

    def __repr__(self) -> str:
        """Number of saddles, and the energy at the highest one above that of the start."""
        height = float(self.saddles.energy.max(initial=-np.inf) - self.minima.energy[0])
        return (
            f"EnergyPath({len(self.saddles)} saddles, highest {max(height, 0.0):.6g} above start)"
        )

    @cached_property
    def length(self) -> Values:
        """Length in the structure's metric from the start to each configuration."""
        structure = self.states.structure
        steps = metric_length(structure, np.diff(self.states.z[:, : structure.unknowns], axis=0))
        return np.concatenate([[0.0], np.cumsum(steps)])

    @check_arguments
    def along(self, count: int) -> States:
        """Configurations at even distances along the path, interpolated between those known.

        Raises
        ------
        InputError
            If `count` is less than two.
        """
        if count < 2:
            raise InputError(f"`count` must be at least 2; got {count}.")
        places = np.linspace(0.0, self.length[-1], count)
        rows = [np.interp(places, self.length, column) for column in self.states.z.T]
        p = np.tile(self.states.p[:1], (count, 1))
        return States(self.states.structure, np.stack(rows, axis=1), p)

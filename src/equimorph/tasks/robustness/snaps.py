"""The least change of parameters that makes a state snap, and where it lands."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from equimorph.door import door
from equimorph.equilibria import Landing, snap_landing
from equimorph.manifold import EquilibriumSet, StabilityDistance, stability_distance
from equimorph.structures import State, States


@dataclass(frozen=True, eq=False)
class LeastSnap:
    """The least change of parameters that makes a state snap, and where the snap lands.

    Parameters
    ----------
    status
        "found", or "refused" with the reason in `why`: no loss of stability is known in the box.
    distance
        As of `stability_distance`.
    change
        Least change of each free parameter that leads to the snap.
    landing
        Where it lands; see `Landing`.
    """

    status: Literal["found", "refused"]
    why: str
    distance: StabilityDistance
    change: dict[str, float]
    landing: Landing | None

    @property
    def states(self) -> States | None:
        """Where stability is lost, and where the snap ends; None without a snap."""
        lost, landing = self.distance.nearest, self.landing
        if lost is None or landing is None:
            return None
        ends = lost, landing.state
        return States(
            lost.structure, np.array([end.z for end in ends]), np.array([end.p for end in ends])
        )

    def __repr__(self) -> str:
        """Change and landing."""
        if self.landing is None:
            return f"LeastSnap(refused: {self.why})"
        moves = ", ".join(f"{name} {value:+.6g}" for name, value in self.change.items())
        return f"LeastSnap({moves}: {self.landing})"


@door
def least_snap(eset: EquilibriumSet, state: State) -> LeastSnap:
    """Find the least straight change of the free parameters that makes a stable state snap.

    With a load among the free parameters of the set this is the least change of actuators and load.

    Parameters
    ----------
    eset
        Equilibrium set over the parameters that may change.
    state
        A stable state of the set.

    Returns
    -------
    The change, and where the snap lands; or that no loss of stability is known in the box.

    Raises
    ------
    InputError
        If the state is unstable, or no state of the set.
    """
    distance = stability_distance(eset, state)
    if distance.nearest is None:
        why = "no loss of stability is known in the box of the set"
        return LeastSnap("refused", why, distance, {}, None)
    fold = distance.nearest
    change = {name: fold[name] - state[name] for name in eset.names}
    landings = snap_landing(fold)
    landing = next((each for each in landings if each.status != "held"), landings[0])
    return LeastSnap("found", "", distance, change, landing)

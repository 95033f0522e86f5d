"""How independent the constraints of an energy are: where they become dependent, sets end.

The gradients of the constraints, in the metric and each relative to its typical size, span what
constraint forces can do. Where their smallest singular value vanishes, as in a chain whose links
lie in one line, the multipliers grow without bound, and equilibria with forces of opposite sign
meet at infinity: no equilibrium is there.
"""

from collections.abc import Callable

import numpy as np

from equimorph.array_types import Float, Int
from equimorph.arrays import Entries, Lanes, Parameters, Values

DEPENDENT = 0.02
"""Smallest singular value of the gradients below which constraints count as dependent."""
SAMPLES = 64
"""Random configurations that tell the typical size of a gradient."""


class Independence:
    """Smallest singular value of the gradients of constraints.

    Parameters
    ----------
    entries
        Entries of F_z of states.
    places
        Row and column in F_z of each entry: of the gradients those with row − n ≥ 0 > column − n.
    mass
        Mass matrix of the n unknowns.
    samples
        Random configurations with their parameters.
    """

    def __init__(
        self,
        entries: Callable[[Lanes, Parameters], Entries],
        places: Int[np.ndarray, "2 entries"],
        mass: Float[np.ndarray, " n"],
        samples: tuple[Lanes, Parameters],
    ) -> None:
        rows, columns = places
        self._entries, self._mass = entries, mass
        self._own = np.flatnonzero((rows >= len(mass)) & (columns < len(mass)))
        self._at = rows[self._own] - len(mass), columns[self._own]
        self._count = int(rows.max()) + 1 - len(mass)
        sizes = np.linalg.norm(self._gradients(*samples), axis=2)
        usable = np.isfinite(sizes).all(axis=1)
        self._typical = np.sqrt((sizes[usable] ** 2).mean(axis=0))

    def __call__(self, z: Lanes, p: Parameters) -> Values:
        """Return it for each state; 0 where a gradient is not finite."""
        gradients = self._gradients(z, p) / self._typical[:, None]
        gradients[~np.isfinite(gradients).all(axis=(1, 2))] = 0.0
        least = np.linalg.eigvalsh(gradients @ np.swapaxes(gradients, 1, 2))[:, 0]
        return np.asarray(np.sqrt(np.maximum(least, 0.0)))

    def _gradients(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes constraints n"]:
        out = np.zeros((len(z), self._count, len(self._mass)))
        out[:, *self._at] = self._entries(z, p)[:, self._own]
        return np.asarray(out / np.sqrt(self._mass))

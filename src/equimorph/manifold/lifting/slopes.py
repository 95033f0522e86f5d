"""Tangents of the set at its points over grid vertices, and what they tell of rays.

See docs/decisions.md, "Every point is corrected once, and rays are matched by tangents".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.manifold.geometry.points import Points
from equimorph.manifold.geometry.setting import Setting

NONE = -1
"""Index of points without tangents, which that of no state is."""
LAST = 1e-13, 1e-6
"""Largest entry of corrections that are taken: less is round-off, and with more it is no point."""


@dataclass
class Slopes:
    """Of each point: tangents along the free parameters, index, and determinant of F_z.

    Computed once, when it is first asked for; the Newton step that comes with them is the last one
    of the point. Points that lie over no grid vertex have none.

    tangents: changes of z for unit changes of the parameters; index: `NONE` where there are none.
    """

    tangents: Float[np.ndarray, "capacity d size"]
    index: Int[np.ndarray, " capacity"]
    determinant: Float[np.ndarray, " capacity"]
    count: int = 0

    @classmethod
    def empty(cls, setting: Setting) -> "Slopes":
        """Return an empty table."""
        shape = (0, len(setting.free), setting.structure.size)
        return cls(np.zeros(shape), np.zeros(0, int), np.zeros(0))

    def fit(self, setting: Setting, points: Points) -> None:
        """Compute what is missing.

        This corrects nothing by itself: points are exact, and the step that comes with their
        tangents takes off what round-off is left.
        """
        self._reserve(len(points.z))
        new = self.count + np.flatnonzero(points.vertex[self.count : points.count] >= 0)
        self.count = points.count
        if len(new) == 0:
            return
        z, p = points.z[new], points.p[new]
        still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
        for k, place in enumerate(setting.free.tolist()):
            along = np.zeros_like(p)
            along[:, place] = 1.0
            out = setting.structure.advance(z, p, along, still, one, none)
            self.tangents[new, k] = out.tangent_z
            if k == 0:  # and one more step of Newton's method
                self.index[new], self.determinant[new] = out.index, out.determinant
                largest = np.abs(out.dz).max(axis=1)
                near = (largest > LAST[0]) & (largest < LAST[1])
                points.z[new[near]] += out.dz[near]

    def _reserve(self, capacity: int) -> None:
        """Make room for as many points as there may be."""
        known = len(self.index)
        if known < capacity:
            for name in ("tangents", "index", "determinant"):
                old = getattr(self, name)
                new = np.empty((capacity, *old.shape[1:]), old.dtype)
                new[:known] = old
                setattr(self, name, new)
            self.index[known:] = NONE

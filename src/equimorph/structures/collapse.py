"""Structures whose parts get shorter: their energies end where a part would have no length.

See docs/decisions.md, "Structures say where their energy ends".
"""

from abc import abstractmethod

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.model import Constraint, Descriptor, remember_call
from equimorph.structures.contract import Structure

COLLAPSED = 0.99
"""Shortening, relative to the length at rest, beyond which engineering strain says nothing: a bar
has a kink in its energy where its joints meet, a part of a rod or member would be turned inside
out. Sheets end there."""


class Shortening(Structure):
    """A structure whose parts may get shorter."""

    @property
    @abstractmethod
    def may_collapse(self) -> bool:
        """Whether parts may get shorter, by a strain that does not hold at length zero."""

    @abstractmethod
    def shortenings(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes parts"]:
        """Shortenings of the parts relative to their lengths at rest, 1 − l/l₀."""

    @property
    @remember_call
    def max_shortening(self) -> Descriptor:
        """Largest shortening of a part relative to its length at rest, 1 − l/l₀."""

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(self.shortenings(z, p).max(axis=1))

        return Descriptor("max_shortening", "1", value, "max(1 − l/l₀)", self.signature)

    @property
    def validity(self) -> tuple[Constraint, ...]:
        """With engineering strain no part may collapse: ``max_shortening <= 0.99``."""
        return (self.max_shortening <= COLLAPSED,) if self.may_collapse else ()

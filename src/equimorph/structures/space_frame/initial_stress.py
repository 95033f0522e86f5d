"""Initial stress of a frame in space: members whose shape free of stress is not that as drawn."""

from functools import cached_property

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Flags, Lanes, Parameters
from equimorph.structures.discrete import STEPS, SURE
from equimorph.structures.frame.patterns import Patterns
from equimorph.structures.newton import newton
from equimorph.structures.space_frame.mechanics import SpatialFrameMechanics
from equimorph.structures.space_frame.model import SpatialFrameModel


class GrowingModel(SpatialFrameModel):
    """A frame whose initial strains are scaled by a last parameter."""

    @cached_property
    def strains(self) -> Float[np.ndarray, "pieces scalars 3"]:
        """Actuated strains of the cross-sections by parameter."""
        found = super().strains.copy()
        found[:, -1] = 0.0
        return found

    @cached_property
    def elongation(self) -> Float[np.ndarray, "pieces scalars"]:
        """Actuated strain along the pieces by parameter."""
        found = super().elongation.copy()
        found[:, -1] = 0.0
        return found


class GrowingFrame(SpatialFrameMechanics):
    """Mechanics of a frame whose initial stress grows with its last parameter, from 0 to 1."""

    def __init__(self, model: SpatialFrameModel) -> None:
        """Take the initial strains of a frame as one more pattern."""
        given, strains = model.patterns, model.strains[None, :, -1]
        initial = model.elongation[None, :, -1] * model.lengths
        none = vars(Patterns.none(model.network, 1))
        last = {**none, "strains": strains, "length": initial}
        pairs = ((each, last[name]) for name, each in vars(given).items())
        both = Patterns(*(np.concatenate(pair) for pair in pairs))
        names = ("network", "mesh", "length", "bending", "system")
        super().__init__(
            GrowingModel(patterns=both, **{name: getattr(model, name) for name in names})
        )

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """One each: nothing is measured by them."""
        return np.ones(self.model.patterns.count)


def grow_stress(model: SpatialFrameModel, p: Parameters) -> tuple[Lanes, Flags]:
    """Natural states: initial strains and actuators grow together from the frame as drawn."""
    growing = GrowingFrame(model)
    target = np.concatenate([p, np.ones((len(p), 1))], axis=1)
    z, found = growing.natural_guess(p), np.ones(len(p), bool)
    for k in range(1, STEPS + 1):
        here = target * (k / STEPS)
        step = newton(growing, z, here, SURE)
        z, found = step.z, found & step.found
    return z, found & np.isfinite(z).all(axis=1)

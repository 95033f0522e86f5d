"""What a structure offers whose paths are followed by loops that are compiled as a whole."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float


@dataclass(frozen=True)
class CompiledSteps:
    """Loops over the kernels of a structure: they follow straight lines in its parameters.

    Their results are those of `Structure.advance` and of the constraints.

    Parameters
    ----------
    march
        `marching.tick_kernels.march_of`, made with the structure's step and values of constraints.
    search
        `marching.search_kernels.search_of`, made with the same.
    tables
        What these share among lanes.
    bounds
        The constraints, one a row, as the structure's kernel reads them.
    guard
        Least ratio of the pivots of a step; below it `Structure.advance` takes the step.
    """

    march: Callable[..., int]
    search: Callable[..., int]
    tables: tuple[tuple[np.ndarray, ...], ...]
    bounds: Float[np.ndarray, "constraints 4"]
    guard: float

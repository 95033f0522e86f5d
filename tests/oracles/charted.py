"""Sets and closed forms that several tests of charts use."""

import numpy as np

from equimorph.manifold import EquilibriumSet, equilibrium_set
from typecheck import unchecked


def lifted(structure, box, intervals, **options) -> EquilibriumSet:
    with unchecked():  # the tests of sets check
        return equilibrium_set(structure, box, checks=0, intervals=intervals, **options)


def spring_fold(x: np.ndarray) -> np.ndarray:
    """|F|/k = (1 − x_l^⅔)^(3/2), below which there are two stable states; 0 for x_l > 1."""
    return np.maximum(1.0 - np.cbrt(x) ** 2, 0.0) ** 1.5

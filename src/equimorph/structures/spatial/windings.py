"""Guesses of rods in space between clamps that turn over and over along their length.

A turn by 4π along a rod leaves both clamps as they are, and can be undone by bending alone: states
with such turns belong to the same structure. See docs/decisions.md, "Guesses wind".
"""

import numpy as np

from equimorph.arrays import Flags, Float, Numbers
from equimorph.structures.resolution import IN_SPACE, turn_of_element

IN_PLANE, BEYOND_PLANE = 0.25, 2.0 / 3.0
"""Shares of the guesses in a plane, and of the others, that wind, where elements resolve that."""
FLATTER = 1.0 / 3.0
"""Waves of guesses that wind, relative to those of the others."""
WHOLE, HALF = 1.8, 1.2
"""Most windings of rods, and half windings of members, over those of evenly bent elements: twist is
resolved beyond, and states undo a part."""
GUESSES = 2.5
"""Guesses for each start of a search, where some wind."""
WINDING = 4.0 * np.pi
"""Turn after which quaternions are what they were."""


def most_windings(elements: int, degree: int) -> int:
    """Windings along so many elements that states of a rod may have."""
    return int(WHOLE * elements * turn_of_element(degree, IN_SPACE.smallest) / WINDING)


def most_half_windings(elements: int, degree: int) -> int:
    """Turns by 2π along so many elements that states of a frame may have."""
    return int(HALF * elements * turn_of_element(degree, IN_SPACE.smallest) / (0.5 * WINDING))


def are_wound(planar: Flags, generator: np.random.Generator) -> Flags:
    """Which guesses wind: different shares of those in a plane, and of the others."""
    share = np.where(planar, IN_PLANE, BEYOND_PLANE)
    return np.asarray(generator.uniform(size=len(planar)) < share)


def random_windings(most: int, planar: Flags, generator: np.random.Generator) -> Numbers:
    """Number of windings of guesses, up to `most` either way, and 0 of those that are not wound."""
    if most == 0:
        return np.zeros(len(planar), int)
    size = generator.integers(1, most + 1, size=len(planar))
    sign = generator.choice([-1, 1], size=len(planar))
    return np.asarray(size * sign * are_wound(planar, generator))


def random_axes(lanes: int, generator: np.random.Generator) -> Float[np.ndarray, "lanes 3"]:
    """Unit vectors in all directions alike."""
    vectors = generator.normal(size=(lanes, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

"""Guesses of nearly straight rods: single waves, as short as the elements resolve.

See docs/decisions.md, "Guesses hold as many waves as the elements resolve".
"""

import numpy as np

from equimorph.arrays import Float, Items, Values
from equimorph.structures.rod.discretisation import Mesh

MODES = np.arange(1, 9)
"""Half waves along a rod that random guesses are sums of."""
NODES = 54 / 8
"""Nodes for each half wave: the default elements have them for `MODES`."""
SHARE = 1 / 3
"""Share of the guesses that are a single wave where the elements resolve more."""
HIGHEST = 1.5
"""Largest angle of a single wave: the ends of the rod are then half its length apart."""


def single_waves(
    mesh: Mesh, held: tuple[bool, bool], lanes: int, generator: np.random.Generator
) -> tuple[Items, Float[np.ndarray, "n nodes"], Values]:
    """Which guesses are single waves, their angles at the nodes, and the thrusts of such waves.

    Thrusts are those under which a straight rod buckles so, in units of 4π²B/L². None are where the
    elements resolve no more than the waves of all other guesses.
    """
    most = int((len(mesh.nodes) - 1) / NODES)
    share = SHARE if most > len(MODES) else 0.0
    number = int(share * lanes)
    lane = np.arange(number) * (lanes // max(number, 1))
    half_waves = generator.integers(1, most + 1, size=number)
    height = generator.uniform(-HIGHEST, HIGHEST, size=number)
    start, stop = held
    along = mesh.nodes if start or not stop else 1.0 - mesh.nodes
    rate = np.pi * (half_waves if start == stop else half_waves - 0.5)
    shape = np.sin if start or stop else np.cos
    waves = height[:, None] * shape(rate[:, None] * along)
    return lane, waves, (rate / (2.0 * np.pi)) ** 2

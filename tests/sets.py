"""Sets of the arch and of the spring that many tests ask, lifted once; searches that overlook."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod, Spring
from typecheck import unchecked

ARCH_BOX = Box(Theta=(0.2, 2.5), Delta=(-2, 2))


@lru_cache(maxsize=12)
def arch_set(  # each a knob of the same set
    intervals: tuple[int, int] = (12, 21),
    *,
    load: str = "uniform",
    q: float = 2.5,
    cap: float = 20.0,
    checks: int = 0,
    accuracy: float | None = None,
) -> EquilibriumSet:
    """Arch over both angles; `cap` bounds the curvature. Small sets are lifted with checks."""
    arch = Rod(load)
    with unchecked():
        return equilibrium_set(
            arch, ARCH_BOX, fixed={"q": q}, within=[arch.max_curvature <= cap],
            intervals=intervals, checks=checks, accuracy=accuracy,
        )  # fmt: skip


@lru_cache(maxsize=12)
def spring_set(
    intervals: tuple[int, int] = (12, 12),
    longest: float = 1.3,
    checks: int = 0,
) -> EquilibriumSet:
    """Spring over (x_l, F); with a longest x_l below 1 its two stable components are apart."""
    box = Box(x_l=(0.3, longest), F=(-0.5, 0.5))
    with unchecked():
        return equilibrium_set(Spring(), box, intervals=intervals, checks=checks)


def blind(search, overlooks=lambda states: (states.index == 0) & (states.z[:, 0] <= 2.0)):
    """Search that overlooks some states: here stable ones at x < 2."""

    def some(*args, **options):
        found = search(*args, **options)
        seen = [np.flatnonzero(~overlooks(each)) for each in found]
        return [
            replace(each, z=each.z[some], p=each.p[some])
            for each, some in zip(found, seen, strict=True)
        ]

    return some

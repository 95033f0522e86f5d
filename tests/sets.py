"""Sets of the arch and of the spring that many tests ask: each is lifted once in a process."""

from functools import lru_cache

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

"""The condensed layout of chained elements, and its factorisation."""

from equimorph.linalg.condensed.layout import PIVOT_GUARD, CondensedLayout

__all__ = ["PIVOT_GUARD", "CondensedLayout"]

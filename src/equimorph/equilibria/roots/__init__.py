"""Roots of scalars inside the steps of curves."""

from equimorph.equilibria.roots.search import Root, root_inside

__all__ = ["Root", "root_inside"]

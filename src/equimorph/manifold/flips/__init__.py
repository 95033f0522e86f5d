"""Flips of the edges of triangles."""

from equimorph.manifold.flips.kernels import flip_edges

__all__ = ["flip_edges"]

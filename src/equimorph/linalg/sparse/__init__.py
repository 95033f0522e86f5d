"""Symmetric matrices of one sparsity pattern, eliminated in an order that keeps them sparse."""

from equimorph.linalg.sparse.layout import SparseLayout

__all__ = ["SparseLayout"]

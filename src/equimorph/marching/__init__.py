"""Compiled kernels of lanes that march along curves, and the loop that structures make theirs."""

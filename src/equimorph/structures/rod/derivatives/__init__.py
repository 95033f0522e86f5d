"""Residual, matrix and derivatives of the rod."""

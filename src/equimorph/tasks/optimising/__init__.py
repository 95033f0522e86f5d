"""Optimisation over equilibrium sets and maps."""

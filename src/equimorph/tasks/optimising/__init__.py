"""Optimisation over equilibrium sets and maps."""

from equimorph.tasks.optimising.certificates import Certificate
from equimorph.tasks.optimising.optimum import Optima, Optimum, optimise

__all__ = ["Certificate", "Optima", "Optimum", "optimise"]

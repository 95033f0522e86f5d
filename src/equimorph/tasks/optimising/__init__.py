"""Optimisation over equilibrium sets and maps."""

from equimorph.tasks.optimising.certificates import Certificate
from equimorph.tasks.optimising.optimum import Optima, Optimum, optimise
from equimorph.tasks.optimising.strength import Strongest, StrongestSettings, strongest

__all__ = [
    "Certificate",
    "Optima",
    "Optimum",
    "Strongest",
    "StrongestSettings",
    "optimise",
    "strongest",
]

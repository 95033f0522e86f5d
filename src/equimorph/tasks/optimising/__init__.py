"""Optimisation over equilibrium sets and maps."""

from equimorph.tasks.optimising.certificates import Certificate
from equimorph.tasks.optimising.following import FollowedOptimum, Jump, follow_optimum
from equimorph.tasks.optimising.optimum import Optima, Optimum, optimise
from equimorph.tasks.optimising.strength import Strongest, StrongestSettings, strongest

__all__ = [
    "Certificate",
    "FollowedOptimum",
    "Jump",
    "Optima",
    "Optimum",
    "Strongest",
    "StrongestSettings",
    "follow_optimum",
    "optimise",
    "strongest",
]

"""Optimisation over equilibrium sets and maps."""

from equimorph.tasks.optimising.certificates import Certificate
from equimorph.tasks.optimising.landscapes import Barriers, Landscape, landscape
from equimorph.tasks.optimising.moving_optimum import follow_optimum
from equimorph.tasks.optimising.optimum import Optima, Optimum, optimise
from equimorph.tasks.optimising.optimum_path import FollowedOptimum, Jump
from equimorph.tasks.optimising.robust import RobustOptimum, robust_optimum
from equimorph.tasks.optimising.strength import Strongest, StrongestSettings, strongest

__all__ = [
    "Barriers",
    "Certificate",
    "FollowedOptimum",
    "Jump",
    "Landscape",
    "Optima",
    "Optimum",
    "RobustOptimum",
    "Strongest",
    "StrongestSettings",
    "follow_optimum",
    "landscape",
    "optimise",
    "robust_optimum",
    "strongest",
]

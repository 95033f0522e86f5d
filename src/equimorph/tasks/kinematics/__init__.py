"""Inverse kinematics on sets: prediction by cells, Newton's method, least squares, families."""

from equimorph.tasks.kinematics.aiming import aimed
from equimorph.tasks.kinematics.families import family
from equimorph.tasks.kinematics.fitting import best_fits
from equimorph.tasks.kinematics.prediction import Predictor, predictor

__all__ = ["Predictor", "aimed", "best_fits", "family", "predictor"]

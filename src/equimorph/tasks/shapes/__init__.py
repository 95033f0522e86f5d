"""Inverse kinematics on sets: linear prediction over cells, Newton's method, fits and families."""

from equimorph.tasks.shapes.solutions import Shapes, solve_shape, solve_shapes

__all__ = ["Shapes", "solve_shape", "solve_shapes"]

"""Inverse kinematics on sets: linear prediction over cells, Newton's method, fits and families."""

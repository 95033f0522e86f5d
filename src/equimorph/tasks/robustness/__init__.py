"""Sensitivity and robustness: derivatives, laws of imperfections, room, trials, least snaps."""

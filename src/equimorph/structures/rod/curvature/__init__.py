"""Curvature of the rod by moment balance, and its largest value."""

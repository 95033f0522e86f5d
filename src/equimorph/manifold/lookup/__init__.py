"""Exact states of a set over points of the parameters."""

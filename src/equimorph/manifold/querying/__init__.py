"""Compiled kernels of queries for the states of a set over points."""

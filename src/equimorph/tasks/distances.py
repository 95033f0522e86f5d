"""Distances of states in the structure's metric, along paths and between candidates."""

import numpy as np

from equimorph.arrays import Float, Int, Values
from equimorph.linalg.apart import firsts_apart
from equimorph.structures import State, States
from equimorph.structures.metric import distances, metric_length, metric_places


def distance(a: State, b: State) -> float:
    """Distance of two configurations in the structure's metric."""
    return float(metric_length(a.structure, a.z - b.z))


def step_lengths(states: States) -> Float[np.ndarray, " steps"]:
    """Distances of successive states in the metric and scaled parameters."""
    ahead, behind = states[1:], states[:-1]
    return distances(states.structure, ahead.z, ahead.p, behind.z, behind.p)


def path_lengths(states: States) -> Values:
    """Length of the path up to each state, in the metric and scaled parameters."""
    return np.concatenate([[0.0], np.cumsum(step_lengths(states))])


def distinct(states: States, tolerance: float) -> Int[np.ndarray, " distinct"]:
    """Numbers of the states that lie further than a tolerance from all earlier ones of these."""
    return firsts_apart(metric_places(states.structure, states.z, states.p), tolerance)

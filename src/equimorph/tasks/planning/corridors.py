"""Corridors: how likely random trees miss a way of a given width.

A corridor is a path around which all settings within half its width have one admissible state, so
that straight lifts between them stay on it. Lengths are shares of the ranges of the actuators.
"""

from math import ceil, gamma, pi

from scipy.special import bdtr

CHANCE = 0.05
"""Probability of being missed from which on a corridor counts as excluded."""
PARTS = 100
"""Widths that are tried."""


def chance_of_missing(
    width: float, length: float, actuators: int, rounds: int, batch: int, reach: float
) -> float:
    """Largest probability with which trees miss a corridor; exact for the chain of balls behind it.

    Balls of a radius ρ stand along the corridor, ρ apart. If a node of a tree lies in one of them
    and a sample falls into the next, the node nearest to the sample is at most 3ρ from it, so that
    a half width of 4ρ holds the straight lift to the sample, which a reach of 3ρ does not cut short
    [KleinbortEtAl2019]_. In each round of uniform samples the next of K balls is met with the
    probability b = 1 − (1 − V_d ρ^d)^batch, in all of them after n rounds with
    P(Bin(n, b) ≥ K). Two trees that grow from both ends share the balls.

    Parameters
    ----------
    width, length
        Of the corridor.
    actuators
        Number d of dimensions.
    rounds, batch
        Rounds of samples for which trees do not grow in between, and samples in each.
    reach
        Longest extension of a tree.
    """
    radius = min(width / 8.0, reach / 3.0)
    ball = min(1.0, pi ** (0.5 * actuators) / gamma(0.5 * actuators + 1.0) * radius**actuators)
    meets = 1.0 - (1.0 - ball) ** batch
    return float(bdtr(ceil(length / radius) - 1, rounds, meets))


def narrowest_excluded(
    actuators: int, rounds: int, batch: int, reach: float, length: float = 1.0
) -> float | None:
    """Least width of corridors that are missed with a probability of 5 % at most; None if none."""
    for part in range(1, PARTS + 1):
        if chance_of_missing(part / PARTS, length, actuators, rounds, batch, reach) <= CHANCE:
            return part / PARTS
    return None

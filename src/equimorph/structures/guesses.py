"""How many random guesses a search makes of a structure.

See docs/decisions.md, "Cheap guesses are many".
"""

CHEAP, MOST = 50.0, 5.0
"""Unknowns below which more guesses are made than starts are asked for, and the most for each."""


def many_if_cheap(size: int) -> float:
    """Guesses for each start: together they cost what one costs with `CHEAP` unknowns."""
    return min(max(CHEAP / size, 1.0), MOST)

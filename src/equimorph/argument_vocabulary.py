"""Vocabulary of argument checks: ranges of numbers by parameter name, and words for each class.

`argument_kinds` combines them with annotations. Nothing here knows a structure.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

LARGEST = sys.float_info.max
"""Largest finite number."""
MANY = 1_000_000
"""Largest count of random starts, checks and the like: more would run for days."""


@dataclass(frozen=True)
class Range:
    """Numbers that are allowed, and how they are called: one, and several."""

    least: float
    most: float
    words: str
    several: str
    above: bool = False
    """Whether `least` itself is excluded."""

    def holds(self, value: Any) -> bool:
        """Whether a real number is in the range; not a number is in none."""
        number = value.item() if isinstance(value, np.generic) else value
        above = self.least < number if self.above else self.least <= number
        return bool(above and number <= self.most)


FINITE = Range(-LARGEST, LARGEST, "a finite number", "finite numbers")
NOT_NEGATIVE = Range(0.0, np.inf, "a number >= 0", "numbers >= 0")
POSITIVE = Range(0.0, LARGEST, "positive and finite", "positive numbers", above=True)
PERIOD = Range(0.0, np.inf, "a positive number", "positive numbers", above=True)
SHARE = Range(0.0, 1.0, "a share of the length, from 0 to 1", "shares of the length, from 0 to 1")
BETWEEN = Range(
    0.0, float(np.nextafter(1.0, 0.0)), "between 0 and 1 (both excluded)",
    "numbers between 0 and 1 (both excluded)", above=True,
)  # fmt: skip
EXTENDED = Range(-np.inf, np.inf, "a number", "numbers")


def count(least: int, most: float = MANY) -> Range:
    """Whole numbers from `least` to `most`."""
    limits = f">= {least}" if np.isinf(most) else f"from {least} to {most}"
    return Range(least, most, f"a whole number {limits}", f"whole numbers {limits}")


WHOLE = count(0, np.inf)
RANGES: Mapping[str, Range] = {
    **dict.fromkeys(
        ("accuracy", "snap_price", "slack", "tolerance", "most", "reach", "distance"), POSITIVE
    ),
    **dict.fromkeys(
        ("tolerances", "spreads", "offsets", "could_measure", "sizes", "limits", "errors"), POSITIVE
    ),
    "survive": POSITIVE,
    **dict.fromkeys(("first_step", "largest_step", "smallest_step", "turning"), POSITIVE),
    **dict.fromkeys(("lower", "upper"), EXTENDED),
    **dict.fromkeys(("EI", "EI_out", "GJ", "EA", "E", "rest", "length"), POSITIVE),
    **dict.fromkeys(("mass", "masses", "duration", "rate", "hold", "dampings"), POSITIVE),
    "links": count(2, 1000),
    **dict.fromkeys(("accelerations", "jerks", "sampling"), POSITIVE),
    **dict.fromkeys(("width", "thickness", "diameter", "wall", "density", "weight"), POSITIVE),
    **dict.fromkeys(("s", "start", "stop"), SHARE),
    **dict.fromkeys(("kinks", "probability"), BETWEEN),
    "degree": count(3, 16),
    "margin": NOT_NEGATIVE,
    **dict.fromkeys(
        ("radius", "damping"), Range(0.0, LARGEST, "a finite number >= 0", "finite numbers >= 0")
    ),
    "intervals": count(2, np.inf),
    "tiles": count(1, np.inf),
    "confidence": Range(0.5, 1.0 - 1e-12, "between 0.5 and 1", "between 0.5 and 1", above=True),
    "slide": Range(
        -2.0 * np.pi, 2.0 * np.pi, "a direction in radians, within ±2π", "directions in radians"
    ),
    "seed": WHOLE,
    "checks": count(0, 100_000),
    "retries": count(0, 20),
    **dict.fromkeys(("samples", "frames"), count(2)),
    **dict.fromkeys(("starts", "runs", "trials", "batch", "fps", "cycles", "rebuilds"), count(1)),
    "count": count(1, 10_000),
    "limit": count(1, 100 * MANY),
    "lifts": count(1, 100 * MANY),
    "steps": count(1, 1000 * MANY),
}
"""Ranges of numbers whose names mean the same in all functions, alone or in lists and mappings."""

CLASSES: Mapping[str, tuple[str, str]] = {
    "Structure": ("a structure, like `Rod()`", "structures"),
    "State": ("a state, like `rod.natural_state(Theta=1.0)`", "states"),
    "States": ("states, like `equilibrium_set(...).at(...)`", "batches of states"),
    "EquilibriumSet": ("an equilibrium set, like `equilibrium_set(rod, Box(...))`", "sets"),
    "Box": ("a box, like `Box(q=(0.0, 2.5))`", "boxes"),
    "Grid": ("a grid, like `Grid(Theta=(0.2, 2.5, 93), Delta=(-2, 2, 81))`", "grids"),
    "Constraint": (
        "a constraint, like `rod.max_curvature <= 6`",
        "constraints, like `[rod.max_curvature <= 6]`",
    ),
    "Descriptor": (
        "a descriptor, like `rod.max_curvature`",
        "descriptors, like `[rod.max_curvature]`",
    ),
    "Extreme": ("an extreme, like `peak(descriptor)`", "extremes, like `peak(descriptor)`"),
    "DesignBound": (
        "a bound, like `DesignBound(lambda B: B, upper=1)`",
        "bounds, like `[DesignBound(lambda B: B, upper=1)]`",
    ),
    "LoadLimit": ("a question, like `LoadLimit(state, 'q')`", "questions"),
    "RouteExtreme": ("a question, like `RouteExtreme(...)`", "questions"),
    "StateValue": ("a question, like `StateValue(state, peak(descriptor))`", "questions"),
    "Workers": (
        "workers with the method `map(function, chunks)`, like `cluster.dask(client)`",
        "workers",
    ),
    "Progress": ("a sink with the method `report(stage, done, total)`", "sinks"),
    "Journal": ("a journal, like `storage.open_journal(path)`", "journals"),
    "Schedule": ("a schedule, like `route.schedule` of a route that arrived", "schedules"),
    "Rule": ("a rule, like `charts.lowest(descriptor)`", "rules"),
    "LimitLoadMap": ("a map of limit loads, like `limit_load_map(...)`", "maps of limit loads"),
    "LimitLoad": ("a limit load, like `limit_load(...)`", "limit loads"),
    "StateEstimate": ("an answer of `estimate_state`", "answers of `estimate_state`"),
    "Errors": ('errors, like `Errors({"Theta": 0.02})`', "errors"),
    "Location": ("an answer of `locate`", "answers of `locate`"),
    "Route": ("a route, like `plan(...)`", "routes"),
    "Path": ("a path, like `lift(...)`", "paths"),
    "Term": ("a term, like `PointForce(1.0)`", "terms, like `PointForce(1.0)`"),
    "CrossSection": ('a section, like `Round("2 mm", E="70 GPa", nu=0.3)`', "sections"),
    "Bar": ("a bar, like `Bar(('A', 'B'))`", "bars, like `Bar(('A', 'B'))`"),
    "Member": ("a member, like `Member(('A', 'B'))`", "members, like `Member(('A', 'B'))`"),
    "SpatialMember": (
        "a member, like `SpatialMember(('A', 'B'))`",
        "members, like `SpatialMember(('A', 'B'))`",
    ),
    "Unknown": ('an unknown, like `Unknown("x")`', 'unknowns, like `Unknown("x")`'),
    "Parameter": ("a parameter, like `Parameter(...)`", "parameters, like `Parameter(...)`"),
    "End": ('an end, like `End(angle="free")`', 'ends, like `End(angle="free")`'),
    "Axes": ("axes of matplotlib", "axes"),
}
"""What objects of a class are called: one of them, and several."""

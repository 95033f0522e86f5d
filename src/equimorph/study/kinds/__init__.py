"""Kinds of questions that a study may ask: every `Kind` that a module of this folder defines."""

import pkgutil
from importlib import import_module
from typing import Any

from equimorph.study.question import Kind

ORDER = (
    *("route", "shape", "optimum", "robust_optimum", "landscape", "track", "follow"),
    *(
        "sampled_route",
        "reach",
        "verify",
        "motion",
        "replay",
        "sensitivity",
        "imperfection",
        "room",
        "snap",
    ),
    *("snap_graph", "transition_network", "barriers", "least_shock", "words"),
    *("trials", "estimate", "calibration", "map", "strongest", "chart", "reduction"),
)
"""Order in which kinds are answered and reported; further kinds follow by their names."""


def _find() -> tuple[Kind[Any], ...]:
    modules = [import_module(f"{__name__}.{each.name}") for each in pkgutil.iter_modules(__path__)]
    kinds = [
        each() for module in modules for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, Kind) and each.__module__ == module.__name__
    ]  # fmt: skip
    places = {table: place for place, table in enumerate(ORDER)}
    return tuple(sorted(kinds, key=lambda kind: (places.get(kind.table, len(ORDER)), kind.table)))


KINDS = _find()

"""What a page holds: states with their pictures and numbers, cells, folds, snaps, routes, barriers.

States of routes, landings of snaps, both sides of barriers and middles of curved edges stand behind
the vertices of the set in one list, so that everything that the page shows is a state of that list
or lies in a cell.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from equimorph.arrays import Int, Num, Values
from equimorph.charts import Reduction
from equimorph.errors import InputError
from equimorph.explorer.pictures import FIDELITY, gallery, quantise, size_of
from equimorph.manifold import (
    EdgeMiddles,
    EquilibriumSet,
    SetBarriers,
    SnapGraph,
    edge_middles,
    overturned_cells,
)
from equimorph.manifold.geometry.topology import facets_of
from equimorph.model import Constraint, Descriptor, Disc, Obstacle
from equimorph.plotting.curves import corner_steps, snap_steps
from equimorph.plotting.support_symbols import AWAY, SYMBOLS, UPRIGHT
from equimorph.structures import States, effort_of, join_states, margin_of
from equimorph.tasks.route import Route

_AT_ONCE = 8192
"""States whose shapes or scalars are computed together."""


def curved_edges(eset: EquilibriumSet) -> EdgeMiddles:
    """Edges whose middle is elsewhere than the mean of its ends, by more than `FIDELITY`.

    That is a share of the size of the structure, or of the box of parameters.
    """
    middles, size = edge_middles(eset), size_of(eset.points)
    starts = range(0, len(middles.ends), _AT_ONCE)
    bends = [_bends(eset, middles, slice(first, first + _AT_ONCE)) for first in starts]
    places = middles.states.p[:, eset.setting.free] - eset.coordinates[middles.ends].mean(axis=1)
    moved = np.abs(places / (eset.box.upper - eset.box.lower)).max(axis=1, initial=0.0)
    bent = np.maximum(np.concatenate([np.zeros(0), *bends]) / size, moved) > FIDELITY
    return EdgeMiddles(middles.ends[bent], middles.states[bent])


def _bends(eset: EquilibriumSet, middles: EdgeMiddles, some: slice) -> Values:
    """How far, at most, a point of a shape is from the mean of where it is at both ends."""
    used, ends = np.unique(middles.ends[some], return_inverse=True)
    shapes = eset.points[used].shape()
    first, second = (shapes[end] for end in ends.reshape(-1, 2).T)
    gap = middles.states[some].shape() - 0.5 * (first + second)
    return np.asarray(np.linalg.norm(gap, axis=2).max(axis=1))


_BARE = re.compile(r"[A-Za-z0-9_-]+")


def study_text(eset: EquilibriumSet, title: str) -> str:
    """Title, structure and set as a study file, to which the page adds routes.

    Refused if the structure cannot be written down, as with loads that are functions.
    """
    structure = {k: v for k, v in eset.structure.identity().items() if v is not None}
    sides = zip(eset.names, eset.box.lower.tolist(), eset.box.upper.tolist(), strict=True)
    section: dict[str, Any] = {"box": {name: [low, high] for name, low, high in sides}}
    if eset.fixed:
        section["fixed"] = {name: float(value) for name, value in eset.fixed.items()}
    validity = {str(each) for each in eset.structure.validity}
    within = [str(each) for each in eset.constraints if str(each) not in validity]
    if within:
        section["within"] = within
    section["intervals"] = list(eset.intervals)
    lines = [f"title = {toml(title)}", "", "[structure]"]
    lines += [f"{_key(key)} = {toml(value)}" for key, value in structure.items()]
    lines += ["", "[set]", *(f"{_key(key)} = {toml(value)}" for key, value in section.items())]
    return "\n".join(lines) + "\n"


def toml(value: Any) -> str:
    """A value as TOML on one line.

    Raises `InputError` for what TOML has no form for.

    Examples
    --------
    >>> toml({"a": [1, 2.5], "b c": "d"})
    '{ a = [1, 2.5], "b c" = "d" }'
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        items = [f"{_key(k)} = {toml(v)}" for k, v in value.items() if v is not None]
        return "{ " + ", ".join(items) + " }" if items else "{}"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml(each) for each in value) + "]"
    raise InputError(f"`structure` must be plain data to be written down; got {value!r}.")


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


_ROUTE_STATES = 400
"""States of a route that a page holds."""
_EXACT = ("stability_margin", "energy")
"""Scalars of which small differences matter: they are kept as single floats."""

Arrays = dict[str, Num[np.ndarray, "..."]]


@dataclass(frozen=True, eq=False)
class Question:
    """What is shown on a page."""

    eset: EquilibriumSet
    routes: Mapping[str, Route]
    snaps: SnapGraph
    reduction: Reduction | None
    barriers: SetBarriers | None
    descriptors: tuple[Descriptor, ...]
    title: str


def contents(asked: Question) -> tuple[dict[str, Any], Arrays]:
    """Words and small tables, and the large arrays."""
    eset = asked.eset
    extra = _States(eset.points)
    routes = [_route(eset, name, each, extra) for name, each in asked.routes.items()]
    runs, snap_arrays = _snaps(asked.snaps, extra)
    barriers = [] if asked.reduction is None else _barriers(asked.reduction, extra)
    middles = curved_edges(eset)
    first_middle = extra.add(middles.states)
    states = extra.all()
    shown = gallery(states)
    scalars, scalar_arrays = _scalars(states, _descriptors(asked))
    study, why = _study(eset, asked.title)
    d = len(eset.names)
    words = {
        "title": asked.title,
        "kind": eset.structure.kind,
        "audit": str(eset.audit),
        "clean": bool(eset.audit.clean),
        "unit": eset.structure.length_unit,
        "upward": eset.structure.upward,
        "space": shown.space,
        "size": shown.size,
        "vertices": len(eset.points),
        "middles": first_middle,
        "parameters": _parameters(eset),
        "fixed": _fixed(eset),
        "constraints": [_bound(each) for each in eset.constraints],
        "obstacles": [_obstacle(each.descriptor.obstacle) for each in eset.constraints
                      if each.descriptor.obstacle is not None],
        "scalars": scalars,
        "elevation": eset.structure.elevation.name,
        "layout": shown.layout,
        "fidelity": shown.error,
        "routes": routes,
        "runs": runs,
        "barriers": barriers,
        "rule": "" if asked.reduction is None else str(asked.reduction.rule),
        "symbols": _symbols(),
        "study": study,
        "no_study": why,
    }  # fmt: skip
    arrays: Arrays = {
        "places": states.p[:, eset.setting.free].astype(np.float32),
        "index": np.minimum(
            np.concatenate([eset.index, states[len(eset.points) :].index]), 255
        ).astype(np.uint8),
        "cells": eset.cells.astype(np.int32),
        "cell_index": np.minimum(eset.cell_index, 255).astype(np.uint8),
        "bent": middles.ends.astype(np.int32),
        "overturned": overturned_cells(eset).astype(np.uint8),
        "stratum": eset.stratum.astype(np.int32),
        "component": eset.component.astype(np.int32),
        "folds": facets_of(eset.folds, d).astype(np.int32),
        "crossings": facets_of(eset.crossings, d).astype(np.int32),
        "mean": shown.mean.astype(np.float32),
        "modes": shown.modes.astype(np.float32),
        "low": shown.low.astype(np.float32),
        "step": shown.step.astype(np.float32),
        "coefficients": shown.coefficients,
        **snap_arrays,
        **_saddles(asked.barriers),
        **scalar_arrays,
    }
    return words, arrays


class _States:
    """A growing list of states."""

    def __init__(self, first: States) -> None:
        self._parts = [first]
        self._count = len(first)

    def add(self, states: States) -> int:
        """Append states; the number of the first."""
        first = self._count
        self._parts.append(states)
        self._count += len(states)
        return first

    def all(self) -> States:
        """Every state, in order."""
        return join_states(self._parts[0].structure, self._parts)


def _parameters(eset: EquilibriumSet) -> list[dict[str, Any]]:
    known = {each.name: each for each in eset.structure.parameters}
    sides = zip(eset.names, eset.box.lower.tolist(), eset.box.upper.tolist(), strict=True)
    return [
        {"name": name, "unit": known[name].unit, "role": str(known[name].role),
         "lower": low, "upper": high, "scale": float(known[name].scale)}
        for name, low, high in sides
    ]  # fmt: skip


def _fixed(eset: EquilibriumSet) -> list[dict[str, Any]]:
    """Values of the parameters that are not free."""
    columns = zip(eset.structure.parameters, eset.setting.base.tolist(), strict=True)
    return [
        {"name": each.name, "unit": each.unit, "value": value}
        for each, value in columns
        if each.name not in eset.names
    ]


def _descriptors(asked: Question) -> list[Descriptor]:
    """The descriptors of the page, each once: heights first, then numbers, then efforts."""
    structure, eset = asked.eset.structure, asked.eset
    found = [structure.elevation, *asked.descriptors]
    found += [each.descriptor for each in eset.constraints]
    found += [margin_of(structure)]
    some = eset.points[:1]
    if structure.index_out_of_plane(some.z, some.p) is not None:
        found.append(structure.descriptor("lateral_margin"))
    found.append(structure.descriptor("energy"))
    moved = [
        each.name
        for each in structure.parameters
        if each.name in eset.names or each.role == "actuator"
    ]
    found += [effort_of(structure, name) for name in moved]
    found += [each for each in structure.support_reactions if np.any(each(eset.points) != 0.0)]
    return list({each.name: each for each in found}.values())


def _scalars(
    states: States, descriptors: Sequence[Descriptor]
) -> tuple[list[dict[str, Any]], Arrays]:
    """Name, unit and scale of each descriptor, and its values."""
    words: list[dict[str, Any]] = []
    arrays: Arrays = {}
    for number, each in enumerate(descriptors):
        values = np.concatenate(
            [each(states[k : k + _AT_ONCE]) for k in range(0, len(states), _AT_ONCE)]
        )
        packed, low, step = quantise(values)
        exact = each.name in _EXACT
        arrays[f"scalar{number}"] = np.nan_to_num(values).astype(np.float32) if exact else packed
        words.append({
            "name": each.name, "unit": each.unit, "symbol": each.symbol or each.name,
            "low": 0.0 if exact else low, "step": 1.0 if exact else step,
        })  # fmt: skip
    return words, arrays


def _route(eset: EquilibriumSet, name: str, route: Route, extra: _States) -> dict[str, Any]:
    """States of a route with its corners and snaps; without states if it has no path."""
    words: dict[str, Any] = {
        "name": name, "status": route.status, "why": route.why, "first": 0, "count": 0,
        "at": [], "corners": [], "snaps": [], "released": [], "margin": None,
    }  # fmt: skip
    if route.path is None:
        return words
    count = len(route.path.states)
    corners = [0, count - 1] if route.schedule is None else corner_steps(route).tolist()
    snaps = snap_steps(route).tolist()
    kept = np.linspace(0, count - 1, min(count, _ROUTE_STATES)).astype(int)
    kept = np.unique([*kept, *corners, *snaps, *(k + 1 for k in snaps)])
    length = route.path.length
    whole = float(length[-1]) or 1.0
    place = {int(step): number for number, step in enumerate(kept)}
    return words | {
        "first": extra.add(route.path.states[kept]),
        "count": len(kept),
        "at": (length[kept] / whole).round(6).tolist(),
        "corners": [place[int(k)] for k in corners],
        "snaps": [place[int(k)] for k in snaps],
        "released": [float(each.released) for each in route.snaps],
        "margin": float(route.margin) if np.isfinite(route.margin) else None,
    }


def _snaps(graph: SnapGraph, extra: _States) -> tuple[list[dict[str, Any]], Arrays]:
    """Runs of the stability boundary; for each vertex that was tried the landing and the energy."""
    runs, vertex, run, landing, released = [], [], [], [], []
    along: list[Int[np.ndarray, " n"]] = []
    run_along = []
    for number, snap in enumerate(graph.snaps):
        runs.append({"source": snap.source, "target": snap.target, "status": snap.status})
        along.append(snap.along)
        run_along.append(np.full(len(snap.along), number))
        landed = [each.state for each in snap.landings if each.landed]
        first = extra.add(join_states(graph.eset.structure, landed))
        for where, each in zip(snap.vertices.tolist(), snap.landings, strict=True):
            vertex.append(where)
            run.append(number)
            released.append(float(each.released))
            landing.append(first if each.landed else -1)
            first += int(each.landed)
    whole = {
        "snap_vertex": vertex, "snap_run": run, "snap_landing": landing,
        "along": np.concatenate([np.zeros(0, int), *along]),
        "along_run": np.concatenate([np.zeros(0, int), *run_along]),
    }  # fmt: skip
    arrays: Arrays = {name: np.asarray(each, dtype=np.int32) for name, each in whole.items()}
    return runs, arrays | {"snap_released": np.asarray(released, dtype=np.float32)}


def _saddles(field: SetBarriers | None) -> Arrays:
    """Vertices of index one, and the cells on which descents from them end."""
    found = None if field is None else field.saddle_landings
    vertices, cells = (np.zeros(0), np.zeros((0, 2))) if found is None else astuple(found)
    return {"saddle_vertex": vertices.astype(np.int32), "saddle_cells": cells.astype(np.int32)}


def _barriers(reduction: Reduction, extra: _States) -> list[dict[str, Any]]:
    """Both sides of each barrier."""
    return [
        {"kind": each.kind, "near": extra.add(each.near), "far": extra.add(each.far),
         "count": len(each.near), "facets": each.facets.tolist()}
        for each in reduction.barriers
    ]  # fmt: skip


def _bound(constraint: Constraint) -> str:
    """A constraint with the unit of its bound."""
    unit = constraint.descriptor.unit
    return str(constraint) if unit in ("", "1") else f"{constraint} {unit}"


def _obstacle(obstacle: Obstacle | None) -> dict[str, Any]:
    if isinstance(obstacle, Disc):
        return {"centre": list(obstacle.centre), "radius": float(obstacle.radius),
                "inside": obstacle.inside}  # fmt: skip
    assert obstacle is not None
    return {"point": list(obstacle.point), "normal": list(obstacle.normal)}


def _symbols() -> dict[str, Any]:
    """Symbols of supports, as the figures draw them."""
    return {
        str(kind): {
            "upright": kind in UPRIGHT,
            "away": kind in AWAY,
            "strokes": [
                {"outline": each.outline.round(4).tolist(), "filled": each.filled}
                for each in strokes
            ],
        }
        for kind, strokes in SYMBOLS.items()
    }


def _study(eset: EquilibriumSet, title: str) -> tuple[str, str]:
    """Beginning of a study file, or why there is none."""
    try:
        return study_text(eset, title), ""
    except InputError as error:
        return "", str(error)

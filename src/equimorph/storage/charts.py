"""Charts and atlases: as HDF5 groups, and as separate files next to that of the set."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py

from equimorph.argument_checks import check_arguments
from equimorph.charts import (
    Atlas,
    Barrier,
    Chart,
    DescriptorChart,
    Projection,
    Reduction,
    rule_from,
)
from equimorph.errors import InputError
from equimorph.storage.hdf import get, get_json, open_file, put, put_json, put_parameters, write
from equimorph.storage.owner import Owner
from equimorph.storage.sets import read_set, write_set
from equimorph.storage.values import read_states
from equimorph.structures import from_identity
from equimorph.tables import units_of

FORMAT = "equimorph chart"
VERSION = 1
"""Version of the layout that is written, the newest that can be read."""
ABOUT, STRUCTURE, CHART = "about", "structure", "chart"
SET, WHOLE, BARRIERS = "set", "whole", "barriers"


@check_arguments
def save_chart(path: str | Path, chart: Chart | Atlas) -> Path:
    """Write a chart or an atlas, with the set that it parameterises, barriers and cuts.

    Parameters
    ----------
    path
        Name of the file.
    chart
        A projection, descriptor chart, reduction or atlas.

    Raises
    ------
    InputError
        If `path` cannot be written, the structure has a callable, the reduction was by a function
        or nearest to a state, or the chart is one of an atlas.
    """

    def fill(file: h5py.File) -> None:
        put_json(file, STRUCTURE, chart.eset.structure.identity())
        write_chart(file.create_group(CHART), chart)

    return write(Path(path), FORMAT, VERSION, fill)


@check_arguments
def load_chart(path: str | Path) -> Chart | Atlas:
    """Read what `save_chart` wrote.

    Raises
    ------
    InputError
        If the file is missing, no chart, newer than this release, truncated or damaged.
    """
    with open_file(Path(path), FORMAT, VERSION) as file:
        return read_chart(file[CHART], Owner(from_identity(get_json(file, STRUCTURE))))


def write_chart(group: h5py.Group, chart: Chart | Atlas) -> None:
    """Write a chart or an atlas with its set into an empty group.

    Refused if the chart belongs to an atlas, or is a reduction by a function or nearest to a state.
    """
    eset = chart.eset
    about: dict[str, Any] = {"kind": type(chart).__name__}
    if isinstance(chart, Reduction):
        about |= {"rule": _rule(chart), "lost": chart.lost}
    elif isinstance(chart, DescriptorChart):
        about["chosen"] = list(chart.names)
    elif not isinstance(chart, Projection | Atlas):
        raise InputError(f"`chart` must not be part of an atlas; got {chart}. Write the atlas.")
    write_set(group.create_group(SET), eset)
    if isinstance(chart, Atlas):
        put(group, "chart", chart.chart, ["cell"], "number of the chart of each cell")
        put(group, "family", chart.family, ["cell"], "number of the stratum it was cut from")
    if isinstance(chart, Reduction):
        write_set(group.create_group(WHOLE), chart.whole)
        put(group, "among", chart.among, ["candidate"], "cells of the whole set with the choice")
        put(group, "cut", chart.cut, ["vertex"], "1 where the preference changes")
        for number, barrier in enumerate(chart.barriers):
            _write_barrier(group.create_group(f"{BARRIERS}/{number}"), barrier)
    put_json(group, ABOUT, about)


def read_chart(group: h5py.Group, owner: Owner) -> Chart | Atlas:
    """Read what `write_chart` wrote.

    Raises `ValueError` if the parts do not belong together.
    """
    about = get_json(group, ABOUT)
    eset = read_set(group[SET], owner)
    if about["kind"] == "Projection":
        return Projection(eset)
    if about["kind"] == "DescriptorChart":
        return DescriptorChart(eset, about["chosen"])
    if about["kind"] == "Atlas":
        chart, family = get(group, "chart"), get(group, "family")
        if not len(chart) == len(family) == len(eset.cells):
            raise ValueError("the charts are not those of the cells")
        return Atlas(eset, chart, family)
    return _read_reduction(group, owner, about)


def _read_reduction(group: h5py.Group, owner: Owner, about: Mapping[str, Any]) -> Reduction:
    eset = read_set(group[SET], owner)
    whole = read_set(group[WHOLE], owner)
    among, cut = get(group, "among"), get(group, "cut").astype(bool)
    if len(cut) != len(eset.points) or not (among < len(whole.cells)).all():
        raise ValueError("the parts of the reduction do not belong together")
    count = len(group[BARRIERS]) if BARRIERS in group else 0
    barriers = tuple(_read_barrier(group[f"{BARRIERS}/{k}"], owner) for k in range(count))
    rule = rule_from(about["rule"], owner.structure)
    return Reduction(eset, whole, rule, among, cut, barriers, about["lost"])


def _rule(chart: Reduction) -> dict[str, str | int | float]:
    if chart.rule.identity is None:
        raise InputError(
            "`chart` must be reduced by a rule that can be written down (lowest, highest, "
            "quasi_static, first_stable_on_path, or nearest to a stratum); "
            f"got one {chart.rule}."
        )
    return dict(chart.rule.identity)


def _write_barrier(group: h5py.Group, barrier: Barrier) -> None:
    put(group, "points", barrier.points, ["point", "coordinate"], "free parameters")
    put(group, "jump", barrier.jump, ["point"], "distance of both sides in the metric")
    put(group, "facets", barrier.facets, [f"facet_{k}" for k in range(barrier.facets.ndim)])
    put_json(group, "kind", barrier.kind)
    for side, states in (("near", barrier.near), ("far", barrier.far)):
        own = group.create_group(side)
        put(own, "z", states.z, ["state", "unknown"], "unknowns and multipliers")
        put_parameters(own, units_of(states.structure.parameters), {"p": states.p}, "state")


def _read_barrier(group: h5py.Group, owner: Owner) -> Barrier:
    near, far = (read_states(group[side], owner) for side in ("near", "far"))
    return Barrier(
        get_json(group, "kind"), get(group, "points"), near, far, get(group, "jump"),
        get(group, "facets"),
    )  # fmt: skip

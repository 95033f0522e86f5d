"""Routes as HDF5 groups: path, events, snaps, schedule, or the reason of a refusal."""

import h5py
import numpy as np

from equimorph.equilibria import Event, Path
from equimorph.model import Schedule
from equimorph.storage.hdf import get, get_json, put, put_coordinate, put_json, put_parameters
from equimorph.storage.owner import Owner
from equimorph.storage.values import read_value, write_value
from equimorph.structures import State, States, Structure
from equimorph.tables import units_of
from equimorph.tasks.route import Route

ABOUT, EVENTS, SCHEDULE, SNAPS, BOTTLENECK = "about", "events", "schedule", "snaps", "bottleneck"
SURVIVAL = "survival"


def write_route(group: h5py.Group, route: Route) -> None:
    """Write a route into an empty group."""
    words = {"status": route.status, "why": route.why, "way_points": route.way_points}
    words |= {"objective": route.objective}
    put_json(group, ABOUT, words)
    # Attributes, because a refused route has none of them and JSON knows no NaN.
    group.attrs.update(margin=route.margin, length=route.length, cost=route.cost)
    if route.path is not None:
        _write_path(group, route.path)
    if route.schedule is not None:
        _write_schedule(group.create_group(SCHEDULE), route.schedule)
    if route.snaps:
        write_value(group.create_group(SNAPS), route.snaps)
    if route.bottleneck is not None:
        write_value(group.create_group(BOTTLENECK), route.bottleneck)
    if route.survival is not None:
        write_value(group.create_group(SURVIVAL), route.survival)


def read_route(group: h5py.Group, owner: Owner) -> Route:
    """Read what `write_route` wrote."""
    about = get_json(group, ABOUT)
    return Route(
        status=about["status"],
        why=about["why"],
        way_points=about["way_points"],
        objective=about.get("objective", "length"),  # older files have neither this
        cost=float(group.attrs.get("cost", np.nan)),  # nor this
        margin=float(group.attrs["margin"]),
        length=float(group.attrs["length"]),
        path=_read_path(group, owner.structure) if "z" in group else None,
        schedule=_read_schedule(group[SCHEDULE]) if SCHEDULE in group else None,
        snaps=read_value(group[SNAPS], owner) if SNAPS in group else (),
        bottleneck=read_value(group[BOTTLENECK], owner) if BOTTLENECK in group else None,
        survival=read_value(group[SURVIVAL], owner) if SURVIVAL in group else None,
    )


def _write_path(group: h5py.Group, path: Path) -> None:
    put(group, "z", path.states.z, ["point", "unknown"], "unknowns and multipliers")
    units = units_of(path.states.structure.parameters)
    put_parameters(group, units, {"p": path.states.p}, "point")
    put(group, "at", path.at, ["point"], "segment + share of it")
    put(group, "length", path.length, ["point"], "length from the start")
    put(group, "index", path.index, ["point"], "negative eigenvalues; 0 is stable")
    states = [event.state for event in path.events]
    put(group, "event_z", np.array([s.z for s in states]), ["event", "unknown"])
    put_parameters(group, units, {"event_p": np.array([s.p for s in states])}, "event")
    words = [[e.kind, e.at, e.criticality, e.detail] for e in path.events]
    put_json(group, EVENTS, words)


def _read_path(group: h5py.Group, structure: Structure) -> Path:
    states = zip(get(group, "event_z"), get(group, "event_p"), strict=True)
    events = [
        Event(kind, State(structure, z, p), at, criticality, detail)
        for (z, p), (kind, at, criticality, detail) in zip(
            states, get_json(group, EVENTS), strict=True
        )
    ]
    return Path(
        states=States(structure, get(group, "z"), get(group, "p")),
        at=get(group, "at"),
        length=get(group, "length"),
        index=get(group, "index"),
        events=tuple(events),
    )


IN_TIME = ("times", "velocities", "accelerations")
"""Fields of schedules that have times; files of older releases have none."""


def _write_schedule(group: h5py.Group, schedule: Schedule) -> None:
    moments = {name: getattr(schedule, name) for name in ("velocities", "accelerations")}
    arrays = {name: each for name, each in moments.items() if each is not None}
    units = dict(zip(schedule.names, schedule.units, strict=True))
    put_parameters(group, units, {"values": schedule.values, **arrays}, "step")
    if schedule.times is not None:
        put(group, "times", schedule.times, ["step"], "time", schedule.time_unit)
    put(group, "progress", schedule.progress, ["step"], "share of the length")
    put(group, "margins", schedule.margins, ["step"], "stability margin")
    put(group, "way_points", schedule.way_points, ["corner"], "steps at the corners")
    table = list(schedule.descriptors.values())
    table_array = np.array(table).reshape(len(table), len(schedule.progress))
    if "descriptor" not in group:
        put_coordinate(group, "descriptor", np.array([*schedule.descriptors], object), "name")
    put(group, "descriptors", table_array, ["descriptor", "step"], "descriptors")
    about = {
        "names": schedule.names,
        "roles": schedule.roles,
        "units": schedule.units,
        "descriptors": list(schedule.descriptors),
        "start": schedule.start,
        "time_unit": schedule.time_unit,
    }
    put_json(group, ABOUT, about)


def _read_schedule(group: h5py.Group) -> Schedule:
    about = get_json(group, ABOUT)
    return Schedule(
        names=tuple(about["names"]),
        roles=tuple(about["roles"]),
        units=tuple(about["units"]),
        values=get(group, "values"),
        progress=get(group, "progress"),
        margins=get(group, "margins"),
        descriptors=dict(zip(about["descriptors"], get(group, "descriptors"), strict=True)),
        start=about["start"],
        way_points=get(group, "way_points"),
        time_unit=about.get("time_unit", "T"),
        **{name: get(group, name) for name in IN_TIME if name in group},
    )

"""Maps over actuator settings: as HDF5 groups, and as tables for people."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int
from equimorph.model import Grid
from equimorph.storage.files import write_csv
from equimorph.storage.hdf import get, get_json, put, put_coordinate, put_json, put_parameters
from equimorph.storage.owner import Owner, words_of
from equimorph.structures import States, Structure, join_states
from equimorph.tables import units_of
from equimorph.tasks.maps.actuator_map import ActuatorMap, natural_states_over
from equimorph.tasks.maps.curvature import CurvatureMap
from equimorph.tasks.maps.curves import MapCurve
from equimorph.tasks.maps.limit_load import LimitLoadMap

ABOUT = "about"


def write_map_group(group: h5py.Group, amap: ActuatorMap) -> None:
    """Write a map with its grid lines as coordinates; the curves one after the other."""
    first, second = amap.grid.names
    units = units_of(amap.structure.parameters)
    for name, axis in zip((first, second), amap.grid.axes(), strict=True):
        put_coordinate(group, name, axis, name, units[name])
    kinds = "; ".join(f"{k}: {kind}" for k, kind in enumerate(amap.kinds))
    shown = amap.descriptor.name if isinstance(amap, CurvatureMap) else f"limit of {amap.load}"
    put(group, "value", amap.value, [first, second], shown, amap.unit)
    put(group, "status", amap.status, [first, second], kinds)
    put(group, "z", amap.states.z, ["setting", "unknown"], "unknowns and multipliers, row by row")
    put_parameters(group, units, {"p": amap.states.p}, "setting")
    curves = amap.curves
    put(group, "curve_kind", np.array([c.kind for c in curves], dtype=object), ["curve"])
    ends = np.cumsum([len(c.points) for c in curves], dtype=np.int64)
    put(group, "curve_end", ends, ["curve"], "points before the end of each curve")
    put(
        group,
        "curve_point",
        _stack_curves(curves, "points"),
        ["point", "coordinate"],
        "settings",
    )
    put(
        group,
        "curve_value",
        _stack_curves(curves, "values"),
        ["point", "side"],
        "lower and higher",
        amap.unit,
    )
    errors = np.concatenate([np.zeros(0), *(c.errors for c in curves)])
    put(group, "curve_error", errors, ["point"], "bound of the error along the grid line")
    states = join_states(amap.structure, [each.states for each in curves])
    put(group, "curve_z", states.z, ["point", "unknown"], "unknowns and multipliers")
    put_parameters(group, units, {"curve_p": states.p}, "point")
    put_json(group, ABOUT, _about(amap))


def read_map_group(group: h5py.Group, owner: Owner) -> ActuatorMap:
    """Read what `write_map_group` wrote; natural states are computed again."""
    about, structure = get_json(group, ABOUT), owner.structure
    grid = Grid(**about["grid"])
    shared: dict[str, Any] = {
        "structure": structure,
        "grid": grid,
        "load": about["load"],
        "within": tuple(map(owner.constraint, about["within"])),
        "fixed": about["fixed"],
        "value": get(group, "value"),
        "status": get(group, "status"),
        "states": States(structure, get(group, "z"), get(group, "p")),
        "curves": _curves(group, structure),
        "sheet": natural_states_over(structure, grid, about["load"], about["fixed"]),
        "bound": about["bound"],
    }
    if "at" not in about:
        return LimitLoadMap(**shared)
    return CurvatureMap(**shared, at=about["at"], descriptor=owner.descriptor(about["descriptor"]))


def _about(amap: ActuatorMap) -> dict[str, Any]:
    box, names = amap.grid.box, amap.grid.names
    sides = zip(names, box.lower.tolist(), box.upper.tolist(), amap.grid.intervals, strict=True)
    about = {
        "grid": {name: [low, high, count] for name, low, high, count in sides},
        "load": amap.load,
        "within": [words_of(each) for each in amap.within],
        "fixed": dict(amap.fixed),
        "bound": amap.bound,
    }
    if isinstance(amap, CurvatureMap):
        about |= {"at": amap.at, "descriptor": amap.descriptor.name}
    return about


def _stack_curves(curves: tuple[MapCurve, ...], name: str) -> Float[np.ndarray, "points 2"]:
    return np.concatenate([np.zeros((0, 2)), *(getattr(c, name) for c in curves)])


def _curves(group: h5py.Group, structure: Structure) -> tuple[MapCurve, ...]:
    kinds, ends = get(group, "curve_kind"), get(group, "curve_end")
    if not len(kinds):
        return ()
    parts = [_split(group, name, ends) for name in ("z", "p", "point", "value", "error")]
    return tuple(
        MapCurve(str(kind), States(structure, z, p), points, values, errors)
        for kind, z, p, points, values, errors in zip(kinds, *parts, strict=True)
    )


def _split(group: h5py.Group, name: str, ends: Int[np.ndarray, " curves"]) -> list[np.ndarray]:
    return np.split(get(group, f"curve_{name}"), ends[:-1])


@check_arguments
def write_map(amap: ActuatorMap, path: str | Path) -> tuple[Path, Path]:
    """Write the values of a map, setting by setting, and its curves, point by point.

    Parameters
    ----------
    amap
        The map.
    path
        Name of the table of the grid, ending in ``.csv``; that of the curves ends in
        ``-curves.csv``. A cell without a value is empty; "error"
        bounds that of a place along its grid line.

    Raises
    ------
    InputError
        If the files cannot be written.
    """
    table = Path(path)
    curves = table.with_name(f"{table.stem}-curves.csv")
    return write_csv(table, amap.table.rows()), write_csv(curves, amap.curve_table.rows())

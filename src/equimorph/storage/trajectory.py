"""Schedules in time as trajectories that robot controllers read: ROS 2 JointTrajectory messages."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError, suggestion
from equimorph.model import Schedule
from equimorph.model.units import UNITS, read_unit
from equimorph.storage.files import write_text

NANOSECONDS = 1_000_000_000
ANGLE, LENGTH = "rad", (0, 1, 0)
DERIVATIVES = ("positions", "velocities", "accelerations")


@check_arguments
def write_trajectory(
    schedule: Schedule,
    path: str | Path,
    joints: Mapping[str, str] | None = None,
    *,
    seconds: float | None = None,
) -> Path:
    """Write the actuators of a schedule in time as a ``trajectory_msgs/msg/JointTrajectory``.

    Positions are in radians and metres, as REP 103 of ROS asks; velocities and accelerations are
    there if the schedule has them, else controllers interpolate linearly.

    Parameters
    ----------
    schedule
        With times, like those of `retime`.
    path
        Ending in ``.yaml`` or ``.json``.
    joints
        Names of the controller's joints by parameter: ``{"theta_A": "shoulder"}``, and in their
        order. None: all actuators that move, under their own names.
    seconds
        Length of the unit of time in seconds, for schedules that do not count seconds.

    Returns
    -------
    The file written.

    Raises
    ------
    InputError
        If the schedule has no times, or times in another unit and no `seconds`, for an unknown
        parameter or one that is neither an angle nor a length, or another ending.
    """
    place = Path(path)
    message = trajectory_message(schedule, joints, seconds=seconds)
    if place.suffix in (".yaml", ".yml"):
        write_text(place, "\n".join(_yaml_lines(message)) + "\n")
    elif place.suffix == ".json":
        write_text(place, json.dumps(message, indent=1) + "\n")
    else:
        raise InputError(f"`path` must end in .yaml, .yml or .json; got {place.name!r}.")
    return place


@check_arguments
def trajectory_message(
    schedule: Schedule, joints: Mapping[str, str] | None = None, *, seconds: float | None = None
) -> dict[str, Any]:
    """Fields of the message of `write_trajectory` as plain data, to be sent from Python.

    Raises
    ------
    InputError
        As `write_trajectory`.

    Examples
    --------
    ``em.storage.trajectory_message(motion.schedule)["points"][0]["time_from_start"]``
    """
    schedule.at(0.0)  # refuses a schedule without times
    unit = _seconds(schedule, seconds)
    named = _moving_actuators(schedule) if joints is None else dict(joints)
    columns = [_column(schedule, name) for name in named]
    factors = np.array([_factor(schedule.names[k], schedule.units[k]) for k in columns])
    given = (schedule.values, schedule.velocities, schedule.accelerations)
    parts = {
        name: values[:, columns] * factors / unit**order
        for order, (name, values) in enumerate(zip(DERIVATIVES, given, strict=True))
        if values is not None
    }
    assert schedule.times is not None
    points = [
        {
            **{name: values[k].tolist() for name, values in parts.items()},
            "time_from_start": _duration(time * unit),
        }
        for k, time in enumerate(schedule.times.tolist())
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": header, "joint_names": list(named.values()), "points": points}


def _seconds(schedule: Schedule, seconds: float | None) -> float:
    if schedule.time_unit == "s" and seconds is None:
        return 1.0
    if seconds is None:
        raise InputError(
            f"`seconds` must be given for a schedule that counts in {schedule.time_unit}; got "
            "none. Give the length of this unit, or units to the structure."
        )
    return seconds


def _column(schedule: Schedule, name: str) -> int:
    if name not in schedule.names:
        raise InputError(
            f"`joints` must name parameters ({', '.join(schedule.names)}); got {name!r}."
            f"{suggestion(name, schedule.names)}"
        )
    return schedule.names.index(name)


def _moving_actuators(schedule: Schedule) -> dict[str, str]:
    """Actuators that move, under their own names."""
    roles = dict(zip(schedule.names, schedule.roles, strict=True))
    return {name: name for name in schedule.moving if roles[name] == "actuator"}


def _factor(name: str, unit: str) -> float:
    """Radians or metres in one unit of a parameter."""
    if unit == ANGLE:
        return 1.0
    known = {word: UNITS[word] for word in UNITS if UNITS[word][1] == LENGTH}
    if unit not in known:
        raise InputError(
            f"`joints` must be angles in rad or lengths in {', '.join(known)}; got {name} in "
            f"{unit or '1'}."
        )
    return read_unit(unit, known, name)[0]


def _duration(time: float) -> dict[str, int]:
    sec, nanosec = divmod(round(time * NANOSECONDS), NANOSECONDS)
    return {"sec": sec, "nanosec": nanosec}


def _yaml_lines(message: Mapping[str, Any]) -> list[str]:
    """YAML of the message; numbers as decimals, which YAML never takes for texts."""
    lines = ["header:", "  stamp: {sec: 0, nanosec: 0}", '  frame_id: ""', "joint_names:"]
    lines += [f"- {json.dumps(name)}" for name in message["joint_names"]]
    lines.append("points:")
    for point in message["points"]:
        sign = "-"
        for name in DERIVATIVES:
            if name in point:
                numbers = ", ".join(np.format_float_positional(x, trim="0") for x in point[name])
                lines.append(f"{sign} {name}: [{numbers}]")
                sign = " "
        time = point["time_from_start"]
        lines.append(f"  time_from_start: {{sec: {time['sec']}, nanosec: {time['nanosec']}}}")
    return lines

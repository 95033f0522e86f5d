import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.storage import read_schedule, trajectory_message, write_schedule, write_trajectory
from equimorph.storage.schedule import _checksum


@pytest.fixture
def schedule() -> Schedule:
    rng = np.random.default_rng(5)
    return Schedule(
        names=("Theta", "Delta", "q", "nu"),
        roles=("actuator", "actuator", "load", "fixed"),
        units=("rad", "rad", "4π²B/L²", "L"),
        values=np.column_stack([rng.normal(size=(7, 2)), np.full(7, 2.5), np.full(7, 0.84)]),
        progress=np.linspace(0.0, 1.0, 7),
        margins=rng.uniform(size=7),
        descriptors={"max_curvature": rng.uniform(size=7), "height(0.5)": rng.normal(size=7)},
        start={"structure": {"kind": "rod", "load": "uniform"}, "unknowns": [0.1, 1 / 3]},
        way_points=np.array([0, 3, 6]),
        descriptor_units={"max_curvature": "1/L", "height(0.5)": "L"},
    )


@pytest.fixture
def written(schedule: Schedule, tmp_path: Path) -> Path:
    return write_schedule(schedule, tmp_path / "route.csv")[0]


def test_a_schedule_comes_back_bit_for_bit(schedule: Schedule, written: Path):
    """Identity. Tolerance: none, the shortest decimals of a double give the double back."""
    back = read_schedule(written)
    for name in ("values", "progress", "margins", "way_points"):
        np.testing.assert_array_equal(getattr(back, name), getattr(schedule, name))
    for name in ("names", "roles", "units", "start", "descriptor_units"):
        assert getattr(back, name) == getattr(schedule, name)
    assert list(back.descriptors) == list(schedule.descriptors)
    for name, values in schedule.descriptors.items():
        np.testing.assert_array_equal(back.descriptors[name], values)


def test_the_table_has_a_header_and_one_row_per_step(written: Path):
    header, *rows = written.read_text().splitlines()
    assert header == (
        "progress,Theta (rad),Delta (rad),q (4π²B/L²),nu (L),stability_margin,"
        "max_curvature (1/L),height(0.5) (L)"
    )
    assert len(rows) == 7


def test_the_sidecar_says_what_is_held_and_what_the_loads_are(written: Path):
    sidecar = json.loads(written.with_suffix(".json").read_text())
    assert sidecar["loads"] == {"q": 2.5}
    assert sidecar["start"]["structure"]["kind"] == "rod"


def test_a_varying_load_is_found_in_the_table(schedule: Schedule, tmp_path: Path):
    values = schedule.values.copy()
    values[:, 2] = np.linspace(0.0, 2.5, 7)
    files = write_schedule(replace(schedule, values=values), tmp_path / "ramp.csv")
    assert json.loads(files[1].read_text())["loads"] == {"q": "varies: see the table"}


def test_a_table_saved_again_by_a_spreadsheet_is_read(schedule: Schedule, written: Path):
    """Other line ends and padded decimals are the same numbers."""
    lines = written.read_text().splitlines()
    written.write_bytes("\r\n".join([*lines[:1], *(f"{line}0" for line in lines[1:])]).encode())
    # A zero is appended to the last column only; repr always has a decimal point here.
    np.testing.assert_array_equal(read_schedule(written).values, schedule.values)


def _edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_a_changed_number_is_found(written: Path):
    _edit(written, "2.5", "2.6")
    with pytest.raises(InputError, match="must hold the numbers that were written"):
        read_schedule(written)


def test_a_changed_sidecar_is_found(written: Path):
    _edit(written.with_suffix(".json"), '"kind": "rod"', '"kind": "beam"')
    with pytest.raises(InputError, match="changed sidecar"):
        read_schedule(written)


def test_a_cut_table_is_refused(written: Path):
    written.write_text(written.read_text()[:-30])
    with pytest.raises(InputError, match=r"damaged|other"):
        read_schedule(written)


def test_an_empty_table_is_refused(written: Path):
    written.write_text("")
    with pytest.raises(InputError, match="damaged"):
        read_schedule(written)


def test_a_sidecar_that_is_no_json_is_refused(written: Path):
    written.with_suffix(".json").write_text("{")
    with pytest.raises(InputError, match="must be JSON"):
        read_schedule(written)


def test_a_foreign_sidecar_is_refused(written: Path):
    written.with_suffix(".json").write_text('{"format": "something else"}')
    with pytest.raises(InputError, match="sidecar of an equimorph schedule"):
        read_schedule(written)


def test_a_sidecar_without_keys_is_refused(written: Path):
    written.with_suffix(".json").write_text('{"format": "equimorph schedule", "version": 1}')
    with pytest.raises(InputError):
        read_schedule(written)


def test_a_newer_schedule_is_refused(written: Path):
    _edit(written.with_suffix(".json"), '"version": 3', '"version": 4')
    with pytest.raises(InputError, match="must have version 3 or less; got 4"):
        read_schedule(written)


def test_a_missing_sidecar_is_named(written: Path):
    written.with_suffix(".json").unlink()
    with pytest.raises(InputError, match=r"route\.json"):
        read_schedule(written)


def test_another_ending_is_refused(schedule: Schedule, tmp_path: Path):
    with pytest.raises(InputError, match=r"must end in \.csv"):
        write_schedule(schedule, tmp_path / "route.txt")


def test_a_folder_that_is_a_file_is_refused_and_left_alone(schedule: Schedule, tmp_path: Path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="can be written"):
        write_schedule(schedule, tmp_path / "file" / "route.csv")
    assert (tmp_path / "file").read_text() == "mine"


def test_the_order_of_keys_in_the_sidecar_does_not_count(schedule: Schedule, written: Path):
    sidecar = written.with_suffix(".json")
    content = json.loads(sidecar.read_text())
    sidecar.write_text(json.dumps(dict(reversed(content.items()))))
    assert read_schedule(written).names == schedule.names


@pytest.fixture
def motion(schedule: Schedule) -> Schedule:
    """The schedule in seconds, with rates and accelerations of what moves."""
    rates = np.zeros((2, 7, 4))
    rates[:, :, :2] = np.random.default_rng(6).normal(size=(2, 7, 2))
    return replace(
        schedule, times=np.linspace(0.0, 1.2, 7), velocities=rates[0], accelerations=rates[1],
        time_unit="s",
    )  # fmt: skip


def test_a_schedule_without_units_of_descriptors_is_read(schedule: Schedule, written: Path):
    """Version 2: their columns had names alone."""
    text = written.read_text()
    written.write_text(text.replace(" (1/L)", "").replace("(0.5) (L)", "(0.5)"))
    sidecar = json.loads(written.with_suffix(".json").read_text())
    del sidecar["checksum"], sidecar["descriptor_units"]
    sidecar["version"] = 2
    table = np.array([[float(each) for each in line.split(",")] for line in text.splitlines()[1:]])
    sidecar["checksum"] = _checksum(sidecar, table)
    written.with_suffix(".json").write_text(json.dumps(sidecar))
    back = read_schedule(written)
    np.testing.assert_array_equal(
        back.descriptors["height(0.5)"], schedule.descriptors["height(0.5)"]
    )
    assert back.descriptor_units == {}


@pytest.mark.parametrize("name", ["motion.csv", "motion.json"])
def test_a_motion_comes_back_bit_for_bit(motion: Schedule, tmp_path: Path, name: str):
    """Identity, from a table with its sidecar and from JSON alone."""
    files = write_schedule(motion, tmp_path / name)
    assert len(files) == (2 if name.endswith("csv") else 1)
    back = read_schedule(tmp_path / name)
    for each in ("times", "values", "velocities", "accelerations", "margins", "way_points"):
        np.testing.assert_array_equal(getattr(back, each), getattr(motion, each))
    assert (back.time_unit, back.names, back.start) == ("s", motion.names, motion.start)
    assert back.descriptor_units == motion.descriptor_units
    np.testing.assert_array_equal(back.at(0.7), motion.at(0.7))


def test_the_header_of_a_motion_has_units(motion: Schedule, tmp_path: Path):
    header = write_schedule(motion, tmp_path / "motion.csv")[0].read_text().splitlines()[0]
    assert header.startswith("time (s),progress,Theta (rad),Delta (rad),q (4π²B/L²),nu (L),")
    assert header.endswith(
        "Theta rate (rad/s),Delta rate (rad/s),Theta acceleration (rad/s²),"
        "Delta acceleration (rad/s²)"
    )


def test_a_schedule_of_the_first_release_is_read(schedule: Schedule, written: Path):
    """Its header had no units, its sidecar neither times nor derivatives."""
    lines = written.read_text().splitlines()
    lines[0] = "progress,Theta,Delta,q,nu,stability_margin,max_curvature,height(0.5)"
    written.write_text("\n".join(lines) + "\n")
    sidecar = json.loads(written.with_suffix(".json").read_text())
    for key in ("checksum", "time_unit", "derivatives", "descriptor_units"):
        del sidecar[key]
    sidecar["version"] = 1
    table = np.array([[float(each) for each in line.split(",")] for line in lines[1:]])
    sidecar["checksum"] = _checksum(sidecar, table)
    written.with_suffix(".json").write_text(json.dumps(sidecar))
    back = read_schedule(written)
    np.testing.assert_array_equal(back.values, schedule.values)
    assert back.times is None


def test_json_alone_that_was_changed_is_found(motion: Schedule, tmp_path: Path):
    write_schedule(motion, tmp_path / "motion.json")
    _edit(tmp_path / "motion.json", "0.2", "0.25")
    with pytest.raises(InputError, match="must hold the numbers that were written"):
        read_schedule(tmp_path / "motion.json")


def test_the_sidecar_of_a_table_is_no_schedule_alone(written: Path):
    with pytest.raises(InputError, match="or the sidecar of a table, whose name ends in"):
        read_schedule(written.with_suffix(".json"))


def test_a_trajectory_has_the_fields_of_the_ros_message(motion: Schedule, tmp_path: Path):
    """trajectory_msgs/JointTrajectory: joint names, points with times in sec and nanosec."""
    path = write_trajectory(motion, tmp_path / "motion.json", {"Delta": "left", "Theta": "right"})
    message = json.loads(path.read_text())
    assert message == trajectory_message(motion, {"Delta": "left", "Theta": "right"})
    assert list(message) == ["header", "joint_names", "points"]
    assert message["joint_names"] == ["left", "right"]
    point = message["points"][6]
    assert point["time_from_start"] == {"sec": 1, "nanosec": 200_000_000}
    assert point["positions"] == motion.values[6, [1, 0]].tolist()
    assert point["accelerations"] == motion.accelerations[6, [1, 0]].tolist()


def test_the_yaml_of_a_trajectory_holds_the_numbers_of_the_json(motion: Schedule, tmp_path: Path):
    """Flow lists are JSON, too: every line of numbers is read as such."""
    tiny = replace(motion, velocities=motion.velocities * 1e-7)
    lines = write_trajectory(tiny, tmp_path / "motion.yaml").read_text().splitlines()
    message = trajectory_message(tiny)
    assert lines[3:6] == ["joint_names:", '- "Theta"', '- "Delta"']
    for word in ("positions", "velocities", "accelerations"):
        found = [json.loads(line.split(": ")[1]) for line in lines if f"{word}:" in line]
        assert found == [point[word] for point in message["points"]]
    assert sum("e-" in line for line in lines) == 0
    assert lines[-1] == "  time_from_start: {sec: 1, nanosec: 200000000}"


def test_lengths_become_metres_and_units_of_time_seconds(motion: Schedule):
    """2 mm/T are 0.004 m/s where T is half a second."""
    units = ("mm", *motion.units[1:])
    given = replace(motion, units=units, time_unit="T")
    message = trajectory_message(given, {"Theta": "slide"}, seconds=0.5)
    assert message["points"][1]["velocities"][0] == pytest.approx(motion.velocities[1, 0] * 2e-3)
    assert message["points"][6]["time_from_start"] == {"sec": 0, "nanosec": 600_000_000}


def test_wrong_trajectories_are_refused(schedule: Schedule, motion: Schedule, tmp_path: Path):
    """One line each."""
    with pytest.raises(InputError, match="`schedule` must have times"):
        trajectory_message(schedule)
    with pytest.raises(InputError, match="`seconds` must be given for a schedule that counts in T"):
        trajectory_message(replace(motion, time_unit="T"))
    with pytest.raises(InputError, match="`joints` must be angles in rad or lengths in m, mm"):
        trajectory_message(motion, {"q": "load"})
    with pytest.raises(InputError, match=r"`joints` must name parameters .*; got 'theta'"):
        trajectory_message(motion, {"theta": "a"})
    with pytest.raises(InputError, match=r"`path` must end in \.yaml, \.yml or \.json"):
        write_trajectory(motion, tmp_path / "motion.txt")


@pytest.mark.parametrize("name", ["table.csv", "alone.json"])
@pytest.mark.parametrize(
    "descriptors",
    [
        {"x (m)": ""},
        {"y": "m", "y (m)": ""},
        {"F": "", "F (descriptor)": ""},
        {"F (descriptor)": "", "F": "N"},
        {"x rate": "m/s", "time (s)": "1"},
        {'a, "b"': "", "c\nd": "κ²", "": "", "=1+1": ""},
    ],
)
def test_names_that_look_like_other_heads_come_back(tmp_path: Path, name: str, descriptors):
    """136 of 5 588 schedules with such names came back with other numbers, 171 as a KeyError."""
    rng = np.random.default_rng(1)
    schedule = Schedule(
        names=("F", "x", "time"),
        roles=("load", "actuator", "actuator"),
        units=("N", "m", "s"),
        values=rng.normal(size=(3, 3)),
        progress=np.linspace(0.0, 1.0, 3),
        margins=rng.uniform(size=3),
        descriptors={each: rng.normal(size=3) for each in descriptors},
        start={"structure": None, "unknowns": [0.1]},
        times=np.array([0.0, 0.5, 2.0]),
        velocities=rng.normal(size=(3, 3)),
        time_unit="s",
        descriptor_units=descriptors,
    )
    back = read_schedule(write_schedule(schedule, tmp_path / name)[-1 if "json" in name else 0])
    for field in ("values", "times", "velocities"):
        np.testing.assert_array_equal(getattr(back, field), getattr(schedule, field))
    assert list(back.descriptors) == list(descriptors)
    for each, values in schedule.descriptors.items():
        np.testing.assert_array_equal(back.descriptors[each], values)

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.storage import read_schedule, write_schedule


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
    )


@pytest.fixture
def written(schedule: Schedule, tmp_path: Path) -> Path:
    return write_schedule(schedule, tmp_path / "route.csv")[0]


def test_a_schedule_comes_back_bit_for_bit(schedule: Schedule, written: Path):
    """Identity. Tolerance: none, the shortest decimals of a double give the double back."""
    back = read_schedule(written)
    for name in ("values", "progress", "margins", "way_points"):
        np.testing.assert_array_equal(getattr(back, name), getattr(schedule, name))
    for name in ("names", "roles", "units", "start"):
        assert getattr(back, name) == getattr(schedule, name)
    assert list(back.descriptors) == list(schedule.descriptors)
    for name, values in schedule.descriptors.items():
        np.testing.assert_array_equal(back.descriptors[name], values)


def test_the_table_has_a_header_and_one_row_per_step(written: Path):
    header, *rows = written.read_text().splitlines()
    assert header == "progress,Theta,Delta,q,nu,stability_margin,max_curvature,height(0.5)"
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
    _edit(written.with_suffix(".json"), '"version": 1', '"version": 2')
    with pytest.raises(InputError, match="must have version 1; got 2"):
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

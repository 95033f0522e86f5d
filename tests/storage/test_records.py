"""Results of tasks, written field by field and read back."""

import h5py
import numpy as np
import pytest

import equimorph as em
from equimorph.storage.owner import Owner
from equimorph.storage.records import content_of, load_record
from equimorph.storage.values import read_value, write_value
from equimorph.structures.quantities import find_descriptor
from same_records import assert_equal


@pytest.fixture(scope="module")
def spring():
    return em.Spring()


@pytest.fixture(scope="module")
def eset(spring):
    return em.equilibrium_set(spring, em.Box(x_l=(0.5, 1.3), F=(-0.2, 0.2)), intervals=(9, 9))


def back(tmp_path, record, structure):
    with h5py.File(tmp_path / "record.h5", "w") as file:
        write_value(file.create_group("record"), record)
    with h5py.File(tmp_path / "record.h5") as file:
        return read_value(file["record"], Owner(structure))


def test_shapes_with_their_routes_come_back(tmp_path, eset, spring):
    start = eset.at(x_l=0.8, F=0.0).stable[0]
    found = em.solve_shape(
        eset, {spring.descriptor("angle"): 0.4, em.value_of(spring, "F"): 0.01}, start=start
    )
    assert found.solved
    again = back(tmp_path, found, spring)
    assert_equal(again, found)
    with pytest.raises(em.InputError, match="must be solved again"):
        again.nearest  # noqa: B018


def test_a_motion_that_is_refused_comes_back(tmp_path, spring):
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.02}).end.state
    refused = em.track(start, {spring.descriptor("angle"): 0.1}, actuators={"x_l": (0.5, 0.85)})
    assert refused.failure == "actuator limit"
    assert_equal(back(tmp_path, refused, spring), refused)


def test_an_estimate_comes_back(tmp_path, eset, spring):
    angle = spring.descriptor("angle")
    known = em.estimate_state(eset, {angle: 0.5, "x_l": 0.8}, errors={angle: 0.01, "x_l": 0.01})
    assert_equal(back(tmp_path, known, spring), known)


def test_numbers_that_json_does_not_know(tmp_path, spring):
    route = em.Route("refused", "why not", [{"x_l": 1.0}])
    again = back(tmp_path, route, spring)
    assert np.isnan(again.margin)
    assert again.way_points == [{"x_l": 1.0}]


def test_functions_are_refused_by_the_place_they_stand_at(tmp_path):
    with (
        h5py.File(tmp_path / "record.h5", "w") as file,
        pytest.raises(em.InputError, match=r"`0` must be data that a file can hold; got builtin"),
    ):
        write_value(file.create_group("record"), {"x_l": abs})


@pytest.mark.parametrize(
    "text",
    [
        "x_l",
        "effort(F)",
        "stability_margin",
        "distance(disc(0.5, 0.2, 0.1))",
        "distance(half_plane(0, 0, 0, 1))",
        "outside(x_l 1 to 2, F 0 to 0.1)",
        "shape_y(0.28)",
        "angle",
    ],
)
def test_descriptors_by_name(spring, text):
    found = find_descriptor(spring, text)
    assert find_descriptor(spring, found.name) == found


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("effort(y)", "must be a parameter"),
        ("distance(disc(1, 2))", "must be that from half_plane"),
        ("distance(disc(1, 2, r))", "must be that from half_plane"),
        ("outside(x_l 1)", "must read like outside"),
        ("outside(x_l 2 to 1)", "lower < upper"),
        ("shape_y(2)", "`s` must be a share of the length, from 0 to 1; got 2"),
        ("shape_y(s)", "must be at a number"),
        ("curl", "curl"),
    ],
)
def test_names_that_mean_nothing(spring, text, problem):
    with pytest.raises(em.InputError, match=problem):
        find_descriptor(spring, text)


def test_a_descriptor_of_the_caller_is_found_by_its_name(tmp_path, eset, spring):
    """Files hold names: the reader gives the descriptors that are its own."""
    steep = em.Descriptor("steep", "1", lambda z, p: np.tan(z[:, 0]), "s", spring.signature)
    targets = {spring.descriptor("angle"): 0.4, em.value_of(spring, "F"): 0.01}
    found, file = em.solve_shape(eset, targets, within=[steep <= 0.5]), tmp_path / "shapes.h5"
    file.write_bytes(content_of(found))
    assert_equal(load_record(file, spring, {"steep": steep}), found)
    with pytest.raises(em.InputError, match="steep"):
        load_record(file, spring)

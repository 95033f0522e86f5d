import os
from pathlib import Path

import pytest

from equimorph.errors import InputError
from equimorph.storage.files import fingerprint, lock_file, replacing, write_text


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(tmp_path: Path):
    target = write_text(tmp_path / "a.txt", "old")

    def write_half() -> None:
        with replacing(target) as partial:
            partial.write_text("half of the ne")
            raise KeyError

    with pytest.raises(KeyError):
        write_half()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_new_file_has_the_permissions_of_any_new_file(tmp_path: Path):
    plain = tmp_path / "plain"
    plain.touch()
    assert write_text(tmp_path / "a.txt", "").stat().st_mode == plain.stat().st_mode


def test_a_missing_folder_is_an_input_error(tmp_path: Path):
    with pytest.raises(InputError, match="No such file or directory"):
        write_text(tmp_path / "none" / "a.txt", "")


def test_a_place_in_use_is_refused_with_its_user(tmp_path: Path):
    path = tmp_path / "lock"
    with lock_file(path, "results"), pytest.raises(InputError) as found, lock_file(path, "results"):
        pass
    assert str(found.value).startswith("`results` must not be in use by another run; got one that")
    assert f"process {os.getpid()} on " in str(found.value)
    with lock_file(path, "results"):
        pass


def test_fingerprints_tell_content_from_order():
    first, second = {"a": 1, "b": {"c": 2, "d": [1, 2]}}, {"b": {"d": [1, 2], "c": 2}, "a": 1}
    assert fingerprint(first) == fingerprint(second)
    assert fingerprint(first) != fingerprint({"a": 1, "b": {"c": 2, "d": [2, 1]}})

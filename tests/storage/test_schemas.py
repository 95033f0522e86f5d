"""Files of older releases are read; a record that cannot be read is named, and the rest is read."""

import json
import lzma
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.storage import load_set, read_results, schemas, write_results
from equimorph.storage.schemas import Change, Schema, UnreadableError
from equimorph.structures import Spring
from equimorph.tasks.estimation import StateEstimate, estimate_state
from equimorph.tasks.route import Route
from typecheck import unchecked

DATA = Path(__file__).parent / "data"


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """Results of a study of the spring, as the first release wrote them: without schemas."""
    path = tmp_path / "old.h5"
    path.write_bytes(lzma.decompress((DATA / "results-1.h5.xz").read_bytes()))
    return path


@pytest.fixture
def written(spring_set: EquilibriumSet, spring_route: Route, tmp_path: Path) -> Path:
    angle = spring_set.structure.descriptor("angle")
    with unchecked():
        known = estimate_state(spring_set, {angle: 0.5, "x_l": 0.8}, {angle: 0.01, "x_l": 0.01})
    return write_results(
        tmp_path / "new.h5", spring_set, angle, {"over": spring_route},
        answers={"estimate": {"seen": known}},
    )  # fmt: skip


def test_a_file_of_the_first_release_is_read(old: Path):
    """Its numbers are those of the closed form F = k (1 − x_l/cos δ) sin δ, see PHYSICS."""
    with unchecked():
        found = read_results(old)
        angle = Spring().angle
        assert found.unreadable == {}
        assert found.equilibrium_set.audit.clean
        assert load_set(old).components == found.equilibrium_set.components
        assert len(found.equilibria[0]) == 3
        assert found.routes["near"].arrived
        assert found.routes["none"].status == "refused"
        assert set(found.answers) == {
            "estimate", "imperfection", "optimum", "room", "sensitivity", "shape",
        }  # fmt: skip
        shape = found.answers["shape"]["flat"]
        assert angle(shape.stable[0]) == pytest.approx(0.4, abs=1e-9)
        assert found.answers["optimum"]["best"].best.value == pytest.approx(0.1, abs=1e-6)
        assert found.answers["sensitivity"]["here"].names == ("x_l", "F", "k")
        assert found.maps["limits"].value.shape == (3, 3)


@pytest.mark.parametrize(
    ("bounds", "why", "now"),
    [("sampled", "", "supported"), ("structural", "", "supported"), ("sampled", "no", "unproved")],
)
def test_a_proof_of_an_older_release_has_the_status_that_its_bounds_bear(bounds, why, now):
    """Version 1 called sampled bounds "proved", version 2 those with allowances for round-off."""
    states = Spring().natural_state(x_l=1.2).batch
    values = {"status": "unproved" if why else "proved", "why": why, "states": states,
              "error": np.zeros(1), "margin": 0.1, "bounds": bounds, "failed": None}  # fmt: skip
    assert schemas.find_schema("Proof").build(1, values).status == now


def test_a_file_says_which_records_it_holds(written: Path):
    with h5py.File(written) as file:
        assert dict(file["set"].attrs) == {"schema": "set", "schema_version": 1}
        words = {"schema": "record", "schema_version": 1}
        assert words.items() <= dict(file["answers/estimate/seen"].attrs).items()
        assert file["routes/over"].attrs["schema"] == "route"
        about = json.loads(file["answers/estimate/seen/about"].asstr()[()])
        assert about["record"][0] == "StateEstimate"
        assert about["record"][2] == 1


@pytest.mark.parametrize("place", ["answers/estimate/seen", "routes/over", "set"])
def test_a_record_of_a_newer_release_is_named_and_the_rest_is_read(written: Path, place: str):
    with h5py.File(written, "r+") as file:
        file[place].attrs["schema_version"] = 2
    with unchecked():
        found = read_results(written)
    assert list(found.unreadable) == [place]
    assert "version 2. Read it with the release that wrote it." in found.unreadable[place]
    assert (found.equilibrium_set is None) == (place == "set")
    assert list(found.routes) == ([] if place == "routes/over" else ["over"])


def test_a_field_that_was_renamed_is_read_or_its_record_is_named(
    written: Path, monkeypatch: pytest.MonkeyPatch
):
    """As if `StateEstimate.why` had been called ``reason`` when the file was written."""
    with h5py.File(written, "r+") as file:
        about = file["answers/estimate/seen/about"]
        text = about.asstr()[()]
        assert '"why"' in text
        about[()] = text.replace('"why"', '"reason"')
    with unchecked():
        found = read_results(written)
        assert "with reason" in _without_others(found.unreadable["answers/estimate/seen"])
        assert found.equilibrium_set is not None
        assert list(found.routes) == ["over"]
        renamed = Change(version=2, renamed={"reason": "why"})
        monkeypatch.setattr(schemas, "CHANGES", {**schemas.CHANGES, "StateEstimate": renamed})
        schemas.schemas.cache_clear()
        found = read_results(written)
        monkeypatch.undo()
        schemas.schemas.cache_clear()
    assert found.unreadable == {}
    assert isinstance(found.answers["estimate"]["seen"], StateEstimate)


def _without_others(message: str) -> str:
    """Message with the only field that is strange, of those that were given."""
    given = message.partition("got version 1 with ")[2].partition(". ")[0].split(", ")
    strange = [each for each in given if each not in StateEstimate.__dataclass_fields__]
    return f"with {', '.join(strange)}"


def test_a_field_of_the_audit_that_this_release_lacks_leaves_the_routes(written: Path):
    """Records inside a set, too, are read by their schema."""
    with h5py.File(written, "r+") as file:
        about = file["set/about"]
        about[()] = about.asstr()[()].replace('"parity_violations"', '"parity_faults"')
    with unchecked():
        found = read_results(written)
        assert list(found.unreadable) == ["set"]
        assert list(found.routes) == ["over"]
        with pytest.raises(InputError, match=r"one that this release can read \(Audit, version \d"):
            load_set(written)


@dataclass(frozen=True)
class Pair:
    """A record whose field was once called ``one``; `third` came later, ``gone`` went."""

    first: float
    second: float
    third: float = 0.0


def test_a_schema_reads_every_older_version():
    change = Change(version=4, renamed={"one": "first"}, added={"second": 2.0}, removed=("gone",))
    schema = Schema("Pair", Pair, change)
    assert schema.build(1, {"one": 1.0, "gone": 5}) == Pair(1.0, 2.0)
    assert schema.build(4, schema.values(Pair(1.0, 3.0, 4.0))) == Pair(1.0, 3.0, 4.0)
    for version, values in ((5, {"first": 1.0, "second": 2.0}), (1, {"second": 2.0}),
                            (1, {"first": 1.0, "fourth": 2.0})):  # fmt: skip
        with pytest.raises(UnreadableError, match="one that this release can read"):
            schema.build(version, values)


def test_every_record_is_as_its_version_says():
    """A field that was renamed without a word in `CHANGES` fails here.

    Raise the version of the record there and say how older ones are read, then write the table
    anew: ``schemas.json`` holds versions and fields of the records that files held so far.
    """
    table = {
        name: [each.change.version, [field.name for field in each.fields]]
        for name, each in schemas.schemas().items()
    }
    known = json.loads((DATA / "schemas.json").read_text())
    for name, (version, names) in known.items():
        assert name in table, f"{name} is gone: name its class of today in CHANGES"
        if table[name][0] == version:
            assert table[name][1] == names, f"{name} has other fields: raise its version"


def test_a_class_may_change_its_name(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(schemas, "CHANGES", {"StateEstimate": Change(schema="Estimate")})
    schemas.schemas.cache_clear()
    assert schemas.find_schema("Estimate").kind is StateEstimate
    monkeypatch.undo()
    schemas.schemas.cache_clear()
    assert replace(schemas.find_schema("StateEstimate").change, version=1).version == 1

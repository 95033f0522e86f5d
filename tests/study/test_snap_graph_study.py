"""The snap graph of a study: the spring's folds x_l = cos³δ, F = sin³δ in closed form."""

import csv
from pathlib import Path

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.storage import read_results
from equimorph.study import Outcome, parse_study, prepare
from studies import answered

STUDY = """\
[structure]
kind = "spring"

[set]
box = { x_l = [0.5, 1.3], F = [-0.2, 0.2] }
intervals = [9, 9]

[[snap_graph]]
name = "where"
samples = 8
descriptor = "height"
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Outcome, Path]:
    return answered(tmp_path_factory.mktemp("snaps"), STUDY)


def test_every_snap_that_was_followed_is_in_the_table(run):
    """Height x_l tan δ before the snap at the fold, and the energy released until the landing."""
    outcome, out = run
    _, snaps, _ = outcome.of("snap_graph")["where"]
    with (out / "where-snap_graph.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    names = [each.partition(" (")[0] for each in head]
    assert "energy released (force·length)" in head
    rows = [dict(zip(names, row, strict=True)) for row in rows]
    assert len(rows) == sum(len(snap.landings) for snap in snaps) >= 8
    for row in rows:
        x, force = float(row["x_l"]), float(row["F"])
        delta = np.sign(force) * np.arccos(np.cbrt(x))
        assert abs(force) == pytest.approx(np.abs(np.sin(delta)) ** 3, abs=1e-9)
        heights = [float(row[f"height {when}"]) for when in ("before", "after")]
        assert heights[0] == pytest.approx(x * np.tan(delta), abs=1e-4)
        angles = np.arctan(np.array(heights) / x)
        before, after = 0.5 * (1 - x / np.cos(angles)) ** 2 + force * x * np.tan(angles)
        assert float(row["energy released"]) == pytest.approx(before - after, abs=1e-7)
        assert row["from stratum"] == row["to stratum"] == "0"


def test_the_page_tells_runs_and_energies(run):
    outcome, out = run
    page = (out / "index.html").read_text(encoding="utf-8")
    _, snaps, _ = outcome.of("snap_graph")["where"]
    most = max(snap.released[1] for snap in snaps)
    assert "<h2>Snap graph where</h2>" in page
    assert f"of the stability boundary; a snap releases {most:.4g} at most." in page
    assert (out / "where-snap_graph.png").exists()


def test_the_graph_is_in_the_results(run):
    outcome, out = run
    strata, snaps, states = read_results(out / "results.h5").answers["snap_graph"]["where"]
    mine = outcome.of("snap_graph")["where"]
    assert strata == mine[0]
    assert [snap.released for snap in snaps] == [snap.released for snap in mine[1]]
    np.testing.assert_array_equal(states[0].z, mine[2][0].z)
    np.testing.assert_array_equal(snaps[0].landings[0].state.z, mine[1][0].landings[0].state.z)


def test_a_descriptor_that_does_not_exist_is_named():
    study = parse_study(STUDY.replace('"height"', '"hight"'), "study.toml")
    with pytest.raises(InputError, match=r"snap_graph\[0\].descriptor.*hight"):
        prepare(study)

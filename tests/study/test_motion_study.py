"""Motions in time and their replay, asked for in a study and on the command line."""

import csv
import itertools
import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from equimorph import plotting, verify
from equimorph.cli import main
from equimorph.errors import InputError
from equimorph.storage import read_results, read_schedule, write_schedule
from equimorph.study import prepare, run_study
from equimorph.study.problem import parse_study
from studies import draw_dots
from typecheck import unchecked

EXAMPLES = Path(__file__).parents[2] / "examples"
STUDY = """
[structure]
kind = "truss"
joints = { A = [-1.0, 0.0], B = [0.0, 0.4], C = [1.0, 0.0] }
bars = [{ ends = ["A", "B"] }, { ends = ["B", "C"] }]
supports = { A = "xy", C = "xy" }
loads = { F = { B = [0.0, -1.0] } }
actuators = { a = { A-B = 1.0 } }
masses = { B = 0.01 }

[set]
box = { a = [-0.1, 0.1] }
fixed = { F = 0.0 }
intervals = [6]
checks = 0

[[motion]]
name = "lift"
start = { at = { a = 0.0 }, lowest = "energy" }
steps = [{ a = 0.05 }, { a = -0.05 }]
rates = { a = 0.02 }
accelerations = { a = 0.02 }
sampling = 2.0

[[replay]]
name = "slowly"
start = { at = { a = 0.0 }, lowest = "energy" }
steps = [{ a = 0.05 }, { a = -0.05 }]
duration = 20.0
simulator = "own"
step = 0.1
hold = 2.0
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motion")
    (folder / "truss.toml").write_text(STUDY)
    with unchecked(), pytest.MonkeyPatch.context() as patch:
        draw_dots(patch)
        patch.setattr(plotting, "replay_film", partial(plotting.replay_film, frames=3))
        outcome = run_study(folder / "truss.toml", folder / "out")
    return outcome, folder / "out"


def test_a_motion_is_written_for_other_programs(done):
    """From 0 to 0.05 and −0.05 at 0.02: 7.5 units of time, and 1 to speed up and 1 to stop."""
    schedule = read_schedule(done[1] / "lift-motion-schedule.csv")
    assert schedule.duration == pytest.approx(9.5, abs=0.6)
    assert np.abs(schedule.velocities).max() == pytest.approx(0.02, rel=1e-2)
    assert np.abs(schedule.accelerations).max() <= 0.02 * (1 + 1e-9)


def test_a_replay_is_told_drawn_and_kept(done):
    _, out = done
    page = (out / "index.html").read_text()
    assert "No snap" in page
    assert "shares the library" in page
    assert (out / "slowly-replay-film.gif").exists()
    with (out / "slowly-replay.csv").open() as file:
        rows = list(csv.DictReader(file))
    kept = read_results(out / "results.h5").answers["replay"]["slowly"]
    assert not kept.snapped
    assert kept.simulator == "own"
    np.testing.assert_allclose([float(row["deviation"]) for row in rows], kept.deviation, rtol=1e-6)
    assert kept.largest_deviation < 0.01


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("rates = { a = 0.02 }", "rates = { b = 0.01 }", "b"),
        ('simulator = "own"', 'simulator = "gazebo"', "simulator"),
        ("duration = 20.0", "duration = -1.0", "duration"),
        ("sampling = 2.0", 'joints = { a = "ram" }\nseconds = 1.0', "joints"),
        ("accelerations = { a", "accelerations = { F", "accelerations"),
    ],
)
def test_mistakes_are_one_line(old, new, words):
    with pytest.raises(InputError, match=words):
        prepare(parse_study(STUDY.replace(old, new), "truss.toml"))


def test_the_command_line_replays_a_schedule(done, monkeypatch, capsys):
    """A schedule with times is played as it is; the own equations are named as not independent."""
    monkeypatch.setattr(sys, "argv", [
        "equimorph", "replay", str(done[1] / "lift-motion-schedule.csv"), "--simulator", "own",
        "--json",
    ])  # fmt: skip
    with unchecked(), pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 0
    told = json.loads(capsys.readouterr().out)
    assert not told["snapped"]
    assert told["largest_deviation"] < 0.01


def test_a_file_that_is_no_schedule_is_refused_in_one_line(monkeypatch, capsys, tmp_path: Path):
    (tmp_path / "a.csv").write_text("x,y\n1,2\n")
    monkeypatch.setattr(sys, "argv", ["equimorph", "replay", str(tmp_path / "a.csv")])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_a_trajectory_is_written_for_a_controller(tmp_path):
    """Two motors of an arch, in the order of their joints, from rest to rest."""
    text = (EXAMPLES / "motion.toml").read_text()
    text = text[: text.index("# The same way")].replace("[12, 16]", "[5, 6]\nchecks = 0")
    (tmp_path / "arch.toml").write_text(text)
    with unchecked(), pytest.MonkeyPatch.context() as patch:
        draw_dots(patch)
        run_study(tmp_path / "arch.toml", tmp_path / "out")
    lines = (tmp_path / "out" / "over-motion-trajectory.yaml").read_text().splitlines()
    assert lines[3:6] == ["joint_names:", '- "spread"', '- "tilt"']
    assert lines[7] == "- positions: [1.0, 0.0]"
    assert lines[8] == "  velocities: [0.0, 0.0]"


SPACE = """
[structure]
kind = "spatial rod"
ends = ["clamped", "free"]
lateral = 2.0
torsion = 0.8
curvature = -2.0

[set]
box = { twist_A = [-0.1, 0.6] }
within = ["max_curvature <= 20"]
intervals = [4]
checks = 0

[[replay]]
name = "turned"
start = { at = { twist_A = 0.0 }, lowest = "energy" }
steps = [{ twist_A = 0.5 }]
duration = 40.0
links = 6
step = 0.1
hold = 2.0
damping = 0.5
"""


@pytest.mark.slow
def test_a_rod_in_space_is_replayed_from_a_study_and_from_a_file(tmp_path, monkeypatch, capsys):
    """A curved cantilever follows its clamp as it turns; its film has frames that differ."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    (tmp_path / "turned.toml").write_text(SPACE)
    with unchecked():
        draw_dots(monkeypatch)
        monkeypatch.setattr(plotting, "replay_film", partial(plotting.replay_film, frames=3))
        run_study(tmp_path / "turned.toml", tmp_path / "out")
        kept = read_results(tmp_path / "out" / "results.h5").answers["replay"]["turned"]
        assert not kept.snapped
        assert kept.points.shape[2] == 3
        assert np.ptp(kept.points[:, -1, 2]) > 0.2
        assert kept.largest_deviation < 0.02
        with Image.open(tmp_path / "out" / "turned-replay-film.gif") as film:
            frames = [np.asarray(each.convert("L")) for each in ImageSequence.Iterator(film)]
        assert len(frames) == 3
        assert all((one != other).any() for one, other in itertools.pairwise(frames))
        motion = verify([{"twist_A": 0.5}], kept.start).schedule.in_time(duration=40.0)
        write_schedule(motion, tmp_path / "turned.csv")
        arguments = ("replay", str(tmp_path / "turned.csv"), "--links", "6", "--json")
        monkeypatch.setattr(sys, "argv", ["equimorph", *arguments])
        with pytest.raises(SystemExit):
            main()
    told = json.loads(capsys.readouterr().out)
    assert told["simulator"] == "mujoco"
    assert told["discretisation"] == pytest.approx(np.nanmax(kept.discretisation), rel=0.1)

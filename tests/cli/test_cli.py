"""Commands as a user meets them: exit codes, one line for bad input, nothing overwritten."""

import subprocess
import sys
from pathlib import Path
from time import perf_counter

import pytest

from equimorph.cli import main
from studies import SPRING, draw_dots

SMALL = SPRING[: SPRING.index("[[route]]")]
"""The study without its route."""


class Shell:
    """Runs the command line in a folder of its own and keeps what it said."""

    def __init__(self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
        self._capsys, self._monkeypatch = capsys, monkeypatch
        self.out, self.err = "", ""

    def __call__(self, *words: str) -> int:
        self._monkeypatch.setattr(sys, "argv", ["equimorph", *words])
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        self.out, self.err = self._capsys.readouterr()
        return code


@pytest.fixture
def shell(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Shell:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    draw_dots(monkeypatch)
    return Shell(capsys, monkeypatch)


def _says_one_line(shell: Shell, part: str) -> bool:
    return shell.err.startswith("equimorph: ") and shell.err.count("\n") == 1 and part in shell.err


def test_help_names_the_commands(shell: Shell):
    assert shell("--help") == 0
    assert all(command in shell.out for command in ("new", "check", "run"))


def test_help_loads_nothing_heavy():
    """What costs most of a second to load must not be loaded for ``--help``."""
    code = (
        "import sys, equimorph.cli\n"
        "heavy = {'numpy', 'numba', 'scipy', 'matplotlib', 'h5py', 'pydantic', 'PIL'}\n"
        "sys.exit(sorted(heavy & set(sys.modules)) or None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_help_answers_within_half_a_second():
    """Best of three, so that a busy machine does not fail it."""
    times = []
    for _ in range(3):
        start = perf_counter()
        subprocess.run(
            [sys.executable, "-m", "equimorph.cli", "--help"], capture_output=True, check=True
        )
        times.append(perf_counter() - start)
    assert min(times) < 0.5


def test_version_is_shown(shell: Shell):
    assert shell("--version") == 0
    assert shell.out.startswith("equimorph 0.")


@pytest.mark.parametrize("kind", ["arch", "spring"])
def test_a_new_study_passes_the_check(kind: str, shell: Shell):
    assert shell("new", "mine.toml", "--kind", kind) == 0
    assert shell("check", "mine.toml") == 0
    assert "sound study with 1 point and 1 route" in shell.out


def test_new_overwrites_nothing(shell: Shell):
    Path("mine.toml").write_text("mine")
    assert shell("new", "mine.toml") == 2
    assert _says_one_line(shell, "must not exist yet")
    assert Path("mine.toml").read_text() == "mine"


def test_a_run_shows_its_answers_and_names_its_page(shell: Shell):
    Path("spring.toml").write_text(SPRING)
    assert shell("run", "spring.toml") == 0
    assert "audit clean" in shell.out
    assert "0.64350" in shell.out
    assert "Route over: arrived without a snap" in shell.out
    assert "results/spring/index.html" in shell.out
    assert Path("results/spring/index.html").is_file()


def test_a_refused_route_is_a_successful_run(shell: Shell):
    Path("spring.toml").write_text(SPRING + "margin = 50.0\n")
    assert shell("run", "spring.toml", "--out", "here") == 0
    assert "Route over: refused" in shell.out


# What is changed in the study, and a part of the one line.
WRONG = {
    "unknown key": ("intervals", "intervalls", "`set.intervalls`"),
    "wrong type": ("[11, 11]", '"many"', "`set.intervals` must be a list"),
    "malformed TOML": ("[set]", "[set", "must be valid TOML"),
    "reversed bounds": ("[0.5, 1.3]", "[1.3, 0.5]", "`set.box.x_l`"),
    "start that is no equilibrium": ('highest = "angle"', "near = { angle = 0.3 }", "near"),
    "goal that is no equilibrium": ('lowest = "angle"', "near = { angle = 0.3 }", "goal.near"),
    "start left open": (', highest = "angle"', "", "must choose by highest, lowest or near"),
    "way-point outside the box": ('name = "over"', 'name = "o"\nvia = [{ x_l = 3.0 }]', "via[0]"),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_is_one_line_and_exit_code_2(case: str, shell: Shell):
    old, new, part = WRONG[case]
    assert old in SPRING
    Path("wrong.toml").write_text(SPRING.replace(old, new, 1))
    assert shell("run", "wrong.toml") == 2
    last = shell.err.strip().splitlines()[-1]
    assert last.startswith("equimorph: ")
    assert part in last
    assert "Traceback" not in shell.err


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('load = "uniform"', "span = 1.0", "`structure.span`"),
        ('load = "uniform"', "span = 0.0", "`structure.span`"),
        ('load = "uniform"', "load = [[0, 1], [1, nan]]", "finite"),
    ],
)
def test_a_rod_that_cannot_be_is_one_line(old: str, new: str, part: str, shell: Shell):
    shell("new", "arch.toml")
    text = Path("arch.toml").read_text()
    Path("arch.toml").write_text(text.replace(old, new, 1))
    assert shell("check", "arch.toml") == 2
    assert _says_one_line(shell, part)


def test_a_missing_file_is_one_line(shell: Shell):
    assert shell("run", "none.toml") == 2
    assert _says_one_line(shell, "none.toml: No such file or directory")
    assert list(Path().iterdir()) == []


def test_an_unwritable_folder_is_one_line(shell: Shell):
    Path("spring.toml").write_text(SMALL)
    Path("file").write_text("mine")
    assert shell("run", "spring.toml", "--out", "file/out") == 2
    assert "must be a folder that can be written" in shell.err
    assert Path("file").read_text() == "mine"


def test_the_folder_of_another_study_is_kept(shell: Shell):
    Path("one.toml").write_text(SMALL)
    Path("two.toml").write_text(SMALL.replace("0.8", "0.7"))
    assert shell("run", "one.toml", "--out", "out") == 0
    before = {file.name: file.read_bytes() for file in Path("out").iterdir()}
    assert shell("run", "two.toml", "--out", "out") == 2
    assert "results of another study" in shell.err
    assert {file.name: file.read_bytes() for file in Path("out").iterdir()} == before
    assert shell("run", "two.toml", "--out", "out", "--replace") == 0


@pytest.mark.parametrize("words", [[], ["run"], ["run", "--sideways", "x.toml"], ["fly"]])
def test_wrong_usage_is_exit_code_2(words: list[str], shell: Shell):
    assert shell(*words) == 2

"""Commands as a user meets them: exit codes, one line for bad input, nothing overwritten."""

import json
import math
import os
import re
import resource
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from equimorph.cli import main, run
from equimorph.cli.output import Output
from equimorph.linalg.compile_ahead import known_calls
from equimorph.study import Outcome
from studies import SPRING, draw_dots, with_answers_of
from typecheck import unchecked

SCHEMA = Path(__file__).parents[2] / "docs" / "study.schema.json"
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


@pytest.fixture
def known(shell: Shell, finished: tuple[Outcome, Path]) -> Shell:
    """A shell in a folder whose ``out`` was left by an interrupted run: it knows the set."""
    with_answers_of(finished[1], Path("out"))
    return shell


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


@pytest.mark.parametrize(("given", "taken"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")])
def test_linear_algebra_has_one_thread_unless_the_environment_says_otherwise(given, taken):
    """OpenBLAS reads its variable when numpy is imported; `--help` ends in SystemExit."""
    code = (
        "import contextlib, os, sys; from equimorph.cli import main; sys.argv = ['', '--help']\n"
        "assert 'numpy' not in sys.modules\n"
        "with contextlib.suppress(SystemExit): main()\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    known = {name: value for name, value in os.environ.items() if "OPENBLAS" not in name}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=known | given
    )
    assert done.stdout.split()[-1] == taken


def test_help_answers_within_half_a_second():
    """Time of the processor, so that a busy machine does not fail it."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "equimorph.cli", "--help"], capture_output=True, check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.5


def test_version_is_shown(shell: Shell):
    assert shell("--version") == 0
    assert shell.out.startswith("equimorph 0.")


@pytest.mark.parametrize("kind", ["arch", "column", "lee", "maps", "spring", "truss"])
def test_a_new_study_passes_the_check(kind: str, shell: Shell):
    assert shell("new", "mine.toml", "--kind", kind) == 0
    assert Path("mine.toml").read_text().startswith("#:schema study.schema.json\n")
    assert Path("study.schema.json").read_text() == SCHEMA.read_text()
    assert shell("check", "mine.toml") == 0
    asked = "2 maps" if kind == "maps" else "1 point and 1 route"
    assert f"valid: it asks for {asked}" in shell.out


def test_the_schema_is_that_of_the_docs(shell: Shell):
    assert shell("schema") == 0
    assert shell.out == SCHEMA.read_text()


def test_a_schema_of_another_release_is_replaced_but_no_other_file(shell: Shell):
    for old, new in (('{"title": "equimorph study"}', SCHEMA.read_text()), ("mine", "mine")):
        Path("study.schema.json").write_text(old)
        Path("mine.toml").unlink(missing_ok=True)
        assert shell("new", "mine.toml") == 0
        assert Path("study.schema.json").read_text() == new


@pytest.mark.parametrize(
    ("words", "completed"),
    [("che", "check"), ("run --allow", "--allow-refused"), ("new x.toml --kind deep", "deep_arch")],
)
def test_shells_complete_commands_options_and_kinds(words: str, completed: str):
    """As bash asks: the words of the line in the environment, the answers on stdout."""
    line = f"equimorph {words}"
    asked = {
        "_EQUIMORPH_COMPLETE": "complete_bash",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(line.split()) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-m", "equimorph.cli"], capture_output=True, text=True, check=False,
        env={**os.environ, **asked},
    )  # fmt: skip
    assert completed in done.stdout.split()


def test_completion_can_be_installed(shell: Shell):
    assert shell("--help") == 0
    assert "--install-completion" in shell.out
    assert "--show-completion" in shell.out


def test_new_overwrites_nothing(shell: Shell):
    Path("mine.toml").write_text("mine")
    assert shell("new", "mine.toml") == 2
    assert _says_one_line(shell, "must not exist yet")
    assert Path("mine.toml").read_text() == "mine"


@pytest.mark.parametrize("kind", ["arch", "spring"])
def test_a_new_study_runs(kind: str, shell: Shell):
    """On a coarser grid; the slow test below runs it as it is written."""
    shell("new", "mine.toml", "--kind", kind)
    text = Path("mine.toml").read_text()
    Path("mine.toml").write_text(re.sub(r"intervals = .*", "intervals = [12, 21]", text))
    with unchecked():
        assert shell("run", "mine.toml") == 0
    assert "audit clean" in shell.out
    assert "arrived without a snap" in shell.out


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["arch", "spring"])
def test_a_new_study_runs_as_it_is_written(kind: str, shell: Shell):
    shell("new", "mine.toml", "--kind", kind)
    with unchecked():
        assert shell("run", "mine.toml") == 0
    assert "audit clean" in shell.out
    assert "arrived without a snap" in shell.out


def test_a_run_shows_its_answers_and_names_its_page(shell: Shell):
    Path("spring.toml").write_text(SPRING)
    with unchecked():
        assert shell("run", "spring.toml") == 0
    assert "Equilibrium set computed" in shell.out
    assert "audit clean" in shell.out
    assert "0.64350" in shell.out
    assert "Route over: arrived without a snap" in shell.out
    assert "results/spring/index.html" in shell.out
    assert Path("results/spring/index.html").is_file()
    assert shell("run", "spring.toml") == 0
    assert "Equilibrium set read from an earlier run" in shell.out


def test_a_refused_route_is_an_answer_with_exit_code_3(known: Shell):
    Path("spring.toml").write_text(SPRING + "margin = 50.0\n")
    assert known("run", "spring.toml", "--out", "out") == 3
    assert "Route over: refused. " in known.out
    assert known("run", "spring.toml", "--out", "out", "--allow-refused") == 0
    assert "Route over: refused. " in known.out
    assert Path("out/index.html").is_file()


def test_answers_as_data(known: Shell):
    """(0.8, 0) of the spring: cos δ = 0.8, PHYSICS section 2. stdout is one line of JSON."""
    Path("spring.toml").write_text(SPRING)
    assert known("run", "spring.toml", "--out", "out", "--json", "--quiet") == 0
    assert known.err == ""
    assert known.out.count("\n") == 1
    told = json.loads(known.out)
    assert told["study"] == "spring.toml"
    assert Path(told["report"]).is_file()
    assert told["set"]["clean"] is True
    (point,) = told["equilibria"]
    assert point["at"] == {"x_l": 0.8, "F": 0.0}
    upper = max(point["states"], key=lambda state: state["angle"])
    assert upper["angle"] == pytest.approx(math.acos(0.8), rel=1e-9)
    (route,) = told["answers"]
    assert (route["table"], route["name"], route["refused"]) == ("route", "over", False)
    assert route["values"][0]["status"] == "arrived"
    assert route["values"][0]["margin"] > 0.0


def test_a_refusal_as_data_tells_why(known: Shell):
    Path("spring.toml").write_text(SPRING + "margin = 50.0\n")
    assert known("run", "spring.toml", "--out", "out", "--json") == 3
    (route,) = json.loads(known.out)["answers"]
    assert route["refused"]
    assert route["why"]
    assert route["line"] == f"Route over: refused. {route['why']}"


def test_a_wrong_study_as_data_lists_its_mistakes(shell: Shell):
    Path("wrong.toml").write_text(SPRING.replace("intervals", "intervalls"))
    for command in ("run", "check"):
        assert shell(command, "wrong.toml", "--json") == 2
        (mistake,) = json.loads(shell.out)["errors"]
        assert "`set.intervalls`" in mistake
        assert _says_one_line(shell, "`set.intervalls`")


def test_a_quiet_run_says_nothing(known: Shell):
    Path("spring.toml").write_text(SPRING)
    assert known("run", "spring.toml", "--out", "out", "--quiet") == 0
    assert (known.out, known.err) == ("", "")


def test_a_verbose_run_logs_its_stages(known: Shell):
    Path("spring.toml").write_text(SPRING)
    assert known("run", "spring.toml", "--out", "out", "--verbose") == 0
    assert "equimorph.study.run: equilibrium set: done in " in known.err
    assert "read from an earlier run" in known.err
    assert "Route over: arrived" in known.out
    assert known("run", "spring.toml", "--out", "out", "--quiet") == 0
    assert known.err == ""


def test_several_studies_have_the_worst_exit_code(shell: Shell, finished: tuple[Outcome, Path]):
    Path("a.toml").write_text(SPRING)
    Path("b.toml").write_text(SPRING + "margin = 50.0\n")
    Path("wrong.toml").write_text(SPRING.replace("intervals", "intervalls"))
    for name in ("a", "b"):
        with_answers_of(finished[1], Path("results") / name)
    assert shell("run", "a.toml", "b.toml", "--json", "--quiet") == 3
    lines = [json.loads(line) for line in shell.out.splitlines()]
    assert [line["study"] for line in lines] == ["a.toml", "b.toml"]
    assert shell("run", "wrong.toml", "a.toml", "--quiet") == 2
    assert _says_one_line(shell, "`set.intervalls`")
    assert shell("check", "a.toml", "b.toml") == 0
    assert shell.out.count("is valid") == 2


def test_studies_of_one_name_would_share_a_folder(shell: Shell):
    assert shell("run", "a/x.toml", "b/x.toml") == 2
    assert _says_one_line(shell, "must have different names; got x twice")


def test_a_check_lists_every_mistake(shell: Shell):
    """Wrong keys in one table, wrong names in others, numbered as in the file."""
    wrong = SPRING.replace("intervals", "intervalls").replace("x_l = 0.8, F = 0.0 }", "F = 9.0 }")
    sound = SPRING + 'margn = 1.0\n\n[[optimum]]\nname = "best"\nobjective = "angel"\n'
    Path("set.toml").write_text(wrong)
    Path("tasks.toml").write_text(sound + 'within = ["high <= 1"]\n')
    assert shell("check", "set.toml") == 2
    assert _says_one_line(shell, "`set.intervalls`")
    assert shell("check", "tasks.toml") == 2
    lines = shell.err.splitlines()
    assert ["`route[0].margn`" in lines[0], "optimum[0].objective" in lines[1]] == [True, True]
    assert "optimum[0].within[0]" in lines[2]
    assert len(lines) == 3
    assert shell("run", "tasks.toml") == 2
    assert _says_one_line(shell, "(2 more after this.)")


# What is changed in the study, and a part of the one line.
WRONG = {
    "unknown key": ("intervals", "intervalls", "`set.intervalls`"),
    "unknown section": ("[[route]]", "[[rout]]", "`rout`"),
    "wrong type": ("[11, 11]", '"many"', "`set.intervals` must be a list"),
    "malformed TOML": ("[set]", "[set", "must be valid TOML"),
    "reversed bounds": ("[0.5, 1.3]", "[1.3, 0.5]", "`set.box.x_l`"),
    "bound not finite": ("[0.5, 1.3]", "[0.5, inf]", "`set.box.x_l"),
    "start outside the box": ("start = { at = { x_l = 0.8", "start = { at = { x_l = 3.0", "start"),
    "way-point outside the box": ('name = "over"', 'name = "o"\nvia = [{ x_l = 3.0 }]', "via[0]"),
    "descriptor unknown": ('highest = "angle"', 'highest = "angel"', "angel"),
    "more memory than there is": ("[11, 11]", "[90000, 90000]", "Reduce `set.intervals`"),
}


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.parametrize("command", ["check", "run"])
def test_bad_input_is_one_line_and_exit_code_2(command: str, case: str, shell: Shell):
    old, new, part = WRONG[case]
    assert old in SPRING
    Path("wrong.toml").write_text(SPRING.replace(old, new, 1))
    assert shell(command, "wrong.toml") == 2
    assert _says_one_line(shell, part)
    assert [file.name for file in Path().iterdir()] == ["wrong.toml"]


# The same for what only the equilibrium set can tell: progress comes before the line.
IMPOSSIBLE = {
    "start that is no equilibrium": ('highest = "angle"', "near = { angle = 0.3 }", "start.near"),
    "goal that is no equilibrium": ('lowest = "angle"', "near = { angle = 0.3 }", "goal.near"),
    "start that is unstable": ('highest = "angle"', "near = { angle = 0.0 }", "has index 1"),
    "start left open": (', highest = "angle"', "", "must choose by highest, lowest or near"),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_a_state_that_is_no_stable_equilibrium_is_one_line(case: str, known: Shell):
    old, new, part = IMPOSSIBLE[case]
    assert old in SPRING
    Path("wrong.toml").write_text(SPRING.replace(old, new, 1))
    assert known("run", "wrong.toml", "--out", "out") == 2
    last = known.err.strip().splitlines()[-1]
    assert last.startswith("equimorph: ")
    assert part in last
    assert "Traceback" not in known.err
    assert [file.name for file in Path("out").iterdir()] == [".equimorph"]


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('load = "uniform"', "span = 1.0", "in `structure`: `span` must lie between 0 and 1"),
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
    for command in ("check", "run"):
        assert shell(command, "none.toml") == 2
        assert _says_one_line(shell, "none.toml: No such file or directory")
    assert list(Path().iterdir()) == []


def test_an_unwritable_folder_is_one_line(shell: Shell):
    Path("spring.toml").write_text(SMALL)
    Path("file").write_text("mine")
    for out in ("file", "file/out"):
        assert shell("run", "spring.toml", "--out", out) == 2
        assert _says_one_line(shell, "must be a folder that can be written")
    assert Path("file").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_folder_without_permission_is_one_line(shell: Shell):
    Path("spring.toml").write_text(SMALL)
    Path("locked").mkdir(mode=0o500)
    assert shell("run", "spring.toml", "--out", "locked/out") == 2
    assert _says_one_line(shell, "Permission denied")


def test_the_folder_of_another_study_is_kept(known: Shell):
    Path("one.toml").write_text(SMALL)
    Path("two.toml").write_text(SMALL.replace("0.8", "0.7"))
    assert known("run", "one.toml", "--out", "out") == 0
    before = {file: file.read_bytes() for file in Path("out").rglob("*") if file.is_file()}
    assert known("run", "two.toml", "--out", "out") == 2
    assert _says_one_line(known, "results of another study")
    assert {file: file.read_bytes() for file in before} == before
    assert known("run", "two.toml", "--out", "out", "--replace") == 0


def test_a_folder_with_other_files_is_kept(shell: Shell):
    Path("spring.toml").write_text(SMALL)
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("mine")
    assert shell("run", "spring.toml", "--out", "mine") == 2
    assert _says_one_line(shell, "with other files")
    assert [file.name for file in Path("mine").iterdir()] == ["notes.txt"]


def test_an_interrupted_run_says_how_to_go_on(known: Shell, monkeypatch: pytest.MonkeyPatch):
    """Ctrl-C while figures are drawn. Shells say 130 of a program that it ended."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    Path("spring.toml").write_text(SPRING)
    with monkeypatch.context() as patch:
        patch.setattr("equimorph.plotting.save", interrupt)
        assert known("run", "spring.toml", "--out", "out") == 130
    last = known.err.strip().splitlines()[-1]
    assert last == "equimorph: interrupted; what is finished is kept in out. Run again to go on."
    assert known("run", "spring.toml", "--out", "out") == 0
    assert "read from an earlier run" in known.out


@pytest.mark.parametrize("where", ["compile_ahead", "read_problem"])
def test_a_run_interrupted_before_it_begins_says_what_is_kept(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, where: str
):
    """Ctrl-C at the start, and while kernels are compiled."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    Path("spring.toml").write_text(SPRING)
    monkeypatch.setattr("equimorph.linalg.compile_ahead.KernelCall.is_kept", False)
    monkeypatch.setattr(f"equimorph.cli.run.{where}", interrupt)
    assert shell("run", "spring.toml", "--out", "out") == 130
    kept = "kernels that are compiled are kept; the study had not begun"
    kept = kept if where == "compile_ahead" else "what is finished is kept in out"
    assert _says_one_line(shell, f"interrupted; {kept}. Run again to go on.")


@pytest.mark.parametrize("module", ["typer", "equimorph.cli.run"])
def test_ctrl_c_while_modules_are_imported_is_one_line(module: str, tmp_path: Path):
    """Before the first line of the command line's own code has run, and in a command."""
    (tmp_path / "spring.toml").write_text(SPRING)
    code = (
        "import os, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # background jobs ignore it
        "class Stop:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name == {module!r}: os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Stop())\n"
        "from equimorph.cli import main\n"
        "main()\n"
    )
    command = [sys.executable, "-c", code, "run", "spring.toml"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 130
    (line,) = done.stderr.splitlines()
    assert line.startswith("equimorph: interrupted; ")


def test_memory_that_runs_out_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch):
    def run_out(*_: object, **__: object) -> None:
        raise MemoryError

    Path("spring.toml").write_text(SPRING)
    monkeypatch.setattr("equimorph.cli.run.run_study", run_out)
    assert shell("run", "spring.toml") == 2
    assert _says_one_line(shell, "must fit into memory")


def test_a_message_is_fit_for_a_terminal(shell: Shell):
    """Keys may hold escape sequences and line breaks."""
    Path("wrong.toml").write_text('"a\\u001b[2Jb\\nc\\u2028d" = 1\n' + SPRING, encoding="utf-8")
    assert shell("check", "wrong.toml") == 2
    assert _says_one_line(shell, "a [2Jb c d")


USAGE = {
    "run": "Missing argument 'FILE...'. See equimorph run --help.",
    "run x.toml --ouput y": "No such option: --ouput",
    "run x.toml --out": "Option '--out' requires an argument. See equimorph",
    "new x.toml y.toml": "extra argument",
    "run x.toml --quiet --verbose": "one of --quiet and --verbose",
    "rnu x.toml": "No such command 'rnu'. Did you mean 'run'?",
    "new x.toml --kind cantilever": "'cantilever' is not one of 'arch', 'arm', 'beam'",
    "--sideways": "No such option: --sideways",
}


@pytest.mark.parametrize("words", USAGE)
def test_wrong_usage_is_one_line_and_exit_code_2(words: str, shell: Shell):
    assert shell(*words.split()) == 2
    assert _says_one_line(shell, USAGE[words])
    assert list(Path().iterdir()) == []


def test_no_words_at_all_show_the_help(shell: Shell):
    assert shell() == 2
    assert "Usage: equimorph" in shell.out


def test_a_check_shows_what_would_be_computed(shell: Shell):
    """Defaults that the file does not name, too."""
    Path("spring.toml").write_text(SPRING)
    assert shell("check", "spring.toml") == 0
    extent = "x_l from 0.5 to 1.3 in 11 intervals, F from -0.2 to 0.2 in 11 intervals; k = 1."
    assert extent in shell.out


def test_warnings_of_libraries_do_not_reach_the_user(tmp_path: Path):
    """A font that does not exist, no place for caches: neither in the output nor on stderr."""
    (tmp_path / "matplotlibrc").write_text("font.family: No Such Font\n")
    code = (
        "import matplotlib.pyplot as plt, sys, warnings\n"
        "from equimorph.cli.app import main\n"
        "sys.argv = ['equimorph', '--version']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "figure, ax = plt.subplots()\n"
        "ax.set_title('words')\n"
        "warnings.warn('of a library')\n"
        "figure.savefig('words.png')\n"
    )
    places = {"MPLCONFIGDIR": str(tmp_path / "none" / "where"), "MATPLOTLIBRC": str(tmp_path)}
    (tmp_path / "none").write_text("a file, so that no folder can be made in it")
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path,
        env={**os.environ, **places},
    )  # fmt: skip
    assert (tmp_path / "words.png").exists()
    told = done.stderr.splitlines()
    assert [line for line in told if "findfont" in line or "library" in line] == []


@pytest.mark.parametrize(("kept", "compiles"), [((True, True), False), ((True, False), True)])
def test_kernels_are_compiled_first_if_one_is_missing(kept, compiles, tmp_path, monkeypatch):
    """A run that meets a kernel without code would compile it in the middle, on one core."""
    calls = [SimpleNamespace(is_kept=each, is_loop=False) for each in kept]
    loop = SimpleNamespace(is_kept=False, is_loop=True)
    done, behind = list[object](), list[object]()
    monkeypatch.setattr(run, "read_problem", lambda _: (None, None, None))
    monkeypatch.setattr(run, "calls_of", lambda _: [loop, *calls])
    monkeypatch.setattr(run, "compile_ahead", done.append)
    monkeypatch.setattr(run, "compile_behind", behind.extend)
    monkeypatch.setattr(run, "run_study", lambda *_, **__: SimpleNamespace(refused=()))
    monkeypatch.setattr(run, "_show", lambda *_: None)
    with unchecked():
        run.run_and_show(tmp_path, tmp_path, Output(quiet=True), replace=False)
    assert done == ([calls] if compiles else [])
    assert behind == [loop]


def test_kernels_of_studies_are_compiled_before_and_loops_behind(monkeypatch):
    """Kernels that two studies need are asked for once; without a study all are compiled."""
    known = known_calls()
    loops = [each for each in known if each.is_loop]
    others = [each for each in known if each.is_common]
    done, behind = list[object](), list[object]()
    monkeypatch.setattr(run, "read_problem", lambda _: (None, None, None))
    monkeypatch.setattr(run, "calls_of", lambda _: [*loops, *others])
    monkeypatch.setattr(run, "compile_ahead", lambda calls: done.append(list(calls)))
    monkeypatch.setattr(run, "compile_behind", behind.extend)
    run.compile_all_of([Path("a.toml"), Path("b.toml")])
    assert (done, behind) == ([others], loops)
    run.compile_all_of([])
    assert done[1] == known
